// A story: a picture of one motion that follows the numbers in its text.

import { animate, reducedMotion, stopAnimation } from "./animation.js";
import { runInBackground } from "./background.js";
import { createFmu, simulate, startValues, SteppedRun } from "./story_models.js";
import { Chart, gridLines, linearScale, modeCurve, palette, tickLabel, timeAxis } from "./chart.js";
import { makeAdjustable } from "./adjustable.js";
import { groupDigits, significant } from "./prose.js";

const STORY_POINTS = 900; // grid steps
const STEPS_PER_LOOK = 500; // steps between two looks at the clock

// `spec` describes a story: the model, its body (a class), the range and the step by which it can be moved, the stop time in
// s, the speed of playback, the unit and factor of the position, y (half the height of the chart), and functions of the
// adjusted values: values() for the run, band() that friction can hold, results() for the text; `costs` are runs of which the
// text states the number of solver steps.
export class Story {
  constructor(section, session, spec) {
    Object.assign(this, { section, session, spec, t: 0, startPosition: undefined, start: startValues(session, spec.model) });
    const find = (name) => section.querySelector(`.${name}`);
    this.outputs = new Map([...section.querySelectorAll("output")].map((output) => [output.dataset.out, output]));
    this.adjustables = {};
    for (const element of section.querySelectorAll(".pull")) {
      const key = element.dataset.key;
      this.adjustables[key] = makeAdjustable(element, spec.formats[key], (value, isFinal) => {
        if (key === spec.startKey) this.startPosition = undefined;
        this.compute();
        this.showTime(spec.stop);
        if (isFinal) this.play();
      });
    }
    const handlers = {
      grab: () => { stopAnimation(this.advanceFrame); this.playing = false; },
      move: (value) => this.startAt(value),
      drop: () => this.play(),
    };
    this.body = new spec.body(find("body"), { range: spec.range, step: spec.step, name: spec.name, handlers,
      describe: (value, stuck) => `${significant(value * spec.factor, 3)} ${spec.unit}, ${stuck ? "holds" : "slips"}` });
    this.overview = new Chart(find("course"), (chart) => this.drawOverview(chart));
    this.law = new Chart(find("law"), (chart) => this.drawLaw(chart));
    this.button = find("again");
    this.button.addEventListener("click", () => this.play());
    this.scrub(find("course"));
    this.advanceFrame = this.advanceFrame.bind(this);
  }

  // Create the instances of the models and show the first picture. The section is pending until its text is complete.
  async begin() {
    this.fmu = await createFmu(this.session, this.spec.model);
    this.referenceFmu = this.spec.reference && (await createFmu(this.session, this.spec.reference.model));
    this.costs = await Promise.all(Object.entries(this.spec.costs ?? {}).map(async ([output, { model, values }]) => ({ output, values, fmu: await createFmu(this.session, model) })));
    this.compute();
    this.showTime(reducedMotion.matches ? this.spec.stop : 0);
    if (!this.costs.length) this.section.classList.remove("pending");
    this.button.disabled = false;
    const text = this.section.querySelector(".prose p");
    let width = 0;
    new ResizeObserver(() => requestAnimationFrame(() => { // space for one more line, so that the picture stays where it is
      if (text.offsetWidth === width) return;
      width = text.offsetWidth;
      text.style.minHeight = "0";
      text.style.minHeight = `${text.offsetHeight + parseFloat(getComputedStyle(text).lineHeight)}px`;
    })).observe(text);
    new IntersectionObserver(([{ isIntersecting }], observer) => {
      if (!isIntersecting) return;
      observer.disconnect();
      if (!reducedMotion.matches) this.play();
    }, { threshold: 0.6 }).observe(this.overview.canvas);
  }

  get values() {
    return Object.fromEntries(Object.entries(this.adjustables).map(([key, { value }]) => [key, value]));
  }

