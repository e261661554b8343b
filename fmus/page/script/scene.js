// A scene: the state of one motion, its runs, and what shows them: mechanisms, diagrams, fields and playback.

import { Diagrams, showLegend } from "./diagrams.js";
import { DragController } from "./drag.js";
import { Mechanism } from "./mechanism.js";
import { formatNumber, formatValue } from "./numbers.js";
import { readColours } from "./plot.js";
import { RunSet } from "./run_set.js";
import { addChange, effectiveValues, replaceValue, settableVariables, valueAt } from "./state.js";
import { describeSettings } from "./tables.js";

const SLICE = 8; // ms per frame for simulation
const LONGEST_FRAME = 0.1; // s of playback
const scenes = []; // all scenes of the page
let isFrameRequested = false;
let lastFrame = 0; // time of the last frame in ms; 0: nothing has moved

function requestFrame() {
  if (isFrameRequested) return;
  isFrameRequested = true;
  requestAnimationFrame(drawFrame);
}

// Draw all scenes; those in view are simulated first.
function drawFrame(now) {
  isFrameRequested = false;
  const elapsed = lastFrame ? Math.min((now - lastFrame) / 1000, LONGEST_FRAME) : 0;
  lastFrame = now;
  const isComplete = scenes.every(({ requested, state }) => state || !requested);
  if (isComplete) document.body.classList.remove("starting"); // everything appears at once, so that nothing shifts
  const deadline = performance.now() + SLICE;
  const shown = scenes.filter(({ state }) => state).sort((a, b) => b.isInView - a.isInView);
  for (const scene of shown) scene.draw(elapsed, deadline);
  if (shown.some(({ playing, drag, runs }) => playing || drag.active || !runs.done)) requestFrame();
  else lastFrame = 0;
}

for (const query of ["(prefers-color-scheme: dark)", "(forced-colors: active)"]) matchMedia(query).addEventListener("change", repaint);

function repaint() {
  readColours();
  for (const { diagrams } of scenes) diagrams.repaint();
}

export class Scene {
  // `root` has elements with the classes mechanism (for the run and for the second run), panels, legend, alert, play, scrub
  // and clock. When all runs are drawn, it has the attribute data-ready. `prefix` begins the ids of created elements.
  constructor(root, library, prefix = "") {
    Object.assign(this, { root, library, prefix, state: null, requested: null, playing: false, isInView: false, fields: new Map() });
    this.find = (name) => root.querySelector(`.${name}`);
    this.runs = new RunSet(library);
    this.drag = new DragController(this);
    this.mechanisms = [...root.querySelectorAll(".mechanism")].map((host) => new Mechanism(host, this.drag));
    this.diagrams = new Diagrams(this.find("panels"), prefix, (t) => this.seek(t));
    this.inputError = ""; // an invalid number
    this.runNames = ["run", "second run"]; // in legends
    this.find("play").addEventListener("click", () => this.play(!this.playing));
    this.find("scrub").addEventListener("input", ({ target }) => this.seek((this.state.stop * target.value) / 1000));
    new IntersectionObserver(([{ isIntersecting }]) => (this.isInView = isIntersecting)).observe(root);
    scenes.push(this);
  }

  get modelInfo() {
    return this.library.models.get(this.state.model);
  }

  get body() {
    return this.modelInfo.bodies[this.state.body];
  }

  // ---- state

  // Show a state once its models are compiled. Returns whether it is shown: another one may have been requested meanwhile.
  async show(next) {
    if (this.playing) this.play(false);
    this.requested = next;
    delete this.root.dataset.ready;
    const names = [next.model, next.comparison?.model, ...Object.values(this.furtherRuns(next)).map(({ model }) => model)];
    await Promise.all(names.filter(Boolean).map((name) => this.library.compile(name)));
    if (this.requested !== next) return false;
    next.stop ??= this.library.stopTime(next.model);
    next.t = Math.min(next.t, next.stop);
    const isOther = next.model !== this.state?.model;
    this.state = next;
    if (isOther) this.build();
    this.restart();
    return true;
  }

