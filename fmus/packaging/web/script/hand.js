// The hand in the mechanism: it puts a body, pulls it or pushes it.

import { change, CLOSE } from "./edit.js";
import { named, valueAt } from "./state.js";

const SHORT = 1 / 40; // of a run: how long a kick lasts

export class Hand {
  // `page` has state, portrait and desk, and can put(variable, value), edited(), play() and wake().
  constructor(page) {
    Object.assign(this, { page, pull: null }); // pull: while a body is dragged
  }

  // A push on the first body that takes one, as hard as its forces are.
  kick() {
    const { state, portrait } = this.page;
    const body = portrait.bodies.find((each) => each.input);
    if (!body) return;
    const rest = valueAt(portrait, state, body.input, state.t);
    change(state, body.input, rest + 2 * this.strength(body), state.t);
    change(state, body.input, rest, Math.min(state.t + SHORT * state.stop, state.stop));
    this.page.edited();
    this.page.play();
  }

  // At the start a body is put where it shall begin; later it is pulled along, as by a spring.
  grab(body) {
    const { state, portrait, playing } = this.page;
    const place = state.t === 0 && !playing && named(portrait, body.start);
    if (place) this.pull = { place };
    else if (body.input) {
      this.pull = { body, rest: valueAt(portrait, state, body.input, state.t), stiffness: this.stiffness(body) };
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
    const { state, desk } = this.page;
    const { place, body, to, rest, stiffness } = this.pull;
    if (to === undefined || !desk.runs.one.reaches(state.t)) return; // the last change is still being run
    if (place) {
      this.page.put(place, Number((to * place.factor).toPrecision(3)) / place.factor);
      return;
    }
    const apart = to - desk.runs.one.at(body.position, state.t);
    change(state, body.input, rest + Number((stiffness * apart).toPrecision(3)), state.t);
    this.page.edited();
  }

  // The largest force on a body in the run, by the unit of its input.
  strength(body) {
    const { desk, portrait } = this.page;
    const { unit } = named(portrait, body.input);
    const { one } = desk.runs;
    return Math.max(0, ...one.reals.filter((name) => named(portrait, name).unit === unit).map((name) => one.largest(name))) || 1;
  }

  stiffness(body) {
    return (4 * this.strength(body)) / (this.page.desk.runs.one.largest(body.position) || 1);
  }
}
