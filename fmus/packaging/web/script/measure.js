// What a run says: turning points and decay, slips, steps, differences.  Sources as in the harness: Thomson, Theory of
// Vibration, sections 2.6 and 2.7; for the friction by energy, Liang and Feeny, Nonlinear Dynamics 46 (2006).


// {t, x} of the points where the speed passes through zero or comes to rest; between two rows the position is the cubic
// of their x and v.  A start at rest counts when motion follows at once.
export function turningPoints(time, x, v) {
  const found = [];
  const last = time.length - 1;
  for (let i = 0; i < last; i++) {
    const h = time[i + 1] - time[i];
    if (v[i] * v[i + 1] < 0 && h > 0) {
      const s = levelAt(h, x[i + 1] - x[i], v[i], v[i + 1]);
      found.push({ t: time[i] + s * h, x: cubic(s, h, x[i], x[i + 1], v[i], v[i + 1]) });
    } else if (v[i] === 0 && turns(v, i)) {
      found.push({ t: time[i], x: x[i] });
    }
  }
  if (v[last] === 0 && turns(v, last)) found.push({ t: time[last], x: x[last] });
  return found;
}

// Whether the zero of v in row i begins a rest that ends a motion and is not followed by more of the same.
function turns(v, i) {
  const before = i ? Math.sign(v[i - 1]) : 0;
  if (i && before === 0) return false; // the rest began earlier
  let next = i + 1;
  while (next < v.length && v[next] === 0) next++;
  if (next === v.length) return i > 0;
  return Math.sign(v[next]) !== before && (i > 0 || next === i + 1);
}

// Where in [0, 1] the cubic over a step h with slopes v0, v1 of opposite sign is level.
function levelAt(h, rise, v0, v1) {
  const b = (3 * rise) / h - 2 * v0 - v1;
  const c = 3 * (v0 + v1) - (6 * rise) / h;
  const root = Math.sqrt(Math.max(b * b - c * v0, 0));
  const q = b > 0 ? -(b + root) : root - b;
  const [one, other] = [q ? v0 / q : 0.5, c ? q / c : 2];
  return Math.abs(one - 0.5) <= Math.abs(other - 0.5) ? one : other;
}

function cubic(s, h, x0, x1, v0, v1) {
  const r = 1 - s;
  return (1 + 2 * s) * r * r * x0 + s * r * r * h * v0 + s * s * (3 - 2 * s) * x1 - s * s * r * h * v1;
}

// From x_0 to x_n in so many cycles: logarithmic decrement, damping ratio, loss a cycle; null without a decay.
export function decayBetween(x_0, x_n, cycles) {
  if (!(x_0 > x_n && x_n > 0)) return null;
  const delta = Math.log(x_0 / x_n) / cycles;
  return { delta, zeta: delta / Math.sqrt(4 * Math.PI ** 2 + delta ** 2), loss: (x_0 - x_n) / cycles };
}

// The mean force of friction between two turning points: the energy lost over the way that was gone.
export function forceByEnergy(run, body, energy, turning) {
  const [from, to] = [turning[0], turning.at(-1)];
  let way = 0;
  for (let i = 1; i < turning.length; i++) way += Math.abs(turning[i].x - turning[i - 1].x);
  return way > 0 ? (run.at(energy, from.t) - run.at(energy, to.t)) / way : NaN;
}

