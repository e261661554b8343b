// The runs of one state:
//
//   main         the run itself
//   comparison   the run to compare it with
//   unchanged    the run without the changes made during playback
//   preview      the same values with the model's default law, method and tolerance: shown while a slow run is under way
//   reference    the preview or main run, if the default method is exact
//   further      runs by name of which only the end is of interest

import { isExact, POINTS } from "./library.js";
import { Run } from "./run.js";
import { comparisonSettings } from "./state.js";

export class RunSet {
  constructor(library) {
    Object.assign(this, { library, fmus: new Map(), list: [] }); // list: all runs, in the order of their computation
  }

  // Start all runs anew. The models must be compiled. `further` has {model, values} by name.
  restart(state, further = {}) {
    const { values, changes, stop } = state;
    const { models } = this.library;
    const createRun = (role, setting = {}, model = state.model) => new Run(this.fmu(model, role), { values, changes, stop, points: POINTS, ...setting });
    const defaults = Object.entries(values).filter(([name]) => name !== "friction" && !name.startsWith("solver."));
    const isDefault = defaults.length === Object.keys(values).length;
    this.preview = isDefault ? undefined : createRun("preview", { values: Object.fromEntries(defaults) });
    this.main = createRun("main");
    this.reference = isExact(models.get(state.model)) ? this.preview ?? this.main : undefined;
    this.comparison = state.comparison ? createRun("comparison", comparisonSettings(models, state), state.comparison.model) : undefined;
    this.unchanged = changes.length ? createRun("unchanged", { changes: [] }) : undefined;
    this.further = Object.fromEntries(Object.entries(further).map(([name, { model, values: own }]) => {
      const key = JSON.stringify([model, own, stop]);
      const known = this.further?.[name];
      return [name, known?.key === key ? known : Object.assign(createRun(name, { values: own, changes: [], points: 0, isEndOnly: true }, model), { key })];
    }));
    this.list = [this.preview, this.main, this.comparison, this.unchanged, ...Object.values(this.further)].filter(Boolean);
    this.pointsShown = 0;
  }

  // The instance of a model for a role.
  fmu(name, role) {
    const key = `${name} ${role}`;
    if (!this.fmus.has(key)) this.fmus.set(key, this.library.createFmu(name));
    return this.fmus.get(key);
  }

  get done() {
    return this.list.every((run) => run.done);
  }

  // Advance unfinished runs up to a deadline in ms, the preview for at most half of the time. Returns whether there is more
  // to draw: a run has ended, or the number of points has doubled.
  advance(deadline) {
    const middle = (performance.now() + deadline) / 2;
    const unfinished = this.list.filter((run) => !run.done);
    for (const run of unfinished) {
      const isPreview = run === this.preview;
      if (!run.advance(isPreview ? middle : deadline) && !isPreview) break;
    }
    const points = this.list.reduce((sum, run) => sum + run.time.length, 0);
    const more = points >= 2 * this.pointsShown || unfinished.some((run) => run.done);
    if (more) this.pointsShown = points;
    return more;
  }
}
