// The page: user input changes the state, the state determines the runs, and the runs are drawn.

import { makeElement, typicalSizes } from "./controls.js";
import { Session } from "./session.js";
import { showLegend } from "./legend.js";
import { Diagrams } from "./diagrams.js";
import { initialComparison, addChange, chooseForComparison, chooseItem, replaceValue } from "./overrides.js";
import { settingLines } from "./setting_lines.js";
import { Form } from "./form.js";
import { DragController } from "./drag.js";
import { Mechanism } from "./mechanism.js";
import { formatNumber } from "./plot.js";
import { defaultState, effectiveValues, decodeState, valueAt, encodeState } from "./state.js";
import { costTable, decayTable, describeSettings, eventTable } from "./tables.js";
import { startStories } from "./stories.js";
import { save, toCsv } from "./export.js";

const SLICE = 8; // ms per frame for simulation
const SUMMARY_DELAY = 300; // ms without a change before tables, link and status are updated
const isEmbedded = location.protocol === "about:";
const $$ = (id) => document.getElementById(id);

const data = JSON.parse($$("data").textContent);
const session = new Session(data);
const page = { session, state: null, modelInfo: null, playing: false, setVariable, restartEdited, play, requestFrame, redraw };
const drag = new DragController(page);
const mechanism = new Mechanism($$("mechanism"), drag);
const diagrams = new Diagrams($$("panels"), seek);
const form = new Form(session.models, {
  choose: (name, value) => { chooseItem(page.modelInfo, page.state.values, name, value); restartEdited(); },
  compare: setComparison,
  body: (number) => { page.state.body = number; restart(); },
  setVariable,
  setStopTime,
  clearChanges: () => { page.state.changes = []; restartEdited(); },
  slideVariable,
  reportError: showError,
});
let isAddressUsed = /^#\./.test(location.hash); // an untouched page leaves its address alone, so that it opens as before
let isExploreRequested = false; // by a link
let requestedState = null; // the state shown last, possibly still compiling
let linkWarning = ""; // unknown parts of a link
let inputError = ""; // an invalid number
let frameRequested = false;
let stale = { curves: true, cursor: true };
let lastFrame = 0; // time of the last frame in ms
let summaryTimer = 0;
let announceFirstPicture = null;
const firstPicture = new Promise((done) => { announceFirstPicture = done; });

// ---- state

// Show a state; `unknownKeys` are parts of a link that were ignored, `version` is that of the page that made the link.
async function showState(next, unknownKeys = [], version = null) {
  if (page.playing) play(false);
  requestedState = next;
  await Promise.all([next.model, ...(next.comparison ? [next.comparison.model] : [])].map((name) => session.compile(name)));
  if (requestedState !== next) return; // another state was selected in the meantime
  next.stop ??= session.stopTime(next.model);
  next.t = Math.min(next.t, next.stop);
  const changed = next.model !== page.state?.model;
  page.state = next;
  page.modelInfo = session.models.get(next.model);
  if (changed) buildControls();
  linkWarning = unknownKeys.length ? `The link contains unknown settings: ${unknownKeys.join(", ")}. ` : "";
  if (version && version !== session.version) linkWarning += `The link was made with version ${version}; this is version ${session.version}. `;
  restart();
}

// Show what a link contains, or else the first model.
async function followLink(hash) {
  isExploreRequested = hash.includes("=");
  isAddressUsed ||= isExploreRequested;
  const decoded = decodeState(hash, session.models);
  if (decoded) await showState(decoded.state, decoded.unknownKeys, decoded.version);
  else await showState(defaultState(session.models.values().next().value), [new URLSearchParams(hash.slice(1)).get(".model")].filter(Boolean));
}

// Build controls and mechanism for another model.
function buildControls() {
  const { modelInfo } = page;
  document.querySelector(`input[name=model][value="${modelInfo.name}"]`).checked = true;
  $$("name").textContent = modelInfo.name;
  $$("title").textContent = modelInfo.title;
  $$("equations").innerHTML = modelInfo.text; // HTML from the build
  for (const formulas of $$("equations").querySelectorAll("pre")) formulas.tabIndex = 0; // scrolls on narrow screens
  mechanism.build(modelInfo);
  $$("kick").hidden = !modelInfo.bodies.some((body) => body.input);
  const stop = session.stopTime(modelInfo.name);
  session.restart({ ...defaultState(modelInfo), stop });
  session.runs.main.advance();
  form.build(modelInfo, stop, typicalSizes(session.runs.main));
  diagrams.clear();
}

