// The diagrams of a scene, each below its title, and their legend.

import { makeElement, makeSvg } from "./controls.js";
import { cursorReadings, legendOf } from "./panels.js";
import { Plot } from "./plot.js";

const SMALLEST_PART = 1e-9; // of an axis that can be enlarged

export class Diagrams {
  // `prefix` distinguishes the ids of several scenes.
  constructor(host, prefix, onSeek) {
    Object.assign(this, { host, prefix, onSeek, plots: new Map() }); // by key: {plot, figure, heading, reading, showAll, panel}
    this.ranges = new Map(); // {x, y} of enlarged diagrams by key
    this.timeRange = null; // of all diagrams over time, if they are enlarged
  }

  clear() {
    this.plots.clear();
    this.ranges.clear();
    this.timeRange = null;
    this.host.replaceChildren();
  }

  // Draw these panels.
  draw(panels) {
    for (const [key, { figure }] of this.plots) figure.hidden = !panels.some((panel) => panel.key === key);
    const added = panels.filter(({ key }) => !this.plots.has(key));
    for (const { key } of added) this.plots.set(key, this.createDiagram(key));
    if (added.length) this.host.append(...panels.map(({ key }) => this.plots.get(key).figure)); // restores the order
    for (const panel of panels) {
      const diagram = this.plots.get(panel.key);
      if (diagram.panel?.title !== panel.title) {
        diagram.heading.innerHTML = panel.symbol ? `<b>${panel.symbol}</b> ` : ""; // HTML from the build
        diagram.heading.append(panel.title);
        diagram.plot.host.setAttribute("aria-label", `Diagram: ${panel.title}`);
      }
      diagram.panel = panel;
      this.show(panel.key);
    }
  }

  // Show a diagram, or the part of it that is enlarged.
  show(key) {
    const { plot, panel: { content }, showAll } = this.plots.get(key);
    const range = this.ranges.get(key);
    const x = (isOverTime(key) ? this.timeRange : range?.x) ?? content.x;
    plot.show({ ...content, x: { ...content.x, low: x.low, high: x.high }, y: { ...content.y, ...range?.y } });
    showAll.hidden = x === content.x && !range?.y;
  }

  // Enlarge the ranges {x, y} of a diagram, either may be null; the times of all diagrams over time. Without ranges, show all.
  zoom(key, ranges) {
    const { content } = this.plots.get(key).panel;
    const [x, y] = ["x", "y"].map((axis) => limitRange(ranges?.[axis], content[axis]));
    const previous = this.ranges.get(key);
    const isReset = !ranges;
    if (isOverTime(key) && (isReset || ranges.x)) this.timeRange = x;
    this.ranges.set(key, { x: isReset || ranges.x ? x : previous?.x, y: isReset || ranges.y ? y : previous?.y });
    for (const [other, { figure }] of this.plots) if (!figure.hidden && (other === key || isOverTime(key))) this.show(other);
  }

  createDiagram(key) {
    const heading = makeElement("span");
    const reading = makeElement("span", { class: "reading" });
    const showAll = makeElement("button", { type: "button", class: "show-all", hidden: true }, "Show all");
    const host = makeElement("div", { class: "plot", role: "group", tabindex: 0, "aria-describedby": "zoom-help" });
    const figure = makeElement("figure", { id: `${this.prefix}panel-${key}` }, makeElement("figcaption", {}, heading, showAll, reading), host);
    const plot = new Plot(host, isOverTime(key) ? this.onSeek : null, (ranges) => this.zoom(key, ranges));
    showAll.addEventListener("click", () => {
      this.zoom(key, null);
      host.focus({ preventScroll: true }); // the button is hidden now
    });
    return { plot, figure, heading, reading, showAll };
  }

  // Move the cursor to a time in s.
  moveCursor(runs, t) {
    for (const { plot, panel, reading } of this.visible()) {
      const { cursor, readings } = cursorReadings(panel, runs, t);
      plot.moveCursor(cursor);
      reading.replaceChildren(...readings.map(({ text, colour }) => makeElement("span", { class: colour }, text)));
    }
  }

  // The legend of all visible diagrams, and of the arrow of the mechanism.
  legend() {
    return uniqueEntries(this.visible().flatMap(({ panel }) => legendOf(panel)));
  }

  visible() {
    return [...this.plots.values()].filter(({ figure }) => !figure.hidden);
  }

  // Redraw everything in the current colours.
  repaint() {
    for (const { plot } of this.plots.values()) plot.paint();
  }
}

function isOverTime(key) {
  return key !== ".phase" && key !== ".law";
}

// A range within that of the whole axis; null for all of it.
function limitRange(range, { low, high, hidden }) {
  if (!range || hidden || !(range.high - range.low > SMALLEST_PART * (high - low))) return null;
  const limited = { low: Math.max(range.low, low), high: Math.min(range.high, high) };
  return limited.low < limited.high && (limited.low > low || limited.high < high) ? limited : null;
}

// ---- legend: one entry for every kind of line, mark and shading, and for the arrow of the mechanism

const [SAMPLE_WIDTH, SAMPLE_HEIGHT] = [26, 12]; // of a sample, in CSS pixels

// Paths of the samples by kind; lines are drawn, bands are filled.
const SAMPLES = {
  line: `M0 ${SAMPLE_HEIGHT / 2}H${SAMPLE_WIDTH}`,
  band: `M0 0H${SAMPLE_WIDTH}V${SAMPLE_HEIGHT}H0Z`,
  mark: `M${SAMPLE_WIDTH / 2} ${SAMPLE_HEIGHT / 2}V${SAMPLE_HEIGHT}`,
  change: `M${SAMPLE_WIDTH / 2} 0V${SAMPLE_HEIGHT}`,
  dots: `M${SAMPLE_WIDTH / 2 - 2} ${SAMPLE_HEIGHT / 2 - 2}h4v4h-4Z`,
  arrow: `M0 ${SAMPLE_HEIGHT / 2}H${SAMPLE_WIDTH}m-6 -4l6 4l-6 4`,
};
const FILLED = ["band", "dots"];

// Remove entries that look and read the same. An entry is {kind, colour, dash, text}.
function uniqueEntries(entries) {
  return [...new Map(entries.map((entry) => [JSON.stringify(entry), entry])).values()];
}

// Show the entries as samples with their texts.
export function showLegend(host, entries) {
  const key = JSON.stringify(entries);
  if (host.dataset.key === key) return;
  host.dataset.key = key;
  host.replaceChildren(...entries.map(({ kind, colour, dash = [], text }) => {
    const sample = makeSvg("svg", { viewBox: `0 0 ${SAMPLE_WIDTH} ${SAMPLE_HEIGHT}`, class: `colour-${colour}`, "aria-hidden": "true" });
    const look = FILLED.includes(kind) ? { fill: "currentColor" } : { stroke: "currentColor", fill: "none", "stroke-width": 2, "stroke-dasharray": dash.join(" ") };
    makeSvg("path", { d: SAMPLES[kind], ...look }, sample);
    return makeElement("span", {}, sample, text);
  }));
}
