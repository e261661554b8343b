// Measurements on runs: turning points and decay, slips, steps, differences. References, as in the harness: Thomson,
// Theory of Vibration, sections 2.6 and 2.7; for the friction from energy, Liang and Feeny, Nonlinear Dynamics 46 (2006).

// The points {t, x} where the speed changes sign or becomes zero, with cubic Hermite interpolation between rows. A start
// at rest counts if the motion starts immediately.
export function turningPoints(time, x, v) {
  const points = [];
  const last = time.length - 1;
  for (let i = 0; i < last; i++) {
    const h = time[i + 1] - time[i];
    if (v[i] * v[i + 1] < 0 && h > 0) {
      const s = turningPosition(h, x[i + 1] - x[i], v[i], v[i + 1]);
      points.push({ t: time[i] + s * h, x: cubic(s, h, x[i], x[i + 1], v[i], v[i + 1]) });
    } else if (v[i] === 0 && startsRest(v, i)) {
      points.push({ t: time[i], x: x[i] });
    }
  }
  if (v[last] === 0 && startsRest(v, last)) points.push({ t: time[last], x: x[last] });
  return points;
}

// Whether the zero of v in row i starts a rest after which the body does not continue in the same direction.
function startsRest(v, i) {
  const before = i ? Math.sign(v[i - 1]) : 0;
  if (i && before === 0) return false; // the rest began earlier
  let next = i + 1;
  while (next < v.length && v[next] === 0) next++;
  if (next === v.length) return i > 0;
  return Math.sign(v[next]) !== before && (i > 0 || next === i + 1);
}

// The position in [0, 1] of the extremum of the cubic over a step h with end slopes v0, v1 of opposite sign.
function turningPosition(h, rise, v0, v1) {
  const b = (3 * rise) / h - 2 * v0 - v1;
  const c = 3 * (v0 + v1) - (6 * rise) / h;
  const root = Math.sqrt(Math.max(b * b - c * v0, 0));
  const q = b > 0 ? -(b + root) : root - b;
  const [first, second] = [q ? v0 / q : 0.5, c ? q / c : 2];
  return Math.abs(first - 0.5) <= Math.abs(second - 0.5) ? first : second;
}

function cubic(s, h, x0, x1, v0, v1) {
  const r = 1 - s;
  return (1 + 2 * s) * r * r * x0 + s * r * r * h * v0 + s * s * (3 - 2 * s) * x1 - s * s * r * h * v1;
}

// Logarithmic decrement, damping ratio and loss per cycle of a decay from x_0 to x_n; null if there is no decay.
export function decayBetween(x_0, x_n, cycles) {
  if (!(x_0 > x_n && x_n > 0)) return null;
  const delta = Math.log(x_0 / x_n) / cycles;
  return { delta, zeta: delta / Math.sqrt(4 * Math.PI ** 2 + delta ** 2), loss: (x_0 - x_n) / cycles };
}

// The mean friction force between turning points: the energy lost divided by the distance travelled.
export function frictionFromEnergy(run, body, energy, turning) {
  const [from, to] = [turning[0], turning.at(-1)];
  let distance = 0;
  for (let i = 1; i < turning.length; i++) distance += Math.abs(turning[i].x - turning[i - 1].x);
  return distance > 0 ? (run.at(energy, from.t) - run.at(energy, to.t)) / distance : NaN;
}

// First slip, period and duration of slips in s, and peak values, as in the harness; null with fewer than two slips.
export function measureSlips(run, body, driverSpeed) {
  const { time, columns } = run;
  const v = columns[body.speed].map((speed) => speed * Math.sign(driverSpeed));
  let [starts, durations] = [[], []];
  if (run.events.length) {
    const sticks = run.stuckIntervals(body.mode);
    starts = sticks.map(([, to]) => to).filter((t) => t < run.setting.stop);
    durations = sticks.slice(1).map(([from], i) => from - starts[i]).filter((duration) => duration > 0);
  } else {
    const relative = v.map((speed) => speed - Math.abs(driverSpeed));
    for (let i = 0; i + 1 < relative.length; i++) {
      if (relative[i] < 0 && relative[i + 1] >= 0) {
        starts.push(time[i] - (relative[i] * (time[i + 1] - time[i])) / (relative[i + 1] - relative[i]));
      }
    }
  }
  if (starts.length < 2) return null;
  const isFast = v.map((speed) => speed >= Math.abs(driverSpeed));
  const isNearFast = isFast.map((fast, i) => fast || isFast[i - 1] || isFast[i + 1]);
  return {
    slips: starts.length,
    first_slip: starts[0],
    period: (starts.at(-1) - starts[0]) / (starts.length - 1),
    slip_time: durations.length ? durations.reduce((sum, duration) => sum + duration, 0) / durations.length : undefined,
    peak_speed: peakMagnitude(time, columns[body.speed], isFast),
    peak_acceleration: peakMagnitude(time, columns[body.acceleration], isNearFast),
  };
}

