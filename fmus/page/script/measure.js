// Turning points of a run, and the difference between two runs.

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
