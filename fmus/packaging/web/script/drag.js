// The hand in the mechanism: it puts a body, pulls it or pushes it.

import { change, CLOSE } from "./overrides.js";
import { named, valueAt } from "./state.js";

const SHORT = 1 / 40; // of a run: how long a kick lasts

export class DragController {
  // `page` has state, modelInfo and session, and can put(variable, value), edited(), play() and wake().
  constructor(page) {
    Object.assign(this, { page, pull: null }); // pull: while a body is dragged
  }

  // A push on the first body that takes main, as hard as its forces are.
  kick() {
    const { state, modelInfo } = this.page;
    const body = modelInfo.bodies.find((each) => each.input);
    if (!body) return;
    const rest = valueAt(modelInfo, state, body.input, state.t);
    change(state, body.input, rest + 2 * this.strength(body), state.t);
    change(state, body.input, rest, Math.min(state.t + SHORT * state.stop, state.stop));
    this.page.edited();
    this.page.play();
  }

  // At the start a body is put where it shall begin; later it is pulled along, as by a spring.
  grab(body) {
    const { state, modelInfo, playing } = this.page;
    const place = state.t === 0 && !playing && named(modelInfo, body.start);
    if (place) this.pull = { place };
    else if (body.input) {
      this.pull = { body, rest: valueAt(modelInfo, state, body.input, state.t), stiffness: this.stiffness(body) };
      this.page.play();
    }
  }

  move(to) {
    if (!this.pull) return;
    this.pull.to = to;
    this.page.wake();
  }

  drop() {
    if (!this.pull) return;
    const { place, body, rest } = this.pull;
    const { state } = this.page;
    this.pull = null;
    if (!place) {
      const last = state.changes.findLast(({ name }) => name === body.input);
      change(state, body.input, rest, Math.max(state.t, (last?.t ?? 0) + 1.01 * CLOSE * state.stop)); // however short it was
      this.page.edited();
    }
    this.page.play();
  }

  // What the pull does in a frame.
  act() {
    const { state, session } = this.page;
    const { place, body, to, rest, stiffness } = this.pull;
    if (to === undefined || !session.runs.main.reaches(state.t)) return; // the last change is still being run
    if (place) {
      this.page.put(place, Number((to * place.factor).toPrecision(3)) / place.factor);
      return;
    }
    const apart = to - session.runs.main.at(body.position, state.t);
    change(state, body.input, rest + Number((stiffness * apart).toPrecision(3)), state.t);
    this.page.edited();
  }

  // The largest force on a body in the run, by the unit of its input.
  strength(body) {
    const { session, modelInfo } = this.page;
    const { unit } = named(modelInfo, body.input);
    const { main } = session.runs;
    return Math.max(0, ...main.reals.filter((name) => named(modelInfo, name).unit === unit).map((name) => main.largest(name))) || 1;
  }

  stiffness(body) {
    return (4 * this.strength(body)) / (this.page.session.runs.main.largest(body.position) || 1);
  }
}
