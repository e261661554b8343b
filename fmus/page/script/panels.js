// The content of the diagrams.

import { difference, turningPoints } from "./measure.js";
import { formatNumber, formatValue } from "./numbers.js";
import { bounds } from "./plot.js";

const MAX_MARKS = 400; // event marks
const ENVELOPE_POINTS = 200;
const MAX_PLOTTED_ROWS = 8000; // longer runs are plotted at grid points and events only

// Return the diagrams of a scene as [{key, title, content}]: those with these keys, in their order; without keys, all that a
// visitor may want. A diagram keeps its key from one state to the next. The key is the name of the variable; other keys start
// with a dot, which no name does. With `envelopes`, the position has turning points and envelopes.
export function buildPanels(scene, { keys, envelopes = false }) {
  const { runs: { main, comparison }, body } = scene;
  const makers = {
    ".phase": () => phasePanel(scene),
    ".law": () => lawPanel(scene),
    ".step": () => timePanel(scene, "solver.h", { key: ".step", log: true, isComplete: true }),
    ".steps": () => timePanel(scene, "solver.steps", { key: ".steps", log: true, isComplete: true }),
    ".magnitude": () => timePanel(scene, body.speed, { key: ".magnitude", log: true, isComplete: true }),
    ".sticking": () => stickingPanel(scene),
    ".error": () => errorPanel(scene),
  };
  const buildPanel = (key) => (makers[key] ? makers[key]() : timePanel(scene, key, { envelopes, isComplete: Boolean(keys) }));
  const panels = (keys ?? usualKeys(scene)).map(buildPanel).filter(Boolean);
  for (const panel of panels) panel.content.description ??= `${panel.title}${comparison ? ", two runs" : ""}: ${describeRange(panel, main)}`;
  return panels;
}

function usualKeys({ runs: { main }, modelInfo, body }) {
  const motion = [body.position, body.speed, body.acceleration].filter(Boolean);
  const energy = modelInfo.variables.find(({ unit, causality }) => unit === "J" && causality === "output")?.name;
  const forces = [...new Set([energy, body.friction, ...(body.contacts ?? [])].filter(Boolean))];
  const inputs = main.inputs.filter((name) => !motion.includes(name) && main.largestMagnitude(name) > 0);
  const [law, sticking] = [body.slip ? [".law"] : [], modelInfo.contacts.length > 1 ? [".sticking"] : []];
  return [...motion, ".phase", ...law, ".step", ".steps", ...forces, ...inputs, ...sticking, ".error"];
}

function describeRange({ content }, main) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of content.curves.at(-1)?.y ?? []) {
    if (!Number.isFinite(value)) continue;
    [low, high] = [Math.min(low, value), Math.max(high, value)];
  }
  return `from ${formatNumber(low, 3)} to ${formatNumber(high, 3)}, ${main.events.length} events`;
}

// A variable over time as {x, y}, in its display unit; null if the run does not have it. For long runs, grid points,
// events and the end are enough, unless it is to be complete.
function curveData(run, { name, factor }, isComplete = false) {
  if (!run.columns[name]) return null;
  const { x, y } = plottedRows(run, run.columns[name], isComplete);
  return { x, y: factor === 1 ? y : y.map((value) => value * factor) };
}

function plottedRows(run, values, isComplete) {
  if (isComplete || run.time.length < MAX_PLOTTED_ROWS) return { x: run.time, y: values };
  const rows = [...new Set([...run.grid, ...run.events.map(({ row }) => row), run.time.length - 1])].sort((a, b) => a - b);
  return { x: rows.map((row) => run.time[row]), y: rows.map((row) => values[row]) };
}

// One curve per run from curveOf(run). The main run comes last, so it is drawn on top.
function runCurves({ runs: { main, comparison, unchanged, preview }, runNames }, curveOf) {
  return [
    unchanged && { ...curveOf(unchanged), colour: "ghost", dash: [4, 4], width: 1, legend: "without the changes" },
    preview && !main.done && { ...curveOf(preview), colour: "ghost", width: 1, legend: "preview by the default method" },
    comparison && { ...curveOf(comparison), colour: "b", legend: runNames[1] },
    { ...curveOf(main), colour: "a", legend: runNames[0] },
  ].filter((curve) => curve?.y);
}

// A variable of all runs over time.
function timePanel(scene, name, { key = name, log = false, envelopes = false, isComplete = false }) {
  const { runs: { main }, state, modelInfo: { contacts }, body } = scene;
  const variable = main.fmu.variables.get(name);
  const { factor, display_unit, text, symbol } = variable;
  const isPosition = name === body.position;
  const extras = isPosition ? positionCurves(main, body, envelopes, factor) : [];
  const curves = [...extras, ...runCurves(scene, (run) => curveData(run, variable, isComplete))];
  if (key === ".magnitude") for (const curve of curves) curve.y = curve.y.map(Math.abs);
  const y = { ...bounds(curves.map((curve) => curve.y), log), log };
  const x = { low: 0, high: state.stop, label: "t in s" };
  const own = contacts.filter((contact) => contact.name === name);
  const shaded = own.length ? own : contacts.filter((contact) => body.contacts?.includes(contact.name));
  const content = { x, y, curves, ...stickingBands(main, shaded), marks: findMarks(main, state, isPosition) };
  const isFriction = name === body.friction || contacts.some((contact) => contact.name === name);
  const arrow = name === body.friction && body.kind !== "none" ? `friction on the body, −${name}` : "";
  const sign = isFriction ? `; the arrow is −${name}` : "";
  return { key, name, title: `${key === ".magnitude" ? "magnitude of the " : ""}${text}${display_unit ? ` in ${display_unit}` : ""}${sign}`, symbol, factor, content, arrow };
}

