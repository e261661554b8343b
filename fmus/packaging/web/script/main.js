// The page: what people do becomes the state, the state becomes runs, the runs become pictures.

import { make, sizes } from "./controls.js";
import { Desk } from "./desk.js";
import { Diagrams } from "./diagrams.js";
import { asPublished, besideAtFirst, change, choose, put } from "./edit.js";
import { Form } from "./form.js";
import { Hand } from "./hand.js";
import { Mechanism } from "./mechanism.js";
import { told } from "./plot.js";
import { fresh, inForce, read, valueAt, written } from "./state.js";
import { cost, decay, events, published, setting } from "./tables.js";
import { csv, picture, save } from "./take.js";

const SLICE = 8; // ms of a frame for the runs
const SETTLED = 300; // ms without a change after which tables, link and words follow
const framed = location.protocol === "about:";
const $$ = (id) => document.getElementById(id);

const data = JSON.parse($$("data").textContent);
const desk = new Desk(data);
const page = { desk, state: null, portrait: null, playing: false, put: take, edited, play, wake };
const hand = new Hand(page);
const mechanism = new Mechanism($$("mechanism"), hand);
const diagrams = new Diagrams($$("panels"), seek);
const form = new Form(desk.portraits, desk.presets, {
  preset: (name) => (desk.presets.has(name) ? enter(ofPreset(name)) : edited()),
  choose: (name, value) => { choose(page.portrait, page.state.values, name, value); edited(); },
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
  await Promise.all([next.model, ...(next.other ? [next.other.model] : [])].map((name) => desk.ready(name)));
  if (latest !== next) return; // somebody has chosen another since
  const changed = next.model !== page.state?.model;
  page.state = next;
  page.portrait = desk.portraits.get(next.model);
  if (changed) arrange();
  unknown = lost.length ? `The link has what is not known here: ${lost.join(", ")}. ` : "";
  restart();
}

// Go where a link leads: to a state, or to a published case by its name alone; the first model without.
async function follow(hash) {
  const found = read(hash, desk.portraits);
  const words = new URLSearchParams(hash.slice(1));
  const preset = words.get(".preset");
  if (found) await enter(found.state, found.lost);
  else if (desk.presets.has(preset)) await enter(ofPreset(preset));
  else await enter(fresh(desk.portraits.values().next().value), [words.get(".model")].filter(Boolean));
}

function ofPreset(name) {
  const preset = desk.presets.get(name);
  return asPublished(preset, desk.portraits.get(preset.model));
}

// Controls and mechanism of another model.
function arrange() {
  const { portrait } = page;
  document.querySelector(`input[name=model][value="${portrait.name}"]`).checked = true;
  $$("name").textContent = portrait.name;
  $$("title").textContent = portrait.title;
  $$("equations").innerHTML = portrait.text; // made by the builder
  mechanism.build(portrait);
  $$("kick").hidden = !portrait.bodies.some((body) => body.input);
  desk.restart(fresh(portrait));
  desk.runs.one.advance();
  form.build(portrait, sizes(desk.runs.one));
  diagrams.clear();
}

function restart() {
  desk.restart(page.state);
  refused = "";
  stale = { curves: true, cursor: true };
  settle();
  showControls();
  wake();
}

// A published case is one until something is changed.
function edited() {
  page.state.preset = unknown = "";
  restart();
}

// A value from a slider, a number field or the hand: from the start, or from the cursor on.
function take(variable, value) {
  const { state, portrait } = page;
  if (!variable.fixed && live() && state.t > 0) change(state, variable.name, value, state.t);
  else put(portrait, state.values, variable.name, value);
  edited();
}

function takeLength(seconds) {
  const { state } = page;
  if (seconds > 0) Object.assign(state, { stop: seconds, t: Math.min(state.t, seconds) });
  edited();
  if (!(seconds > 0)) refused = `A run takes more than 0 s: it stays ${told(state.stop)} s long.`;
}

async function takeOther({ model, ...values }) {
  const { state, portrait } = page;
  if (model === "") state.other = null;
  else if (model) {
    await desk.ready(model);
    state.other = { model, values: besideAtFirst(portrait, state, model) };
  } else for (const [name, value] of Object.entries(values)) choose(desk.portraits.get(state.other.model), state.other.values, name, value);
  restart();
}

// Whether what is set acts from the cursor on.
function live() {
  return page.playing || $$("live").checked;
}

function showControls() {
  const { state, portrait } = page;
  form.show(state, live());
  mechanism.equip(Object.fromEntries(Object.keys(inForce(portrait, {})).map((name) => [name, valueAt(portrait, state, name, state.t)])));
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
  if (hand.pull) hand.act();
  if (desk.work(SLICE)) stale.curves = true;
  const { one } = desk.runs;
  if (stale.curves) drawAlert();
  if (one.time.length && stale.curves) {
    mechanism.fit(one);
    diagrams.draw(desk, page.state, { turns: $$("turns").checked });
  }
  if (one.time.length && (stale.curves || stale.cursor) && one.reaches(page.state.t)) {
    drawCursor();
    stale.cursor = false;
  }
  stale.curves = !one.time.length;
  if (page.playing || hand.pull || !desk.done) wake();
  else before = 0;
  if (!desk.done) settle();
}

function advance(passed) {
  const { state } = page;
  const end = desk.runs.one.time.at(-1) ?? 0; // of what there is
  state.t = Math.max(state.t, Math.min(state.t + passed * Number($$("speed").value), end));
  stale.cursor = true;
  if (state.t >= state.stop || (desk.runs.one.done && state.t >= end)) play(false);
}

// What a run was refused for; the diagrams of the last one that went stay, and are faint.
function drawAlert() {
  const { one, other } = desk.runs;
  $$("alert").textContent = refused || one.failure || other?.failure || "";
  $$("alert").hidden = !$$("alert").textContent;
  for (const id of ["panels", "mechanism"]) $$(id).classList.toggle("gone", !one.time.length);
}

function drawCursor() {
  const { state, portrait } = page;
  const { one } = desk.runs;
  const t = Math.min(state.t, one.time.at(-1));
  diagrams.point(desk, t);
  mechanism.move((name) => (one.modes.includes(name) ? one.columns[name][one.row(t)] : one.at(name, t)));
  $$("scrub").value = Math.round((1000 * state.t) / state.stop);
  $$("clock").textContent = `${state.t.toFixed(state.stop < 10 ? 3 : 2)} s`;
  $$("scrub").setAttribute("aria-valuetext", $$("clock").textContent);
  if (page.playing && state.changes.length) form.follow(portrait, state);
}

// Tables, link and words, when nothing has changed for a while.
function settle() {
  clearTimeout(settling);
  settling = setTimeout(() => {
    if (!desk.done) return settle();
    const { state } = page;
    const { one } = desk.runs;
    const made = one.time.length ? [published, cost, decay, events].map((table) => table(desk, state)) : [];
    $$("tables").replaceChildren(...made.filter(Boolean));
    remember();
    const ran = one.failure ? "" : `${setting(one)}: ${one.events.length} events in ${told(state.stop)} s.`;
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
  kick: () => hand.kick(),
  reset: () => enter(fresh(page.portrait)),
  print: () => print(),
  csv: () => save(new Blob([csv(desk.runs.one, desk.runs.other)], { type: "text/csv" }), `${page.state.model}.csv`),
  png: async () => save(await picture(diagrams.shown(), setting(desk.runs.one)), `${page.state.model}.png`),
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
for (const [name, portrait] of desk.portraits) {
  const choice = make("input", { type: "radio", name: "model", value: name });
  choice.addEventListener("change", () => enter(fresh(portrait)));
  $$("models").append(make("label", {}, choice, name));
}
$$("choices").append(...Object.values(form.lists).map(({ element }) => element));
globalThis.bench = { desk, plots: diagrams.plots, seek, state: () => page.state }; // for the console
await follow(location.hash);
