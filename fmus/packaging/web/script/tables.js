// The numbers under the diagrams, as tables.

import { make } from "./controls.js";
import { COUNTS } from "./fmu.js";
import { decayBetween, difference, figures, forceByEnergy, turningPoints } from "./measure.js";
import { told } from "./plot.js";
import { inForce } from "./state.js";

const LISTED = 60; // events
const UNITS = { ms: 1e-3, s: 1, deg: Math.PI / 180, "lbf.in": 0.45359237 * 9.80665 * 0.0254 };
const FIGURES = { // name of a figure -> words, unit
  steps: ["steps (time points)", ""],
  mean_step: ["mean step", "s"],
  run_time: ["run time here", "s"],
  x_0: ["first peak", "m"],
  x_n: ["last peak", "m"],
  sample_0: ["first peak, as sampled", "m"],
  sample_n: ["last peak, as sampled", "m"],
  first_slip: ["first slip", "s"],
  slip_time: ["duration of a slip", "s"],
  zeta: ["damping ratio", ""],
  f: ["friction force", "N"],
  T_f: ["joint torque", "N·m"],
  period: ["slip period", "s"],
  peak_speed: ["peak speed", "m/s"],
  peak_acceleration: ["peak acceleration", "m/s²"],
};

function table(caption, heads, rows) {
  const head = make("tr", {}, ...heads.map((text) => make("th", { scope: "col" }, text)));
  const body = rows.map(([first, ...cells]) => make("tr", {}, make("th", { scope: "row" }, first), ...cells.map((cell) => make("td", {}, cell))));
  return make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption },
    make("table", {}, make("caption", {}, caption), make("thead", {}, head), make("tbody", {}, ...body)));
}

// Law and method of a run, in words.
export function setting(run) {
  const values = inForce(run.fmu.modelInfo, run.setting.values);
  const label = (name) => run.fmu.variables.get(name)?.items.find(({ value }) => value === values[name])?.label;
  const rtol = values["solver.rtol"] ? `rtol ${values["solver.rtol"]}` : "";
  return [run.fmu.modelInfo.name, label("friction"), label("solver.method"), rtol].filter(Boolean).join(", ");
}

// What the runs took, and how far they are apart.
export function cost(session, state) {
  const { main, comparison, reference } = session.runs;
  const runs = [main, comparison].filter(Boolean);
  const body = session.models.get(state.model).bodies[state.body];
  const { shown, factor } = main.fmu.variables.get(body.position);
  const rows = [
    ...Object.entries(COUNTS).map(([name, words]) => [words, ...runs.map((run) => String(run.counts?.[name] ?? ""))]),
    ["run time here, drawing points included", ...runs.map((run) => `${told(1000 * run.seconds, 2)} ms`)],
  ];
  const off = (run) => (run === reference ? "is the closed form" : `${told(difference(reference, run, body.position).largest * factor, 3)} ${shown}`);
  const alike = (run) => run.fmu.modelInfo === reference?.fmu.modelInfo;
  if (reference?.done) rows.push([`largest error of ${body.position} against the closed form`, ...runs.map((run) => (alike(run) ? off(run) : ""))]);
  if (comparison?.columns[body.position] && comparison.columns[body.speed]) {
    const apart = (name) => {
      const variable = main.fmu.variables.get(name);
      return `${told(difference(main, comparison, name).largest * variable.factor, 3)} ${variable.shown}`;
    };
    rows.push([`largest difference in ${body.position}`, "", apart(body.position)], [`largest difference in ${body.speed}`, "", apart(body.speed)]);
  }
  return table("What it costs", ["", ...runs.map(setting)], rows);
}

// A published case beside what this page measures.
export function published(session, state) {
  const preset = session.presets.get(state.preset);
  const run = session.runs.published;
  if (!preset || !run?.done || run.failure) return null;
  const modelInfo = session.models.get(state.model);
  const measured = figures(run, modelInfo.bodies[0], preset.decay, inForce(modelInfo, state.values));
  const rows = Object.entries(preset.published).filter(([name]) => name !== "source").map(([name, figure]) => compared(name, figure, measured[name]));
  return table(preset.title, ["", "measured here", `published (${preset.published.source})`, "difference"], rows);
}

function compared(name, figure, value) {
  const [words, own] = FIGURES[name] ?? [name, ""];
  const [number, unit] = Array.isArray(figure) ? figure : [figure, own];
  const factor = Array.isArray(figure) ? UNITS[unit] : 1;
  if (value === undefined) return [words, "–", `${number} ${unit}`, ""];
  const digits = Math.max(5, String(number).replace(".", "").replace(/^0+/, "").length);
  const plain = typeof number === "number";
  const [size, small] = !plain && own === "s" && Math.abs(value) < 1 ? [1e3 * value, "ms"] : [value / factor, unit];
  const apart = plain && name !== "run_time" ? `${told(100 * (value / factor / number - 1), 2)} %` : name === "run_time" ? "elsewhere" : "";
  return [words, `${told(size, digits)} ${small.replace(".", "·")}`, `${number} ${plain ? unit.replace(".", "·") : ""}`.trim(), apart];
}

// What the turning points say.
export function decay(session, state) {
  const { main } = session.runs;
  const modelInfo = session.models.get(state.model);
  const body = modelInfo.bodies[state.body];
  const { shown, factor } = main.fmu.variables.get(body.position);
  const turning = turningPoints(main.time, main.columns[body.position], main.columns[body.speed]);
  const falling = turning.filter(({ x }, i) => i === 0 || Math.abs(x) < Math.abs(turning[i - 1].x));
  const [first, last] = [falling[0], falling.at(-1)];
  const between = falling.length > 2 && decayBetween(Math.abs(first.x), Math.abs(last.x), (falling.length - 1) / 2);
  if (!between) return null;
  const size = (x) => `${told(Math.abs(x) * factor, 6)} ${shown}`;
  const rows = [
    ["turning points", String(turning.length)],
    ["the first, the last that is smaller than the main before", `${size(first.x)}, ${size(last.x)}`],
    ["logarithmic decrement of a cycle", told(between.delta, 6)],
    ["damping ratio that would give it", told(between.zeta, 6)],
    ["loss of amplitude in a cycle", size(between.loss)],
  ];
  const energy = modelInfo.variables.find(({ unit, causality }) => unit === "J" && causality === "output");
  if (energy) {
    const force = forceByEnergy(main, body, energy.name, falling);
    rows.push([`friction by the energy lost on the way (mean of all losses)`, `${told(force, 6)} ${shown === "deg" ? "N·m" : "N"}`]);
  }
  return table("What the decay says", ["", "measured"], rows);
}

// The events, each with its time.
export function events(session, state) {
  const { main } = session.runs;
  const body = session.models.get(state.model).bodies[state.body];
  if (!main.events.length) return null;
  const word = { "-1": "slides backward", 0: "sticks", 1: "slides forward" };
  const rows = main.events.slice(0, LISTED).map(({ t, row }, i) => [String(i + 1), String(t), body.mode ? word[main.columns[body.mode][row]] : ""]);
  const more = main.events.length - rows.length;
  const made = table("Events", ["", "t in s", "from then on it"], rows);
  made.classList.add("long");
  if (more > 0) made.append(make("p", {}, `and ${more} more: the CSV file has them all.`));
  return made;
}