// The intervals in which contacts stick as {bands, rows}: each of several contacts has a row with its name.
function stickingBands(run, contacts) {
  const bands = contacts.flatMap(({ mode }, row) => run.stuckIntervals(mode).map(([from, to]) => ({ from, to, row })));
  return { bands, rows: contacts.map(({ name }) => name) };
}

// The sticking of all contacts over time, in a row for each.
function stickingPanel({ runs: { main }, state, modelInfo: { contacts } }) {
  const x = { low: 0, high: state.stop, label: "t in s" };
  const total = ({ mode }) => main.stuckIntervals(mode).reduce((sum, [from, to]) => sum + to - from, 0);
  const title = "sticking of each contact";
  const description = `${title}: ${contacts.map((contact) => `${contact.name} for ${formatNumber(total(contact), 3)} s`).join(", ")}`;
  const content = { x, y: { low: 0, high: 1, hidden: true }, curves: [], ...stickingBands(main, contacts), description };
  return { key: ".sticking", title, symbol: "", content };
}

// Additional curves with the position: the driver, and optionally envelopes and turning points.
function positionCurves(main, body, hasEnvelopes, factor) {
  const curves = [];
  if (body.driver) curves.push({ ...curveData(main, { name: body.driver, factor }), colour: "soft", dash: [2, 3], width: 1, legend: "driver" });
  if (!hasEnvelopes) return curves;
  const turning = turningPoints(main.time, main.columns[body.position], main.columns[body.speed]);
  for (const envelope of envelopes(turning)) {
    for (const sign of [1, -1]) curves.push({ ...envelope, y: envelope.y.map((value) => sign * value * factor), colour: "event", width: 1 });
  }
  const dots = { x: turning.map(({ t }) => t), y: turning.map(({ x }) => x * factor), colour: "event", dots: true, legend: "turning points" };
  return [...curves, dots];
}

// The straight line and the exponential through the first turning point and the last that is smaller than its
// predecessor.
function envelopes(turning) {
  const sizes = turning.map(({ t, x }) => ({ t, x: Math.abs(x) })).filter(({ x }, i, all) => i === 0 || x < all[i - 1].x);
  const [first, last] = [sizes[0], sizes.at(-1)];
  if (sizes.length < 3 || !(last.x > 0)) return [];
  const fractions = Array.from({ length: ENVELOPE_POINTS + 1 }, (_, i) => i / ENVELOPE_POINTS);
  const x = fractions.map((s) => first.t + s * (last.t - first.t));
  return [
    { x, y: fractions.map((s) => first.x + s * (last.x - first.x)), dash: [7, 4], legend: "straight envelope: dry friction" },
    { x, y: fractions.map((s) => first.x * (last.x / first.x) ** s), dash: [2, 4], legend: "exponential envelope: viscous damper" },
  ];
}

// Events as short marks, changes as long marks, with the value if `labelled`.
function findMarks(main, state, labelled) {
  const every = Math.ceil(main.events.length / MAX_MARKS);
  const events = main.events.filter((_, i) => i % every === 0).map(({ t }) => ({ x: t, colour: "event" }));
  const latest = new Map(); // of changes in quick succession, only the last gets a label
  for (const change of state.changes) latest.set(`${change.name} ${Math.round((40 * change.t) / state.stop)}`, change);
  const changes = [...latest.values()].map(({ t, name, value }) => {
    return { x: t, label: labelled ? `${name} ${formatValue(main.fmu.variables.get(name), value, 3)}` : " ", colour: "event" };
  });
  return [...events, ...changes];
}

// Friction over slip speed; the cursor is the point at its time.
function lawPanel({ runs, body, runNames }) {
  const [slip, friction] = [body.slip, body.friction].map((name) => runs.main.fmu.variables.get(name));
  const other = runs.comparison?.columns[slip.name] && runs.comparison.columns[friction.name] ? lawCurves(runs.comparison, body, slip, friction) : [];
  const curves = [...other.map((curve) => ({ ...curve, colour: "b", legend: runNames[1] })), ...lawCurves(runs.main, body, slip, friction)];
  const content = {
    x: { ...bounds(curves.map((curve) => curve.x)), label: `${slip.name} in ${slip.display_unit}` },
    y: bounds(curves.map((curve) => curve.y)), curves,
  };
  return { key: ".law", title: `friction law: ${friction.name} in ${friction.display_unit} against ${slip.name}`, symbol: "", content, phase: [slip, friction] };
}

