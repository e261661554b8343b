// A map over sliding friction and speed of the driver: how often the body slips. Computed in small slices.

import { formatNumber, ticks } from "./plot.js";
import { Run } from "./run.js";
import { effectiveValues, findVariable } from "./state.js";

const [COLUMNS, ROWS] = [54, 36];
const MAP_SLICE = 6; // ms of computing per frame
const STRIDE = 6; // every sixth cell comes first, so that the whole picture appears soon
const [SPEED, FRICTION, LIMIT] = ["v_driver", "mu_d", "mu_s"]; // variables: axes, and the largest sliding friction
const RANGE = 3; // of the speed, in start values
const MARGIN = { left: 48, right: 12, top: 10, bottom: 38 }; // px
const [PALEST, DARKEST] = [0.08, 0.95]; // opacity of one slip and of the most slips

export class FrictionMap {
  // Draws on a canvas; `onPick(values)` takes the values of a cell, `describe(text)` shows a sentence.
  constructor(session, canvas, onPick, describe) {
    Object.assign(this, { session, canvas, onPick, describe, key: "", counts: [], order: [], isVisible: false, isRunning: false });
    new IntersectionObserver(([{ isIntersecting }]) => {
      this.isVisible = isIntersecting;
      this.resume();
    }).observe(canvas);
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener("click", (event) => {
      const cell = this.cellAt(event.offsetX, event.offsetY);
      if (cell !== null) this.onPick(this.valuesOf(cell));
    });
    canvas.addEventListener("pointermove", (event) => this.describeCell(this.cellAt(event.offsetX, event.offsetY)));
    canvas.addEventListener("pointerleave", () => this.describeCell(null));
  }

  get isComplete() {
    return this.counts.length > 0 && !this.order.length;
  }

  // Whether a model has a map.
  static suits({ bodies, variables }) {
    return Boolean(bodies[0].mode && bodies[0].driver) && [SPEED, FRICTION, LIMIT].every((name) => variables.some((variable) => variable.name === name));
  }

  // Show the map for a state: its values from the start, with true sticking.
  show(state) {
    const modelInfo = this.session.models.get(state.model);
    const all = Object.entries(effectiveValues(modelInfo, state.values)).filter(([name]) => name !== "friction" && !name.startsWith("solver."));
    const { [SPEED]: speed, [FRICTION]: friction, ...values } = Object.fromEntries(all);
    const highest = RANGE * Math.abs(findVariable(modelInfo, SPEED).start);
    const key = JSON.stringify([state.model, state.stop, values]);
    Object.assign(this, { modelInfo, speed, friction, highest, stop: state.stop, values });
    if (key !== this.key) Object.assign(this, { key, counts: new Array(COLUMNS * ROWS).fill(null), order: interlaced(COLUMNS * ROWS) });
    this.draw();
    this.resume();
  }

  hide() {
    Object.assign(this, { key: "", counts: [], order: [] });
  }

  // The values in the middle of a cell, with three digits.
  valuesOf(cell) {
    const [column, row] = [cell % COLUMNS, Math.floor(cell / COLUMNS)];
    const round = (value) => Number(value.toPrecision(3));
    return { [SPEED]: round((this.highest * (column + 0.5)) / COLUMNS), [FRICTION]: round((this.values[LIMIT] * (row + 0.5)) / ROWS) };
  }

  resume() {
    if (this.isRunning || !this.isVisible || !this.order.length) return;
    this.isRunning = true;
    requestAnimationFrame(() => this.computeSlice());
  }

  computeSlice() {
    const end = performance.now() + MAP_SLICE;
    if (this.session.done) { // the run itself comes first
      while (this.order.length && performance.now() < end) {
        const cell = this.order.shift();
        this.counts[cell] = this.countSlips(cell);
      }
      this.draw();
    }
    this.isRunning = false;
    this.resume();
  }

  // How often the body starts to slip; NaN if the run fails.
  countSlips(cell) {
    const run = new Run(this.session.fmu(this.modelInfo.name, "map"), { values: { ...this.values, ...this.valuesOf(cell) }, changes: [], stop: this.stop, points: 0 });
    run.advance();
    return run.failure ? NaN : run.countSlips(this.modelInfo.bodies[0].mode);
  }

