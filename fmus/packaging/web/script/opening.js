// The opening: one scene with two friction laws and the same solver, and what each law costs.

import { animate, reducedMotion, stopAnimation } from "./animation.js";
import { cancelTask, runInBackground } from "./background.js";
import { createFmu, HYBRID, ode23, positionAt, SIGN, simulate, startValues, SteppedRun } from "./story_models.js";
import { StoryBlock } from "./story_bodies.js";
import { makeAdjustable } from "./adjustable.js";
import { Chart, gridLines, linearScale, modeCurve, palette, timeAxis } from "./chart.js";
import { formatPower } from "./numbers.js";
import { countOf, fixedDigits, groupDigits, powerOfTen, significant, withUnit } from "./prose.js";

const GRID_STEP = 0.005; // s
const POINT_SPACING = 0.002; // s between two points of a curve
const STEPS_PER_SECOND = 13000; // of sign(v), so that they can be watched
const STEPS_PER_FRAME = 420; // at most
const SETTLED_SPACING = 3000; // steps between two looks at the clock
const SPEED_BINS = 300; // of the diagram of speeds
const TIME_AFTER_REST = 0.3; // s
const CREEP_TIME = 0.2; // s before the end
const CLOSE_UP = 0.8; // s before the end
const OPENING_RANGE = 0.12; // m
const LONGEST_OPENING = 20; // s
const OPENING_SPEED = 1.3; // m/s, of the friction diagram
const [FINEST_SPEED, FASTEST_SPEED] = [-9, 0.3]; // powers of ten of m/s, of the diagram of speeds
const MOST_STEPS = 6; // power of ten, of the diagram of steps
const openingElement = (id) => document.getElementById(`opening-${id}`);
const openingOutput = (name) => document.querySelector(`#opening output[data-out=${name}]`);

// One of the two masses, with its run.
class OpeningLane {
  constructor(key, fmu, law, handlers, { f, k }) {
    Object.assign(this, { key, fmu, law, sticks: law === HYBRID });
    this.count = openingElement(`${key}-count`);
    this.clock = openingElement(`${key}-clock`);
    const name = this.sticks ? "Mass with true sticking" : "Mass with sign(v)";
    this.body = new StoryBlock(openingElement(`${key}-body`), { range: OPENING_RANGE, step: 0.005, name: `${name}: drag it, or press the arrow keys and then Enter`, handlers,
      describe: (x, stuck) => `${fixedDigits(1000 * x, 1)} millimetres, ${stuck ? "holds" : "slips"}` });
    this.body.showBand(f / k, this.sticks ? `friction can hold the spring within ±${fixedDigits((1000 * f) / k, 1)} mm` : "");
  }

  start(x0, stop, rtol) {
    this.run = new SteppedRun(this.fmu, { ...this.law, ...ode23(rtol), x0 }, stop, GRID_STEP);
    Object.assign(this, { stop, points: [], speeds: new Float64Array(2 * SPEED_BINS), rest: undefined, creepStart: undefined, milliseconds: 0 });
    this.record();
  }

  // Advance to time t in s, by at most `maxSteps` communication steps or up to the deadline in ms.
  advance(t, maxSteps, deadline = Infinity) {
    const { run } = this;
    const begin = performance.now();
    for (let n = 1; n <= maxSteps && run.t < t; n++) {
      run.step();
      this.record();
      if (n % SETTLED_SPACING === 0 && performance.now() > deadline) break;
    }
    this.milliseconds += performance.now() - begin;
  }

  // Record what the charts show of the present point.
  record() {
    const { run, points, speeds, stop } = this;
    const { t, x, v } = run;
    const stuck = this.sticks && run.mode === 0;
    const last = points.at(-1);
    if (!stuck) this.rest = undefined;
    else this.rest ??= t;
    if (t >= stop - CREEP_TIME - 1e-9) this.creepStart ??= { t, x };
    if (!last || t - last.t >= POINT_SPACING || last.stuck !== stuck || t === stop) points.push({ t, x, stuck, steps: run.steps });
    const bin = Math.min(Math.floor(((t - stop + CLOSE_UP) / CLOSE_UP) * SPEED_BINS), SPEED_BINS - 1);
    if (bin < 0 || v === 0) return;
    speeds[2 * bin] = Math.min(speeds[2 * bin] || Infinity, Math.abs(v));
    speeds[2 * bin + 1] = Math.max(speeds[2 * bin + 1], Math.abs(v));
  }

  get stuck() {
    return this.rest !== undefined;
  }

  // The mean speed at the end, in m/s.
  get creep() {
    return Math.abs(this.run.x - this.creepStart.x) / (this.run.t - this.creepStart.t);
  }

