// What each diagram shows, from the runs and the state.

import { difference, turningPoints } from "./measure.js";
import { bounds, told } from "./plot.js";

const NEAR = 400; // marks of events at most
const SMOOTH = 200; // points of an envelope
const MANY = 8000; // points of a run

// [{key, title, content}]: a diagram is known by its key from main state to the next.
export function panels(session, state, tools) {
  const { main, comparison } = session.runs;
  const modelInfo = session.models.get(state.model);
  const body = modelInfo.bodies[state.body];
  const names = [body.position, body.speed, body.acceleration].filter(Boolean);
  const energy = modelInfo.variables.find(({ unit, causality }) => unit === "J" && causality === "output")?.name;
  const found = names.map((name) => overTime(session, state, tools, name, name));
  found.push(phase(session, body));
  found.push(overTime(session, state, tools, "solver.h", "step", true));
  if (energy) found.push(overTime(session, state, tools, energy, "energy"));
  if (body.friction) found.push(overTime(session, state, tools, body.friction, "friction"));
  const apart = errors(session, body, state);
  if (apart) found.push(apart);
  for (const panel of found) panel.content.words = `${panel.title}${comparison ? ", two runs" : ""}: ${extent(panel, main)}`;
  return found;
}

function extent({ content }, main) {
  const { low, high } = bounds([content.curves.at(-1)?.y ?? []], content.y.log);
  return `from ${told(low, 3)} to ${told(high, 3)}, ${main.events.length} events`;
}

// A variable {x, y} of a run over time, in the unit that people read; null where it has none of the name.  Of a run of
// very many steps a picture needs the points of the grid and the events alone, but for the steps themselves.
function series(run, { name, factor }) {
  if (!run.columns[name]) return null;
  const all = run.time.length < MANY || name === "solver.h";
  const rows = all ? null : [...run.grid, ...run.events.map(({ row }) => row)].sort((a, b) => a - b);
  const [x, y] = [run.time, run.columns[name]].map((column) => (all ? column : rows.map((row) => column[row])));
  return { x, y: factor === 1 ? y : y.map((value) => value * factor) };
}

// What `drawn` gives of each run, the run itself last and so above the others.
function curves({ main, comparison, unchanged, preview }, drawn) {
  return [
    unchanged && { ...drawn(unchanged), colour: "ghost", dash: [4, 4], width: 1 },
    preview && !main.done && { ...drawn(preview), colour: "ghost", width: 1 },
    comparison && { ...drawn(comparison), colour: "b" },
    { ...drawn(main), colour: "a" },
  ].filter((curve) => curve?.y);
}

// One variable of every run over time.
function overTime(session, state, tools, name, key, log = false) {
  const { main } = session.runs;
  const variable = main.fmu.variables.get(name);
  const { factor, shown, text, symbol } = variable;
  const body = main.fmu.modelInfo.bodies[state.body];
  const beside = name === body.position ? companions(main, body, tools, factor) : [];
  const all = [...beside, ...curves(session.runs, (run) => series(run, variable))];
  const y = { ...bounds(all.map((each) => each.y), log), log };
  const x = { low: 0, high: state.stop, label: "t in s" };
  const content = { x, y, curves: all, bands: main.stuck(body.mode), marks: marks(main, state, name === body.position) };
  return { key, name, title: `${text}${shown ? ` in ${shown}` : ""}`, symbol, factor, content };
}

// Beside the position: the driver; envelope and turning points where they are wanted.
function companions(main, body, tools, factor) {
  const found = [];
  if (body.driver) found.push({ ...series(main, { name: body.driver, factor }), colour: "soft", dash: [2, 3], width: 1 });
  if (!tools.turns) return found;
  const turning = turningPoints(main.time, main.columns[body.position], main.columns[body.speed]);
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
function marks(main, state, labelled) {
  const every = Math.ceil(main.events.length / NEAR);
  const events = main.events.filter((_, i) => i % every === 0).map(({ t }) => ({ x: t, colour: "event" }));
  const latest = new Map(); // of changes that follow each comparison closely only the last has a label
  for (const change of state.changes) latest.set(`${change.name} ${Math.round((40 * change.t) / state.stop)}`, change);
  const changes = [...latest.values()].map(({ t, name, value }) => {
    const { factor, shown } = main.fmu.variables.get(name);
    return { x: t, label: labelled ? `${name} ${told(value * factor, 3)} ${shown}` : " ", colour: "event" };
  });
  return [...events, ...changes];
}

// Speed over position.
function phase(session, body) {
  const [x, v] = [body.position, body.speed].map((name) => session.runs.main.fmu.variables.get(name));
  const has = (run) => run.columns[x.name] && run.columns[v.name];
  const all = curves(session.runs, (run) => has(run) && { x: series(run, x).y, y: series(run, v).y, width: 1.2 });
  const content = {
    x: { ...bounds(all.map((each) => each.x)), label: `${x.name}${x.shown ? ` in ${x.shown}` : ""}` },
    y: bounds(all.map((each) => each.y)), curves: all,
  };
  return { key: "phase", title: `phase plane: ${v.name} in ${v.shown} over ${x.name}`, symbol: "", content, phase: [x, v] };
}

// How far the runs are from the closed form, or from each comparison where there is none.
function errors(session, body, state) {
  const { main, comparison, reference } = session.runs;
  const { factor, shown } = main.fmu.variables.get(body.position);
  const same = state.comparison?.model === state.model;
  const curve = (from, to, colour) => {
    const { time, apart } = difference(from, to, body.position);
    return { x: time, y: apart.map((value) => Math.abs(value) * factor), colour };
  };
  const found = [];
  let title = `error of ${body.position} against the closed form`;
  if (reference && (!comparison || same)) {
    if (comparison) found.push(curve(reference, comparison, "b"));
    if (reference !== main) found.push(curve(reference, main, "a"));
  } else if (comparison?.columns[body.position]) {
    found.push(curve(main, comparison, "b"));
    title = `difference of the two in ${body.position}`;
  }
  if (!found.length) return null;
  const y = { ...bounds(found.map((each) => each.y), true), log: true };
  const x = { low: 0, high: state.stop, label: "t in s" };
  return { key: "error", title: `${title}${shown ? ` in ${shown}` : ""}`, symbol: "", content: { x, y, curves: found } };
}

// Where the cursor stands in a diagram, and what is read there: {spot, readings [{text, colour}]}.
export function spotted({ phase, name, factor }, { runs }, t) {
  const [points, readings] = [[], []];
  for (const [run, colour] of [[runs.main, "a"], [runs.comparison, "b"]]) {
    if (!run?.time.length || !(phase ?? [{ name }]).every((each) => run.columns[each.name])) continue;
    const [x, y] = phase ? phase.map((each) => run.at(each.name, t) * each.factor) : [t, run.at(name, t) * factor];
    points.push({ x, y, colour });
    if (!phase) readings.push({ text: told(y), colour });
  }
  return { spot: { x: phase ? undefined : t, points }, readings };
}
