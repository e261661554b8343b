// The runs behind the page, for one state of it: the run itself, the one beside it, the closed form to compare with,
// the motion as it would be without changes, and the published case as it was published.

import { Fmu } from "./fmu.js";
import { Run } from "./run.js";
import { beside, inForce } from "./state.js";
import { load } from "./wasm.js";

export const POINTS = 1600; // of the grid

export class Desk {
  constructor(data) {
    this.portraits = new Map(data.models.map((portrait) => [portrait.name, portrait]));
    this.presets = new Map(data.presets.map((preset) => [preset.name, preset]));
    this.codes = new Map();
    this.fmus = new Map();
    this.runs = {};
  }

  // Compile a model, if it is not yet.
  async ready(name) {
    if (!this.codes.has(name)) this.codes.set(name, load(this.portraits.get(name).code));
    this.codes.set(name, await this.codes.get(name));
  }

  fmu(name, role) {
    const key = `${name} ${role}`;
    if (!this.fmus.has(key)) this.fmus.set(key, new Fmu(this.portraits.get(name), this.codes.get(name)));
    return this.fmus.get(key);
  }

  // Begin all runs anew; the models must be ready.
  restart(state) {
    const portrait = this.portraits.get(state.model);
    const { stop, changes } = state;
    const setting = { values: state.values, changes, stop, points: POINTS };
    const runs = { one: new Run(this.fmu(state.model, "one"), setting) };
    if (state.other) {
      const theirs = { ...setting, ...beside(this.portraits, state) };
      runs.other = new Run(this.fmu(state.other.model, "other"), theirs);
    }
    const exact = closedForm(portrait);
    if (exact && this.isTrue(state)) runs.truth = runs.one;
    else if (exact) runs.truth = new Run(this.fmu(state.model, "truth"), { ...setting, values: { ...state.values, ...exact } });
    if (changes.length) runs.before = new Run(this.fmu(state.model, "before"), { ...setting, changes: [] });
    const preset = this.presets.get(state.preset);
    if (preset) {
      const points = preset.grid ? Math.round(stop / preset.grid) : 0;
      runs.published = new Run(this.fmu(state.model, "published"), { values: state.values, changes: [], stop, points });
    }
    this.runs = runs;
  }

  // Whether the run itself is the closed form.
  isTrue(state) {
    const portrait = this.portraits.get(state.model);
    const values = inForce(portrait, state.values);
    return Object.entries(closedForm(portrait) ?? { none: 1 }).every(([name, value]) => values[name] === value);
  }

  // Advance what is not done, the first first, until the deadline in ms; whether there was anything to do.
  work(deadline) {
    const waiting = Object.values(this.runs).filter((run) => !run.done);
    for (const run of waiting) {
      if (!run.advance(deadline)) break;
    }
    return waiting.length > 0;
  }
}

// The choices of the closed form; null for a model without.
function closedForm(portrait) {
  const item = (name, label) => portrait.variables.find((each) => each.name === name)?.items.find((each) => each.label === label);
  const exact = item("solver.method", "exact");
  if (!exact) return null;
  const hybrid = item("friction", "hybrid");
  return { "solver.method": exact.value, ...(hybrid && { friction: hybrid.value }) };
}

