// One diagram: axes, curves, shaded times and marks on one canvas, the cursor on another above it.

const LEFT = 58;
const RIGHT = 10;
const TOP = 8;
const BOTTOM = 22;
const TICKS = 5;
const FONT = "11px system-ui, sans-serif";

// Round numbers from low to high, about so many.
export function ticks(low, high, count = TICKS) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((each) => each >= rough * (1 - 1e-9));
  const [first, last] = [Math.ceil(low / step - 1e-9), Math.floor(high / step + 1e-9)];
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}

// A number for people: no more digits than are wanted, no trailing zeros, a true minus.
export function told(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  let text = String(Number(value.toPrecision(digits)));
  if (Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3)) {
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    text = `${Number(mantissa)}e${Number(power)}`;
  }
  return text.replace(/-/g, "−");
}

// Where a curve goes on a picture, [x, y, x, y, ...]: of neighbours in one column of pixels the first, lowest, highest
// and last.  `place` gives pixels; what is no number, or has no place on the axis, is left out.
export function thinned(x, y, place) {
  const kept = [];
  let column, first, lowest, highest, last, low, high;
  const keep = (row) => row !== undefined && kept.push(place.x(x[row]), place.y(y[row]));
  const keepColumn = () => [...new Set([first, lowest, highest, last])].sort((a, b) => a - b).forEach(keep);
  for (let row = 0; row < x.length; row++) {
    const [pixelX, pixelY] = [place.x(x[row]), place.y(y[row])];
    if (!Number.isFinite(pixelX + pixelY)) continue;
    if (Math.floor(pixelX) !== column) {
      keepColumn();
      column = Math.floor(pixelX);
      first = lowest = highest = row;
      low = high = pixelY;
    }
    if (pixelY < low) [lowest, low] = [row, pixelY];
    if (pixelY > high) [highest, high] = [row, pixelY];
    last = row;
  }
  keepColumn();
  return kept;
}

const colours = {}; // of the page, by name

// Read the colours, as they are on this screen or on paper.
export function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["a", "b", "ghost", "line", "soft", "stick", "event", "cursor"]) colours[name] = style.getPropertyValue(`--${name}`).trim();
}

export class Plot {
  // `host` is the element that it fills; `onSeek(x)` is told where a pointer asks for the cursor.
  constructor(host, onSeek) {
    this.host = host;
    this.curves = host.appendChild(document.createElement("canvas"));
    this.curves.setAttribute("role", "img");
    this.above = host.appendChild(document.createElement("canvas"));
    this.above.setAttribute("aria-hidden", "true");
    this.paints = 0; // how often the curves were drawn
    this.content = this.spot = null;
    this.width = this.height = 0;
    new ResizeObserver(([{ contentRect: { width, height } }]) => { // who asks the host itself has all laid out anew
      Object.assign(this, { width, height });
      this.paint();
    }).observe(host);
    if (onSeek) this.listen(onSeek);
  }

  listen(onSeek) {
    const seek = (event) => {
      const { left, width } = this.host.getBoundingClientRect();
      const { low, high } = this.content.x;
      const share = (event.clientX - left - LEFT) / (width - LEFT - RIGHT);
      onSeek(low + Math.min(Math.max(share, 0), 1) * (high - low));
    };
    this.host.addEventListener("pointerdown", (event) => {
      this.host.setPointerCapture(event.pointerId);
      seek(event);
    });
    this.host.addEventListener("pointermove", (event) => event.buttons && seek(event));
  }

  // content: x and y {low, high, label, log}, curves [{x, y, colour, dash, dots}], bands [[from, to]],
  // marks [{x, label, colour}], and what it shows in words.
  show(content) {
    this.content = content;
    this.curves.setAttribute("aria-label", content.words);
    this.paint();
  }

  // The cursor: x, and points {x, y, colour} on the curves.
  point(spot) {
    this.spot = spot;
    if (!this.content || !this.width) return;
    const { width, height } = this;
    const context = this.ready(this.above);
    const place = this.scales(width, height);
    if (spot.x !== undefined) line(context, colours.cursor, 1, [place.x(spot.x), TOP, place.x(spot.x), height - BOTTOM]);
    for (const { x, y, colour } of spot.points) dot(context, colours[colour], place.x(x), place.y(y), 3.5);
  }

