// The page: what people do becomes the state, the state becomes runs, the runs become pictures.

import { Choice, Field, items, make, tolerances } from "./controls.js";
import { Desk } from "./desk.js";
import { Mechanism } from "./mechanism.js";
import { panels, spotted } from "./panels.js";
import { Plot, told } from "./plot.js";
import { beside, fresh, inForce, read, settable, valueAt, written } from "./state.js";
import { cost, decay, events, published, setting } from "./tables.js";
import { csv, picture, save } from "./take.js";

const SLICE = 8; // ms of a frame for the runs
const CLOSE = 1 / 400; // of a run: changes of one variable nearer than that are one
const SETTLED = 300; // ms without a change after which tables, link and words follow
const SHORT = 1 / 40; // of a run: how long a kick lasts
const $$ = (id) => document.getElementById(id);

const data = JSON.parse($$("data").textContent);
const desk = new Desk(data);
const tools = { turns: false };
const plots = new Map(); // key of a diagram -> {plot, figure, panel}
const fields = new Map();
let state = null;
let portrait = null;
let playing = false;
let speed = 1;
let waiting = false; // a frame is asked for
let stale = { curves: true, cursor: true };
let before = 0; // time of the last frame in ms
let settling = 0;
let pull = null; // while a body is dragged: {body, to}

const mechanism = new Mechanism($$("mechanism"), dragged);
const lists = {
  preset: new Choice("preset", "Published case", takePreset),
  friction: new Choice("friction", "Friction law", (value) => choose("friction", Number(value))),
  method: new Choice("method", "Method", (value) => choose("solver.method", Number(value))),
  rtol: new Choice("rtol", "Tolerance", (value) => choose("solver.rtol", Number(value))),
  other: new Choice("other", "Beside it", (value) => takeOther({ model: value })),
  otherFriction: new Choice("other-friction", "its law", (value) => takeOther({ friction: Number(value) })),
  otherMethod: new Choice("other-method", "its method", (value) => takeOther({ "solver.method": Number(value) })),
  otherRtol: new Choice("other-rtol", "its tolerance", (value) => takeOther({ "solver.rtol": Number(value) })),
  body: new Choice("body", "Body", (value) => { state.body = Number(value); restart(); }),
};
const DIRECT = ["friction", "solver.method", "solver.rtol"]; // which have a list of their own above

// ---- the state, and what follows from it

async function enter(next, lost = []) {
  stop();
  await Promise.all([next.model, ...(next.other ? [next.other.model] : [])].map((name) => desk.ready(name)));
  const changed = next.model !== state?.model;
  state = next;
  portrait = desk.portraits.get(state.model);
  if (changed) await arrange();
  $$("status").textContent = lost.length ? `The link has what ${state.model} does not know: ${lost.join(", ")}` : "";
  restart();
}

// Go where a link leads: to a state, or to a published case by its name alone; the first model without.
async function follow(hash) {
  const found = read(hash, desk.portraits);
  const preset = new URLSearchParams(hash.slice(1)).get(".preset");
  if (found) await enter(found.state, found.lost);
  else if (desk.presets.has(preset)) await takePreset(preset);
  else await enter(fresh(desk.portraits.values().next().value));
}

// Controls and mechanism of another model.
async function arrange() {
  document.querySelector(`input[name=model][value="${state.model}"]`).checked = true;
  $$("name").textContent = state.model;
  $$("title").textContent = portrait.title;
  $$("equations").innerHTML = portrait.text; // made by the builder
  mechanism.build(portrait);
  $$("kick").hidden = !portrait.bodies.some((body) => body.input);
  const usual = usualSizes(portrait);
  fields.clear();
  const rows = { fields: [], rare: [] };
  for (const variable of settable(portrait)) {
    if (variable.type !== "Real" || DIRECT.includes(variable.name)) continue;
    const field = new Field(variable, usual(variable), (value) => put(variable, value));
    fields.set(variable.name, field);
    rows[variable.name.includes(".") ? "rare" : "fields"].push(field.element);
  }
  for (const variable of settable(portrait)) {
    if (variable.type === "Real" || DIRECT.includes(variable.name)) continue;
    const choice = new Choice(`field-${variable.name}`, variable.text, (value) => choose(variable.name, Number(value)));
    fields.set(variable.name, { put: (value) => choice.fill(items(variable), value) });
    rows.fields.push(choice.element);
  }
  const length = { name: ".stop", symbol: "T", text: "length of the run", shown: "s", factor: 1, unit: "s", above: 0, start: portrait.stop, allowed: "above 0" };
  fields.set(".stop", new Field(length, 0, (value) => { if (value > 0) { state.stop = value; state.t = Math.min(state.t, value); edited(); } }));
  rows.rare.push(fields.get(".stop").element);
  for (const [id, elements] of Object.entries(rows)) $$(id).replaceChildren(...elements);
  plots.clear();
  $$("panels").replaceChildren();
}

