// The models and runs of the stories.

import { Fmu } from "./fmu.js";
import { Run } from "./run.js";

export const HYBRID = { friction: 1 };
export const SIGN = { friction: 2 };
const ODE23_METHOD = 2;
const GRID_COINCIDENCE = 1e-9; // in grid steps: a grid point this close to the end of a solver step coincides with it

// The solver ode23 with a relative tolerance, and the absolute one in the ratio of MATLAB's defaults (1e-3 and 1e-6).
export const ode23 = (rtol) => ({ "solver.method": ODE23_METHOD, "solver.rtol": rtol, "solver.atol": rtol / 1000 });

// Return an instance of a model of its own, so that stories do not disturb each other.
export async function createFmu(session, name) {
  await session.compile(name);
  return new Fmu(session.models.get(name), session.code.get(name));
}

// The start values of a model by name.
export function startValues(session, name) {
  return Object.fromEntries(session.models.get(name).variables.map((variable) => [variable.name, variable.start]));
}

// Run to the end at once: for closed forms and short runs.
export function simulate(fmu, values, stop, points) {
  const run = new Run(fmu, { values, stop, points, changes: [] });
  run.advance();
  return run;
}

// A run that stores its present point only, so that it may take any number of solver steps.
export class SteppedRun {
  // The run stops at the end of every solver step, and every `gridStep` in s if that is given.
  constructor(fmu, values, stop, gridStep = stop) {
    Object.assign(this, { fmu, stop, gridStep, t: 0 });
    fmu.begin(values, stop);
    this.read();
  }

  // Go on to the end of the solver step or to the next grid point.
  step() {
    const gridPoint = (Math.floor(this.t / this.gridStep + GRID_COINCIDENCE) + 1) * this.gridStep;
    let target = gridPoint < this.stop - GRID_COINCIDENCE * this.gridStep ? gridPoint : this.stop;
    if (this.next <= target + GRID_COINCIDENCE * this.gridStep) target = Math.min(this.next, this.stop);
    this.fmu.step(this.t, target - this.t);
    this.t = target;
    this.read();
  }

  read() {
    const { reals, modes } = this.fmu;
    const values = this.fmu.readReals();
    this.next = values[reals.length];
    for (let i = 0; i < reals.length; i++) this[reals[i]] = values[i];
    const integers = this.fmu.readIntegers();
    for (let i = 0; i < modes.length; i++) this[modes[i]] = integers[i];
  }

  get done() {
    return this.t >= this.stop;
  }

  // Counters of the solver up to now, also of steps that it repeated with a tighter tolerance.
  get steps() {
    return this.count("solver.steps");
  }

  get rejected() {
    return this.count("solver.rejected");
  }

  count(name) {
    return this.fmu.readCounts()[this.fmu.counted.indexOf(name)];
  }
}

// Interpolate a position of a recorded run at a time in s by its velocity, the cubic polynomial of both ends.
export function positionAt(run, t, position = "x", velocity = "v") {
  const row = Math.min(run.row(t), run.time.length - 2);
  const [x, v] = [run.columns[position], run.columns[velocity]];
  const h = run.time[row + 1] - run.time[row];
  if (!(h > 0)) return x[row];
  const s = (t - run.time[row]) / h;
  const u = 1 - s;
  return u * u * ((1 + 2 * s) * x[row] + s * h * v[row]) + s * s * ((1 + 2 * u) * x[row + 1] - u * h * v[row + 1]);
}
