// The band of positions in which friction can hold a body at rest: found by starting the model there and reading its mode.

import { FmuError } from "./fmu.js";
import { settableVariables, valueAt } from "./state.js";

const [SMALLEST_EDGE, MAX_DOUBLINGS, BISECTIONS] = [1e-9, 60, 44];
const MAX_KNOWN = 2000; // bands kept for repeated questions, as while a slider moves

export class HoldingBands {
  constructor(session) {
    Object.assign(this, { session, known: new Map() });
  }

  // The bands of a body as [{t, low, high}], each from the time t in s on, relative to the driver if there is one; null
  // if there is none. They are those of true sticking, whatever the friction law of the run.
  find(state, body) {
    if (!body.band_starts) return null;
    const times = [0, ...new Set(state.changes.map(({ t }) => t).filter((t) => t > 0))];
    const bands = times.map((t) => ({ t, ...this.bandAt(state, body, t) }));
    return bands.every(({ high }) => Number.isFinite(high)) ? bands : null;
  }

  bandAt(state, body, t) {
    const modelInfo = this.session.models.get(state.model);
    const names = settableVariables(modelInfo).map(({ name }) => name).filter((name) => name !== "friction" && !name.startsWith("solver."));
    const values = Object.fromEntries(names.map((name) => [name, valueAt(modelInfo, state, name, t)]));
    const [start, speed] = body.band_starts;
    Object.assign(values, { [start]: 0, [speed]: 0 });
    const key = JSON.stringify([state.model, body.position, values]);
    if (this.known.size > MAX_KNOWN) this.known.clear();
    if (!this.known.has(key)) this.known.set(key, this.search(state.model, body, values));
    return this.known.get(key);
  }

  // Beyond the lower edge the body starts to move forward, beyond the upper edge backward.
  search(model, body, values) {
    const fmu = this.session.fmu(model, "holding band");
    const [start] = body.band_starts;
    const modeAt = (position) => {
      fmu.begin({ ...values, [start]: position }, 1);
      return fmu.readIntegers()[fmu.modes.indexOf(body.mode)];
    };
    const edge = (side) => {
      let [held, free] = [0, side * SMALLEST_EDGE];
      const isFree = (position) => modeAt(position) * side < 0;
      for (let n = 0; n < MAX_DOUBLINGS && !isFree(free); n++) [held, free] = [free, 2 * free];
      if (!isFree(free)) return NaN; // held everywhere
      if (held === 0 && isFree(0)) { // a force from outside moves the band to the other side of zero
        let step = -side * SMALLEST_EDGE;
        for (let n = 0; n < MAX_DOUBLINGS && isFree(step); n++) step *= 2;
        [held, free] = [step, 0];
      }
      for (let n = 0; n < BISECTIONS; n++) {
        const middle = (held + free) / 2;
        if (isFree(middle)) free = middle;
        else held = middle;
      }
      return held;
    };
    try {
      const [low, high] = [edge(-1), edge(1)];
      return low < high ? { low, high } : {};
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      return {}; // refused values
    }
  }
}
