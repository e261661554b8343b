// The scene in which everything can be set: model, second run, all variables, and the tables of results.

import { Choice, Field, itemOptions, makeElement, sliderRange, toleranceOptions, typicalSizes } from "./controls.js";
import { save, toCsv } from "./export.js";
import { formatNumber, formatValue } from "./numbers.js";
import { buildPanels } from "./panels.js";
import { Scene } from "./scene.js";
import { chooseForComparison, chooseItem, comparisonSettings, decodeState, defaultState, effectiveValues, encodeState, findVariable, initialComparison, settableVariables } from "./state.js";
import { costTable, describeSettings, eventTable } from "./tables.js";

const SUMMARY_DELAY = 300; // ms without a change before link and status are updated
const SOLVER_LISTS = { // id: variable, label, label for the comparison run
  friction: ["friction", "Friction law", "2nd run: law"],
  method: ["solver.method", "Method", "2nd run: method"],
  rtol: ["solver.rtol", "Tolerance", "2nd run: tolerance"],
};
export const isEmbedded = location.protocol === "about:";
const $$ = (id) => document.getElementById(id);

export class Explore extends Scene {
  constructor(root, library) {
    super(root, library);
    this.isAddressUsed = /^#\./.test(location.hash); // an untouched page leaves its address alone, so that it opens as before
    this.linkWarning = ""; // unknown parts of a link
    this.summaryTimer = 0;
    const list = (id, text, onChange) => [id, new Choice(id, text, onChange)];
    const solverLists = Object.entries(SOLVER_LISTS);
    this.lists = Object.fromEntries([
      ...solverLists.map(([id, [name, text]]) => list(id, text, (value) => this.choose(name, Number(value)))),
      list("comparison", "Compare with", (model) => this.compare({ model })),
      ...solverLists.map(([id, [name, , text]]) => list(`comparison-${id}`, text, (value) => this.compare({ [name]: Number(value) }))),
      list("body", "Body", (number) => { this.state.body = Number(number); this.restart(); }),
    ]);
    $$("choices").append(...Object.values(this.lists).map(({ element }) => element));
    for (const [name, modelInfo] of library.models) {
      const choice = makeElement("input", { type: "radio", name: "model", value: name });
      choice.addEventListener("change", () => { this.isAddressUsed = true; this.show(defaultState(modelInfo)); });
      $$("models").append(makeElement("label", {}, choice, name));
    }
    for (const [id, action] of Object.entries({
      kick: () => this.drag.kick(),
      "previous-event": () => this.seekEvent(this.runs.main.events.findLast(({ t }) => t < this.state.t)),
      "next-event": () => this.seekEvent(this.runs.main.events.find(({ t }) => t > this.state.t)),
      reset: () => this.show(defaultState(this.modelInfo)),
      csv: () => save(new Blob([toCsv(this.runs, this.link)], { type: "text/csv" }), `${this.state.model}.csv`),
      link: () => this.copyLink(),
    })) $$(id).addEventListener("click", action);
    $$("live").addEventListener("change", () => this.showValues());
    $$("envelopes").addEventListener("change", () => this.redraw());
    $$("link").hidden = isEmbedded;
  }

  // ---- state

  // `unknownKeys` are parts of a link that were ignored, `version` is that of the page that made the link.
  async show(next, unknownKeys = [], version = null) {
    if (!(await super.show(next))) return;
    this.linkWarning = unknownKeys.length ? `The link contains unknown settings: ${unknownKeys.join(", ")}. ` : "";
    if (version && version !== this.library.version) this.linkWarning += `The link was made with version ${version}; this is version ${this.library.version}. `;
  }