// The largest magnitude in the selected rows, or the vertex of the parabola through it and its neighbours, if selected.
function peakMagnitude(time, column, isSelected) {
  let i = -1;
  for (let row = 0; row < column.length; row++) {
    if (isSelected[row] && (i < 0 || Math.abs(column[row]) > Math.abs(column[i]))) i = row;
  }
  const y = Math.abs(column[i]);
  if (!(i > 0 && isSelected[i - 1] && isSelected[i + 1])) return y;
  const [left, right] = [time[i] - time[i - 1], time[i + 1] - time[i]];
  if (!(left > 0 && right > 0)) return y;
  const [down, up] = [(y - Math.abs(column[i - 1])) / left, (Math.abs(column[i + 1]) - y) / right];
  const curvature = (up - down) / (left + right);
  const slope = (down * right + up * left) / (left + right);
  return curvature < 0 ? y - (slope * slope) / (4 * curvature) : y;
}

// Number of time points and mean step in s. The last step counts twice, as in the publication.
export function stepStatistics(run) {
  const times = run.ends.map((row) => run.time[row]);
  const last = times.at(-1) - times.at(-2);
  return { steps: times.length, mean_step: (times.at(-1) - times[0] + last) / times.length };
}

// All quantities of a published case in SI units, by the names in scene files; `values` are the effective values.
export function measureQuantities(run, body, decay, values) {
  const quantities = { ...stepStatistics(run), run_time: run.seconds };
  if (decay) Object.assign(quantities, decayQuantities(run, body, decay, values));
  if (body.driver) Object.assign(quantities, measureSlips(run, body, values[body.driver_speed]) ?? {});
  return quantities;
}

function decayQuantities(run, body, { gives, first = 0, cycles }, values) {
  const [x, v] = [run.columns[body.position], run.columns[body.speed]];
  const turning = turningPoints(run.time, x, v);
  const begin = 2 * first;
  const end = cycles === undefined ? turning.length - 1 : begin + Math.round(2 * cycles);
  if (!(turning[end] && turning[begin])) return {};
  const [x_0, x_n] = [Math.abs(turning[begin].x), Math.abs(turning[end].x)];
  const peaks = { x_0, x_n, sample_0: sampledPeak(run, x, turning[begin].t), sample_n: sampledPeak(run, x, turning[end].t) };
  const decay = decayBetween(x_0, x_n, (end - begin) / 2);
  if (!decay) return peaks;
  const stiffness = gives === "f" ? values.k : values.m * values.g * values.a;
  return { ...peaks, [gives]: gives === "zeta" ? decay.zeta : (stiffness * decay.loss) / 4 };
}

// The larger of the two rows around a turning point: the peak in a plot of the rows.
function sampledPeak(run, x, t) {
  let row = run.time.findIndex((time) => time >= t);
  row = Math.max(row, 1);
  return Math.max(Math.abs(x[row - 1]), Math.abs(x[row]));
}

// The differences of an output between two runs at common grid points, and the largest magnitude.
export function difference(first, second, name) {
  const count = Math.min(first.grid.length, second.grid.length);
  const [a, b] = [first.columns[name], second.columns[name]];
  const [time, differences] = [[], []];
  let largest = 0;
  for (let i = 0; i < count; i++) {
    time.push(first.time[first.grid[i]]);
    differences.push(b[second.grid[i]] - a[first.grid[i]]);
    largest = Math.max(largest, Math.abs(differences[i]));
  }
  return { time, differences, largest };
}
