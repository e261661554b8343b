// Dragging a body: sets its start position, pulls it with a force, or gives it a kick.

import { addChange, findVariable, MIN_CHANGE_SPACING, valueAt } from "./state.js";

const KICK_DURATION = 1 / 40; // of the run

export class DragController {
  constructor(scene) {
    Object.assign(this, { scene, active: null }); // active: the drag in progress
  }

  // Apply a force pulse to the first body with an input, twice the largest force of the run.
  kick() {
    const { state, modelInfo } = this.scene;
    const body = modelInfo.bodies.find(({ input }) => input);
    if (!body) return;
    const restForce = valueAt(modelInfo, state, body.input, state.t);
    addChange(state, body.input, restForce + 2 * this.largestForce(body), state.t);
    addChange(state, body.input, restForce, Math.min(state.t + KICK_DURATION * state.stop, state.stop));
    this.scene.restartEdited();
    this.scene.play();
  }

  // Start dragging a body at its position. This sets the start position, at time zero or where the scene asks for it; or else
  // it pulls the body with a virtual spring.
  grab(body, position) {
    const { state, modelInfo, playing, dragsStart } = this.scene;
    const startVariable = (dragsStart || (state.t === 0 && !playing)) && findVariable(modelInfo, body.start);
    if (startVariable) {
      if (playing) this.scene.play(false);
      this.active = { startVariable, target: state.t > 0 ? position : undefined };
      state.t = 0;
      this.scene.requestFrame();
    } else if (body.input) {
      this.active = { body, restForce: valueAt(modelInfo, state, body.input, state.t), stiffness: this.stiffness(body) };
      this.scene.play();
    }
  }

  move(target) {
    if (!this.active) return;
    this.active.target = target;
    this.scene.requestFrame();
  }

  drop() {
    if (!this.active) return;
    const { startVariable, body, restForce } = this.active;
    const { state } = this.scene;
    this.active = null;
    if (!startVariable) {
      const last = state.changes.findLast(({ name }) => name === body.input);
      // The force lasts for a minimum time, so that the end of the pull does not replace it.
      addChange(state, body.input, restForce, Math.max(state.t, (last?.t ?? 0) + 1.01 * MIN_CHANGE_SPACING * state.stop));
      this.scene.restartEdited();
    }
    this.scene.redraw();
    this.scene.play();
  }

  // Apply the drag; called once per frame.
  update() {
    const { state, runs } = this.scene;
    const { startVariable, body, target, restForce, stiffness } = this.active;
    if (target === undefined || !runs.main.hasReached(state.t)) return; // the last change is still being simulated
    if (startVariable) {
      this.scene.setVariable(startVariable, target);
      return;
    }
    const extension = target - runs.main.at(body.position, state.t);
    addChange(state, body.input, restForce + Number((stiffness * extension).toPrecision(3)), state.t);
    this.scene.restartEdited();
  }

  // The largest force (or torque) in the run, among outputs with the unit of the input.
  largestForce(body) {
    const { runs: { main }, modelInfo } = this.scene;
    const { unit } = findVariable(modelInfo, body.input);
    return Math.max(0, ...main.reals.filter((name) => findVariable(modelInfo, name).unit === unit).map((name) => main.largestMagnitude(name))) || 1;
  }

  // The stiffness of the virtual spring.
  stiffness(body) {
    return (4 * this.largestForce(body)) / (this.scene.runs.main.largestMagnitude(body.position) || 1);
  }
}