  // Run with the adjusted values; a closed form takes a millisecond.
  compute() {
    const { spec } = this;
    const values = spec.values(this.values, this.startPosition);
    this.run = simulate(this.fmu, values, spec.stop, STORY_POINTS);
    this.shown = spec.of(this.run);
    const reference = this.referenceFmu && simulate(this.referenceFmu, spec.reference.values(this.values, this.startPosition), spec.stop, STORY_POINTS);
    this.reference = reference && spec.reference.of(reference);
    this.stuck = this.run.columns.mode ? (i) => this.run.columns.mode[i] === 0 : () => false;
    this.rest = this.run.columns.mode && this.run.restTime();
    this.edge = spec.band(this.values, this.start);
    this.body.showBand(this.edge, spec.bandLabel(this.edge));
    for (const [key, text] of Object.entries(spec.results(this))) this.outputs.get(key).innerHTML = text; // HTML from the stories
    if (this.costs.length) this.countCosts();
    this.section.querySelector(".course").setAttribute("aria-label", spec.picture(this));
  }

  // Count the solver steps of the runs in `costs`, one after the other.
  countCosts() {
    const waiting = [...this.costs];
    let run = null;
    runInBackground(this.section.id, (deadline) => {
      const { output, values, fmu } = waiting[0];
      run ??= new SteppedRun(fmu, values(this.values, this.startPosition), this.spec.stop);
      for (let n = 1; !run.done; n++) {
        run.step();
        if (n % STEPS_PER_LOOK === 0 && performance.now() > deadline) return false;
      }
      this.outputs.get(output).textContent = groupDigits(run.steps);
      run = null;
      waiting.shift();
      if (!waiting.length) this.section.classList.remove("pending");
      return !waiting.length;
    });
  }

  // Start the motion at a position to which the body is dragged.
  startAt(value) {
    const { spec } = this;
    this.startPosition = value;
    if (spec.startKey) this.adjustables[spec.startKey].set(Math.abs(value) * spec.factor);
    this.compute();
    this.t = 0;
    this.body.moveTo(value, this.stuck(0));
    this.paint();
  }

  play() {
    if (reducedMotion.matches) return this.showTime(this.spec.stop);
    this.showTime(0);
    this.playing = true;
    animate(this.advanceFrame);
  }

  advanceFrame(elapsed) {
    if (!this.playing || this.body.held) return false;
    this.showTime(Math.min(this.t + elapsed * this.spec.speed, this.spec.stop));
    if (this.t >= this.spec.stop) this.playing = false;
    return this.playing;
  }

  showTime(t) {
    this.t = t;
    if (!this.run) return;
    const row = this.run.row(t);
    this.row = row;
    this.body.moveTo(this.interpolate(this.shown.at), this.stuck(row), this.shown.shift ? this.interpolate(this.shown.shift) : 0);
    const { canvas } = this.overview;
    canvas.setAttribute("aria-valuenow", t.toFixed(2));
    canvas.setAttribute("aria-valuetext", `at ${t.toFixed(2)} seconds: ${this.body.description}`);
    this.paint();
  }

  interpolate(column) {
    const { time } = this.run;
    const row = this.run.row(this.t);
    if (!(time[row + 1] > time[row])) return column[row];
    return column[row] + ((column[row + 1] - column[row]) * (this.t - time[row])) / (time[row + 1] - time[row]);
  }

  paint() {
    this.overview.paint();
    this.law.paint();
  }

