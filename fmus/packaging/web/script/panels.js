// What each diagram shows, from the runs and the state.

import { difference, turningPoints } from "./measure.js";
import { bounds, told } from "./plot.js";

const NEAR = 400; // marks of events at most
const SMOOTH = 200; // points of an envelope
const MANY = 8000; // points of a run

// [{key, title, content}]: a diagram is known by its key from one state to the next.
export function panels(desk, state, tools) {
  const { one, other } = desk.runs;
  const portrait = desk.portraits.get(state.model);
  const body = portrait.bodies[state.body];
  const names = [body.position, body.speed, body.acceleration].filter(Boolean);
  const energy = portrait.variables.find(({ unit, causality }) => unit === "J" && causality === "output")?.name;
  const found = names.map((name) => overTime(desk, state, tools, name, name));
  found.push(phase(desk, body));
  found.push(overTime(desk, state, tools, "solver.h", "step", true));
  if (energy) found.push(overTime(desk, state, tools, energy, "energy"));
  if (body.friction) found.push(overTime(desk, state, tools, body.friction, "friction"));
  const apart = errors(desk, body, state);
  if (apart) found.push(apart);
  for (const panel of found) panel.content.words = `${panel.title}${other ? ", two runs" : ""}: ${extent(panel, one)}`;
  return found;
}

function extent({ content }, one) {
  const { low, high } = bounds([content.curves.at(-1)?.y ?? []], content.y.log);
  return `from ${told(low, 3)} to ${told(high, 3)}, ${one.events.length} events`;
}

// A variable of a run, in the unit that people read.  Of a run of very many steps a picture needs the points of the
// grid and the events alone, but for the steps themselves.
function series(run, { name, factor }) {
  const [all, column] = [run.time.length < MANY || name === "solver.h", run.columns[name]];
  if (all && factor === 1) return column;
  if (all) return column.map((value) => value * factor);
  return sparse(run).map((row) => column[row] * factor);
}

function times(run, name) {
  return run.time.length < MANY || name === "solver.h" ? run.time : sparse(run).map((row) => run.time[row]);
}

function sparse(run) {
  const rows = [...run.grid, ...run.events.map(({ row }) => row)];
  return rows.sort((one, next) => one - next);
}

// One variable of every run over time.
function overTime(desk, state, tools, name, key, log = false) {
  const { one, other, before, quick } = desk.runs;
  const variable = one.fmu.variables.get(name);
  const { factor, shown, text } = variable;
  const curve = (run, colour, dash) => ({ x: times(run, name), y: series(run, variable), colour, dash });
  const curves = [];
  const body = one.fmu.portrait.bodies[state.body];
  if (name === body.position) curves.push(...companions(one, body, tools, factor));
  if (before) curves.push({ ...curve(before, "ghost", [4, 4]), width: 1 });
  if (quick && !one.done) curves.push({ ...curve(quick, "ghost"), width: 1 });
  if (other?.columns[name]) curves.push(curve(other, "b"));
  curves.push(curve(one, "a"));
  const y = { ...bounds(curves.map((each) => each.y), log), log };
  const x = { low: 0, high: state.stop, label: "t in s" };
  const title = `${text}${shown ? ` in ${shown}` : ""}`;
  return { key, name, title, symbol: variable.symbol, factor, content: { x, y, curves, bands: one.stuck(body.mode), marks: marks(one, state, name === body.position) } };
}

// Beside the position: the driver; envelope and turning points where they are wanted.
function companions(one, body, tools, factor) {
  const found = [];
  if (body.driver) found.push({ x: times(one), y: series(one, { name: body.driver, factor }), colour: "soft", dash: [2, 3], width: 1 });
  if (!tools.turns) return found;
  const turning = turningPoints(one.time, one.columns[body.position], one.columns[body.speed]);
  for (const envelope of envelopes(turning)) {
    for (const side of [1, -1]) found.push({ ...envelope, y: envelope.y.map((value) => side * value * factor), colour: "event", width: 1 });
  }
  const dots = { x: turning.map(({ t }) => t), y: turning.map(({ x }) => x * factor), colour: "event", dots: true };
  return [...found, dots];
}