  // Build what depends on the model.
  build() {
    const models = [this.state.model, this.state.comparison?.model];
    this.mechanisms.forEach((mechanism, i) => mechanism.build(this.library.models.get(models[i])));
    this.diagrams.clear();
  }

  // The runs of which only the end is of interest, as {model, values} by name.
  furtherRuns() {
    return {};
  }

  restart() {
    this.runs.restart(this.state, this.furtherRuns(this.state));
    this.inputError = "";
    this.showValues();
    this.redraw();
  }

  // Restart after a change by the user.
  restartEdited() {
    this.restart();
  }

  // Whether changes apply from the cursor time on.
  get changesAtCursor() {
    return this.playing;
  }

  // The message with which the model refuses the values in force at the cursor time, some of them replaced; empty if it
  // accepts them.
  refusal(replaced = {}) {
    const { state, modelInfo } = this;
    const values = Object.fromEntries(settableVariables(modelInfo).map(({ name }) => [name, valueAt(modelInfo, state, name, state.t)]));
    return this.library.refusal(state.model, { ...values, ...replaced }, state.stop).replace(/\.?$/, "");
  }

  // Set a variable from a control or by dragging, from the start or from the cursor time on.
  setVariable(variable, value) {
    const { state, modelInfo } = this;
    const refusal = this.refusal({ [variable.name]: value });
    if (refusal && !this.refusal()) { // a refused state, from a link, can be changed freely
      this.showValues();
      return this.showError(`${refusal}; ${this.describeValue(variable)} remains.`);
    }
    if (!variable.fixed && this.changesAtCursor && state.t > 0) addChange(state, variable.name, value, state.t);
    else replaceValue(modelInfo, state, variable.name, value, state.t);
    this.restartEdited();
  }

  // Set a variable by its slider, which stops at the last position that the model accepts. `valueOf(position)` is the value
  // at a position.
  slideVariable(variable, position, valueOf) {
    const isRefused = (at) => this.refusal({ [variable.name]: valueOf(at) });
    const refusal = isRefused(position);
    if (!refusal || this.refusal()) return this.setVariable(variable, valueOf(position));
    let [accepted, refused] = [this.fields.get(variable.name).position, position];
    while (Math.abs(refused - accepted) > 1) {
      const middle = Math.round((accepted + refused) / 2);
      if (isRefused(middle)) refused = middle;
      else accepted = middle;
    }
    if (!isRefused(accepted)) this.setVariable(variable, valueOf(accepted)); // else the value in force lies beside its position
    else this.showValues();
    this.showError(`${refusal}; the slider stops at ${this.describeValue(variable)}.`);
  }

  describeValue(variable) {
    return `${variable.name} = ${formatValue(variable, valueAt(this.modelInfo, this.state, variable.name, this.state.t))}`;
  }

  showError(message) {
    this.inputError = message;
    this.drawAlert();
  }

  // The functions that a field of a variable calls.
  fieldActions(variable) {
    return {
      change: (value) => this.setVariable(variable, value),
      slide: (position, valueOf) => this.slideVariable(variable, position, valueOf),
      refuse: (message) => this.showError(message),
    };
  }

  // Show the values at the cursor time.
  showValues() {
    const { state, modelInfo } = this;
    for (const [name, field] of this.fields) field.show(name === ".stop" ? state.stop : valueAt(modelInfo, state, name, state.t));
    const values = Object.fromEntries(Object.keys(effectiveValues(modelInfo, {})).map((name) => [name, valueAt(modelInfo, state, name, state.t)]));
    for (const mechanism of this.mechanisms) mechanism.showDampers(values);
  }

  // ---- playback

  requestFrame() {
    requestFrame();
  }

