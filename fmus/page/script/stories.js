// The opening and the stories: model, values, fields, diagrams and text of each.
//
//   model, values, stop   the state; comparison: the second run; restShown: ends this time in s after the motion has stopped
//   derive(values)        sets values that follow from others; stepsPerSecond: most steps that playback passes in a second
//   fields                ranges of the fields by variable
//   keys, ranges          diagrams, and the parts of them that are shown; envelopes: straight and exponential decay
//   furtherRuns(state)    runs whose counters the text states
//   text(scene)           HTML

import { formatCount, formatNumber, formatQuantity } from "./numbers.js";
import { bounds } from "./plot.js";
import { effectiveValues } from "./state.js";

const [HYBRID, SIGN] = [1, 2]; // values of the variable friction
const CREEP_TIME = 0.2; // s before the end
const CLOSE_UP = { from: 4.1, to: 4.1003 }; // s, of the steps that chatter
const DEGREE = Math.PI / 180;

// The solver ode23 with a relative tolerance, and the absolute one in the ratio of MATLAB's defaults (1e-3 and 1e-6).
const ode23 = (rtol) => ({ "solver.method": 2, "solver.rtol": rtol, "solver.atol": rtol / 1000 });
const setAbsoluteTolerance = (values) => (values["solver.atol"] = values["solver.rtol"] / 1000);
const TOLERANCE = { "solver.rtol": { low: 1e-4, high: 1e-2, log: true } };
const TWO_LAWS = { model: "coulomb", values: ode23(1e-3), comparison: { model: "coulomb", values: { friction: SIGN } }, runNames: ["true sticking", "sign(v)"], derive: setAbsoluteTolerance };

const bold = (text) => `<b>${text}</b>`;
const seconds = (t) => bold(`${formatNumber(t)} s`);
const metres = (x) => bold(formatQuantity(Math.abs(x), "m"));
const degrees = (angle) => bold(`${formatNumber(Math.abs(angle) / DEGREE, 3)}°`);
const newtons = (force) => bold(`${formatNumber(Math.abs(force), 3)} N`);
const count = (value) => bold(formatCount(value));
const countOf = (value, noun) => bold(`${formatCount(value)} ${noun}${value === 1 ? "" : "s"}`);
const valuesOf = ({ modelInfo, state }) => effectiveValues(modelInfo, state.values);
const stepsOf = (run) => run.counts["solver.steps"];
const errorOf = ({ main, reference }, run = main) => run.columns.x.at(-1) - reference.columns.x.at(-1);
const restText = (rest, distance) => (rest === 0 ? `stays where it is, ${distance} off` : `stops after ${seconds(rest)}, ${distance} off`);

// The times at which a run begins to slip, and at which it begins to stick.
function cycles(run) {
  const times = (isSlip) => run.events.filter(({ row }) => (run.columns.mode[row] !== 0) === isSlip).map(({ t }) => t);
  return { slips: times(true), holds: times(false) };
}

