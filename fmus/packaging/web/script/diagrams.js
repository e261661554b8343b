// The diagrams in their places: what the panels say is drawn, each under its title.

import { make } from "./controls.js";
import { panels, spotted } from "./panels.js";
import { Plot, readColours } from "./plot.js";

const LAST = ["phase", "step", "energy", "friction", "error"]; // in this order, after those of the motion

export class Diagrams {
  constructor(host, onSeek) {
    Object.assign(this, { host, onSeek, plots: new Map() }); // key of a diagram -> {plot, figure, heading, reading, panel}
    readColours();
  }

  clear() {
    this.plots.clear();
    this.host.replaceChildren();
  }

  draw(desk, state, tools) {
    const found = panels(desk, state, tools);
    for (const [key, { figure }] of this.plots) figure.hidden = !found.some((panel) => panel.key === key);
    for (const panel of found) {
      if (!this.plots.has(panel.key)) this.plots.set(panel.key, this.placed(panel.key));
      const known = this.plots.get(panel.key);
      if (known.panel?.title !== panel.title) {
        known.heading.innerHTML = panel.symbol ? `<b>${panel.symbol}</b> ` : ""; // made by the builder
        known.heading.append(panel.title);
      }
      known.panel = panel;
      known.plot.show(panel.content);
    }
  }

  placed(key) {
    const heading = make("span");
    const reading = make("span", { class: "reading" });
    const host = make("div", { class: "plot" });
    const figure = make("figure", { id: `panel-${key}` }, make("figcaption", {}, heading, reading), host);
    const after = LAST.includes(key) && LAST.slice(LAST.indexOf(key) + 1).map((each) => this.plots.get(each)?.figure).find(Boolean);
    this.host.insertBefore(figure, after || null);
    return { plot: new Plot(host, key === "phase" ? null : this.onSeek), figure, heading, reading };
  }

  // Put the cursor at t in s.
  point(desk, t) {
    for (const { plot, panel, reading } of this.shown()) {
      const { spot, readings } = spotted(panel, desk, t);
      plot.point(spot);
      reading.replaceChildren(...readings.map(({ text, colour }) => make("span", { class: colour }, text)));
    }
  }

  shown() {
    return [...this.plots.values()].filter(({ figure }) => !figure.hidden);
  }

  // Draw all anew, in the colours that there are now.
  paint() {
    readColours();
    for (const { plot } of this.plots.values()) plot.paint();
  }
}
