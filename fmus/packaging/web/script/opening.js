// The opening: one scene with two friction laws, and what each costs.

import { animate, reducedMotion, stopAnimation } from "./animation.js";
import { createFmu, HYBRID, ODE23, SIGN_ODE23, simulate } from "./story_models.js";
import { StoryBlock } from "./story_bodies.js";
import { Chart, gridLines, linearScale, modeCurve, palette, powersOfTen, timeAxis } from "./chart.js";
import { fixedDigits, groupDigits, significant } from "./prose.js";
import { Run } from "./run.js";

const GRID_STEP = 0.005; // s
const POINT_SPACING = 0.002; // s between two points of a curve
const STEPS_PER_SECOND = 13000; // of sign(v), so that they can be watched
const STEPS_PER_FRAME = 420; // at most
const STEP_BINS = 500; // of the diagram of step lengths
const TIME_AFTER_REST = 0.3; // s
const [OPENING_FRICTION, OPENING_STIFFNESS] = [0.5, 157.9]; // N, N/m
const OPENING_RANGE = 0.12; // m
const LONGEST_OPENING = 20; // s
const OPENING_SPEED = 1.3; // m/s, of the friction diagram
const openingElement = (id) => document.getElementById(`opening-${id}`);

// One of the two masses, with its run.
class OpeningLane {
  constructor(key, fmu, values, handlers) {
    Object.assign(this, { fmu, values, sticks: key === "true", points: [], ends: [], bins: new Float64Array(2 * STEP_BINS) });
    this.count = openingElement(`${key}-count`);
    this.clock = openingElement(`${key}-clock`);
    const name = this.sticks ? "Mass with true sticking" : "Mass with sign(v)";
    this.body = new StoryBlock(openingElement(`${key}-body`), { range: OPENING_RANGE, step: 0.005, name: `${name}: drag it, or press the arrow keys and then Enter`, handlers,
      describe: (x, stuck) => `${fixedDigits(1000 * x, 1)} millimetres, ${stuck ? "holds" : "slips"}` });
    this.body.showBand(OPENING_FRICTION / OPENING_STIFFNESS, this.sticks ? "friction can hold the spring within ±3.2 mm" : "");
  }

  start(x0, stop) {
    this.run = new Run(this.fmu, { values: { ...this.values, x0 }, stop, points: Math.round(stop / GRID_STEP), changes: [] });
    this.run.begin();
    Object.assign(this, { stop, points: [], ends: [], bins: new Float64Array(2 * STEP_BINS), recordedRows: 0, recordedSteps: 0, steps: 0, milliseconds: 0 });
    this.record();
  }

  // Advance to time t in s, by at most `maxSteps` steps.
  advance(t, maxSteps) {
    const { run } = this;
    const begin = performance.now();
    for (let n = 0; n < maxSteps && !run.done && run.t < t; n++) run.step();
    this.milliseconds += performance.now() - begin;
    this.steps = this.fmu.readCounts()[0];
    this.record();
  }

  // Record what the charts show of the new rows of the run.
  record() {
    const { run, points, bins } = this;
    const { x, v, mode, F_friction } = run.columns;
    for (; this.recordedRows < run.time.length; this.recordedRows++) {
      const i = this.recordedRows;
      const t = run.time[i];
      const stuck = this.sticks && mode[i] === 0;
      const last = points.at(-1);
      this.now = { t, x: x[i], v: v[i], F: F_friction[i], stuck };
      if (!last || t - last.t >= POINT_SPACING || last.stuck !== stuck || t === this.stop) points.push(this.now);
    }
    for (; this.recordedSteps < run.ends.length; this.recordedSteps++) {
      const row = run.ends[this.recordedSteps];
      if (!row) continue;
      const [t, h] = [run.time[row], run.time[row] - run.time[run.ends[this.recordedSteps - 1]]];
      if (this.ends.length < 600) this.ends.push({ t, h, stuck: this.sticks && mode[row - 1] === 0 });
      const bin = Math.min(Math.floor((t / this.stop) * STEP_BINS), STEP_BINS - 1);
      bins[2 * bin] = Math.min(bins[2 * bin] || Infinity, h);
      bins[2 * bin + 1] = Math.max(bins[2 * bin + 1], h);
    }
  }

