// Dragging a body: sets its start position, pulls it with a force, or gives it a kick.

import { addChange, MIN_CHANGE_SPACING } from "./overrides.js";
import { findVariable, valueAt } from "./state.js";

const KICK_DURATION = 1 / 40; // of the run

export class DragController {
  // `page` has state, modelInfo and session, and the functions setVariable(variable, value), restartEdited(), play(),
  // requestFrame() and redraw().
  constructor(page) {
    Object.assign(this, { page, active: null }); // active: the drag in progress
  }

  // Apply a force pulse to the first body with an input, twice the largest force of the run.
  kick() {
    const { state, modelInfo } = this.page;
    const body = modelInfo.bodies.find(({ input }) => input);
    if (!body) return;
    const restForce = valueAt(modelInfo, state, body.input, state.t);
    addChange(state, body.input, restForce + 2 * this.largestForce(body), state.t);
    addChange(state, body.input, restForce, Math.min(state.t + KICK_DURATION * state.stop, state.stop));
    this.page.restartEdited();
    this.page.play();
  }

  // Start dragging. At time zero this sets the start position; later it pulls the body with a virtual spring.
  grab(body) {
    const { state, modelInfo, playing } = this.page;
    const startVariable = state.t === 0 && !playing && findVariable(modelInfo, body.start);
    if (startVariable) this.active = { startVariable };
    else if (body.input) {
      this.active = { body, restForce: valueAt(modelInfo, state, body.input, state.t), stiffness: this.stiffness(body) };
      this.page.play();
    }
  }

  move(target) {
    if (!this.active) return;
    this.active.target = target;
    this.page.requestFrame();
  }

  drop() {
    if (!this.active) return;
    const { startVariable, body, restForce } = this.active;
    const { state } = this.page;
    this.active = null;
    if (!startVariable) {
      const last = state.changes.findLast(({ name }) => name === body.input);
      // The force lasts for a minimum time, so that the end of the pull does not replace it.
      addChange(state, body.input, restForce, Math.max(state.t, (last?.t ?? 0) + 1.01 * MIN_CHANGE_SPACING * state.stop));
      this.page.restartEdited();
    }
    this.page.redraw();
    this.page.play();
  }

  // Apply the drag; called once per frame.
  update() {
    const { state, session } = this.page;
    const { startVariable, body, target, restForce, stiffness } = this.active;
    if (target === undefined || !session.runs.main.hasReached(state.t)) return; // the last change is still being simulated
    if (startVariable) {
      this.page.setVariable(startVariable, target);
      return;
    }
    const extension = target - session.runs.main.at(body.position, state.t);
    addChange(state, body.input, restForce + Number((stiffness * extension).toPrecision(3)), state.t);
    this.page.restartEdited();
  }

  // The largest force (or torque) in the run, among outputs with the unit of the input.
  largestForce(body) {
    const { session, modelInfo } = this.page;
    const { unit } = findVariable(modelInfo, body.input);
    const { main } = session.runs;
    return Math.max(0, ...main.reals.filter((name) => findVariable(modelInfo, name).unit === unit).map((name) => main.largestMagnitude(name))) || 1;
  }

  // The stiffness of the virtual spring.
  stiffness(body) {
    return (4 * this.largestForce(body)) / (this.page.session.runs.main.largestMagnitude(body.position) || 1);
  }
}