  show(closedForm) {
    const { key, run, stuck } = this;
    this.body.moveTo(run.x, stuck);
    this.count.textContent = groupDigits(run.steps);
    const state = stuck ? "at rest" : run.t === 0 ? "released" : run.v === 0 ? "does not move" : run.done ? "still slips" : "slips";
    this.clock.textContent = `t = ${fixedDigits(run.t, 2)} s, ${state}`;
    const texts = {
      off: withUnit(Math.abs(run.x - positionAt(closedForm, run.t)), 2, "m"),
      speed: withUnit(Math.abs(run.v), 2, "m/s"),
      spring: `${fixedDigits(Math.abs(run.F_spring), 2)} N`,
      friction: `${fixedDigits(Math.abs(run.F_friction), 2)} N`,
      mode: stuck ? `at rest since ${fixedDigits(this.rest, 2)} s` : state,
      time: this.milliseconds ? `${significant(this.milliseconds, 1)} ms` : "–",
    };
    for (const [name, text] of Object.entries(texts)) openingOutput(`${key}-${name}`).textContent = text;
  }
}

// Fill the opening; it plays once when it comes into view.
export async function showOpening(session) {
  const [first, second, third, fourth] = await Promise.all(Array.from({ length: 4 }, () => createFmu(session, "coulomb")));
  const start = startValues(session, "coulomb");
  const { k } = start;
  const band = start.f / k; // m, in which friction holds the spring
  let x0 = start.x0;
  let stop = 0;
  let t = 0;
  let isDragged = false;
  let closedForm = null; // the same motion by the default method
  const handlers = {
    grab() {
      stopAnimation(advanceFrame);
      cancelTask("opening");
      isDragged = true;
    },
    // While a mass is held, the charts show what it would do when released, on the scales they have.
    move(x) {
      x0 = x;
      closedForm = simulate(third, { ...HYBRID, x0 }, stop, Math.round(stop / GRID_STEP));
      for (const lane of lanes) {
        lane.start(x0, stop, rtol());
        if (lane.sticks) lane.advance(stop, 1e6);
        lane.body.moveTo(x, Math.abs(x) <= band);
        lane.count.textContent = groupDigits(lane.run.steps);
        lane.clock.textContent = "held";
      }
      const rest = closedForm.restTime();
      const where = `${fixedDigits(1000 * Math.abs(closedForm.columns.x.at(-1)), 1)} mm off centre`;
      openingElement("verdict").textContent = rest === 0 ? `Let go here, and friction holds the spring: the upper mass stays, ${where}.`
        : rest === undefined ? "Let go, and it slips to and fro." : `Let go, and the upper mass stops after ${fixedDigits(rest, 2)} s, ${where}.`;
      paint();
    },
    drop() {
      isDragged = false;
      begin();
      play();
    },
  };
  const exact = new OpeningLane("true", first, HYBRID, handlers, start);
  const sign = new OpeningLane("sign", second, SIGN, handlers, start);
  const lanes = [exact, sign];
  const tolerance = makeAdjustable(document.querySelector("#opening .rtol"), powerOfTen, () => {
    stopAnimation(advanceFrame);
    begin();
    settle();
  });
  const rtol = () => 10 ** tolerance.value;

  // The time at which the scene ends: a little after the mass that sticks has come to rest.
  function sceneEnd(x0) {
    return Math.round(10 * (simulate(third, { ...HYBRID, x0 }, LONGEST_OPENING, 0).restTime() + TIME_AFTER_REST)) / 10;
  }

  // Set both to the start.
  function begin() {
    stop = sceneEnd(x0);
    closedForm = simulate(third, { ...HYBRID, x0 }, stop, Math.round(stop / GRID_STEP));
    t = 0;
    cancelTask("opening");
    for (const lane of lanes) lane.start(x0, stop, rtol());
    show();
  }

  function show() {
    for (const lane of lanes) lane.show(closedForm);
    describeResult();
    paint();
  }

  function advanceFrame(elapsed) {
    t = Math.min(t + elapsed, stop);
    exact.advance(t, STEPS_PER_FRAME);
    sign.advance(t, Math.min(STEPS_PER_FRAME, Math.ceil(STEPS_PER_SECOND * elapsed)));
    if (isDragged) return false;
    show();
    const isRunning = lanes.some(({ run }) => !run.done);
    openingElement("replay").textContent = isRunning ? "Start again" : "Play it again";
    return isRunning;
  }

  function play() {
    if (reducedMotion.matches) settle();
    else animate(advanceFrame);
  }

  // Run to the end as fast as possible, for readers who prefer reduced motion or change the tolerance.
  function settle() {
    t = stop;
    runInBackground("opening", (deadline) => {
      exact.advance(stop, 1e6);
      sign.advance(stop, Infinity, deadline);
      show();
      return sign.run.done;
    });
  }

  function describeResult() {
    if (lanes.some(({ run }) => !run.done)) {
      openingElement("verdict").textContent = "Watch the lower counter when the upper mass stops.";
      return;
    }
    const rests = exact.stuck ? ` and rests ${exact.rest === 0 ? "from the start" : `from ${fixedDigits(exact.rest, 2)} s on`}` : "";
    const moves = sign.run.v === 0 ? "" : `, and still moves at ${withUnit(sign.creep, 2, "m/s")} on average`;
    openingElement("verdict").textContent = `In the same ${fixedDigits(stop, 1)} s, true sticking takes ${countOf(exact.run.steps, "step")}${rests}; sign(v) takes ${groupDigits(sign.run.steps)}${moves}.`;
  }

  // Compare both laws at two tolerances, in the default scene, and the default method.
  function compareTolerances() {
    const end = sceneEnd(start.x0);
    const reference = simulate(third, { ...HYBRID, x0: start.x0 }, end, 0);
    openingOutput("closed-form-steps").textContent = groupDigits(reference.counts["solver.steps"]);
    const cases = [["coarse", "true", -3], ["coarse", "sign", -3], ["fine", "true", -4], ["fine", "sign", -4]];
    let run = null;
    runInBackground("tolerances", (deadline) => {
      const [accuracy, key, exponent] = cases[0];
      run ??= new SteppedRun(fourth, { ...(key === "true" ? HYBRID : SIGN), ...ode23(10 ** exponent), x0: start.x0 }, end);
      for (let n = 1; !run.done; n++) {
        run.step();
        if (n % SETTLED_SPACING === 0 && performance.now() > deadline) return false;
      }
      openingOutput(`${accuracy}-${key}-steps`).textContent = groupDigits(run.steps);
      openingOutput(`${accuracy}-${key}-off`).textContent = significant(1000 * Math.abs(run.x - reference.columns.x.at(-1)), 2);
      run = null;
      cases.shift();
      if (!cases.length) openingElement("accuracy").classList.remove("pending");
      return !cases.length;
    });
  }

  // ---- charts

  const overview = new Chart(openingElement("overview"), (chart) => {
    const [left, right, top] = [46, chart.w - 20, 20];
    const x = linearScale(0, stop, left, right);
    const upper = top + (chart.h - top) * 0.36;
    const ribbon = upper + 10;
    const y = linearScale(-OPENING_RANGE * 1000, OPENING_RANGE * 1000, upper, top);
    const count = linearScale(0, MOST_STEPS, chart.h - 26, ribbon + 54);
    chart.text("position, mm", 0, 8, { colour: palette.ink });
    gridLines(chart, y, [-100, 0, 100], left, right, (value) => fixedDigits(value, 0));
    chart.clipped(left, top - 4, right - left, chart.h, () => {
      chart.box(left, y(1000 * band), right - left, y(-1000 * band) - y(1000 * band), palette.hold);
      for (const { points, sticks } of [sign, exact]) modeCurve(chart, points.length, (i) => [x(points[i].t), y(1000 * points[i].x)], (i) => points[i].stuck, sticks ? 2 : 1.25);
    });
    for (const [i, { points, sticks }] of lanes.entries()) { // the ribbons
      const place = ribbon + 10 * i;
      chart.box(left, place, right - left, 7, palette.line, 0.6);
      for (let j = 0; j + 1 < points.length; ) {
        const from = points[j];
        while (j + 1 < points.length && points[j].stuck === from.stuck) j++;
        chart.box(x(from.t), place, x(points[j].t) - x(from.t), 7, from.stuck ? palette.stick : palette.slip);
      }
      chart.text(sticks ? "true" : "sign(v)", left - 6, place + 4, { align: "right", size: 11, halo: false });
    }
    chart.text("solver steps so far", 0, ribbon + 38, { colour: palette.ink });
    gridLines(chart, count, [0, 2, 4, 6], left, right, (exponent) => (exponent < 3 ? String(10 ** exponent) : formatPower(exponent)));
    for (const { points, sticks, run } of [sign, exact]) {
      modeCurve(chart, points.length, (i) => [x(points[i].t), count(Math.log10(Math.max(points[i].steps, 1)))], (i) => points[i].stuck, sticks ? 2.5 : 1.25);
      const shown = `${sticks ? "true sticking" : "sign(v)"}: ${groupDigits(run.steps)}`;
      chart.label(shown, right - 4, count(Math.log10(Math.max(run.steps, 1))) + (sticks ? 16 : -14), { align: "right", key: run.fmu, size: 11.5, colour: points.at(-1).stuck ? palette.stick : palette.slip });
    }
    timeAxis(chart, x, 0, stop, chart.h - 24);
  });

  // A logarithmic axis has no zero, so that zero has a line of its own below it.
  const speed = new Chart(openingElement("speed"), (chart) => {
    const [left, right, top, zero] = [46, chart.w - 16, 20, chart.h - 40];
    const from = Math.max(0, stop - CLOSE_UP);
    const x = linearScale(from, stop, left, right);
    const y = linearScale(FINEST_SPEED, FASTEST_SPEED, zero - 22, top);
    chart.text(`speed in the last ${fixedDigits(stop - from, 1)} s`, 0, 8, { colour: palette.ink });
    gridLines(chart, y, [-9, -6, -3, 0], left, right, (exponent) => withUnit(10 ** exponent, 1, "m/s"));
    gridLines(chart, () => zero, [0], left, right, () => "0");
    const binWidth = (right - left) / SPEED_BINS;
    for (const { speeds, sticks, points } of [sign, exact]) {
      const middle = [];
      chart.clipped(left, top - 6, right - left, zero - top, () => {
        for (let i = 0; i < SPEED_BINS; i++) {
          if (!speeds[2 * i + 1]) continue;
          const [low, high] = [y(Math.log10(speeds[2 * i])), y(Math.log10(speeds[2 * i + 1]))];
          const place = left + (i + 0.5) * binWidth;
          middle.push([place, high]);
          if (low > high + 1) chart.line([[place, low], [place, high]], palette.slip, 1);
        }
        chart.line(middle, palette.slip, sticks ? 2 : 1.25);
      });
      const held = points.filter((point) => point.stuck && point.t > from);
      if (sticks && held.length) chart.line([[x(held[0].t), zero], [x(held.at(-1).t), zero]], palette.stick, 3);
    }
    if (exact.stuck) chart.label("true sticking: exactly 0", right - 4, zero - 12, { align: "right", colour: palette.stick });
    if (sign.run.t > stop - CREEP_TIME && sign.run.v !== 0) chart.label("sign(v): never 0", right - 4, y(-4.5), { align: "right", colour: palette.slip });
    timeAxis(chart, x, from, stop, chart.h - 24);
  });

  const law = new Chart(openingElement("law"), (chart) => {
    const [left, right, top, bottom] = [34, chart.w - 6, 20, chart.h - 26];
    const { f } = start;
    const x = linearScale(-OPENING_SPEED * 1.1, OPENING_SPEED * 1.1, left, right);
    const y = linearScale(-1.5 * f, 1.5 * f, bottom, top);
    chart.text("friction in N over slip speed", 0, 8, { colour: palette.ink });
    gridLines(chart, y, [-f, 0, f], left, right);
    chart.line([[left, y(-f)], [x(0), y(-f)]], palette.slip, 2);
    chart.line([[x(0), y(f)], [right, y(f)]], palette.slip, 2);
    chart.line([[x(0), y(-f)], [x(0), y(f)]], palette.stick, 4);
    const { run: held, stuck } = exact;
    const { run: slipping } = sign;
    chart.dot(x(slipping.v), y(slipping.F_friction), 6, palette.slip, true);
    chart.dot(x(held.v), y(held.F_friction), 5, stuck ? palette.stick : palette.slip);
    if (stuck) chart.label(`true: ${fixedDigits(held.F_friction, 2)} N`, x(0) + 11, y(held.F_friction), { colour: palette.stick, key: "true" });
    if (stuck && slipping.t > 0 && Math.abs(slipping.v) < 0.01) chart.label(`sign(v): ${fixedDigits(slipping.F_friction, 2)} N`, x(0) - 11, y(slipping.F_friction), { colour: palette.slip, align: "right", key: "sign" });
    chart.label("slips: f", right - 4, y(f) - 12, { colour: palette.slip, align: "right" });
    chart.label("holds what is needed", x(0) - 8, y(0.12 * f), { colour: palette.stick, align: "right" });
    for (const speed of [-1, 0, 1]) chart.text(speed === 1 ? "1 m/s" : fixedDigits(speed, 0), x(speed), chart.h - 11, { align: "center", size: 11 });
  });
  const paint = () => [overview, speed, law].forEach((chart) => chart.paint());

  begin();
  openingElement("replay").addEventListener("click", () => {
    begin();
    play();
  });
  openingElement("replay").disabled = false;
  openingOutput("start").textContent = `${fixedDigits(1000 * start.x0, 0)} mm`;
  new IntersectionObserver(([{ isIntersecting }], observer) => { // plays once, when it is first in view
    if (!isIntersecting) return;
    observer.disconnect();
    play();
  }).observe(openingElement("true-body"));
  compareTolerances();
  return { lanes };
}