export const OPENING = {
  ...TWO_LAWS, restShown: 0.3, stepsPerSecond: 13000,
  fields: { ...TOLERANCE, x0: { low: -0.12, high: 0.12, log: false } },
  keys: ["x", ".steps", ".magnitude", ".law"],
  furtherRuns: ({ values }) => ({
    fineTrue: { model: "coulomb", values: { ...values, ...ode23(1e-4), friction: HYBRID } },
    fineSign: { model: "coulomb", values: { ...values, ...ode23(1e-4), friction: SIGN } },
  }),
  text: ({ runs, state }) => {
    const { main, comparison: sign, reference, further: { fineTrue, fineSign } } = runs;
    const rest = main.restTime();
    const creep = (sign.columns.x.at(-1) - sign.at("x", state.stop - CREEP_TIME)) / CREEP_TIME;
    const rests = rest === undefined ? "" : ` and rests ${rest === 0 ? "from the start" : `from ${seconds(rest)} on`}`;
    const row = (title, textOf) => `<tr><th scope="row">${title}</th><td class="a">${textOf(main)}</td><td class="b">${textOf(sign)}</td></tr>`;
    const last = (name) => (run) => run.columns[name].at(-1);
    return `<p>In the same ${seconds(state.stop)}, true sticking takes ${countOf(stepsOf(main), "step")}${rests}; sign(v) takes ${count(stepsOf(sign))}${creep ? `, and still moves at ${bold(formatQuantity(Math.abs(creep), "m/s"))} on average` : ""}.</p>
      <table><thead><tr><td></td><th scope="col">true sticking</th><th scope="col">sign(v)</th></tr></thead><tbody>
      ${row("distance from the closed form", (run) => metres(errorOf(runs, run)))}
      ${row("speed", (run) => bold(formatQuantity(Math.abs(last("v")(run)), "m/s")))}
      ${row("force of the spring", (run) => newtons(last("F_spring")(run)))}
      ${row("friction", (run) => newtons(last("F_friction")(run)))}</tbody></table>
      <p>The tolerance sets the error; the law sets the work: with 10<sup>−4</sup>, true sticking takes ${countOf(stepsOf(fineTrue), "step")} and ends ${metres(errorOf(runs, fineTrue))} off, sign(v) ${count(stepsOf(fineSign))} and ${metres(errorOf(runs, fineSign))}. The default method of this FMU is the closed form: ${countOf(stepsOf(reference), "step")}, exact to rounding. Other tools hold a body exactly as well: scipy, PathSim and Drake do, once their user programs stick and slip as events. In these FMUs, the model contains the events.</p>`;
  },
};