// One line for the forces that hold the body, as far as the run shows them, and one curve for each direction of the slip, so
// that no line joins them.
function lawCurves(run, body, slip, friction) {
  const largest = run.largestMagnitude(friction.name) * friction.factor;
  const held = { x: [0, 0], y: [-largest, largest], colour: "stick", legend: "holds", width: 3 };
  const modes = run.columns[body.mode];
  const slips = new Map(); // by mode
  run.time.forEach((_, row) => {
    const mode = modes?.[row];
    if (mode === 0) return;
    if (!slips.has(mode)) slips.set(mode, { x: [], y: [], colour: "slip", legend: "slips" });
    slips.get(mode).x.push(run.columns[slip.name][row] * slip.factor);
    slips.get(mode).y.push(run.columns[friction.name][row] * friction.factor);
  });
  return [...(modes?.includes(0) ? [held] : []), ...slips.values()];
}

// Speed over position.
function phasePanel(scene) {
  const { runs: { main }, body } = scene;
  const [x, v] = [body.position, body.speed].map((name) => main.fmu.variables.get(name));
  const has = (run) => run.columns[x.name] && run.columns[v.name];
  const curves = runCurves(scene, (run) => has(run) && { x: curveData(run, x).y, y: curveData(run, v).y, width: 1.2 });
  const content = {
    x: { ...bounds(curves.map((curve) => curve.x)), label: `${x.name}${x.display_unit ? ` in ${x.display_unit}` : ""}` },
    y: bounds(curves.map((curve) => curve.y)), curves,
  };
  return { key: ".phase", title: `phase plane: ${v.name} in ${v.display_unit} against ${x.name}`, symbol: "", content, phase: [x, v] };
}

// Errors of the runs against the closed form, or else the difference between the two runs. Null if a run has failed: an
// error up to the failure would say little.
function errorPanel({ runs: { main, comparison, reference }, state, body, runNames }) {
  if ([main, comparison, reference].some((run) => run?.failure)) return null;
  const { factor, display_unit } = main.fmu.variables.get(body.position);
  const sameModel = state.comparison?.model === state.model;
  const curve = (from, to, colour) => {
    const { time, differences } = difference(from, to, body.position);
    return { x: time, y: differences.map((value) => Math.abs(value) * factor), colour, legend: runNames[colour === "a" ? 0 : 1] };
  };
  const curves = [];
  let title = `error of ${body.position} against the closed form`;
  if (reference && (!comparison || sameModel)) {
    if (comparison) curves.push(curve(reference, comparison, "b"));
    if (reference !== main) curves.push(curve(reference, main, "a"));
  } else if (comparison?.columns[body.position]) {
    curves.push(curve(main, comparison, "b"));
    title = `difference in ${body.position} between the two runs`;
  }
  if (!curves.length) return null;
  const y = { ...bounds(curves.map((each) => each.y), true), log: true };
  const x = { low: 0, high: state.stop, label: "t in s" };
  return { key: ".error", title: `${title}${display_unit ? ` in ${display_unit}` : ""}`, symbol: "", content: { x, y, curves } };
}

// The entries of the legend for a diagram.
export function legendOf({ content, arrow }) {
  const { curves, bands = [], marks = [] } = content;
  const lines = curves.filter(({ legend }) => legend).map(({ colour, dash, dots, legend }) => ({ kind: dots ? "dots" : "line", colour, dash, text: legend }));
  const isStuck = bands.length > 0 && [{ kind: "band", colour: "hold", text: "sticks" }];
  const isEvent = marks.some(({ label }) => !label) && [{ kind: "mark", colour: "event", text: "event" }];
  const isChange = marks.some(({ label }) => label) && [{ kind: "change", colour: "event", text: "change of a value" }];
  const isArrow = arrow && [{ kind: "arrow", colour: "ink", text: arrow }];
  return [...lines.reverse(), ...(isStuck || []), ...(isEvent || []), ...(isChange || []), ...(isArrow || [])];
}

// The cursor of a diagram and the values there: {cursor, readings [{text, colour}]}.
export function cursorReadings({ key, phase, name, factor }, runs, t) {
  const sizeOf = key === ".magnitude" ? Math.abs : (value) => value;
  const [points, readings] = [[], []];
  for (const [run, colour] of [[runs.main, "a"], [runs.comparison, "b"]]) {
    if (!run?.time.length || (run.failure && t > run.time.at(-1)) || !(phase ?? [{ name }]).every((variable) => run.columns[variable.name])) continue;
    const [x, y] = phase ? phase.map((variable) => run.at(variable.name, t) * variable.factor) : [t, sizeOf(run.at(name, t) * factor)];
    points.push({ x, y, colour });
    if (!phase) readings.push({ text: formatNumber(y), colour });
  }
  return { cursor: { x: phase ? undefined : t, points }, readings };
}