function restart() {
  session.restart(page.state);
  inputError = "";
  stale = { curves: true, cursor: true };
  scheduleSummary();
  showControls();
  requestFrame();
}

// Restart after a change.
function restartEdited() {
  isAddressUsed = true;
  linkWarning = "";
  restart();
}

// Set a variable from a control or by dragging, from the start or from the cursor time on.
function setVariable(variable, value) {
  const { state, modelInfo } = page;
  const refusal = session.refusal(state, { [variable.name]: value });
  if (refusal && !session.refusal(state)) { // a refused state, from a link, can be changed freely
    form.follow(modelInfo, state);
    showError(`${refusal.replace(/\.?$/, "")}; ${describeValue(variable, valueAt(modelInfo, state, variable.name, state.t))} remains.`);
    return;
  }
  if (!variable.fixed && changesAtCursor() && state.t > 0) addChange(state, variable.name, value, state.t);
  else replaceValue(modelInfo, state, variable.name, value, state.t);
  restartEdited();
}

// Set a variable by its slider, which stops at the last position that the model accepts. `valueOf(position)` is the value
// at a position.
function slideVariable(variable, position, valueOf) {
  const { state, modelInfo } = page;
  const isRefused = (at) => session.refusal(state, { [variable.name]: valueOf(at) });
  const refusal = isRefused(position);
  if (!refusal || session.refusal(state)) return setVariable(variable, valueOf(position));
  let [accepted, refused] = [form.fields.get(variable.name).position, position];
  while (Math.abs(refused - accepted) > 1) {
    const middle = Math.round((accepted + refused) / 2);
    if (isRefused(middle)) refused = middle;
    else accepted = middle;
  }
  if (!isRefused(accepted)) setVariable(variable, valueOf(accepted)); // else the value in force lies beside its position
  else form.follow(modelInfo, state);
  showError(`${refusal.replace(/\.?$/, "")}; the slider stops at ${describeValue(variable, valueAt(modelInfo, state, variable.name, state.t))}.`);
}

function describeValue({ name, factor, display_unit }, value) {
  return `${name} = ${formatNumber(value * factor)} ${display_unit}`.trim();
}

function showError(message) {
  inputError = message;
  drawAlert();
}

function setStopTime(seconds) {
  const { state } = page;
  if (seconds > 0) Object.assign(state, { stop: seconds, t: Math.min(state.t, seconds) });
  restartEdited();
  if (!(seconds > 0)) inputError = `The stop time must be above 0 s; it remains ${formatNumber(state.stop)} s.`;
}

async function setComparison({ model, ...values }) {
  isAddressUsed = true;
  const { state, modelInfo } = page;
  if (model === "") state.comparison = null;
  else if (model) {
    await session.compile(model);
    state.comparison = { model, values: initialComparison(modelInfo, state, model) };
  } else for (const [name, value] of Object.entries(values)) chooseForComparison(session.models, state, name, value);
  restart();
}

// Whether changes apply from the cursor time on.
function changesAtCursor() {
  return page.playing || $$("live").checked;
}

function showControls() {
  const { state, modelInfo } = page;
  form.show(state);
  mechanism.showDampers(Object.fromEntries(Object.keys(effectiveValues(modelInfo, {})).map((name) => [name, valueAt(modelInfo, state, name, state.t)])));
}

// ---- frames

function requestFrame() {
  if (frameRequested) return;
  frameRequested = true;
  requestAnimationFrame(frame);
}

// Draw the diagrams and the scale of the mechanism again.
function redraw() {
  stale.curves = true;
  requestFrame();
}