// The size that a variable usually has, where its start is zero: from the default run, by its unit.
function usualSizes(portrait) {
  desk.restart(fresh(portrait));
  const { one } = desk.runs;
  one.advance();
  const largest = (name) => (one.columns[name] ?? []).reduce((most, value) => Math.max(most, Math.abs(value)), 0);
  const body = portrait.bodies[0];
  const first = (unit) => portrait.variables.find((each) => each.unit === unit && each.start > 0)?.start ?? 1;
  const length = portrait.variables.find(({ name }) => name === body.position).unit === "m" ? largest(body.position) : first("m");
  const bases = [first("kg"), length, largest(body.position) / largest(body.speed), 1];
  return ({ unit, powers }) => {
    const alike = one.reals.filter((name) => one.fmu.variables.get(name).unit === unit);
    const size = Math.max(0, ...alike.map(largest)) || powers.reduce((product, power, i) => product * bases[i] ** power, 1);
    return Number.isFinite(size) && size > 0 ? Number(size.toPrecision(1)) : 1;
  };
}

function restart() {
  desk.restart(state);
  stale.curves = true;
  settle();
  showControls();
  wake();
}

// A published case is one until something is changed.
function edited() {
  state.preset = "";
  restart();
}

// A value from a slider or a number field: from the start, or from the cursor on.
function put(variable, value) {
  const live = !variable.fixed && (playing || $$("live").checked) && state.t > 0;
  if (live) change(variable.name, value);
  else if (value === variable.start) delete state.values[variable.name];
  else state.values[variable.name] = value;
  edited();
}

function change(name, value, t = state.t) {
  const close = (each) => each.name === name && Math.abs(each.t - t) < CLOSE * state.stop;
  const later = (each) => each.name === name && each.t > t;
  const kept = state.changes.filter((each) => !later(each));
  const same = kept.findLast(close);
  if (same) same.value = value;
  else kept.push({ t, name, value });
  state.changes = kept.sort((one, next) => one.t - next.t);
}

function choose(name, value) {
  const { start } = portrait.variables.find((each) => each.name === name);
  if (value === start) delete state.values[name];
  else state.values[name] = value;
  repair(portrait, name, state.values);
  edited();
}

// The closed form holds for the hybrid law: whoever takes one of the two chooses the other, too.
function repair(owner, name, values) {
  const method = owner.variables.find((each) => each.name === "solver.method");
  const law = owner.variables.find((each) => each.name === "friction");
  const exact = method.items.find(({ label }) => label === "exact");
  const hybrid = law?.items.find(({ label }) => label === "hybrid");
  const now = inForce(owner, values);
  if (!exact || !hybrid || now["solver.method"] !== exact.value || now.friction === hybrid.value) return;
  if (name === "friction") values["solver.method"] = method.items.find(({ label }) => label !== "exact").value;
  else values.friction = hybrid.value;
}

async function takeOther(words) {
  const { model, ...values } = words;
  if (model === "") state.other = null;
  else {
    const name = model ?? state.other.model;
    const kept = model === undefined ? state.other.values : besideAtFirst(name);
    state.other = { model: name, values: { ...kept, ...values } };
    await desk.ready(name);
    repair(desk.portraits.get(name), Object.keys(values)[0], state.other.values);
  }
  restart();
}

// What stands beside a run at first: of the same model its next law or method, of another what it has by itself.
function besideAtFirst(name) {
  if (name !== state.model) return {};
  const now = inForce(portrait, state.values);
  const items = (variable) => portrait.variables.find((each) => each.name === variable)?.items ?? [];
  const law = items("friction").find(({ value }) => value !== now.friction);
  const method = items("solver.method").find(({ label, value }) => label !== "exact" && value !== now["solver.method"]);
  return law ? { friction: law.value, "solver.method": method.value } : { "solver.method": method.value };
}

