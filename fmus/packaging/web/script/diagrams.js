// The diagrams in their places: what the panels say is drawn, each under its title.

import { make } from "./controls.js";
import { panels, spotted } from "./panels.js";
import { Plot, readColours } from "./plot.js";

export class Diagrams {
  constructor(host, onSeek) {
    Object.assign(this, { host, onSeek, plots: new Map() }); // key of a diagram -> {plot, figure, heading, reading, panel}
    readColours();
  }

  clear() {
    this.plots.clear();
    this.host.replaceChildren();
  }

  draw(session, state, tools) {
    const found = panels(session, state, tools);
    for (const [key, { figure }] of this.plots) figure.hidden = !found.some((panel) => panel.key === key);
    const fresh = found.filter(({ key }) => !this.plots.has(key));
    for (const { key } of fresh) this.plots.set(key, this.made(key));
    if (fresh.length) this.host.append(...found.map(({ key }) => this.plots.get(key).figure)); // in their order
    for (const panel of found) {
      const known = this.plots.get(panel.key);
      if (known.panel?.title !== panel.title) {
        known.heading.innerHTML = panel.symbol ? `<b>${panel.symbol}</b> ` : ""; // made by the builder
        known.heading.append(panel.title);
      }
      known.panel = panel;
      known.plot.show(panel.content);
    }
  }

  made(key) {
    const heading = make("span");
    const reading = make("span", { class: "reading" });
    const host = make("div", { class: "plot" });
    const figure = make("figure", { id: `panel-${key}` }, make("figcaption", {}, heading, reading), host);
    return { plot: new Plot(host, key === "phase" ? null : this.onSeek), figure, heading, reading };
  }

  // Put the cursor at t in s.
  point(session, t) {
    for (const { plot, panel, reading } of this.shown()) {
      const { spot, readings } = spotted(panel, session, t);
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
