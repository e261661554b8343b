// The models of the page. A model is compiled when it is needed first.

import { Fmu, FmuError, load } from "./fmu.js";
import { Run } from "./run.js";
import { findVariable } from "./state.js";

export const POINTS = 1600; // grid steps
const REST_SEARCH = 1.1; // a rest that begins before this multiple of a model's stop time is shown
const REST_SHOWN = 0.05; // at least this fraction of the stop time of it

export class ModelLibrary {
  constructor({ version, models }) {
    this.version = version;
    this.models = new Map(models.map((modelInfo) => [modelInfo.name, modelInfo]));
    this.code = new Map(); // compiled modules by model
    this.checked = new Map(); // instances for refusal(), by model
    this.defaultRuns = new Map();
  }

  // Compile a model, unless it is compiled already.
  async compile(name) {
    if (!this.code.has(name)) this.code.set(name, load(this.models.get(name).code));
    this.code.set(name, await this.code.get(name));
  }

  // Return a new instance of a compiled model.
  createFmu(name) {
    return new Fmu(this.models.get(name), this.code.get(name));
  }

  // The run of a compiled model with its default values, a little beyond its stop time.
  defaultRun(name) {
    if (!this.defaultRuns.has(name)) {
      const run = new Run(this.createFmu(name), { values: {}, changes: [], stop: REST_SEARCH * this.models.get(name).stop, points: POINTS });
      run.advance();
      this.defaultRuns.set(name, run);
    }
    return this.defaultRuns.get(name);
  }

  // The stop time of the default run in s: that of the model, or later if the model comes to rest soon after it.
  stopTime(name) {
    const { stop, bodies } = this.models.get(name);
    const rest = bodies.some((body) => body.driver) ? undefined : this.defaultRun(name).restTime();
    return rest > stop ? roundUp(rest + REST_SHOWN * stop) : stop;
  }

  // The message with which a compiled model refuses to start with these values; empty if it accepts them.
  refusal(name, values, stop) {
    if (!this.checked.has(name)) this.checked.set(name, this.createFmu(name));
    try {
      this.checked.get(name).begin(values, stop);
      return "";
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      return error.message;
    }
  }
}

// Round up to two digits.
function roundUp(value) {
  const unit = 10 ** (Math.floor(Math.log10(value)) - 1);
  return Number((Math.ceil(value / unit - 1e-9) * unit).toPrecision(2));
}

// Whether the default method of a model is the closed form.
export function isExact(modelInfo) {
  const { items = [], start } = findVariable(modelInfo, "solver.method") ?? {}; // no variable with a single method
  return items.some(({ label, value }) => label === "exact" && value === start);
}
