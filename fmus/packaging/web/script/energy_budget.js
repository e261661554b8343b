// The energy budget of a run: what has become heat.

const LARGEST_DECREASE = 1e-3; // of the heat, relative to its largest value; a larger one is energy that the balance misses

// The heat in J at each row of a run: energy at the start, minus energy now, plus the work of forces from outside and of
// drivers. Null if the balance misses something, so that heat would turn into motion.
export function heatOf(run, energy, bodies) {
  if (bodies.some(({ driver, spring_force }) => driver && !spring_force)) return null;
  const { time, columns } = run;
  const stored = columns[energy];
  const heat = [0];
  let [work, largest, decrease] = [0, 0, 0];
  for (let row = 1; row < time.length; row++) {
    if (time[row] === time[row - 1]) work += stored[row] - stored[row - 1]; // a changed value, such as a stiffness
    for (const { input, position, driver, spring_force } of bodies) {
      const moved = (name) => columns[name][row] - columns[name][row - 1];
      if (input) work += columns[input][row - 1] * moved(position); // constant between changes
      if (driver) work += 0.5 * (columns[spring_force][row] + columns[spring_force][row - 1]) * moved(driver);
    }
    heat.push(stored[0] + work - stored[row]);
    largest = Math.max(largest, heat[row]);
    decrease = Math.max(decrease, largest - heat[row]);
  }
  return decrease <= LARGEST_DECREASE * largest + Number.EPSILON * Math.abs(stored[0]) ? heat : null;
}
