// A run: the motion on a grid of equal steps, at every end of the solver's own steps, and at every event.
//
// It advances in slices of time, so that a long one never holds up the page: what there is can be drawn.

import { Refused } from "./fmu.js";

const NEARLY = 1e-9; // of a grid step: a grid point this close to the end of a solver's step is that end
const MOST = 300000; // communication points
const EVERY = 32; // points between two looks at the clock
const COUNTS = ["solver.steps", "solver.rejected", "solver.evaluations", "events.count"];

export class Run {
  // setting: values by name, changes [{t, name, value}] in order of time, stop in s, and the number of grid steps (0:
  // none, the solver's own steps alone).
  constructor(fmu, setting) {
    Object.assign(this, { fmu, setting });
    const variables = fmu.portrait.variables;
    const outputs = variables.filter((variable) => variable.causality === "output");
    const has = (name) => fmu.variables.has(name);
    this.reals = outputs.filter((variable) => variable.type === "Real").map((variable) => variable.name);
    this.modes = outputs.filter((variable) => variable.type !== "Real").map((variable) => variable.name);
    const ahead = ["solver.t_next", "solver.h", ...["events.t_last"].filter(has)];
    this.readReals = fmu.reader([...this.reals, ...ahead]);
    this.readIntegers = fmu.reader([...this.modes, ...["events.count"].filter(has)]);
    this.readCounts = fmu.reader(COUNTS.filter(has));
    this.time = [];
    this.columns = Object.fromEntries([...this.reals, ...this.modes, "solver.h"].map((name) => [name, []]));
    this.grid = []; // rows at the points of the grid
    this.ends = []; // rows where a step of the solver ends, the start included
    this.events = []; // [{t, row}]
    this.change = 0; // of the setting, the next to come
    this.point = 1; // of the grid, the next to come
    this.failure = "";
    this.done = false;
    this.seconds = 0;
  }

  // Go on until the end, or until the clock (in ms) is beyond the deadline; true at the end.
  advance(deadline = Infinity) {
    const begun = performance.now();
    try {
      if (!this.time.length) this.begin();
      for (let turn = 1; !this.done; turn++) {
        this.step();
        if (turn % EVERY === 0 && performance.now() > deadline) break;
      }
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      this.failure = error.message;
      this.done = true;
    }
    this.seconds += (performance.now() - begun) / 1000;
    return this.done;
  }

  begin() {
    this.fmu.begin(this.setting.values, this.setting.stop);
    this.t = 0;
    this.record();
    this.grid.push(0);
    this.ends.push(0);
    this.changed();
  }

  // One communication step: to the end of the solver's own, to a grid point, or to a change.
  step() {
    const { stop, points, changes } = this.setting;
    const h = points ? stop / points : 0;
    const nearly = NEARLY * h;
    while (points && this.point * h <= this.t + nearly) this.point++;
    let target = points && this.point * h < stop - nearly ? this.point * h : stop;
    let ends = false;
    if (this.next <= target + nearly) [target, ends] = [Math.min(this.next, stop), true];
    const change = changes[this.change];
    if (change && change.t < target) [target, ends] = [change.t, false];
    this.fmu.step(this.t, target - this.t);
    this.t = target;
    this.record();
    const row = this.time.length - 1;
    if (ends || target === stop) this.ends.push(row);
    if (points && (target === stop || Math.abs(target - this.point * h) <= nearly)) this.grid.push(row);
    this.done = target >= stop;
    if (this.done) this.finish();
    else this.changed();
    if (!this.done && row >= MOST) {
      throw new Refused(`The run has ${MOST} points at t = ${this.t.toPrecision(5)} s and goes no further: ` +
        "raise the tolerance, shorten the run, or take a law that does not chatter.");
    }
  }

  record() {
    const [reals, integers] = [this.readReals(), this.readIntegers()];
    const { reals: names, modes, columns } = this;
    this.next = reals[names.length];
    if (!reals.every(Number.isFinite)) return; // the next step says why
    this.time.push(this.t);
    for (let i = 0; i < names.length; i++) columns[names[i]].push(reals[i]);
    for (let i = 0; i < modes.length; i++) columns[modes[i]].push(integers[i]);
    columns["solver.h"].push(reals[names.length + 1]);
    const count = integers[modes.length];
    if (count > (this.count ?? 0)) this.events.push({ t: reals[names.length + 2], row: this.time.length - 1 });
    this.count = count;
  }

  // Make the changes that are due, and record what follows them.
  changed() {
    const { changes } = this.setting;
    if (!(changes[this.change]?.t <= this.t)) return;
    for (; changes[this.change]?.t <= this.t; this.change++) {
      this.fmu.set(changes[this.change].name, changes[this.change].value);
    }
    this.record();
  }

  finish() {
    const has = COUNTS.filter((name) => this.fmu.variables.has(name));
    const counts = this.readCounts();
    this.counts = Object.fromEntries(has.map((name, i) => [name, counts[i]]));
  }

  // The largest size of an output; zero of one that it has not.
  largest(name) {
    return (this.columns[name] ?? []).reduce((most, value) => Math.max(most, Math.abs(value)), 0);
  }

  // The last row at or before a time in s.
  row(t) {
    let [low, high] = [0, this.time.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.time[middle] <= t) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // The value of an output at a time in s, on the straight line between two rows.
  at(name, t) {
    const [row, column] = [this.row(t), this.columns[name]];
    const [from, to] = [this.time[row], this.time[row + 1]];
    if (!(to > from)) return column[row];
    return column[row] + (column[row + 1] - column[row]) * Math.min((t - from) / (to - from), 1);
  }

  // Times [from, to] in s where a mode is zero.
  stuck(mode) {
    const [found, column] = [[], this.columns[mode] ?? []];
    for (let row = 0; row < column.length; row++) {
      if (column[row] !== 0) continue;
      const from = this.time[row];
      while (row + 1 < column.length && column[row + 1] === 0) row++;
      found.push([from, this.time[Math.min(row + 1, this.time.length - 1)]]);
    }
    return found;
  }
}