async function takePreset(name) {
  const preset = desk.presets.get(name);
  if (!preset) return;
  const owner = desk.portraits.get(preset.model);
  const next = fresh(owner);
  Object.assign(next.values, preset.values);
  for (const [variable, label] of Object.entries(preset.labels)) {
    next.values[variable] = owner.variables.find((each) => each.name === variable).items.find((item) => item.label === label).value;
  }
  for (const { name: variable, start } of owner.variables) if (next.values[variable] === start) delete next.values[variable];
  Object.assign(next, { preset: name, stop: preset.stop ?? next.stop, other: null });
  await enter(next);
}

function showControls() {
  const live = playing || $$("live").checked;
  const now = inForce(portrait, state.values);
  for (const [name, field] of fields) {
    if (name === ".stop") field.put(state.stop);
    else field.put(live ? valueAt(portrait, state, name, state.t) : now[name]);
  }
  const variable = (owner, name) => owner.variables.find((each) => each.name === name);
  lists.preset.fill([["", "none: my own"], ...[...desk.presets.values()].map(({ name, title }) => [name, `${name}: ${title}`])], state.preset);
  lists.friction.fill(items(variable(portrait, "friction")), now.friction);
  lists.method.fill(items(variable(portrait, "solver.method")), now["solver.method"]);
  lists.rtol.fill(tolerances(portrait, now["solver.rtol"]), now["solver.rtol"]);
  lists.body.fill(portrait.bodies.map(({ position }, i) => [i, position]), state.body);
  const comparable = [...desk.portraits.values()].filter(({ bodies }) => bodies[0].position === portrait.bodies[0].position);
  lists.other.fill([["", "nothing"], ...comparable.map(({ name }) => [name, name === state.model ? `${name}, otherwise` : name])], state.other?.model ?? "");
  const theirs = state.other && desk.portraits.get(state.other.model);
  const set = theirs ? inForce(theirs, beside(desk.portraits, state).values) : {};
  lists.otherFriction.fill(theirs ? items(variable(theirs, "friction")) : [], set.friction);
  lists.otherMethod.fill(theirs ? items(variable(theirs, "solver.method")) : [], set["solver.method"]);
  lists.otherRtol.fill(theirs ? tolerances(theirs, set["solver.rtol"]) : [], set["solver.rtol"]);
  mechanism.equip(Object.fromEntries(Object.keys(now).map((name) => [name, valueAt(portrait, state, name, state.t)])));
  showChanges();
}

function showChanges() {
  const { length } = state.changes;
  $$("changes").hidden = !length;
  if (!length) return;
  const last = state.changes.slice(-3).map(({ t, name, value }) => {
    const { factor, shown } = portrait.variables.find((each) => each.name === name);
    return `${name} = ${told(value * factor)} ${shown} at ${told(t)} s`;
  });
  const clear = make("button", { type: "button" }, "Forget changes");
  clear.addEventListener("click", () => { state.changes = []; edited(); });
  $$("changes").replaceChildren(`${length} change${length > 1 ? "s" : ""} while it runs; last: ${last.join("; ")}. `, clear);
}

// ---- frames

function wake() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(frame);
}

function frame(now) {
  waiting = false;
  const passed = before ? Math.min((now - before) / 1000, 0.1) : 0;
  before = now;
  if (playing) advance(passed);
  if (pull) pulled();
  if (desk.work(performance.now() + SLICE)) stale.curves = true;
  const { one } = desk.runs;
  if (stale.curves) drawAlert();
  if (one.time.length) {
    if (stale.curves) drawCurves();
    if (stale.curves || stale.cursor) drawCursor();
    stale = { curves: false, cursor: false };
  }
  const unfinished = Object.values(desk.runs).some((run) => !run.done);
  if (playing || pull || unfinished) wake();
  else before = 0;
  if (unfinished) settle();
}

function advance(passed) {
  const end = desk.runs.one.time.at(-1) ?? 0; // of what there is
  state.t = Math.min(state.t + passed * speed, end);
  stale.cursor = true;
  if (state.t >= state.stop || (desk.runs.one.done && state.t >= end)) {
    stop();
    settle();
  }
}