function frame(now) {
  frameRequested = false;
  document.body.classList.remove("starting"); // everything appears at once, so that nothing shifts
  const elapsed = lastFrame ? Math.min((now - lastFrame) / 1000, 0.1) : 0;
  lastFrame = now;
  if (page.playing) advanceCursor(elapsed);
  if (drag.active) drag.update();
  if (session.advance(SLICE)) stale.curves = true;
  const { main } = session.runs;
  if (stale.curves) drawAlert();
  if (main.time.length && stale.curves) {
    mechanism.fit(main);
    diagrams.draw(session, page.state, { envelopes: $$("envelopes").checked });
    showLegend($$("legend"), diagrams.legend());
  }
  if (main.time.length && (stale.curves || stale.cursor) && main.hasReached(page.state.t)) {
    drawCursor();
    stale.cursor = false;
  }
  stale.curves = !main.time.length;
  if (session.done) announceFirstPicture();
  if (isExploreRequested && $$("stories")) $$("explore").scrollIntoView({ behavior: "instant" });
  isExploreRequested = false;
  if (page.playing || drag.active || !session.done) requestFrame();
  else lastFrame = 0;
  if (!session.done) scheduleSummary();
}

// Move the cursor during playback.
function advanceCursor(elapsed) {
  const { state } = page;
  const end = session.runs.main.time.at(-1) ?? 0; // simulated so far
  state.t = Math.max(state.t, Math.min(state.t + elapsed * Number($$("speed").value), end));
  stale.cursor = true;
  if (state.t >= state.stop || (session.runs.main.done && state.t >= end)) play(false);
}

// Show the error of a run. The diagrams of the last successful run remain, dimmed.
function drawAlert() {
  const { main, comparison } = session.runs;
  const failures = [["run", main], ["second run", comparison]].filter(([, run]) => run?.failure)
    .map(([role, run]) => `The ${role} (${describeSettings(run)}) ${run.time.length ? `ends at ${formatNumber(run.time.at(-1))} s` : "does not start"}: ${run.failure}`);
  $$("alert").textContent = inputError || failures.join(" ");
  $$("alert").hidden = !$$("alert").textContent;
  for (const id of ["panels", "mechanism"]) $$(id).classList.toggle("stale", !main.time.length);
}

function drawCursor() {
  const { state, modelInfo } = page;
  const { main } = session.runs;
  const t = Math.min(state.t, main.time.at(-1));
  diagrams.moveCursor(session, t);
  mechanism.move((name) => (main.modes.includes(name) ? main.columns[name][main.row(t)] : main.at(name, t)));
  $$("scrub").value = Math.round((1000 * state.t) / state.stop);
  $$("previous-event").disabled = !(main.events[0]?.t < state.t);
  $$("next-event").disabled = !(main.events.at(-1)?.t > state.t);
  $$("clock").textContent = `${state.t.toFixed(state.stop < 10 ? 3 : 2)} s`;
  $$("scrub").setAttribute("aria-valuetext", $$("clock").textContent);
  if (state.changes.length) form.follow(modelInfo, state);
}

// Update tables, link and status when nothing has changed for a while.
function scheduleSummary() {
  clearTimeout(summaryTimer);
  summaryTimer = setTimeout(() => {
    if (!session.done) return scheduleSummary();
    const { state } = page;
    const { main } = session.runs;
    const tables = main.time.length ? [costTable, decayTable, eventTable].map((table) => table(session, state)) : [];
    $$("tables").replaceChildren(...tables.filter(Boolean));
    updateAddress();
    const summary = main.failure ? "" : `${describeSettings(main)}: ${main.events.length} events in ${formatNumber(state.stop)} s.`;
    if (!page.playing) $$("status").textContent = linkWarning + summary;
  }, SUMMARY_DELAY);
}

// ---- user actions

function seek(t) {
  isAddressUsed = true;
  page.state.t = t;
  stale.cursor = true;
  scheduleSummary();
  requestFrame();
}

// One large diagram on the full screen, where the browser allows it.
async function showProjector(on) {
  document.body.classList.toggle("projector", on);
  $$("projector").setAttribute("aria-pressed", String(on));
  diagrams.repaint();
  try {
    if (on) await document.documentElement.requestFullscreen();
    else if (document.fullscreenElement) await document.exitFullscreen();
  } catch {
    // the window keeps its size
  }
}

