// A diagram: axes, curves, shaded intervals and marks on one canvas, the cursor on another on top.

import { formatNumber, formatPower } from "./numbers.js";

const RIGHT = 10;
const TOP = 8;
const FONT_SIZE = 11; // px
const [LEFT, BOTTOM] = [58, 22]; // margins at the texts of the axes
const TICK_COUNT = 5;
const ROW_GAP = 4; // above and below a shaded row
const CURSOR_SIZE = 3.5; // px
const LEAST_DRAG = 8; // px; a shorter one is a click
const [KEY_ZOOM, KEY_PAN] = [0.7, 0.2]; // of the range shown

// Round numbers from low to high, about `count` of them.
export function ticks(low, high, count = TICK_COUNT) {
  const spacing = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(spacing));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((round) => round >= spacing * (1 - 1e-9));
  const [first, last] = [Math.ceil(low / step - 1e-9), Math.floor(high / step + 1e-9)];
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}

// Format a tick with as many digits as distinguish it from its neighbours.
function formatTick(value, all) {
  const largest = Math.max(...all.map(Math.abs));
  const digits = all.length > 1 ? Math.ceil(Math.log10(largest / (all[1] - all[0]))) + 1 : 0;
  return formatNumber(value, Math.min(Math.max(digits, 4), 15));
}

// Reduce a curve to pixels [x, y, x, y, ...]: per column of pixels the first, lowest, highest and last point. `scale`
// maps values to pixels. Skips points that are not finite.
export function decimate(x, y, scale) {
  const pixels = [];
  let column, first, lowest, highest, last, low, high;
  const addPoint = (row) => row !== undefined && pixels.push(scale.x(x[row]), scale.y(y[row]));
  const addColumn = () => [...new Set([first, lowest, highest, last])].sort((a, b) => a - b).forEach(addPoint);
  for (let row = 0; row < x.length; row++) {
    const [pixelX, pixelY] = [scale.x(x[row]), scale.y(y[row])];
    if (!Number.isFinite(pixelX + pixelY)) continue;
    if (Math.floor(pixelX) !== column) {
      addColumn();
      column = Math.floor(pixelX);
      first = lowest = highest = row;
      low = high = pixelY;
    }
    if (pixelY < low) [lowest, low] = [row, pixelY];
    if (pixelY > high) [highest, high] = [row, pixelY];
    last = row;
  }
  addColumn();
  return pixels;
}

const colours = {}; // by name of the CSS variable

// Read the current colours of the style sheet (light or dark).
export function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["a", "b", "ghost", "line", "soft", "hold", "event", "cursor", "stick", "slip"]) colours[name] = style.getPropertyValue(`--${name}`).trim();
}

export class Plot {
  // Fills the element `host`. Calls onZoom({x, y}) with the ranges of a rectangle that is drawn with the mouse, or
  // onZoom(null) to show all; and onSeek(x), unless it is null, when a click or a finger moves the cursor.
  constructor(host, onSeek, onZoom) {
    Object.assign(this, { host, onSeek, onZoom });
    this.curveCanvas = host.appendChild(document.createElement("canvas"));
    this.curveCanvas.setAttribute("role", "img");
    this.cursorCanvas = host.appendChild(document.createElement("canvas"));
    this.cursorCanvas.setAttribute("aria-hidden", "true");
    this.content = this.cursor = this.rectangle = null;
    this.width = this.height = 0;
    new ResizeObserver(([{ contentRect: { width, height } }]) => { // reading clientWidth instead would force a layout
      Object.assign(this, { width, height });
      this.paint();
    }).observe(host);
    this.listen();
    host.addEventListener("keydown", (event) => this.pressKey(event));
  }