  // The cell at a point of the canvas; null beside the map.
  cellAt(px, py) {
    const { clientWidth, clientHeight } = this.canvas;
    const [column, row] = [(px - MARGIN.left) / (clientWidth - MARGIN.left - MARGIN.right), 1 - (py - MARGIN.top) / (clientHeight - MARGIN.top - MARGIN.bottom)];
    if (!this.key || column < 0 || column >= 1 || row < 0 || row >= 1) return null;
    return Math.floor(column * COLUMNS) + COLUMNS * Math.floor(row * ROWS);
  }

  describeCell(cell) {
    if (!this.key) return;
    const known = this.counts.filter(Number.isFinite);
    const slips = (count) => `${count} ${count === 1 ? "slip" : "slips"}`;
    const progress = known.length < this.counts.length ? ` Computed: ${Math.floor((100 * known.length) / this.counts.length)} %.` : "";
    if (cell === null || !Number.isFinite(this.counts[cell])) {
      const [least, most] = [Math.min(...known), Math.max(...known)];
      const range = known.length ? `from ${least} to ${slips(most)} in ${formatNumber(this.stop)} s` : "";
      const still = least === 0 ? " In the area of one colour at the left it never slips." : "";
      return this.describe(`The stronger the colour, the more slips: ${range}.${still}${progress}`);
    }
    const values = Object.entries(this.valuesOf(cell)).map(([name, value]) => `${name} = ${formatNumber(value)} ${findVariable(this.modelInfo, name).display_unit}`.trim());
    this.describe(`${values.join(", ")}: ${slips(this.counts[cell])}.${progress}`);
  }

  draw() {
    const { canvas, counts } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!this.key || !width) return;
    this.describeCell(null);
    const ratio = Math.min(devicePixelRatio || 1, 3);
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const style = getComputedStyle(canvas);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    const [innerWidth, innerHeight] = [width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom];
    const x = (speed) => MARGIN.left + (speed / this.highest) * innerWidth;
    const y = (friction) => MARGIN.top + (1 - friction / this.values[LIMIT]) * innerHeight;
    const most = counts.reduce((largest, count) => Math.max(largest, count || 0), 1);
    const edge = (index, count, from, size) => Math.round(ratio * (from + (index / count) * size)) / ratio; // on pixels: no seams
    counts.forEach((count, cell) => {
      if (!(count >= 0) || count === null) return;
      const [column, row] = [cell % COLUMNS, ROWS - 1 - Math.floor(cell / COLUMNS)];
      const [left, top] = [edge(column, COLUMNS, MARGIN.left, innerWidth), edge(row, ROWS, MARGIN.top, innerHeight)];
      context.fillStyle = colour(count ? "slip" : "stick");
      context.globalAlpha = count ? PALEST + ((DARKEST - PALEST) * count) / most : 1;
      context.fillRect(left, top, edge(column + 1, COLUMNS, MARGIN.left, innerWidth) - left, edge(row + 1, ROWS, MARGIN.top, innerHeight) - top);
    });
    context.globalAlpha = 1;
    context.fillStyle = colour("soft");
    context.strokeStyle = colour("edge");
    context.font = "11px system-ui, sans-serif";
    context.strokeRect(MARGIN.left, MARGIN.top, innerWidth, innerHeight);
    const { factor, display_unit } = findVariable(this.modelInfo, SPEED);
    context.textAlign = "center";
    for (const value of ticks(0, this.highest * factor, 5)) context.fillText(formatNumber(value), x(value / factor), height - MARGIN.bottom + 15);
    context.fillText(`${SPEED} in ${display_unit}`, MARGIN.left + innerWidth / 2, height - 6);
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const value of ticks(0, this.values[LIMIT], 5)) context.fillText(formatNumber(value), MARGIN.left - 5, y(value));
    context.save();
    context.translate(10, MARGIN.top + innerHeight / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = "center";
    context.fillText(FRICTION, 0, 0);
    context.restore();
    if (this.speed < 0 || this.speed > this.highest || this.friction > this.values[LIMIT]) return;
    for (const [line, size] of [[colour("paper"), 5], [colour("ink"), 2]]) {
      [context.strokeStyle, context.lineWidth] = [line, size];
      context.beginPath();
      context.arc(x(this.speed), y(this.friction), 7, 0, 2 * Math.PI);
      context.stroke();
    }
  }
}

// The numbers below `count`: every sixth first, then those between.
function interlaced(count) {
  const order = [];
  for (let first = 0; first < STRIDE; first++) {
    for (let cell = first; cell < count; cell += STRIDE) order.push(cell);
  }
  return order;
}