  show() {
    const { now, run } = this;
    this.body.moveTo(now.x, now.stuck);
    this.count.textContent = groupDigits(this.steps);
    const state = now.stuck ? "at rest" : run.done ? "still slips" : "slipping";
    this.clock.textContent = `t = ${fixedDigits(now.t, 2)} s, ${state}`;
  }
}

// Fill the opening; it plays once when it comes into view.
export async function showOpening(session) {
  const [first, second] = await Promise.all([createFmu(session, "coulomb"), createFmu(session, "coulomb")]);
  let x0 = 0.1;
  let stop = 4.3;
  let t = 0;
  let isDragged = false;
  const handlers = {
    grab() {
      stopAnimation(advanceFrame);
      isDragged = true;
    },
    // While a mass is held, the charts show what it would do when released, on the scales they have.
    move(x) {
      x0 = x;
      exact.start(x0, stop);
      exact.advance(stop, 1e6);
      sign.start(x0, stop);
      for (const lane of lanes) {
        lane.body.moveTo(x, Math.abs(x) <= OPENING_FRICTION / OPENING_STIFFNESS);
        lane.count.textContent = groupDigits(lane.steps);
        lane.clock.textContent = "held";
      }
      const end = exact.run.restTime();
      const where = `${fixedDigits(1000 * Math.abs(exact.now.x), 1)} mm off centre`;
      openingElement("verdict").textContent = end === 0 ? `Let go here, and it stays: ${where}, friction holds the spring.`
        : end === undefined ? "Let go, and it slips to and fro." : `Let go, and it stops after ${fixedDigits(end, 2)} s, ${where}.`;
      paint();
    },
    drop() {
      isDragged = false;
      start();
      play();
    },
  };
  const exact = new OpeningLane("true", first, HYBRID, handlers);
  const sign = new OpeningLane("sign", second, { ...SIGN_ODE23, ...ODE23 }, handlers);
  const lanes = [exact, sign];

  // Set both to the start; the scene ends a little after the mass that sticks has come to rest.
  function start() {
    stop = Math.round(10 * (simulate(first, { ...HYBRID, x0 }, LONGEST_OPENING, 0).restTime() + TIME_AFTER_REST)) / 10;
    t = 0;
    for (const lane of lanes) {
      lane.start(x0, stop);
      lane.show();
    }
    describeResult();
    paint();
  }

  function advanceFrame(elapsed) {
    t = Math.min(t + elapsed, stop);
    exact.advance(t, STEPS_PER_FRAME);
    sign.advance(t, Math.min(STEPS_PER_FRAME, Math.ceil(STEPS_PER_SECOND * elapsed)));
    if (isDragged) return false;
    for (const lane of lanes) lane.show();
    paint();
    const isRunning = lanes.some((lane) => !lane.run.done);
    if (!isRunning) describeResult();
    openingElement("replay").textContent = isRunning ? "Start again" : "Play it again";
    return isRunning;
  }

  function play() {
    if (reducedMotion.matches) settle();
    else animate(advanceFrame);
  }

  // Run to the end in slices without drawing, for readers who prefer reduced motion.
  function settle() {
    if (isDragged) return;
    t = stop;
    exact.advance(stop, 1e6);
    sign.advance(stop, 3000);
    if (lanes.some((lane) => !lane.run.done)) return void setTimeout(settle);
    for (const lane of lanes) lane.show();
    describeResult();
    paint();
  }

  function describeResult() {
    const done = lanes.every((lane) => lane.run?.done);
    if (!done) {
      openingElement("verdict").textContent = "The lower mass has no way to stand still. Watch its counter when the upper one stops.";
      return;
    }
    const off = 1000 * Math.abs(sign.now.x - exact.now.x);
    const last = sign.points.filter((point) => point.t > stop - 0.2);
    const creep = (1e6 * Math.abs(last.at(-1).x - last[0].x)) / (last.at(-1).t - last[0].t);
    const slowed = reducedMotion.matches ? "." : "; the counters are slowed down so that you can watch.";
    openingElement("verdict").textContent = `The same ${fixedDigits(stop, 1)} s: ${groupDigits(exact.steps)} step${exact.steps === 1 ? "" : "s"} against ${groupDigits(sign.steps)}. ` +
      `The lower mass ${off > 0.01 ? `ends ${significant(off, 2)} mm from where it should, and ` : ""}still creeps at ${significant(creep, 2)} µm/s. ` +
      (sign.milliseconds > 0 ? `This machine needed ${significant(exact.milliseconds, 1)} and ${significant(sign.milliseconds, 2)} ms${slowed}` : "");
  }

  // ---- charts

  const overview = new Chart(openingElement("overview"), (chart) => {
    const [left, right, top] = [46, chart.w - 20, 20];
    const x = linearScale(0, stop, left, right);
    const upper = top + (chart.h - top) * 0.4;
    const ribbon = upper + 10;
    const y = linearScale(-OPENING_RANGE * 1000, OPENING_RANGE * 1000, upper, top);
    const h = linearScale(-6, 0, chart.h - 26, ribbon + 54);
    chart.text("position, mm", 0, 8, { colour: palette.ink });
    gridLines(chart, y, [-100, 0, 100], left, right, (value) => fixedDigits(value, 0));
    chart.clipped(left, top - 4, right - left, chart.h, () => {
      chart.box(left, y(3.167), right - left, y(-3.167) - y(3.167), palette.hold);
      for (const lane of [sign, exact]) {
        modeCurve(chart, lane.points.length, (i) => [x(lane.points[i].t), y(1000 * lane.points[i].x)], (i) => lane.points[i].stuck, lane.sticks ? 2 : 1.25);
      }
    });
    // the ribbons
    for (const [i, lane] of lanes.entries()) {
      const place = ribbon + 10 * i;
      chart.box(left, place, right - left, 7, palette.line, 0.6);
      for (let j = 0; j + 1 < lane.points.length; ) {
        const from = lane.points[j];
        while (j + 1 < lane.points.length && lane.points[j].stuck === from.stuck) j++;
        chart.box(x(from.t), place, x(lane.points[j].t) - x(from.t), 7, from.stuck ? palette.stick : palette.slip);
      }
      chart.text(lane.sticks ? "true" : "sign(v)", left - 6, place + 4, { align: "right", size: 11, halo: false });
    }
    chart.text("length of each solver step", 0, ribbon + 38, { colour: palette.ink });
    const [values, labels] = powersOfTen([0, -2, -4, -6]);
    gridLines(chart, (value) => h(Math.log10(value)), values, left, right, labels);
    for (const { t: to, h: size, stuck } of exact.ends) {
      const colour = stuck ? palette.stick : palette.slip;
      chart.line([[x(to - size), h(Math.log10(size))], [x(to), h(Math.log10(size))]], colour, 2);
      chart.dot(x(to), h(Math.log10(size)), 3, colour);
    }
    let previous = null;
    for (let i = 0; i < STEP_BINS; i++) {
      const [least, most] = [sign.bins[2 * i], sign.bins[2 * i + 1]];
      if (!most) continue;
      const place = x(((i + 0.5) / STEP_BINS) * stop);
      const [low, high] = [h(Math.log10(least)), h(Math.log10(most))];
      if (previous) chart.line([previous, [place, high]], palette.slip, 1);
      chart.box(place - 0.7, high - 0.7, Math.max(1.4, (right - left) / STEP_BINS + 0.5), low - high + 1.4, palette.slip);
      previous = [place, low];
    }
    chart.text(exact.steps === 1 ? "true sticking: one step" : "true sticking: a step for each half-swing, one for the rest", x(0.02 * stop), h(-0.6) + 10, { colour: palette.ink, size: 11.5 });
    if (sign.ends.length > 20 && stop > 3) chart.text("sign(v): tiny at every turn", x(0.02 * stop), h(-5.2), { colour: palette.slip, size: 11.5 });
    const end = stop - TIME_AFTER_REST; // about where the true mass stops
    if (end > 2.5 && sign.now?.t > end + 0.1) chart.text("here it should stop: 10 µs", x(end) - 6, h(-5.2), { colour: palette.slip, size: 11.5, align: "right" });
    timeAxis(chart, x, 0, stop, chart.h - 24);
  });

  const zoom = new Chart(openingElement("zoom"), (chart) => {
    const [left, right, top, bottom] = [34, chart.w - 16, 20, chart.h - 26];
    const from = Math.max(0, stop - 0.8);
    const x = linearScale(from, stop, left, right);
    const y = linearScale(-8, 8, bottom, top);
    chart.text(`the last ${fixedDigits(stop - from, 1)} s, position in mm`, 0, 8, { colour: palette.ink });
    chart.box(left, y(3.167), right - left, y(-3.167) - y(3.167), palette.hold);
    gridLines(chart, y, [-5, 0, 5], left, right, (value) => fixedDigits(value, 0));
    chart.text("friction can hold: ±f/k", right - 8, y(3.167) + 11, { align: "right", size: 11.5, halo: false, colour: palette.stick });
    chart.clipped(left, top, right - left, bottom - top, () => {
      for (const lane of [sign, exact]) {
        modeCurve(chart, lane.points.length, (i) => [x(lane.points[i].t), y(1000 * lane.points[i].x)], (i) => lane.points[i].stuck, lane.sticks ? 2.5 : 1.5);
      }
    });
    for (const { now, sticks } of [sign, exact]) if (now && now.t > from) chart.dot(x(now.t), y(1000 * now.x), 4, now.stuck ? palette.stick : palette.slip, !sticks);
    if (exact.run?.done) chart.text("holds", right - 10, y(1000 * exact.now.x) - 10, { align: "right", colour: palette.stick, halo: false });
    if (exact.run?.done && sign.now.t > stop - 0.28) chart.text("sign(v) creeps", right - 10, y(1000 * sign.now.x) + 14, { align: "right", colour: palette.slip });
    timeAxis(chart, x, from, stop, chart.h - 24);
  });

  const law = new Chart(openingElement("law"), (chart) => {
    const [left, right, top, bottom] = [34, chart.w - 6, 20, chart.h - 26];
    const x = linearScale(-OPENING_SPEED * 1.1, OPENING_SPEED * 1.1, left, right);
    const y = linearScale(-0.75, 0.75, bottom, top);
    chart.text("friction in N over slip speed", 0, 8, { colour: palette.ink });
    gridLines(chart, y, [-0.5, 0, 0.5], left, right);
    chart.line([[left, y(-0.5)], [x(0), y(-0.5)]], palette.slip, 2);
    chart.line([[x(0), y(0.5)], [right, y(0.5)]], palette.slip, 2);
    chart.line([[x(0), y(-0.5)], [x(0), y(0.5)]], palette.stick, 4);
    chart.text("holds what", x(0) - 8, y(0) - 19, { colour: palette.stick, align: "right" });
    chart.text("is needed", x(0) - 8, y(0) - 5, { colour: palette.stick, align: "right" });
    chart.text("slips: f", right - 4, y(0.5) - 10, { colour: palette.slip, align: "right" });
    if (sign.now) chart.dot(x(sign.now.v), y(sign.now.F), 6, palette.slip, true);
    if (exact.now) chart.dot(x(exact.now.v), y(exact.now.F), 5, exact.now.stuck ? palette.stick : palette.slip);
    if (exact.now?.stuck) chart.text(`true: ${fixedDigits(exact.now.F, 2)} N`, x(0) + 11, y(exact.now.F), { colour: palette.stick });
    if (exact.now?.stuck && sign.now.t > 0 && Math.abs(sign.now.v) < 0.01) chart.text(`sign(v): ${fixedDigits(sign.now.F, 2)} N`, x(0) - 11, y(sign.now.F) - 11, { colour: palette.slip, align: "right" });
    for (const speed of [-1, 0, 1]) chart.text(speed === 1 ? "1 m/s" : fixedDigits(speed, 0), x(speed), chart.h - 11, { align: "center", size: 11 });
  });
  const paint = () => [overview, zoom, law].forEach((chart) => chart.paint());

  start();
  openingElement("replay").addEventListener("click", () => {
    start();
    play();
  });
  openingElement("replay").disabled = false;
  new IntersectionObserver(([{ isIntersecting }], observer) => { // plays once, when it is first in view
    if (!isIntersecting) return;
    observer.disconnect();
    play();
  }).observe(openingElement("true-body"));
  return { lanes };
}