export const STORIES = {
  stops: {
    title: "It stops", model: "coulomb", stop: 5,
    fields: { f: { low: 0.5, high: 2, log: false }, x0: { low: -0.12, high: 0.12, log: false } },
    keys: ["x", ".law"], envelopes: true,
    text: (scene) => {
      const { main } = scene.runs;
      const { f, k } = valuesOf(scene);
      const [rest, turns] = [main.restTime(), main.events.filter(({ t }) => t > 0).length]; // the last one is the stop
      const end = rest === undefined ? "still swings when the picture ends"
        : `${rest > 0 ? `makes ${countOf(turns, "half-swing")} and ` : ""}${restText(rest, metres(main.columns.x.at(-1)))} centre`;
      return `<p>Dry friction takes the same energy on every centimetre, so each full swing is ${metres((4 * f) / k)} shorter than the one before, and the swings shrink along a straight line. The mass ${end}. Anywhere within ${bold("±")}${metres(f / k)} of the centre, the spring is too weak to move it.</p>`;
    },
  },
  chatters: {
    title: "It chatters", ...TWO_LAWS, stop: 4.3, fields: TOLERANCE,
    keys: ["v", ".law"],
    ranges: ({ runs: { comparison: { time, columns: { v } } } }) => {
      const shown = v.filter((_, i) => time[i] >= CLOSE_UP.from && time[i] <= CLOSE_UP.to);
      const largest = 1.25 * Math.max(1e-9, ...shown.map(Math.abs));
      return { v: { x: { low: CLOSE_UP.from, high: CLOSE_UP.to }, y: bounds([shown, [0]]) }, ".law": { x: { low: -largest, high: largest } } };
    },
    text: ({ runs }) => {
      const { main, comparison: sign, reference } = runs;
      const rest = reference.restTime();
      const before = (run) => run.ends.filter((row) => run.time[row] <= rest).length - 1;
      const row = (run) => `${count(before(run))} steps until then and ${count(stepsOf(run) - before(run))} in the 0.3 s after that, rejects ${count(run.counts["solver.rejected"])} more, and ends ${metres(errorOf(runs, run))} from the closed form`;
      return `<p>At rest, friction is whatever balances the spring; sign(v) offers only the full force, one way or the other: here ${newtons(sign.columns.F_friction.at(-1))}, where the spring pulls with ${newtons(sign.columns.F_spring.at(-1))}. The mass should stop after ${seconds(rest)}. With sign(v), ode23 takes ${row(sign)}. With true sticking, it takes ${row(main)}. The diagrams show ${bold(`${formatNumber(1000 * (CLOSE_UP.to - CLOSE_UP.from), 2)} ms`)} of the time at rest.</p>`;
    },
  },
  squeaks: {
    title: "It squeaks", model: "stickslip", stop: 12,
    fields: { v_driver: { low: 0.01, high: 0.2, log: false }, mu_d: { low: 0.1, high: 0.88, log: false } },
    keys: ["x", ".law"],
    text: (scene) => {
      const { slips, holds } = cycles(scene.runs.main);
      const { mu_s, mu_d } = valuesOf(scene);
      const { stop } = scene.state;
      const hold = holds.find((t) => t > slips[0]);
      const lasts = hold ? `lasting ${seconds(hold - slips[0])}` : "without an end";
      const cycle = slips.length > 1 ? `${countOf(slips.length, "slip")} in ${stop} s, one every ${seconds(slips.at(-1) - slips.at(-2))}, each ${lasts}`
        : slips.length ? `one slip in the first ${stop} s, ${lasts}` : `no slip in the first ${stop} s`;
      return `<p>A driver pulls the sled through a spring. The sled stands until the spring is stronger than friction at rest; then it slips, and sticks again. Friction is weaker once it slips, ${bold(formatNumber(mu_d, 3))} instead of ${bold(formatNumber(mu_s, 3))}, so it overshoots: ${cycle}. A few hundred times a second, this is a door hinge, a brake, or a violin.</p>`;
    },
  },
  creeps: {
    title: "It creeps", model: "pacejka", stop: 12, comparison: { model: "stickslip", values: {} }, runNames: ["smooth curve", "true sticking"],
    fields: { x_m: { low: 0.001, high: 0.02, log: true }, v_driver: { low: 0.02, high: 0.044, log: false } },
    keys: ["x", ".law"],
    furtherRuns: ({ values }) => {
      const { x_m, ...shared } = values;
      return { smooth: { model: "pacejka", values: { ...values, ...ode23(1e-3) } }, exact: { model: "stickslip", values: { ...shared, ...ode23(1e-3) } } };
    },
    text: (scene) => {
      const { main: { time, columns: { x, v } }, comparison, further: { smooth, exact } } = scene.runs;
      const { x_m } = valuesOf(scene);
      const row = v.findIndex((speed) => speed > x_m);
      const share = row > 0 ? (x_m - v[row - 1]) / (v[row] - v[row - 1]) : 1; // of the interval before that row
      const at = (column) => column.at(row - 1) + share * (column.at(row) - column.at(row - 1));
      const creeps = row < 0 ? `creeps ${metres(x.at(-1) - x[0])} in ${scene.state.stop} s` : row === 0 ? "slips from the start" : `creeps ${metres(at(x) - x[0])} before it breaks away, after ${seconds(at(time))}`;
      const breaksAway = comparison.columns.mode[0] === 0 ? cycles(comparison).slips[0] : 0;
      const stands = breaksAway === undefined ? "does not move" : breaksAway === 0 ? "slips from the start" : `does not move for ${seconds(breaksAway)}`;
      return `<p>A common cure is to smooth the jump, so that friction rises to its peak within ${bold(formatQuantity(x_m, "m/s"))} of slip. But a smooth curve is zero at rest and pushes back only on what slides: the sled ${creeps}; with true sticking, it ${stands}. A steeper curve creeps less and costs more: here ${count(stepsOf(smooth))} steps of ode23 with a tolerance of 10<sup>−3</sup>, where true sticking takes ${count(stepsOf(exact))} of the same.</p>`;
    },
  },
  swings: {
    title: "It swings", model: "pendulum", values: { theta0: 10 * DEGREE }, stop: 6,
    fields: { mu: { low: 0.08, high: 0.5, log: false }, theta0: { low: -25 * DEGREE, high: 25 * DEGREE, log: false } },
    keys: ["theta", ".law"], envelopes: true,
    text: (scene) => {
      const { main } = scene.runs;
      const { mu, r, a, theta0 } = valuesOf(scene);
      const rest = main.restTime();
      const end = rest === undefined ? "still swings when the picture ends" : `${restText(rest, degrees(main.columns.theta.at(-1)))} the vertical`;
      return `<p>Friction need not be on a floor: here it is in the pin of a pendulum, with a coefficient of ${bold(formatNumber(mu, 3))}. Released at ${degrees(theta0)}, it ${end}; anything within ${bold("±")}${degrees(Math.asin((mu * r) / a))} is held. From a record of such swings one can read the friction of a bearing, without taking it apart.</p>`;
    },
  },
};