// What a run was refused for; the diagrams of the last one that went stay, and are faint.
function drawAlert() {
  const { one, other } = desk.runs;
  $$("alert").textContent = one.failure || other?.failure || "";
  $$("alert").hidden = !$$("alert").textContent;
  for (const id of ["panels", "mechanism"]) $$(id).classList.toggle("gone", !one.time.length);
}

function drawCurves() {
  mechanism.fit(desk.runs.one);
  const found = panels(desk, state, tools);
  for (const [key, { figure }] of plots) figure.hidden = !found.some((panel) => panel.key === key);
  for (const panel of found) {
    if (!plots.has(panel.key)) plots.set(panel.key, placed(panel));
    const known = plots.get(panel.key);
    known.panel = panel;
    known.heading.innerHTML = panel.symbol ? `<b>${panel.symbol}</b> ` : ""; // made by the builder
    known.heading.append(panel.title);
    known.plot.show(panel.content);
  }
}

function placed(panel) {
  const heading = make("span");
  const reading = make("span", { class: "reading" });
  const host = make("div", { class: "plot" });
  const figure = make("figure", { id: `panel-${panel.key}` }, make("figcaption", {}, heading, reading), host);
  const siblings = ["phase", "step", "energy", "friction", "error"];
  const after = siblings.slice(siblings.indexOf(panel.key) + 1).map((key) => plots.get(key)?.figure).find(Boolean);
  $$("panels").insertBefore(figure, siblings.includes(panel.key) ? after ?? null : null);
  return { plot: new Plot(host, panel.key === "phase" ? null : seek), figure, heading, reading };
}

function drawCursor() {
  const { one } = desk.runs;
  const t = Math.min(state.t, one.time.at(-1));
  for (const { plot, panel, reading, figure } of plots.values()) {
    if (figure.hidden) continue;
    const { spot, readings } = spotted(panel, desk, t);
    plot.point(spot);
    reading.replaceChildren(...readings.map(({ text, colour }) => make("span", { class: colour }, text)));
  }
  mechanism.move((name) => (one.modes.includes(name) ? one.columns[name][one.row(t)] : one.at(name, t)));
  $$("scrub").value = Math.round((1000 * state.t) / state.stop);
  $$("clock").textContent = `${state.t.toFixed(state.stop < 10 ? 3 : 2)} s`;
  $$("scrub").setAttribute("aria-valuetext", $$("clock").textContent);
  if (playing && state.changes.length) for (const [name, field] of fields) if (name !== ".stop") field.put(valueAt(portrait, state, name, state.t));
}

// Tables, link and words, when nothing has changed for a while.
function settle() {
  clearTimeout(settling);
  settling = setTimeout(() => {
    if (Object.values(desk.runs).some((run) => !run.done)) return settle();
    const { one } = desk.runs;
    const made = one.time.length ? [published, cost, decay, events].map((table) => table(desk, state)) : [];
    $$("tables").replaceChildren(...made.filter(Boolean));
    history.replaceState(null, "", written(state));
    if (!one.failure && !playing) $$("status").textContent = `${setting(one)}: ${one.events.length} events in ${told(state.stop)} s.`;
  }, SETTLED);
}

// ---- what people do

function seek(t) {
  state.t = t;
  stale.cursor = true;
  if ($$("live").checked) showControls();
  settle();
  wake();
}

function play() {
  if (state.t >= state.stop) state.t = 0;
  playing = true;
  before = 0;
  showPlaying();
  wake();
}

function stop() {
  playing = false;
  showPlaying();
  if (state) showControls();
}

function showPlaying() {
  $$("play").textContent = playing ? "Pause" : "Play";
  $$("play").setAttribute("aria-pressed", String(playing));
}

// A push on the first body that takes one, as hard as its forces are.
function kick() {
  const body = portrait.bodies.find((each) => each.input);
  if (!body) return;
  const rest = valueAt(portrait, state, body.input, state.t);
  change(body.input, rest + 2 * strength(body), state.t);
  change(body.input, rest, Math.min(state.t + SHORT * state.stop, state.stop));
  edited();
  play();
}

