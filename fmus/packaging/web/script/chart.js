// The charts of the stories: canvases in the resolution of the screen, and the elements that all of them share.

import { formatPower, ticks } from "./plot.js";
import { fixedDigits } from "./prose.js";

export const palette = {};
const charts = new Set();

// Read the current colours of the style sheet.
export function readPalette() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["stick", "slip", "hold", "ink", "soft", "line", "paper"]) palette[name] = style.getPropertyValue(`--${name}`).trim();
  palette.font = style.getPropertyValue("--sans").trim();
  for (const chart of charts) chart.paint();
}

export class Chart {
  // `draw(chart)` draws everything; its context has CSS pixels as units.
  constructor(canvas, draw) {
    Object.assign(this, { canvas, draw, c: canvas.getContext("2d"), w: 0, h: 0 });
    charts.add(this);
    new ResizeObserver(([{ contentRect }]) => this.size(contentRect.width, contentRect.height)).observe(canvas);
  }

  size(w, h) {
    const ratio = Math.min(devicePixelRatio || 1, 3);
    Object.assign(this, { w, h, ratio });
    [this.canvas.width, this.canvas.height] = [Math.round(w * ratio), Math.round(h * ratio)];
    this.paint();
  }

  paint() {
    if (!this.w) return;
    this.c.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    this.c.clearRect(0, 0, this.w, this.h);
    this.c.lineJoin = "round";
    this.draw(this);
  }

  text(label, x, y, { colour = palette.soft, align = "left", size = 12, base = "middle", weight = 400, halo = true } = {}) {
    const { c } = this;
    c.font = `${weight} ${size}px ${palette.font}`;
    [c.textAlign, c.textBaseline] = [align, base];
    if (halo) {
      [c.strokeStyle, c.lineWidth] = [palette.paper, 4];
      c.strokeText(label, x, y);
    }
    c.fillStyle = colour;
    c.fillText(label, x, y);
  }

  line(points, colour, width = 1.75, dash = []) {
    const { c } = this;
    c.beginPath();
    for (const [x, y] of points) c.lineTo(x, y);
    [c.strokeStyle, c.lineWidth] = [colour, width];
    c.setLineDash(dash);
    c.stroke();
    c.setLineDash([]);
  }

  box(x, y, w, h, colour, alpha = 1) {
    const { c } = this;
    c.globalAlpha = alpha;
    c.fillStyle = colour;
    c.fillRect(x, y, w, h);
    c.globalAlpha = 1;
  }

  dot(x, y, r, colour, hollow) {
    const { c } = this;
    c.beginPath();
    c.arc(x, y, r, 0, 7);
    [c.fillStyle, c.strokeStyle, c.lineWidth] = [hollow ? palette.paper : colour, hollow ? colour : palette.paper, 2];
    if (!hollow) c.fill();
    c.stroke();
  }

  clipped(x, y, w, h, drawContent) {
    const { c } = this;
    c.save();
    c.beginPath();
    c.rect(x, y, w, h);
    c.clip();
    drawContent();
    c.restore();
  }
}

export function linearScale(a, b, p, q) {
  const k = (q - p) / (b - a);
  const map = (value) => p + (value - a) * k;
  map.inverse = (pixel) => a + (pixel - p) / k;
  return map;
}

// The label of a tick, with as many decimals as the ticks need.
export function tickLabel(value, all) {
  if (Math.abs(value) < 1e-9 * Math.abs(all[1] - all[0])) return "0";
  const places = Math.max(0, -Math.floor(Math.log10(all[1] - all[0]) + 1e-9));
  return fixedDigits(value, places);
}

// A time axis under a diagram.
export function timeAxis(chart, x, from, to, y, unit = "s") {
  const count = Math.max(2, Math.min(8, Math.floor((x(to) - x(from)) / 55)));
  const all = ticks(from, to, count);
  all.forEach((t, i) => {
    chart.line([[x(t), y], [x(t), y + 4]], palette.line, 1);
    chart.text(tickLabel(t, all) + (i === all.length - 1 ? ` ${unit}` : ""), x(t), y + 13, { align: "center", size: 11, halo: false });
  });
}

export function gridLines(chart, y, values, left, right, format = (value) => tickLabel(value, values)) {
  for (const value of values) {
    chart.line([[left, y(value)], [right, y(value)]], palette.line, 1);
    chart.text(format(value), left - 6, y(value), { align: "right", size: 11, halo: false });
  }
}

// Powers of ten and their labels, in s.
export const powersOfTen = (exponents) => [exponents.map((e) => 10 ** e), (value) => (value === 1 ? "1 s" : `${formatPower(Math.round(Math.log10(value)))} s`)];

// A curve in the colours of its modes: at(i) is a point, stuck(i) whether the body holds from there on.
export function modeCurve(chart, count, point, isStuck, width = 2, dash = []) {
  for (let i = 0; i + 1 < count; ) {
    const held = isStuck(i);
    const points = [point(i)];
    while (i + 1 < count && isStuck(i) === held) points.push(point(++i));
    chart.line(points, held ? palette.stick : palette.slip, width, dash);
  }
}