  listen() {
    const at = (event) => {
      const { left, top } = this.host.getBoundingClientRect();
      const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
      return [clamp(event.clientX - left, LEFT, this.width - RIGHT), clamp(event.clientY - top, TOP, this.height - BOTTOM)];
    };
    const seek = (event) => this.onSeek?.(this.valuesAt(...at(event)).x);
    const showRectangle = (rectangle) => {
      this.rectangle = rectangle;
      if (this.cursor) this.moveCursor(this.cursor);
    };
    this.host.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      this.host.setPointerCapture(event.pointerId);
      if (event.pointerType === "mouse") showRectangle([at(event), at(event)]);
      else seek(event);
    });
    this.host.addEventListener("pointermove", (event) => {
      if (this.rectangle) showRectangle([this.rectangle[0], at(event)]);
      else if (event.buttons && event.pointerType !== "mouse") seek(event);
    });
    this.host.addEventListener("pointerup", (event) => {
      if (!this.rectangle) return;
      const [from, to] = this.rectangle;
      showRectangle(null);
      const [start, end] = [from, to].map(([x, y]) => this.valuesAt(x, y));
      const range = (key, i) => (Math.abs(to[i] - from[i]) >= LEAST_DRAG ? { low: Math.min(start[key], end[key]), high: Math.max(start[key], end[key]) } : null);
      const [x, y] = [range("x", 0), range("y", 1)];
      if (x || y) this.onZoom({ x, y });
      else seek(event);
    });
    this.host.addEventListener("pointercancel", () => showRectangle(null));
    this.host.addEventListener("dblclick", () => this.onZoom(null));
    this.cancelRectangle = () => showRectangle(null);
  }

  // The keys + and - enlarge and reduce, arrows move the part shown, and Escape shows all.
  pressKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.content) return;
    const pan = { ArrowLeft: [-KEY_PAN, 0], ArrowRight: [KEY_PAN, 0], ArrowDown: [0, -KEY_PAN], ArrowUp: [0, KEY_PAN] }[event.key] ?? [0, 0];
    const factor = { "+": KEY_ZOOM, "=": KEY_ZOOM, "-": 1 / KEY_ZOOM }[event.key] ?? 1;
    if (event.key === "Escape") [this.cancelRectangle(), this.onZoom(null)];
    else if (factor === 1 && !pan.some(Boolean)) return;
    else {
      const [left, right, top, bottom] = [LEFT, this.width - RIGHT, TOP, this.height - BOTTOM];
      const [x, y] = [(left + right) / 2 + pan[0] * (right - left), (top + bottom) / 2 - pan[1] * (bottom - top)];
      const [across, down] = [right - left, bottom - top].map((size) => (factor * size) / 2);
      const [start, end] = [this.valuesAt(x - across, y + down), this.valuesAt(x + across, y - down)];
      this.onZoom({ x: { low: start.x, high: end.x }, y: { low: start.y, high: end.y } });
    }
    event.preventDefault();
  }

  // The values {x, y} at a point of the canvas.
  valuesAt(px, py) {
    const { x, y } = this.content;
    const [low, high] = [y.low, y.high].map((value) => (y.log ? Math.log10(value) : value));
    const value = high - ((py - TOP) / (this.height - TOP - BOTTOM)) * (high - low);
    return {
      x: x.low + ((px - LEFT) / (this.width - LEFT - RIGHT)) * (x.high - x.low),
      y: y.log ? 10 ** value : value,
    };
  }

  // content: x and y {low, high, label, log, hidden}, curves [{x, y, colour, dash, dots}], shaded bands [{from, to, row}]
  // in equally high rows, the names of the rows, marks [{x, label, colour}] and a description. With a hidden y axis, the
  // names of the rows stand in its place.
  show(content) {
    this.content = content;
    this.curveCanvas.setAttribute("aria-label", content.description);
    this.paint();
  }

  // Draw the cursor: x, points {x, y, colour} on the curves, and the rectangle that is being drawn.
  moveCursor(cursor) {
    this.cursor = cursor;
    if (!this.content || !this.width) return;
    const { width, height } = this;
    const context = this.prepareCanvas(this.cursorCanvas);
    const scale = this.scales(width, height);
    context.save();
    context.beginPath();
    context.rect(LEFT - CURSOR_SIZE, 0, width - LEFT - RIGHT + 2 * CURSOR_SIZE, height - BOTTOM + CURSOR_SIZE);
    context.clip();
    if (cursor.x !== undefined) line(context, colours.cursor, 1, [scale.x(cursor.x), TOP, scale.x(cursor.x), height - BOTTOM]);
    for (const { x, y, colour } of cursor.points) dot(context, colours[colour], scale.x(x), scale.y(y), CURSOR_SIZE);
    context.restore();
    if (!this.rectangle) return;
    const [[left, top], [right, bottom]] = this.rectangle;
    context.strokeStyle = colours.cursor;
    context.setLineDash([4, 3]);
    context.strokeRect(left, top, right - left, bottom - top);
    context.setLineDash([]);
  }

  paint() {
    if (!this.content || !this.width) return;
    this.draw(this.prepareCanvas(this.curveCanvas), this.width, this.height);
    if (this.cursor) this.moveCursor(this.cursor);
  }

  // Clear a canvas, fit it to the host and use CSS pixels as units. Returns its context.
  prepareCanvas(canvas) {
    const { width, height } = this;
    const ratio = devicePixelRatio;
    const [pixelWidth, pixelHeight] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== pixelWidth || canvas.height !== pixelHeight) [canvas.width, canvas.height] = [pixelWidth, pixelHeight];
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    return context;
  }

  // Functions from values to pixels: {x, y}.
  scales(width, height) {
    const { x, y } = this.content;
    const transform = y.log ? (value) => (value > 0 ? Math.log10(value) : NaN) : (value) => value;
    const [low, high] = [transform(y.low), transform(y.high)];
    return {
      x: (value) => LEFT + ((value - x.low) / (x.high - x.low)) * (width - LEFT - RIGHT),
      y: (value) => TOP + ((high - transform(value)) / (high - low)) * (height - TOP - BOTTOM),
    };
  }

  // Draw everything except the cursor, on any canvas.
  draw(context, width, height) {
    const { x, y, curves, bands = [], rows = [], marks = [] } = this.content;
    const scale = this.scales(width, height);
    const [right, bottom] = [width - RIGHT, height - BOTTOM];
    context.font = `${FONT_SIZE}px system-ui, sans-serif`;
    context.lineJoin = "round";
    context.fillStyle = colours.hold;
    const rowHeight = (bottom - TOP) / Math.max(rows.length, 1);
    const gap = rows.length > 1 ? Math.min(ROW_GAP, 0.2 * rowHeight) : 0;
    for (const { from, to, row } of bands.filter((band) => band.to >= x.low && band.from <= x.high)) {
      const [start, end] = [scale.x(Math.max(from, x.low)), scale.x(Math.min(to, x.high))];
      context.fillRect(start, TOP + row * rowHeight + gap, Math.max(end - start, 0.5), rowHeight - 2 * gap);
    }
    context.fillStyle = colours.soft;
    context.textAlign = "right";
    context.textBaseline = "middle";
    if (y.hidden) rows.forEach((name, row) => context.fillText(name, LEFT - 6, TOP + (row + 0.5) * rowHeight, LEFT - 8));
    const isDecade = y.log && y.high / y.low >= 10;
    const values = y.hidden ? [] : isDecade ? decades(y.low, y.high) : ticks(y.low, y.high);
    for (const value of values) {
      line(context, colours.line, 1, [LEFT, scale.y(value), right, scale.y(value)]);
      context.fillText(isDecade ? formatPower(Math.round(Math.log10(value))) : formatTick(value, values), LEFT - 6, scale.y(value));
    }
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    const times = ticks(x.low, x.high, width < 420 ? 4 : 8);
    for (const value of times) {
      line(context, colours.line, 1, [scale.x(value), TOP, scale.x(value), bottom]);
      const text = formatTick(value, times);
      const half = context.measureText(text).width / 2;
      if (scale.x(value) + half < width - context.measureText(x.label).width - 8) context.fillText(text, scale.x(value), height - 6);
    }
    context.textAlign = "right";
    context.fillText(x.label, width - 2, height - 6);
    context.save();
    context.beginPath();
    context.rect(LEFT, TOP, right - LEFT, bottom - TOP);
    context.clip();
    for (const curve of curves) this.curve(context, curve, scale);
    for (const mark of marks) this.mark(context, mark, scale, right, bottom);
    if (rows.length > 1 && !y.hidden) {
      context.fillStyle = colours.soft;
      context.textAlign = "right";
      rows.forEach((name, row) => context.fillText(`${name} stuck`, right - 3, TOP + (row + 1) * rowHeight - gap - 4));
    }
    context.restore();
  }

  curve(context, { x, y, colour, dash = [], dots = false, width = 1.6 }, scale) {
    const pixels = decimate(x, y, scale);
    if (dots) {
      for (let i = 0; i < pixels.length; i += 2) dot(context, colours[colour], pixels[i], pixels[i + 1], 2.6);
      return;
    }
    context.setLineDash(dash);
    line(context, colours[colour], width, pixels);
    context.setLineDash([]);
  }

  mark(context, { x, label, colour }, scale, edge, bottom) {
    line(context, colours[colour], 1, [scale.x(x), label ? TOP : bottom - 6, scale.x(x), bottom]);
    if (!label) return;
    context.fillStyle = colours[colour];
    const isNearEdge = scale.x(x) + context.measureText(label).width + 6 > edge;
    context.textAlign = isNearEdge ? "right" : "left";
    context.fillText(label, scale.x(x) + (isNearEdge ? -3 : 3), TOP + 10);
  }
}

function line(context, colour, width, points) {
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.beginPath();
  for (let i = 0; i < points.length; i += 2) context.lineTo(points[i], points[i + 1]);
  context.stroke();
}

function dot(context, colour, x, y, size) {
  context.fillStyle = colour;
  context.beginPath();
  context.arc(x, y, size, 0, 2 * Math.PI);
  context.fill();
}

// Powers of ten from low to high, at most six of them.
function decades(low, high) {
  const [first, last] = [Math.ceil(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];
  const every = Math.max(1, Math.ceil((last - first) / TICK_COUNT));
  return Array.from({ length: Math.floor((last - first) / every) + 1 }, (_, i) => 10 ** (first + i * every));
}

// The range of an axis around all values, with a margin; powers of ten for a logarithmic axis.
export function bounds(columns, log = false) {
  let [low, high] = [Infinity, -Infinity];
  for (const column of columns) {
    for (const value of column) {
      if (!Number.isFinite(value) || (log && !(value > 0))) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) return log ? { low: 0.1, high: 10 } : { low: -1, high: 1 };
  if (log) {
    const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
    return { low: 10 ** first, high: 10 ** Math.max(last, first + 1) };
  }
  const margin = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
  return { low: low - margin, high: high + margin };
}
