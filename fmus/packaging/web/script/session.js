// The runs behind the page, for one state of it: the run itself, the one beside it, the motion as it would be without
// changes, the published case as it was published, and by the model's own law, method and tolerance the quick one:
// what is seen at once where another takes its time, and the closed form where there is one.

import { Fmu } from "./fmu.js";
import { Run } from "./run.js";
import { beside, named } from "./state.js";
import { load } from "./wasm.js";

export const POINTS = 1600; // of the grid

export class Session {
  constructor(data) {
    this.models = new Map(data.models.map((modelInfo) => [modelInfo.name, modelInfo]));
    this.presets = new Map(data.presets.map((preset) => [preset.name, preset]));
    this.codes = new Map();
    this.fmus = new Map();
    this.runs = {};
  }

  // Compile a model, if it is not yet.
  async ready(name) {
    if (!this.codes.has(name)) this.codes.set(name, load(this.models.get(name).code));
    this.codes.set(name, await this.codes.get(name));
  }

  fmu(name, role) {
    const key = `${name} ${role}`;
    if (!this.fmus.has(key)) this.fmus.set(key, new Fmu(this.models.get(name), this.codes.get(name)));
    return this.fmus.get(key);
  }

  // Begin all runs anew; the models must be ready.
  restart(state) {
    const { values, changes, stop } = state;
    const modelInfo = this.models.get(state.model);
    const run = (role, setting = {}, model = state.model) =>
      new Run(this.fmu(model, role), { values, changes, stop, points: POINTS, ...setting });
    const own = Object.entries(values).filter(([name]) => name !== "friction" && !name.startsWith("solver."));
    const runs = {};
    if (own.length < Object.keys(values).length) runs.preview = run("preview", { values: Object.fromEntries(own) });
    runs.main = run("main");
    if (isExact(modelInfo)) runs.reference = runs.preview ?? runs.main;
    if (state.comparison) runs.comparison = run("comparison", beside(this.models, state), state.comparison.model);
    if (changes.length) runs.unchanged = run("unchanged", { changes: [] });
    const preset = this.presets.get(state.preset);
    if (preset) runs.published = run("published", { points: preset.grid ? Math.round(stop / preset.grid) : 0 });
    [this.runs, this.seen] = [runs, 0];
  }

  get done() {
    return Object.values(this.runs).every((run) => run.done);
  }

  // Advance what is not done for so many ms, half of them at most the quick one; whether there is more to see: a run
  // has ended, or has twice the points.
  work(slice) {
    const begun = performance.now();
    const waiting = new Set(Object.values(this.runs).filter((run) => !run.done));
    for (const run of waiting) {
      const quick = run === this.runs.preview;
      if (!run.advance(begun + (quick ? slice / 2 : slice)) && !quick) break;
    }
    const points = Object.values(this.runs).reduce((sum, run) => sum + run.time.length, 0);
    const more = points >= 2 * this.seen || [...waiting].some((run) => run.done);
    if (more) this.seen = points;
    return more;
  }
}

// Whether a model by itself has its motion in closed form.
function isExact(modelInfo) {
  const { items, start } = named(modelInfo, "solver.method");
  return items.some(({ label, value }) => label === "exact" && value === start);
}
