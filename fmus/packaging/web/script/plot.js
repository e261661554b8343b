// A diagram: axes, curves, shaded intervals and marks on one canvas, the cursor on another on top.

const RIGHT = 10;
const TOP = 8;
const FONT_SIZE = 11; // px, for which the margins at the texts of the axes are chosen
const axisText = { size: FONT_SIZE, left: 58, bottom: 22 }; // the font size now, and the margins for it
const TICK_COUNT = 5;
const ROW_GAP = 4; // above and below a shaded row

// Round numbers from low to high, about `count` of them.
export function ticks(low, high, count = TICK_COUNT) {
  const spacing = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(spacing));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((round) => round >= spacing * (1 - 1e-9));
  const [first, last] = [Math.ceil(low / step - 1e-9), Math.floor(high / step + 1e-9)];
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}

const SUPERSCRIPTS = { "-": "⁻", ...Object.fromEntries([..."⁰¹²³⁴⁵⁶⁷⁸⁹"].map((digit, i) => [String(i), digit])) };

// A power of ten, as in 10⁻⁶.
export function formatPower(exponent) {
  return `10${[...String(exponent)].map((character) => SUPERSCRIPTS[character]).join("")}`;
}

// Format a number with at most `digits` digits, without trailing zeros, with a typographic minus sign; very large and small
// ones with a power of ten, as in 2.5·10⁻⁶.
export function formatNumber(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  let text = String(Number(value.toPrecision(digits)));
  if (Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3)) {
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    const factor = Number(mantissa);
    text = factor === 1 ? formatPower(Number(power)) : `${factor}·${formatPower(Number(power))}`;
  }
  return text.replace(/-/g, "−");
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

// Read the current colours of the style sheet (light, dark or print) and the font size.
export function readColours() {
  const style = getComputedStyle(document.documentElement);
  axisText.size = parseFloat(style.getPropertyValue("--plot-text")) || FONT_SIZE;
  [axisText.left, axisText.bottom] = [58, 22].map((margin) => (margin * axisText.size) / FONT_SIZE);
  for (const name of ["a", "b", "ghost", "line", "soft", "hold", "event", "cursor", "measured", "stick", "slip"]) colours[name] = style.getPropertyValue(`--${name}`).trim();
}

export class Plot {
  // Fills the element `host`. Calls onSeek(x) when a pointer moves the cursor.
  constructor(host, onSeek) {
    this.host = host;
    this.curveCanvas = host.appendChild(document.createElement("canvas"));
    this.curveCanvas.setAttribute("role", "img");
    this.cursorCanvas = host.appendChild(document.createElement("canvas"));
    this.cursorCanvas.setAttribute("aria-hidden", "true");
    this.paints = 0; // number of redraws, for tests
    this.content = this.cursor = null;
    this.width = this.height = 0;
    new ResizeObserver(([{ contentRect: { width, height } }]) => { // reading clientWidth instead would force a layout
      Object.assign(this, { width, height });
      this.paint();
    }).observe(host);
    if (onSeek) this.listen(onSeek);
  }

  listen(onSeek) {
    const seek = (event) => {
      const { left, width } = this.host.getBoundingClientRect();
      const { low, high } = this.content.x;
      const fraction = (event.clientX - left - axisText.left) / (width - axisText.left - RIGHT);
      onSeek(low + Math.min(Math.max(fraction, 0), 1) * (high - low));
    };
    this.host.addEventListener("pointerdown", (event) => {
      this.host.setPointerCapture(event.pointerId);
      seek(event);
    });
    this.host.addEventListener("pointermove", (event) => event.buttons && seek(event));
  }

  // content: x and y {low, high, label, log, hidden}, curves [{x, y, colour, dash, dots}], shaded bands [{from, to, row}]
  // in equally high rows, the names of the rows, marks [{x, label, colour}] and a description. With a hidden y axis, the
  // names of the rows stand in its place.
  show(content) {
    this.content = content;
    this.curveCanvas.setAttribute("aria-label", content.description);
    this.paint();
  }

  // Draw the cursor: x, and points {x, y, colour} on the curves.
  moveCursor(cursor) {
    this.cursor = cursor;
    if (!this.content || !this.width) return;
    const { width, height } = this;
    const context = this.prepareCanvas(this.cursorCanvas);
    const scale = this.scales(width, height);
    if (cursor.x !== undefined) line(context, colours.cursor, 1, [scale.x(cursor.x), TOP, scale.x(cursor.x), height - axisText.bottom]);
    for (const { x, y, colour } of cursor.points) dot(context, colours[colour], scale.x(x), scale.y(y), 3.5);
  }

  paint() {
    if (!this.content || !this.width) return;
    this.paints++;
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
      x: (value) => axisText.left + ((value - x.low) / (x.high - x.low)) * (width - axisText.left - RIGHT),
      y: (value) => TOP + ((high - transform(value)) / (high - low)) * (height - TOP - axisText.bottom),
    };
  }

  // Draw everything except the cursor, on any canvas.
  draw(context, width, height) {
    const { x, y, curves, bands = [], rows = [], marks = [] } = this.content;
    const scale = this.scales(width, height);
    const [right, bottom] = [width - RIGHT, height - axisText.bottom];
    context.font = `${axisText.size}px system-ui, sans-serif`;
    context.lineJoin = "round";
    context.fillStyle = colours.hold;
    const rowHeight = (bottom - TOP) / Math.max(rows.length, 1);
    const gap = rows.length > 1 ? Math.min(ROW_GAP, 0.2 * rowHeight) : 0;
    for (const { from, to, row } of bands) {
      context.fillRect(scale.x(from), TOP + row * rowHeight + gap, Math.max(scale.x(to) - scale.x(from), 0.5), rowHeight - 2 * gap);
    }
    context.fillStyle = colours.soft;
    context.textAlign = "right";
    context.textBaseline = "middle";
    if (y.hidden) rows.forEach((name, row) => context.fillText(name, axisText.left - 6, TOP + (row + 0.5) * rowHeight, axisText.left - 8));
    for (const value of y.hidden ? [] : y.log ? decades(y.low, y.high) : ticks(y.low, y.high)) {
      line(context, colours.line, 1, [axisText.left, scale.y(value), right, scale.y(value)]);
      context.fillText(y.log ? formatPower(Math.round(Math.log10(value))) : formatNumber(value), axisText.left - 6, scale.y(value));
    }
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    for (const value of ticks(x.low, x.high, width < 420 ? 4 : 8)) {
      line(context, colours.line, 1, [scale.x(value), TOP, scale.x(value), bottom]);
      const text = formatNumber(value);
      const half = context.measureText(text).width / 2;
      if (scale.x(value) + half < width - context.measureText(x.label).width - 8) context.fillText(text, scale.x(value), height - 6);
    }
    context.textAlign = "right";
    context.fillText(x.label, width - 2, height - 6);
    context.save();
    context.beginPath();
    context.rect(axisText.left, TOP, right - axisText.left, bottom - TOP);
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