  // Show what a link contains, or else the first model.
  async follow(hash) {
    const { models } = this.library;
    this.isAddressUsed ||= hash.includes("=");
    const decoded = decodeState(hash, models);
    if (decoded) await this.show(decoded.state, decoded.unknownKeys, decoded.version);
    else await this.show(defaultState(models.values().next().value), [new URLSearchParams(hash.slice(1)).get(".model")].filter(Boolean));
    if (!hash.includes("=") || !$$("stories")) return;
    await new Promise(requestAnimationFrame); // after the first picture
    $$("explore").scrollIntoView({ behavior: "instant" });
  }

  // Create the controls of another model.
  build() {
    super.build();
    const { modelInfo, library, fields } = this;
    document.querySelector(`input[name=model][value="${modelInfo.name}"]`).checked = true;
    $$("name").textContent = modelInfo.name;
    $$("title").textContent = modelInfo.title;
    $$("equations").innerHTML = modelInfo.text; // HTML from the build
    for (const formulas of $$("equations").querySelectorAll("pre")) formulas.tabIndex = 0; // scrolls on narrow screens
    $$("kick").hidden = !modelInfo.bodies.some((body) => body.input);
    const typicalSize = typicalSizes(library.defaultRun(modelInfo.name));
    const listed = Object.values(SOLVER_LISTS).map(([name]) => name);
    const variables = settableVariables(modelInfo).filter(({ name }) => !listed.includes(name));
    const numbers = variables.filter(({ type }) => type === "Real").map((variable) =>
      [variable.name, new Field(`field-${variable.name}`, variable, sliderRange(variable, typicalSize(variable)), this.fieldActions(variable))]);
    const choices = variables.filter(({ type }) => type !== "Real").map((variable) => {
      const choice = new Choice(`field-${variable.name}`, variable.text, (value) => this.choose(variable.name, Number(value)));
      return [variable.name, { element: choice.element, show: (value) => choice.fill(itemOptions(variable), value) }];
    });
    fields.clear();
    for (const [name, field] of [...numbers, ...choices, [".stop", this.stopTimeField()]]) fields.set(name, field);
    for (const [id, ofSolver] of [["fields", false], ["solver-fields", true]]) {
      $$(id).replaceChildren(...[...fields].filter(([name]) => name.startsWith("solver.") === ofSolver).map(([, { element }]) => element));
    }
  }

  stopTimeField() {
    const start = this.library.stopTime(this.state.model);
    const variable = { name: ".stop", symbol: "T", text: "stop time", display_unit: "s", factor: 1, unit: "s", above: 0, start, allowed: "above 0" };
    const change = (seconds) => {
      const { state } = this;
      if (seconds > 0) Object.assign(state, { stop: seconds, t: Math.min(state.t, seconds) });
      this.restartEdited();
      if (!(seconds > 0)) this.showError(`The stop time must be above 0 s; it remains ${formatNumber(state.stop)} s.`);
    };
    return new Field("field-.stop", variable, sliderRange(variable), { change, slide: (position, valueOf) => change(valueOf(position)), refuse: (message) => this.showError(message) });
  }

  restart() {
    super.restart();
    this.showLists();
    this.scheduleSummary();
  }

  restartEdited() {
    this.isAddressUsed = true;
    this.linkWarning = "";
    super.restartEdited();
  }

  choose(name, value) {
    chooseItem(this.modelInfo, this.state.values, name, value);
    this.restartEdited();
  }

  async compare({ model, ...values }) {
    const { state, modelInfo, library } = this;
    if (model === "") state.comparison = null;
    else if (model) {
      await library.compile(model);
      state.comparison = { model, values: initialComparison(modelInfo, state, model) };
    } else for (const [name, value] of Object.entries(values)) chooseForComparison(library.models, state, name, value);
    this.restartEdited();
  }

  get changesAtCursor() {
    return this.playing || $$("live").checked;
  }

  // ---- controls

