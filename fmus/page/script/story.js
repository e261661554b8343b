// A story: a scene with a sentence that follows its runs. It is read from its data in stories.js.

import { Field, makeElement } from "./controls.js";
import { formatCount } from "./numbers.js";
import { buildPanels } from "./panels.js";
import { Run } from "./run.js";
import { Scene } from "./scene.js";
import { defaultState, encodeState, findVariable } from "./state.js";

const LONGEST_MOTION = 20; // s, of a motion that is shown until after it has stopped
const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");

export class Story extends Scene {
  // `section` of the page is filled; `data` is a story of stories.js.
  constructor(section, library, data) {
    section.append(document.getElementById("story-parts").content.cloneNode(true));
    super(section, library, `${section.id}-`);
    Object.assign(this, { data, dragsStart: true });
    this.runNames = data.runNames ?? this.runNames;
  }

  // Show the first picture, and play once when it is in view.
  async start() {
    const { model, values = {}, stop = null, comparison = null } = this.data;
    await this.library.compile(model);
    const state = { ...defaultState(this.library.models.get(model)), values: { ...values }, stop, comparison };
    await this.show({ ...state, t: reducedMotion.matches ? Infinity : 0 });
    new IntersectionObserver(([{ isIntersecting }], observer) => {
      if (!isIntersecting) return;
      observer.disconnect();
      if (!reducedMotion.matches) this.play();
    }, { threshold: 0.6 }).observe(this.find("play"));
  }

  build() {
    super.build();
    for (const [name, range] of Object.entries(this.data.fields)) {
      const variable = findVariable(this.modelInfo, name);
      const field = new Field(`${this.prefix}field-${name}`, variable, range, this.fieldActions(variable));
      this.fields.set(name, field);
      this.find("fields").append(field.element);
    }
  }

  restart() {
    const { state, data } = this;
    data.derive?.(state.values);
    if (data.restShown) state.stop = Math.round(10 * (this.restTime() + data.restShown)) / 10;
    state.t = Math.min(state.t, state.stop);
    super.restart();
    this.find("to-explore").href = encodeState({ ...state, t: 0 }, this.library.models, this.library.version);
  }

  // The time at which the motion stops, by the default method.
  restTime() {
    const { model, values } = this.state;
    const physical = Object.fromEntries(Object.entries(values).filter(([name]) => !name.startsWith("solver.")));
    const run = new Run(this.runs.fmu(model, "rest"), { values: physical, changes: [], stop: LONGEST_MOTION, points: 0 });
    run.advance();
    return run.restTime() ?? LONGEST_MOTION;
  }

  // A change shows the end of the new motion; while the body is dragged, its start.
  restartEdited() {
    if (this.playing) this.play(false);
    this.state.t = this.drag.active ? 0 : Infinity;
    super.restartEdited();
  }

  get changesAtCursor() {
    return false;
  }

  play(playing = true) {
    if (playing && reducedMotion.matches) this.seek(this.state.stop);
    else super.play(playing);
  }

  // Few steps are passed in a frame, so that their number can be watched.
  moveCursor(elapsed) {
    const { runs: { main, comparison }, state, data: { stepsPerSecond } } = this;
    const times = stepsPerSecond ? [main, comparison].map((run) => run.time[run.row(state.t) + Math.ceil(stepsPerSecond * elapsed)] ?? Infinity) : [];
    super.moveCursor(Math.max(Math.min(elapsed, ...times.map((t) => t - state.t)), 0));
  }

  furtherRuns(state) {
    return this.data.furtherRuns?.(state) ?? {};
  }

  panels() {
    const { keys, envelopes, ranges } = this.data;
    const panels = buildPanels(this, { keys, envelopes });
    for (const [key, { x, y }] of Object.entries(ranges?.(this) ?? {})) {
      const { content } = panels.find((panel) => panel.key === key);
      Object.assign(content, { x: { ...content.x, ...x }, y: { ...content.y, ...y } });
    }
    return panels;
  }

  drawResults() {
    if ([this.runs.main, this.runs.comparison].some((run) => run?.failure)) return;
    this.find("text").innerHTML = this.data.text(this); // HTML of stories.js
  }

  drawCursor(t) {
    super.drawCursor(t);
    this.root.querySelectorAll(".meter").forEach((meter, i) => {
      const run = this.shownRuns[i];
      if (!run.time.length) return;
      const row = run.row(t);
      meter.querySelector(".count").textContent = formatCount(run.columns["solver.steps"][row]);
      meter.querySelector(".motion").textContent = run.columns.mode[row] === 0 ? "at rest" : run.columns.v[row] === 0 ? "released" : "slips";
    });
  }
}

// Create the section of a story below the opening, with its link.
export function createSection(id, title) {
  const section = makeElement("section", { id, class: "story", "aria-labelledby": `${id}-title` }, makeElement("h2", { id: `${id}-title` }, title), makeElement("div", { class: "mechanism" }));
  document.getElementById("stories").append(section);
  document.getElementById("story-links").append(makeElement("a", { href: `#${id}` }, title));
  return section;
}