// The straight line and the exponential through the first turning point and the last that is still moving.
function envelopes(turning) {
  const sizes = turning.map(({ t, x }) => ({ t, x: Math.abs(x) })).filter(({ x }, i, all) => i === 0 || x < all[i - 1].x);
  const [first, last] = [sizes[0], sizes.at(-1)];
  if (sizes.length < 3 || !(last.x > 0)) return [];
  const share = Array.from({ length: SMOOTH + 1 }, (_, i) => i / SMOOTH);
  const x = share.map((s) => first.t + s * (last.t - first.t));
  return [
    { x, y: share.map((s) => first.x + s * (last.x - first.x)), dash: [7, 4] },
    { x, y: share.map((s) => first.x * (last.x / first.x) ** s), dash: [2, 3] },
  ];
}

// Events as short marks, changes as long ones with their value.
function marks(one, state, labelled) {
  const every = Math.ceil(one.events.length / NEAR);
  const events = one.events.filter((_, i) => i % every === 0).map(({ t }) => ({ x: t, colour: "event" }));
  const latest = new Map(); // of changes that follow each other closely only the last has a label
  for (const change of state.changes) latest.set(`${change.name} ${Math.round((40 * change.t) / state.stop)}`, change);
  const changes = [...latest.values()].map(({ t, name, value }) => {
    const { factor, shown } = one.fmu.variables.get(name);
    return { x: t, label: labelled ? `${name} ${told(value * factor, 3)} ${shown}` : " ", colour: "event" };
  });
  return [...events, ...changes];
}

// Speed over position.
function phase(desk, body) {
  const { one, other, before } = desk.runs;
  const [x, v] = [body.position, body.speed].map((name) => one.fmu.variables.get(name));
  const curve = (run, colour, dash) => ({
    x: series(run, x), y: series(run, v), colour, dash, width: 1.2,
  });
  const curves = [];
  if (before) curves.push({ ...curve(before, "ghost", [4, 4]), width: 1 });
  if (other?.columns[x.name] && other.columns[v.name]) curves.push(curve(other, "b"));
  curves.push(curve(one, "a"));
  const content = {
    x: { ...bounds(curves.map((each) => each.x)), label: `${x.name}${x.shown ? ` in ${x.shown}` : ""}` },
    y: bounds(curves.map((each) => each.y)), curves,
  };
  return { key: "phase", title: `phase plane: ${v.name} in ${v.shown} over ${x.name}`, symbol: "", content, phase: [x, v] };
}

// How far the runs are from the closed form, or from each other where there is none.
function errors(desk, body, state) {
  const { one, other, truth } = desk.runs;
  const { factor, shown } = one.fmu.variables.get(body.position);
  const same = state.other?.model === state.model;
  const curve = (from, to, colour) => {
    const { time, apart } = difference(from, to, body.position);
    return { x: time, y: apart.map((value) => Math.abs(value) * factor), colour };
  };
  const curves = [];
  let title = `error of ${body.position} against the closed form`;
  if (truth && (!other || same)) {
    if (other) curves.push(curve(truth, other, "b"));
    if (truth !== one) curves.push(curve(truth, one, "a"));
  } else if (other?.columns[body.position]) {
    curves.push(curve(one, other, "b"));
    title = `difference of the two in ${body.position}`;
  }
  if (!curves.length) return null;
  const y = { ...bounds(curves.map((each) => each.y), true), log: true };
  const x = { low: 0, high: state.stop, label: "t in s" };
  return { key: "error", title: `${title}${shown ? ` in ${shown}` : ""}`, symbol: "", content: { x, y, curves } };
}

// Where the cursor stands in a diagram, and what is read there: {spot, readings [{text, colour}]}.
export function spotted(panel, desk, t) {
  const { one, other } = desk.runs;
  const points = [];
  const readings = [];
  for (const [run, colour] of [[one, "a"], [other, "b"]]) {
    if (!run?.time.length) continue;
    if (panel.phase) {
      const [x, v] = panel.phase;
      if (!run.columns[x.name] || !run.columns[v.name]) continue;
      points.push({ x: run.at(x.name, t) * x.factor, y: run.at(v.name, t) * v.factor, colour });
    } else if (panel.name && run.columns[panel.name]) {
      const y = run.at(panel.name, t) * panel.factor;
      points.push({ x: t, y, colour });
      readings.push({ text: told(y), colour });
    }
  }
  return { spot: { x: panel.phase ? undefined : t, points }, readings };
}