addEventListener("fullscreenchange", () => { // the key Escape leaves both
  if (!document.fullscreenElement && document.body.classList.contains("projector")) showProjector(false);
});

// Stop at an event, which may be missing.
function seekEvent(event) {
  if (page.playing) play(false);
  if (event) seek(event.t);
}

function play(playing = true) {
  const { state } = page;
  if (playing && state.t >= state.stop) state.t = 0;
  lastFrame = 0;
  page.playing = playing;
  $$("play").textContent = playing ? "Pause" : "Play";
  $$("play").setAttribute("aria-pressed", String(playing));
  if (!playing) {
    showControls();
    scheduleSummary();
  }
  requestFrame();
}

for (const [id, action] of Object.entries({
  play: () => play(!page.playing),
  kick: () => drag.kick(),
  projector: () => showProjector(!document.body.classList.contains("projector")),
  "previous-event": () => seekEvent(session.runs.main.events.findLast(({ t }) => t < page.state.t)),
  "next-event": () => seekEvent(session.runs.main.events.find(({ t }) => t > page.state.t)),
  reset: () => showState(defaultState(page.modelInfo)),
  csv: () => save(new Blob([toCsv(session.runs.main, session.runs.comparison, settingLines(session, page.state))], { type: "text/csv" }), `${page.state.model}.csv`),
  link: copyLink,
})) $$(id).addEventListener("click", action);
$$("scrub").addEventListener("input", () => seek((page.state.stop * $$("scrub").value) / 1000));
$$("live").addEventListener("change", showControls);
$$("envelopes").addEventListener("change", redraw);

function currentLink() {
  return encodeState(page.state, session.models, session.version);
}

// Store the state in the address. A page embedded in another one leaves the address alone.
function updateAddress() {
  if (!isEmbedded && isAddressUsed) history.replaceState(null, "", currentLink());
}

async function copyLink() {
  isAddressUsed = true;
  updateAddress();
  let target = "copied to the clipboard";
  try {
    await navigator.clipboard.writeText(location.href);
  } catch {
    target = "in the address bar"; // the clipboard is unavailable or access is denied
  }
  const reach = location.protocol === "file:" ? " It works on this computer only, because this page is a local file." : "";
  $$("status").textContent = `The link is ${target}; it contains all settings.${reach}`;
}

addEventListener("hashchange", ({ newURL }) => { // the state may have replaced the address since
  const { hash } = new URL(newURL);
  if (/^#[a-z]/.test(hash)) return; // a part of the page
  if (hash !== currentLink()) followLink(hash);
});
addEventListener("keydown", (event) => {
  if (event.key !== " " || event.target.closest("button, input, select, summary, a, [role=slider]")) return;
  const { top, bottom } = $$("stage").getBoundingClientRect();
  if (bottom < 0 || top > innerHeight) return; // the space bar scrolls
  event.preventDefault();
  $$("play").click();
});

for (const query of ["(prefers-color-scheme: dark)", "(forced-colors: active)"]) matchMedia(query).addEventListener("change", () => diagrams.repaint());

// ---- start

$$("version").textContent = data.version;
$$("link").hidden = isEmbedded;
for (const [name, modelInfo] of session.models) {
  const choice = makeElement("input", { type: "radio", name: "model", value: name });
  choice.addEventListener("change", () => { isAddressUsed = true; showState(defaultState(modelInfo)); });
  $$("models").append(makeElement("label", {}, choice, name));
}
$$("choices").append(...Object.values(form.lists).map(({ element }) => element));
globalThis.app = { session, plots: diagrams.plots, seek, state: () => page.state }; // for tests and the console
$$("stories")?.addEventListener("click", (event) => { // in a page embedded in a report, a link would lead to the report
  const link = event.target.closest("a");
  if (!link || !isEmbedded) return;
  event.preventDefault();
  document.querySelector(link.getAttribute("href")).scrollIntoView();
});
if ($$("stories")) globalThis.app.stories = startStories(session, firstPicture);
await followLink(location.hash);