// First slip, period, duration of slips in s, and peaks, as the harness measures them; null with fewer than two slips.
export function slips(run, body, driverSpeed) {
  const { time, columns } = run;
  const v = columns[body.speed].map((each) => each * Math.sign(driverSpeed));
  let [starts, durations] = [[], []];
  if (run.events.length) {
    const rests = run.stuck(body.mode);
    starts = rests.map(([, to]) => to).filter((t) => t < run.setting.stop);
    durations = rests.slice(1).map(([from], i) => from - starts[i]).filter((each) => each > 0);
  } else {
    const over = v.map((each) => each - Math.abs(driverSpeed));
    for (let i = 0; i + 1 < over.length; i++) {
      if (over[i] < 0 && over[i + 1] >= 0) {
        starts.push(time[i] - (over[i] * (time[i + 1] - time[i])) / (over[i + 1] - over[i]));
      }
    }
  }
  if (starts.length < 2) return null;
  const fast = v.map((each) => each >= Math.abs(driverSpeed));
  const near = fast.map((each, i) => each || fast[i - 1] || fast[i + 1]);
  return {
    slips: starts.length,
    first_slip: starts[0],
    period: (starts.at(-1) - starts[0]) / (starts.length - 1),
    slip_time: durations.length ? durations.reduce((sum, each) => sum + each, 0) / durations.length : undefined,
    peak_speed: crest(time, columns[body.speed], fast),
    peak_acceleration: crest(time, columns[body.acceleration], near),
  };
}

// The largest size among the rows named, or the top of the parabola through it and its neighbours among them.
function crest(time, column, among) {
  let i = -1;
  for (let row = 0; row < column.length; row++) {
    if (among[row] && (i < 0 || Math.abs(column[row]) > Math.abs(column[i]))) i = row;
  }
  const y = Math.abs(column[i]);
  if (!(i > 0 && among[i - 1] && among[i + 1])) return y;
  const [left, right] = [time[i] - time[i - 1], time[i + 1] - time[i]];
  if (!(left > 0 && right > 0)) return y;
  const [down, up] = [(y - Math.abs(column[i - 1])) / left, (Math.abs(column[i + 1]) - y) / right];
  const bend = (up - down) / (left + right);
  const slope = (down * right + up * left) / (left + right);
  return bend < 0 ? y - (slope * slope) / (4 * bend) : y;
}

// Number of time points and the mean step in s, the last one counted twice, as published.
export function steps(run) {
  const ends = run.ends.map((row) => run.time[row]);
  const last = ends.at(-1) - ends.at(-2);
  return { steps: ends.length, mean_step: (ends.at(-1) - ends[0] + last) / ends.length };
}

// All figures of a published case, in SI units by the names that scenes use; `values` in force, by name.
export function figures(run, body, decay, values) {
  const found = { ...steps(run), run_time: run.seconds };
  if (decay) Object.assign(found, decayFigures(run, body, decay, values));
  if (body.driver) Object.assign(found, slips(run, body, values[body.driver_speed]) ?? {});
  return found;
}

function decayFigures(run, body, { gives, first = 0, cycles }, values) {
  const [x, v] = [run.columns[body.position], run.columns[body.speed]];
  const turning = turningPoints(run.time, x, v);
  const begin = 2 * first;
  const end = cycles === undefined ? turning.length - 1 : begin + Math.round(2 * cycles);
  if (!(turning[end] && turning[begin])) return {};
  const [x_0, x_n] = [Math.abs(turning[begin].x), Math.abs(turning[end].x)];
  const found = { x_0, x_n, sample_0: sampled(run, x, turning[begin].t), sample_n: sampled(run, x, turning[end].t) };
  const between = decayBetween(x_0, x_n, (end - begin) / 2);
  if (!between) return found;
  const stiffness = gives === "f" ? values.k : values.m * values.g * values.a;
  return { ...found, [gives]: gives === "zeta" ? between.zeta : (stiffness * between.loss) / 4 };
}

// The larger of the two rows around a turning point: what a plot of the rows shows as the peak.
function sampled(run, x, t) {
  let row = run.time.findIndex((each) => each >= t);
  row = Math.max(row, 1);
  return Math.max(Math.abs(x[row - 1]), Math.abs(x[row]));
}

// The largest difference of two runs in an output, at the grid points that both have.
export function difference(one, other, name) {
  const count = Math.min(one.grid.length, other.grid.length);
  const [a, b] = [one.columns[name], other.columns[name]];
  const [time, apart] = [[], []];
  let largest = 0;
  for (let i = 0; i < count; i++) {
    time.push(one.time[one.grid[i]]);
    apart.push(b[other.grid[i]] - a[one.grid[i]]);
    largest = Math.max(largest, Math.abs(apart[i]));
  }
  return { time, apart, largest };
}