  showLists() {
    const { state, modelInfo, lists, library: { models } } = this;
    lists.body.fill(modelInfo.bodies.map(({ position }, i) => [i, position]), state.body);
    const comparable = [...models.values()].filter(({ bodies }) => bodies[0].position === modelInfo.bodies[0].position);
    lists.comparison.fill([["", "nothing"], ...comparable.map(({ name }) => [name, name === state.model ? "same model" : name])], state.comparison?.model ?? "");
    this.fillSolverLists("", modelInfo, effectiveValues(modelInfo, state.values));
    const other = state.comparison && models.get(state.comparison.model);
    this.fillSolverLists("comparison-", other, other ? effectiveValues(other, comparisonSettings(models, state).values) : {});
    this.showChanges();
  }

  fillSolverLists(prefix, modelInfo, values) {
    for (const [id, [name]] of Object.entries(SOLVER_LISTS)) {
      const options = id === "rtol" ? toleranceOptions : (model) => itemOptions(findVariable(model, name));
      this.lists[prefix + id].fill(modelInfo ? options(modelInfo, values[name]) : [], values[name]);
    }
  }

  showChanges() {
    const { modelInfo, state: { changes } } = this;
    $$("changes").hidden = !changes.length;
    if (!changes.length) return;
    const last = changes.slice(-3).map(({ t, name, value }) => `${name} = ${formatValue(findVariable(modelInfo, name), value)} at ${formatNumber(t)} s`);
    const clear = makeElement("button", { type: "button" }, "Clear changes");
    clear.addEventListener("click", () => { this.state.changes = []; this.restartEdited(); });
    $$("changes").replaceChildren(`${changes.length} change${changes.length > 1 ? "s" : ""} during the run; last: ${last.join("; ")}. `, clear);
  }

  // ---- playback

  seek(t) {
    this.isAddressUsed = true;
    super.seek(t);
    this.scheduleSummary();
  }

  // Stop at an event, which may be missing.
  seekEvent(event) {
    if (this.playing) this.play(false);
    if (event) this.seek(event.t);
  }

  play(playing = true) {
    super.play(playing);
    if (!playing) this.scheduleSummary();
  }

  get speed() {
    return Number($$("speed").value);
  }

  // ---- results

  panels() {
    return buildPanels(this, { envelopes: $$("envelopes").checked });
  }

  drawCursor(t) {
    super.drawCursor(t);
    const { events } = this.runs.main;
    $$("previous-event").disabled = !(events[0]?.t < this.state.t);
    $$("next-event").disabled = !(events.at(-1)?.t > this.state.t);
  }

  drawResults() {
    const tables = this.runs.main.time.length ? [costTable, eventTable].map((table) => table(this)) : [];
    $$("tables").replaceChildren(...tables.filter(Boolean));
  }

  // Update link and status when nothing has changed for a while.
  scheduleSummary() {
    clearTimeout(this.summaryTimer);
    this.summaryTimer = setTimeout(() => {
      if (!this.runs.done) return this.scheduleSummary();
      const { state, runs: { main } } = this;
      this.updateAddress();
      const summary = main.failure ? "" : `${describeSettings(main)}: ${main.events.length} events in ${formatNumber(state.stop)} s.`;
      if (!this.playing) $$("status").textContent = this.linkWarning + summary;
    }, SUMMARY_DELAY);
  }

  // ---- link

  get link() {
    return encodeState(this.state, this.library.models, this.library.version);
  }

  // Store the state in the address. A page embedded in another one leaves the address alone.
  updateAddress() {
    if (!isEmbedded && this.isAddressUsed) history.replaceState(null, "", this.link);
  }

  async copyLink() {
    this.isAddressUsed = true;
    this.updateAddress();
    let target = "copied to the clipboard";
    try {
      await navigator.clipboard.writeText(location.href);
    } catch {
      target = "in the address bar"; // the clipboard is unavailable or access is denied
    }
    const reach = location.protocol === "file:" ? " It works on this computer only, because this page is a local file." : "";
    $$("status").textContent = `The link is ${target}; it contains all settings.${reach}`;
  }
}
