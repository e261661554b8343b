// The diagrams on the page, each below its title.

import { makeElement } from "./controls.js";
import { uniqueEntries } from "./legend.js";
import { buildPanels, cursorReadings, legendOf } from "./panels.js";
import { Plot, readColours } from "./plot.js";

export class Diagrams {
  constructor(host, onSeek) {
    Object.assign(this, { host, onSeek, plots: new Map() }); // by key: {plot, figure, heading, reading, panel}
    readColours();
  }

  clear() {
    this.plots.clear();
    this.host.replaceChildren();
  }

  // Draw the diagrams of a state; `options` has `envelopes`.
  draw(session, state, options) {
    const panels = buildPanels(session, state, options);
    for (const [key, { figure }] of this.plots) figure.hidden = !panels.some((panel) => panel.key === key);
    const added = panels.filter(({ key }) => !this.plots.has(key));
    for (const { key } of added) this.plots.set(key, this.createDiagram(key));
    if (added.length) this.host.append(...panels.map(({ key }) => this.plots.get(key).figure)); // restores the order
    for (const panel of panels) {
      const diagram = this.plots.get(panel.key);
      if (diagram.panel?.title !== panel.title) {
        diagram.heading.innerHTML = panel.symbol ? `<b>${panel.symbol}</b> ` : ""; // HTML from the build
        diagram.heading.append(panel.title);
      }
      diagram.panel = panel;
      diagram.plot.show(panel.content);
    }
  }

  createDiagram(key) {
    const heading = makeElement("span");
    const reading = makeElement("span", { class: "reading" });
    const host = makeElement("div", { class: "plot" });
    const figure = makeElement("figure", { id: `panel-${key}` }, makeElement("figcaption", {}, heading, reading), host);
    return { plot: new Plot(host, [".phase", ".law"].includes(key) ? null : this.onSeek), figure, heading, reading };
  }

  // Move the cursor to a time in s.
  moveCursor(session, t) {
    for (const { plot, panel, reading } of this.visible()) {
      const { cursor, readings } = cursorReadings(panel, session, t);
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
    readColours();
    for (const { plot } of this.plots.values()) plot.paint();
  }
}
