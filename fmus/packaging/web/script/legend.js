// The legend: one entry for every kind of line, mark and shading in the diagrams and for the arrow of the mechanism.

import { makeElement } from "./controls.js";

const SVG_NAMESPACE = "http://www.w3.org/2000/svg";
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
export function uniqueEntries(entries) {
  return [...new Map(entries.map((entry) => [JSON.stringify(entry), entry])).values()];
}

// Show the entries as samples with their texts.
export function showLegend(host, entries) {
  const key = JSON.stringify(entries);
  if (host.dataset.key === key) return;
  host.dataset.key = key;
  host.replaceChildren(...entries.map(({ kind, colour, dash = [], text }) => {
    const sample = document.createElementNS(SVG_NAMESPACE, "svg");
    const path = document.createElementNS(SVG_NAMESPACE, "path");
    for (const [name, value] of Object.entries({ viewBox: `0 0 ${SAMPLE_WIDTH} ${SAMPLE_HEIGHT}`, class: `colour-${colour}`, "aria-hidden": "true" })) sample.setAttribute(name, value);
    path.setAttribute("d", SAMPLES[kind]);
    path.setAttribute(FILLED.includes(kind) ? "fill" : "stroke", "currentColor");
    if (!FILLED.includes(kind)) path.setAttribute("fill", "none");
    if (!FILLED.includes(kind)) path.setAttribute("stroke-width", "2");
    if (dash.length) path.setAttribute("stroke-dasharray", dash.join(" "));
    sample.append(path);
    return makeElement("span", {}, sample, text);
  }));
}