// The largest force on a body in the run, by the unit of its input.
function strength(body) {
  const { one } = desk.runs;
  const { unit } = one.fmu.variables.get(body.input);
  const columns = one.reals.filter((name) => one.fmu.variables.get(name).unit === unit).map((name) => one.columns[name]);
  return columns.reduce((most, column) => column.reduce((m, F) => Math.max(m, Math.abs(F)), most), 0) || 1;
}

// At the start a body is put where it shall begin; later it is pulled along, as by a spring.
function dragged(body, to, phase) {
  const variable = portrait.variables.find(({ name }) => name === body.start);
  if (phase === "grab") {
    if (state.t === 0 && !playing && variable) pull = { body, place: variable };
    else if (body.input) pull = { body, to, rest: valueAt(portrait, state, body.input, state.t), stiffness: stiffness(body) };
    if (pull && !pull.place) play();
    return;
  }
  if (!pull) return;
  if (phase === "move") {
    pull.to = to;
    wake();
  } else {
    const { place, rest } = pull;
    pull = null;
    if (!place) {
      const last = state.changes.findLast(({ name }) => name === body.input);
      change(body.input, rest, Math.max(state.t, (last?.t ?? 0) + 1.01 * CLOSE * state.stop)); // however short it was
      edited();
    }
    play();
  }
}

function stiffness(body) {
  const reach = desk.runs.one.columns[body.position].reduce((most, x) => Math.max(most, Math.abs(x)), 0) || 1;
  return (4 * strength(body)) / reach;
}

function pulled() {
  const { body, place, to, rest } = pull;
  if (to === undefined) return;
  if (place) {
    put(place, Number((to * place.factor).toPrecision(3)) / place.factor);
    return;
  }
  const apart = to - desk.runs.one.at(body.position, state.t);
  change(body.input, rest + Number((pull.stiffness * apart).toPrecision(3)));
  edited();
}

$$("play").addEventListener("click", () => (playing ? (stop(), settle()) : play()));
$$("kick").addEventListener("click", kick);
$$("scrub").addEventListener("input", () => seek((state.stop * $$("scrub").value) / 1000));
$$("speed").addEventListener("change", () => { speed = Number($$("speed").value); });
$$("live").addEventListener("change", () => showControls());
$$("turns").addEventListener("change", () => { tools.turns = $$("turns").checked; stale.curves = true; wake(); });
$$("reset").addEventListener("click", () => enter(fresh(portrait)));
$$("print").addEventListener("click", () => print());
$$("csv").addEventListener("click", () => save(new Blob([csv(desk.runs.one, desk.runs.other)], { type: "text/csv" }), `${state.model}.csv`));
$$("png").addEventListener("click", async () => {
  const shown = [...plots.values()].filter(({ figure }) => !figure.hidden);
  const titled = shown.map(({ plot, heading }) => ({ plot, words: heading.textContent }));
  save(await picture(titled, setting(desk.runs.one)), `${state.model}.png`);
});
$$("link").addEventListener("click", async () => {
  history.replaceState(null, "", written(state));
  try {
    await navigator.clipboard.writeText(location.href);
    $$("status").textContent = "The link is in the clipboard: it carries all that is set.";
  } catch {
    $$("status").textContent = "The link is in the address bar: it carries all that is set.";
  }
});
addEventListener("hashchange", () => { if (location.hash !== written(state)) follow(location.hash); });
addEventListener("keydown", (event) => {
  if (event.key !== " " || event.target.closest("button, input, select, summary, a")) return;
  event.preventDefault();
  $$("play").click();
});

// Paper is white, whatever the screen is.
const repaint = () => { for (const { plot } of plots.values()) plot.paint(); };
addEventListener("beforeprint", () => { document.documentElement.classList.add("paper"); repaint(); });
addEventListener("afterprint", () => { document.documentElement.classList.remove("paper"); repaint(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);

// ---- begin

$$("version").textContent = data.version;
for (const name of desk.portraits.keys()) {
  const choice = make("input", { type: "radio", name: "model", value: name });
  choice.addEventListener("change", () => enter(fresh(desk.portraits.get(name))));
  $$("models").append(make("label", {}, choice, name));
}
$$("choices").append(...Object.values(lists).map(({ element }) => element));
globalThis.bench = { desk, plots, seek, state: () => state }; // for the console
await follow(location.hash);
