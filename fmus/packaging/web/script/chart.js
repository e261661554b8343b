// The charts of the stories: canvases in the resolution of the screen, and the elements that all of them share.

import { ticks } from "./plot.js";
import { fixedDigits } from "./prose.js";

export const palette = {};
export const charts = new Set(); // all charts of the page

// Read the current colours of the style sheet.
export function readPalette() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["stick", "slip", "hold", "ink", "soft", "line", "paper"]) palette[name] = style.getPropertyValue(`--${name}`).trim();
  palette.font = style.getPropertyValue("--sans").trim();
  for (const chart of charts) chart.paint();
}

const CELL = 3; // CSS pixels: resolution in which curves and texts occupy a chart
const [LABEL_REACH, LABEL_STEP] = [120, 4]; // CSS pixels: how far a label may be moved, and in which steps
const LABEL_MARGIN = 3; // CSS pixels around a label
const LABEL_SHIFTS = shiftsByDistance();

// All shifts of a label, in pixels, by their length.
function shiftsByDistance() {
  const shifts = [];
  for (let dx = -LABEL_REACH; dx <= LABEL_REACH; dx += LABEL_STEP) for (let dy = -LABEL_REACH; dy <= LABEL_REACH; dy += LABEL_STEP) shifts.push([dx, dy]);
  return shifts.sort((a, b) => Math.hypot(...a) - Math.hypot(...b));
}

export class Chart {
  // `draw(chart)` draws everything; its context has CSS pixels as units.
  constructor(canvas, draw) {
    Object.assign(this, { canvas, draw, c: canvas.getContext("2d"), w: 0, h: 0, labelShifts: new Map() });
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
    this.columns = Math.ceil(this.w / CELL);
    this.occupied = new Uint8Array(this.columns * Math.ceil(this.h / CELL));
    this.labels = [];
    this.draw(this);
    for (const label of this.labels) this.placeLabel(label);
  }

  // Draw a text as close to (x, y) as it touches neither a curve nor another text, after everything else; without such a
  // place there is no text. While a chart moves, the label stays at the same place as long as that is free.
  label(text, x, y, options = {}) {
    this.labels.push({ text, x, y, options, key: options.key ?? text });
  }

  placeLabel({ text, x, y, options, key }) {
    const isFree = ([dx, dy]) => this.isFree(this.textBox(text, x + dx, y + dy, options));
    const last = this.labelShifts.get(key);
    const shift = last && isFree(last) ? last : LABEL_SHIFTS.find(isFree);
    if (!shift) return;
    this.labelShifts.set(key, shift);
    this.text(text, x + shift[0], y + shift[1], options);
  }

  textBox(text, x, y, { align = "left", size = 12, weight = 400 }) {
    this.c.font = `${weight} ${size}px ${palette.font}`;
    const { width } = this.c.measureText(text);
    const left = x - width * { left: 0, center: 0.5, right: 1 }[align];
    return [left - LABEL_MARGIN, y - 0.6 * size - LABEL_MARGIN, left + width + LABEL_MARGIN, y + 0.6 * size + LABEL_MARGIN];
  }

  isFree([left, top, right, bottom]) {
    if (left < 0 || top < 0 || right > this.w || bottom > this.h) return false;
    for (let row = Math.floor(top / CELL); row <= bottom / CELL; row++) {
      for (let column = Math.floor(left / CELL); column <= right / CELL; column++) if (this.occupied[row * this.columns + column]) return false;
    }
    return true;
  }

  occupy(left, top, right, bottom) {
    const [first, last] = [Math.max(0, Math.floor(left / CELL)), Math.min(this.columns - 1, Math.floor(right / CELL))];
    for (let row = Math.max(0, Math.floor(top / CELL)); row <= Math.min(bottom, this.h - 1) / CELL; row++) {
      if (first <= last) this.occupied.fill(1, row * this.columns + first, row * this.columns + last + 1);
    }
  }

  occupyLine([x0, y0], [x1, y1]) {
    const count = Math.min(Math.ceil(Math.hypot(x1 - x0, y1 - y0) / CELL) || 1, 2000);
    for (let i = 0; i <= count; i++) {
      const [x, y] = [x0 + ((x1 - x0) * i) / count, y0 + ((y1 - y0) * i) / count];
      this.occupy(x, y, x, y);
    }
  }

  text(label, x, y, options = {}) {
    const { colour = palette.soft, align = "left", size = 12, weight = 400, halo = true } = options;
    const { c } = this;
    this.occupy(...this.textBox(label, x, y, options));
    c.font = `${weight} ${size}px ${palette.font}`;
    [c.textAlign, c.textBaseline] = [align, "middle"];
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
    if (colour !== palette.line) for (let i = 1; i < points.length; i++) this.occupyLine(points[i - 1], points[i]); // a curve, no grid line
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
    this.occupy(x - r, y - r, x + r, y + r);
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

// A curve in the colours of its modes: at(i) is a point, stuck(i) whether the body holds from there on.
export function modeCurve(chart, count, point, isStuck, width = 2, dash = []) {
  for (let i = 0; i + 1 < count; ) {
    const held = isStuck(i);
    const points = [point(i)];
    while (i + 1 < count && isStuck(i) === held) points.push(point(++i));
    chart.line(points, held ? palette.stick : palette.slip, width, dash);
  }
}