  paint() {
    if (!this.content || !this.width) return;
    this.paints++;
    this.drawn(this.ready(this.curves), this.width, this.height);
    if (this.spot) this.point(this.spot);
  }

  // A canvas of the size of the host, cleared, measured in CSS pixels.
  ready(canvas) {
    const { width, height } = this;
    const scale = devicePixelRatio;
    const [wide, high] = [Math.round(width * scale), Math.round(height * scale)];
    if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
    const context = canvas.getContext("2d");
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    return context;
  }

  scales(width, height) {
    const { x, y } = this.content;
    const raised = y.log ? (value) => (value > 0 ? Math.log10(value) : NaN) : (value) => value;
    const [low, high] = [raised(y.low), raised(y.high)];
    return {
      x: (value) => LEFT + ((value - x.low) / (x.high - x.low)) * (width - LEFT - RIGHT),
      y: (value) => TOP + ((high - raised(value)) / (high - low)) * (height - TOP - BOTTOM),
    };
  }

  // All but the cursor, on any canvas.
  drawn(context, width, height) {
    const { x, y, curves, bands = [], marks = [] } = this.content;
    const place = this.scales(width, height);
    const [right, bottom] = [width - RIGHT, height - BOTTOM];
    context.font = FONT;
    context.lineJoin = "round";
    context.fillStyle = colours.stick;
    for (const [from, to] of bands) context.fillRect(place.x(from), TOP, Math.max(place.x(to) - place.x(from), 0.5), bottom - TOP);
    context.fillStyle = colours.soft;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const value of y.log ? decades(y.low, y.high) : ticks(y.low, y.high)) {
      line(context, colours.line, 1, [LEFT, place.y(value), right, place.y(value)]);
      context.fillText(y.log ? `1e${Math.round(Math.log10(value))}`.replace("-", "−") : told(value), LEFT - 6, place.y(value));
    }
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    for (const value of ticks(x.low, x.high, width < 420 ? 4 : 8)) {
      line(context, colours.line, 1, [place.x(value), TOP, place.x(value), bottom]);
      const text = told(value);
      const half = context.measureText(text).width / 2;
      if (place.x(value) + half < width - context.measureText(x.label).width - 8) context.fillText(text, place.x(value), height - 6);
    }
    context.textAlign = "right";
    context.fillText(x.label, width - 2, height - 6);
    context.save();
    context.beginPath();
    context.rect(LEFT, TOP, right - LEFT, bottom - TOP);
    context.clip();
    for (const curve of curves) this.curve(context, curve, place);
    for (const mark of marks) this.mark(context, mark, place, right, bottom);
    context.restore();
  }

  curve(context, { x, y, colour, dash = [], dots = false, width = 1.6 }, place) {
    const kept = thinned(x, y, place);
    if (dots) {
      for (let i = 0; i < kept.length; i += 2) dot(context, colours[colour], kept[i], kept[i + 1], 2.6);
      return;
    }
    context.setLineDash(dash);
    line(context, colours[colour], width, kept);
    context.setLineDash([]);
  }

  mark(context, { x, label, colour }, place, edge, bottom) {
    line(context, colours[colour], 1, [place.x(x), label ? TOP : bottom - 6, place.x(x), bottom]);
    if (!label) return;
    context.fillStyle = colours[colour];
    const late = place.x(x) + context.measureText(label).width + 6 > edge;
    context.textAlign = late ? "right" : "left";
    context.fillText(label, place.x(x) + (late ? -3 : 3), TOP + 10);
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

// Powers of ten from low to high, not more than six of them.
function decades(low, high) {
  const [first, last] = [Math.ceil(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];
  const every = Math.max(1, Math.ceil((last - first) / TICKS));
  return Array.from({ length: Math.floor((last - first) / every) + 1 }, (_, i) => 10 ** (first + i * every));
}

// Bounds around all values, with some room; powers of ten where the axis is logarithmic.
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
  const room = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
  return { low: low - room, high: high + room };
}
