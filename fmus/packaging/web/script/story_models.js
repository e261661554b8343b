// The models and runs of the stories.

import { Fmu } from "./fmu.js";
import { Run } from "./run.js";

export const HYBRID = { friction: 1 };
export const SIGN_ODE23 = { friction: 2, "solver.method": 2 };
export const ODE23 = { "solver.method": 2, "solver.rtol": 1e-3, "solver.atol": 1e-6 };

// Return an instance of a model of its own, so that stories do not disturb each other.
export async function createFmu(session, name) {
  await session.compile(name);
  return new Fmu(session.models.get(name), session.code.get(name));
}

// Run to the end at once: for closed forms and short runs.
export function simulate(fmu, values, stop, points) {
  const run = new Run(fmu, { values, stop, points, changes: [] });
  run.advance();
  return run;
}
