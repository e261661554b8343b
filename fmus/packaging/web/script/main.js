// The page: what people do becomes the state, the state becomes runs, the runs become pictures.

import { make, sizes } from "./controls.js";
import { Session } from "./session.js";
import { Diagrams } from "./diagrams.js";
import { asPublished, besideAtFirst, change, choose, put } from "./overrides.js";
import { Form } from "./form.js";
import { DragController } from "./drag.js";
import { Mechanism } from "./mechanism.js";
import { told } from "./plot.js";
import { fresh, inForce, read, valueAt, written } from "./state.js";
import { cost, decay, events, published, setting } from "./tables.js";
import { csv, picture, save } from "./export.js";

const SLICE = 8; // ms of a frame for the runs
const SETTLED = 300; // ms without a change after which tables, link and words follow
const framed = location.protocol === "about:";
const $$ = (id) => document.getElementById(id);

const data = JSON.parse($$("data").textContent);
const session = new Session(data);
const page = { session, state: null, modelInfo: null, playing: false, put: take, edited, play, wake };
const drag = new DragController(page);
const mechanism = new Mechanism($$("mechanism"), drag);
const diagrams = new Diagrams($$("panels"), seek);
const form = new Form(session.models, session.presets, {
  preset: (name) => (session.presets.has(name) ? enter(ofPreset(name)) : edited()),
  choose: (name, value) => { choose(page.modelInfo, page.state.values, name, value); edited(); },
  beside: takeOther,
  body: (number) => { page.state.body = number; restart(); },
  put: take,
  length: takeLength,
  forget: () => { page.state.changes = []; edited(); },
  refuse: (sentence) => { refused = sentence; drawAlert(); },
});
let latest = null; // state that was to be entered
let unknown = ""; // a sentence about what a link has
let refused = ""; // a sentence about what was typed
let waiting = false; // a frame is asked for
let stale = { curves: true, cursor: true };
let before = 0; // time of the last frame in ms
let settling = 0;

// ---- the state, and what follows from it

async function enter(next, lost = []) {
  if (page.playing) play(false);
  latest = next;
  await Promise.all([next.model, ...(next.comparison ? [next.comparison.model] : [])].map((name) => session.ready(name)));
  if (latest !== next) return; // somebody has chosen another since
  const changed = next.model !== page.state?.model;
  page.state = next;
  page.modelInfo = session.models.get(next.model);
  if (changed) arrange();
  unknown = lost.length ? `The link has what is not known here: ${lost.join(", ")}. ` : "";
  restart();
}

// Go where a link leads: to a state, or to a published case by its name alone; the first model without.
async function follow(hash) {
  const found = read(hash, session.models);
  const words = new URLSearchParams(hash.slice(1));
  const preset = words.get(".preset");
  if (found) await enter(found.state, found.lost);
  else if (session.presets.has(preset)) await enter(ofPreset(preset));
  else await enter(fresh(session.models.values().next().value), [words.get(".model")].filter(Boolean));
}

function ofPreset(name) {
  const preset = session.presets.get(name);
  return asPublished(preset, session.models.get(preset.model));
}

// Controls and mechanism of another model.
function arrange() {
  const { modelInfo } = page;
  document.querySelector(`input[name=model][value="${modelInfo.name}"]`).checked = true;
  $$("name").textContent = modelInfo.name;
  $$("title").textContent = modelInfo.title;
  $$("equations").innerHTML = modelInfo.text; // made by the builder
  mechanism.build(modelInfo);
  $$("kick").hidden = !modelInfo.bodies.some((body) => body.input);
  session.restart(fresh(modelInfo));
  session.runs.main.advance();
  form.build(modelInfo, sizes(session.runs.main));
  diagrams.clear();
}

function restart() {
  session.restart(page.state);
  refused = "";
  stale = { curves: true, cursor: true };
  settle();
  showControls();
  wake();
}

// A published case is main until something is changed.
function edited() {
  page.state.preset = unknown = "";
  restart();
}

// A value from a slider, a number field or the drag: from the start, or from the cursor on.
function take(variable, value) {
  const { state, modelInfo } = page;
  if (!variable.fixed && live() && state.t > 0) change(state, variable.name, value, state.t);
  else put(modelInfo, state.values, variable.name, value);
  edited();
}

function takeLength(seconds) {
  const { state } = page;
  if (seconds > 0) Object.assign(state, { stop: seconds, t: Math.min(state.t, seconds) });
  edited();
  if (!(seconds > 0)) refused = `A run takes more than 0 s: it stays ${told(state.stop)} s long.`;
}

async function takeOther({ model, ...values }) {
  const { state, modelInfo } = page;
  if (model === "") state.comparison = null;
  else if (model) {
    await session.ready(model);
    state.comparison = { model, values: besideAtFirst(modelInfo, state, model) };
  } else for (const [name, value] of Object.entries(values)) choose(session.models.get(state.comparison.model), state.comparison.values, name, value);
  restart();
}

// Whether what is set acts from the cursor on.
function live() {
  return page.playing || $$("live").checked;
}