  seek(t) {
    this.state.t = t;
    delete this.root.dataset.ready;
    this.isCursorStale = true;
    requestFrame();
  }

  play(playing = true) {
    const { state } = this;
    if (playing && state.t >= state.stop) state.t = 0;
    this.playing = playing;
    this.find("play").textContent = playing ? "Pause" : "Play";
    this.find("play").setAttribute("aria-pressed", String(playing));
    if (!playing) this.showValues();
    requestFrame();
  }

  // The speed of playback.
  get speed() {
    return 1;
  }

  // Move the cursor during playback, up to what is simulated so far.
  moveCursor(elapsed) {
    const { state, runs } = this;
    const shown = [runs.main, runs.comparison].filter((run) => run === runs.main || (run && !run.failure));
    const end = Math.min(...shown.map(({ time }) => time.at(-1) ?? 0));
    state.t = Math.max(state.t, Math.min(state.t + elapsed * this.speed, end));
    this.isCursorStale = true;
    if (state.t >= state.stop || (state.t >= end && shown.every((run) => run.done))) this.play(false);
  }

  // ---- drawing

  // Draw everything again.
  redraw() {
    delete this.root.dataset.ready;
    this.areCurvesStale = this.isCursorStale = true;
    requestFrame();
  }

  // Advance the runs up to the deadline in ms, and draw what has changed.
  draw(elapsed, deadline) {
    if (this.playing) this.moveCursor(elapsed);
    if (this.drag.active) this.drag.update();
    const { runs, state } = this;
    if (!runs.done && runs.advance(deadline)) this.areCurvesStale = true;
    const { main } = runs;
    if (this.areCurvesStale) {
      this.drawAlert();
      if (main.time.length) this.drawCurves();
      if (runs.done) this.drawResults();
      this.isCursorStale = true;
    }
    this.areCurvesStale = false;
    if (this.isCursorStale && main.time.length && main.hasReached(state.t)) {
      this.drawCursor(Math.min(state.t, main.time.at(-1)));
      this.isCursorStale = false;
    }
    if (runs.done && this.requested === state) this.root.dataset.ready = ""; // else another state is being compiled
  }

  // The runs that the mechanisms show.
  get shownRuns() {
    return [this.runs.main, this.runs.comparison];
  }

  drawCurves() {
    this.mechanisms.forEach((mechanism, i) => this.shownRuns[i].time.length && mechanism.fit(this.shownRuns[i]));
    this.diagrams.draw(this.panels());
    showLegend(this.find("legend"), this.diagrams.legend());
  }

  // Draw what needs complete runs.
  drawResults() {}

  drawCursor(t) {
    const { state, runs } = this;
    this.diagrams.moveCursor(runs, t);
    this.mechanisms.forEach((mechanism, i) => {
      const run = this.shownRuns[i];
      if (run.time.length) mechanism.move((name) => (run.modes.includes(name) ? run.columns[name][run.row(t)] : run.at(name, t)));
    });
    const [scrub, clock] = [this.find("scrub"), this.find("clock")];
    scrub.value = Math.round((1000 * state.t) / state.stop);
    clock.textContent = `${state.t.toFixed(state.stop < 10 ? 3 : 2)} s`;
    scrub.setAttribute("aria-valuetext", clock.textContent);
    if (state.changes.length) this.showValues();
  }

  // Show the error of a run. The diagrams of the last successful run remain, dimmed.
  drawAlert() {
    const { main, comparison } = this.runs;
    const failures = [["run", main], ["second run", comparison]].filter(([, run]) => run?.failure)
      .map(([role, run]) => `The ${role} (${describeSettings(run)}) ${run.time.length ? `ends at ${formatNumber(run.time.at(-1))} s` : "does not start"}: ${run.failure}`);
    const alert = this.find("alert");
    alert.textContent = this.inputError || failures.join(" ");
    alert.hidden = !alert.textContent;
    this.root.classList.toggle("stale", !main.time.length);
  }
}

readColours();