  // Let the pointer and the arrow keys choose the time.
  scrub(canvas) {
    const seekTo = (event) => {
      const { left } = canvas.getBoundingClientRect();
      this.playing = false;
      this.showTime(Math.min(Math.max(this.x.inverse(event.clientX - left), 0), this.spec.stop));
    };
    const attributes = { role: "slider", tabindex: 0, "aria-valuemin": 0, "aria-valuemax": this.spec.stop, "aria-valuenow": 0 };
    for (const [key, value] of Object.entries(attributes)) canvas.setAttribute(key, value);
    canvas.addEventListener("keydown", (event) => {
      const change = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
      if (!change) return;
      event.preventDefault();
      this.playing = false;
      this.showTime(Math.min(Math.max(this.t + (change * this.spec.stop) / 100, 0), this.spec.stop));
    });
    let down = false;
    canvas.addEventListener("pointerdown", (event) => { down = true; canvas.setPointerCapture(event.pointerId); seekTo(event); });
    canvas.addEventListener("pointermove", (event) => down && seekTo(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (down = false));
  }

  drawOverview(chart) {
    const { spec, run, shown } = this;
    if (!run) return;
    const [left, right, top, bottom] = [44, chart.w - 16, 26, chart.h - 48];
    const x = linearScale(0, spec.stop, left, right);
    const y = linearScale(spec.low ?? -spec.y, spec.y, bottom, top);
    const curve = shown.y ?? shown.at;
    this.x = x;
    const f = spec.factor;
    chart.text(spec.title, 0, 9, { colour: palette.ink });
    if (this.edge) {
      chart.clipped(left, top - 6, right - left, bottom - top + 12, () => chart.box(left, y(this.edge * f), right - left, y(-this.edge * f) - y(this.edge * f), palette.hold));
    }
    gridLines(chart, y, spec.gridValues, left, right);
    chart.clipped(left, top - 8, right - left, bottom - top + 16, () => {
      spec.extra?.(chart, x, y, this);
      modeCurve(chart, run.time.length, (i) => [x(run.time[i]), y(f * curve[i])], this.stuck, 2);
    });
    for (const { label, t, at, colour, align = "center" } of spec.labels(this)) chart.label(label, x(t), y(at), { colour: palette[colour], align, halo: this.edge < 0.01 });
    const place = bottom + 8;
    ribbon(chart, run, this.stuck, x, place, 16);
    timeAxis(chart, x, 0, spec.stop, place + 16);
    chart.line([[x(this.t), top - 6], [x(this.t), place + 16]], palette.ink, 1);
    chart.dot(x(this.t), y(f * this.interpolate(curve)), 5, this.stuck(run.row(this.t)) ? palette.stick : palette.slip);
  }

  drawLaw(chart) {
    const { spec, run, shown } = this;
    if (!run) return;
    const { law } = spec;
    const [left, right, top, bottom] = [40, chart.w - 14, 26, chart.h - 48];
    const x = linearScale(law.from, law.to, left, right);
    const y = linearScale(law.low, law.high, bottom, top);
    chart.text(law.title, 0, 9, { colour: palette.ink });
    gridLines(chart, y, law.gridValues, left, right);
    for (const value of law.speeds) chart.text(tickLabel(value, law.speeds) + (value === law.speeds.at(-1) ? ` ${law.unit}` : ""), x(value), bottom + 14, { align: "center", size: 11 });
    chart.clipped(left, top - 8, right - left, bottom - top + 16, () => law.draw(chart, x, y, this));
    const row = run.row(this.t);
    const [v, F] = [law.speedFactor * shown.v[row], law.forceFactor * shown.F[row]];
    const stuck = this.stuck(row);
    chart.dot(Math.min(Math.max(x(v), left), right), y(F), 6, stuck ? palette.stick : palette.slip);
    law.label(chart, x, y, this, { v, F, stuck });
  }
}

// When the body holds and when it slips, labelled where the label fits.
function ribbon(chart, run, stuck, x, y, height) {
  for (let i = 0; i + 1 < run.time.length; ) {
    const held = stuck(i);
    const from = i;
    while (i + 1 < run.time.length && stuck(i) === held) i++;
    chart.box(x(run.time[from]), y, Math.max(x(run.time[i]) - x(run.time[from]), 0.5), height, held ? palette.stick : palette.slip);
    const wide = x(run.time[i]) - x(run.time[from]);
    chart.occupy(x(run.time[from]), y, x(run.time[i]), y + height);
    if (wide > 44) chart.text(held ? "holds" : "slips", x(run.time[from]) + wide / 2, y + height / 2 + 0.5, { align: "center", size: 11, weight: 600, colour: palette.paper, halo: false });
  }
}