function showControls() {
  const { state, modelInfo } = page;
  form.show(state, live());
  mechanism.equip(Object.fromEntries(Object.keys(inForce(modelInfo, {})).map((name) => [name, valueAt(modelInfo, state, name, state.t)])));
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
  if (page.playing) advance(passed);
  if (drag.pull) drag.act();
  if (session.work(SLICE)) stale.curves = true;
  const { main } = session.runs;
  if (stale.curves) drawAlert();
  if (main.time.length && stale.curves) {
    mechanism.fit(main);
    diagrams.draw(session, page.state, { turns: $$("turns").checked });
  }
  if (main.time.length && (stale.curves || stale.cursor) && main.reaches(page.state.t)) {
    drawCursor();
    stale.cursor = false;
  }
  stale.curves = !main.time.length;
  if (page.playing || drag.pull || !session.done) wake();
  else before = 0;
  if (!session.done) settle();
}

function advance(passed) {
  const { state } = page;
  const end = session.runs.main.time.at(-1) ?? 0; // of what there is
  state.t = Math.max(state.t, Math.min(state.t + passed * Number($$("speed").value), end));
  stale.cursor = true;
  if (state.t >= state.stop || (session.runs.main.done && state.t >= end)) play(false);
}

// What a run was refused for; the diagrams of the last main that went stay, and are faint.
function drawAlert() {
  const { main, comparison } = session.runs;
  $$("alert").textContent = refused || main.failure || comparison?.failure || "";
  $$("alert").hidden = !$$("alert").textContent;
  for (const id of ["panels", "mechanism"]) $$(id).classList.toggle("gone", !main.time.length);
}

function drawCursor() {
  const { state, modelInfo } = page;
  const { main } = session.runs;
  const t = Math.min(state.t, main.time.at(-1));
  diagrams.point(session, t);
  mechanism.move((name) => (main.modes.includes(name) ? main.columns[name][main.row(t)] : main.at(name, t)));
  $$("scrub").value = Math.round((1000 * state.t) / state.stop);
  $$("clock").textContent = `${state.t.toFixed(state.stop < 10 ? 3 : 2)} s`;
  $$("scrub").setAttribute("aria-valuetext", $$("clock").textContent);
  if (page.playing && state.changes.length) form.follow(modelInfo, state);
}

// Tables, link and words, when nothing has changed for a while.
function settle() {
  clearTimeout(settling);
  settling = setTimeout(() => {
    if (!session.done) return settle();
    const { state } = page;
    const { main } = session.runs;
    const made = main.time.length ? [published, cost, decay, events].map((table) => table(session, state)) : [];
    $$("tables").replaceChildren(...made.filter(Boolean));
    remember();
    const ran = main.failure ? "" : `${setting(main)}: ${main.events.length} events in ${told(state.stop)} s.`;
    if (!page.playing) $$("status").textContent = unknown + ran;
  }, SETTLED);
}

// ---- what people do

function seek(t) {
  page.state.t = t;
  stale.cursor = true;
  if ($$("live").checked) showControls();
  settle();
  wake();
}

function play(playing = true) {
  const { state } = page;
  if (playing && state.t >= state.stop) state.t = 0;
  before = 0;
  page.playing = playing;
  $$("play").textContent = playing ? "Pause" : "Play";
  $$("play").setAttribute("aria-pressed", String(playing));
  if (!playing) {
    showControls();
    settle();
  }
  wake();
}

for (const [id, act] of Object.entries({
  play: () => play(!page.playing),
  kick: () => drag.kick(),
  reset: () => enter(fresh(page.modelInfo)),
  print: () => print(),
  csv: () => save(new Blob([csv(session.runs.main, session.runs.comparison)], { type: "text/csv" }), `${page.state.model}.csv`),
  png: async () => save(await picture(diagrams.shown(), setting(session.runs.main)), `${page.state.model}.png`),
  link: copyLink,
})) $$(id).addEventListener("click", act);
$$("scrub").addEventListener("input", () => seek((page.state.stop * $$("scrub").value) / 1000));
$$("live").addEventListener("change", showControls);
$$("turns").addEventListener("change", () => { stale.curves = true; wake(); });

// The address carries the state; within another page it is not ours.
function remember() {
  if (!framed) history.replaceState(null, "", written(page.state));
}

async function copyLink() {
  remember();
  let place = "clipboard";
  try {
    await navigator.clipboard.writeText(location.href);
  } catch {
    place = "address bar"; // there is no clipboard, or it is not ours to write
  }
  $$("status").textContent = `The link is in the ${place}: it carries all that is set.`;
}

addEventListener("hashchange", ({ newURL }) => { // the address may by now be that of the state again
  const { hash } = new URL(newURL);
  if (hash !== written(page.state)) follow(hash);
});
addEventListener("keydown", (event) => {
  if (event.key !== " " || event.target.closest("button, input, select, summary, a")) return;
  event.preventDefault();
  $$("play").click();
});

// Paper is white, whatever the screen is.
for (const [event, paper] of [["beforeprint", true], ["afterprint", false]]) {
  addEventListener(event, () => { document.documentElement.classList.toggle("paper", paper); diagrams.paint(); });
}
for (const look of ["(prefers-color-scheme: dark)", "(forced-colors: active)"]) matchMedia(look).addEventListener("change", () => diagrams.paint());

// ---- begin

$$("version").textContent = data.version;
$$("link").hidden = framed;
for (const [name, modelInfo] of session.models) {
  const choice = make("input", { type: "radio", name: "model", value: name });
  choice.addEventListener("change", () => enter(fresh(modelInfo)));
  $$("models").append(make("label", {}, choice, name));
}
$$("choices").append(...Object.values(form.lists).map(({ element }) => element));
globalThis.app = { session, plots: diagrams.plots, seek, state: () => page.state }; // for the console
await follow(location.hash);
