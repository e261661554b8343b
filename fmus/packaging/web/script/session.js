// The runs behind the page, for one state:
//
//   main         the run itself
//   comparison   the run to compare it with
//   unchanged    the run without the changes made during playback
//   preview      the same values with the model's default law, method and tolerance: shown while a slow run is under way
//   reference    the preview or main run, if the default method is exact

import { Fmu, FmuError } from "./fmu.js";
import { Run } from "./run.js";
import { comparisonSettings, findVariable, settableVariables, valueAt } from "./state.js";
import { load } from "./wasm.js";

export const POINTS = 1600; // grid steps
const REST_SEARCH = 1.1; // a rest that begins before this multiple of a model's stop time is shown
const REST_SHOWN = 0.05; // at least this fraction of the stop time of it

export class Session {
  constructor(data) {
    this.version = data.version;
    this.models = new Map(data.models.map((modelInfo) => [modelInfo.name, modelInfo]));
    this.code = new Map(); // compiled modules by model
    this.fmus = new Map();
    this.stopTimes = new Map();
    this.runs = {};
  }

  // Compile a model, unless it is compiled already.
  async compile(name) {
    if (!this.code.has(name)) this.code.set(name, load(this.models.get(name).code));
    this.code.set(name, await this.code.get(name));
  }

  fmu(name, role) {
    const key = `${name} ${role}`;
    if (!this.fmus.has(key)) this.fmus.set(key, new Fmu(this.models.get(name), this.code.get(name)));
    return this.fmus.get(key);
  }

  // The stop time of the default run in s: that of the model, or later if the model comes to rest soon after it. The model
  // must be compiled.
  stopTime(name) {
    const modelInfo = this.models.get(name);
    if (!this.stopTimes.has(name)) {
      const { stop, bodies } = modelInfo;
      const run = new Run(this.fmu(name, "stop time"), { values: {}, changes: [], stop: REST_SEARCH * stop, points: 0 });
      run.advance();
      const rest = bodies.some((body) => body.driver) ? undefined : run.restTime();
      this.stopTimes.set(name, rest > stop ? roundUp(rest + REST_SHOWN * stop) : stop);
    }
    return this.stopTimes.get(name);
  }

  // The message with which a model refuses to start with the values in force at the cursor time, one of them replaced;
  // empty if it accepts them.
  refusal(state, replaced = {}) {
    const modelInfo = this.models.get(state.model);
    const names = settableVariables(modelInfo).map(({ name }) => name);
    const values = Object.fromEntries(names.map((name) => [name, valueAt(modelInfo, state, name, state.t)]));
    try {
      this.fmu(state.model, "refusal").begin({ ...values, ...replaced }, state.stop);
      return "";
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      return error.message;
    }
  }

  // Restart all runs. The models must be compiled.
  restart(state) {
    const { values, changes, stop } = state;
    const modelInfo = this.models.get(state.model);
    const createRun = (role, setting = {}, model = state.model) =>
      new Run(this.fmu(model, role), { values, changes, stop, points: POINTS, ...setting });
    const defaults = Object.entries(values).filter(([name]) => name !== "friction" && !name.startsWith("solver."));
    const runs = {};
    if (defaults.length < Object.keys(values).length) runs.preview = createRun("preview", { values: Object.fromEntries(defaults) });
    runs.main = createRun("main");
    if (isExact(modelInfo)) runs.reference = runs.preview ?? runs.main;
    if (state.comparison) runs.comparison = createRun("comparison", comparisonSettings(this.models, state), state.comparison.model);
    if (changes.length) runs.unchanged = createRun("unchanged", { changes: [] });
    [this.runs, this.pointsShown] = [runs, 0];
  }

  get done() {
    return Object.values(this.runs).every((run) => run.done);
  }

  // Advance unfinished runs for a time slice in ms, the preview for at most half of it. Returns whether there is more to
  // draw: a run has ended, or the number of points has doubled.
  advance(slice) {
    const begin = performance.now();
    const unfinished = new Set(Object.values(this.runs).filter((run) => !run.done));
    for (const run of unfinished) {
      const isPreview = run === this.runs.preview;
      if (!run.advance(begin + (isPreview ? slice / 2 : slice)) && !isPreview) break;
    }
    const points = Object.values(this.runs).reduce((sum, run) => sum + run.time.length, 0);
    const more = points >= 2 * this.pointsShown || [...unfinished].some((run) => run.done);
    if (more) this.pointsShown = points;
    return more;
  }
}

// Round up to two digits.
function roundUp(value) {
  const unit = 10 ** (Math.floor(Math.log10(value)) - 1);
  return Number((Math.ceil(value / unit - 1e-9) * unit).toPrecision(2));
}

// Whether the default method of a model is the closed form.
function isExact(modelInfo) {
  const { items = [], start } = findVariable(modelInfo, "solver.method") ?? {}; // no variable with a single method
  return items.some(({ label, value }) => label === "exact" && value === start);
}
