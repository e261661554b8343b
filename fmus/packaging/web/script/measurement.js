// A measurement of the visitor: time and position from a CSV file, to be drawn over the run. It stays in the page.

import { parseNumber } from "./controls.js";

const MAX_DRAWN_POINTS = 4000;
const TIME_UNITS = { s: 1, sec: 1, seconds: 1, ms: 1e-3, us: 1e-6, "µs": 1e-6, min: 60 };
const POSITION_UNITS = {
  m: { m: 1, mm: 1e-3, cm: 1e-2, um: 1e-6, "µm": 1e-6, in: 0.0254 },
  rad: { rad: 1, mrad: 1e-3, deg: Math.PI / 180, "°": Math.PI / 180 },
};

// The units in which a position with this SI unit can be given.
function positionUnits(unit) {
  return POSITION_UNITS[unit] ?? { [unit]: 1 };
}

// A file that cannot be used, with the reason.
export class MeasurementError extends Error {}

// Read a CSV file: comments are skipped, the delimiter is found, and the headings state the units, as in "t [ms]" or
// "x (mm)". Without a unit, values are in s and in `unit` (m or rad), that of the position in the model. Returns {name,
// time, position} in SI units.
export function readMeasurement(name, text, unit) {
  const lines = text.replace(/^\uFEFF/, "").split(/\r?\n/).filter((line) => line.trim() && !/^\s*(#|%|\/\/)/.test(line));
  const delimiter = [";", "\t", ","].find((character) => lines[0]?.includes(character));
  if (!delimiter) throw new MeasurementError(`${name} has no two columns: separate time and position by commas, semicolons or tabs.`);
  const rows = lines.map((line) => line.split(delimiter).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1")));
  const hasHeadings = rows[0].some((cell) => cell && Number.isNaN(parseNumber(cell)));
  const headings = (hasHeadings ? rows.shift() : rows[0].map(() => "")).map(readHeading);
  const timeColumn = Math.max(headings.findIndex((heading) => /^(t|time|zeit)$/i.test(heading.quantity)), 0);
  const positionColumn = choosePosition(headings, timeColumn, unit);
  const factors = [unitFactor(name, headings[timeColumn], TIME_UNITS), unitFactor(name, headings[positionColumn], positionUnits(unit))];
  const points = rows.map((row) => [timeColumn, positionColumn].map((column, i) => parseNumber(row[column] ?? "") * factors[i]))
    .filter((point) => point.every(Number.isFinite));
  if (points.length < 2) throw new MeasurementError(`${name} has fewer than two rows with a time and a position.`);
  const every = Math.ceil(points.length / MAX_DRAWN_POINTS);
  const drawn = points.filter((_, i) => i % every === 0);
  return { name, count: points.length, time: drawn.map(([t]) => t), position: drawn.map(([, x]) => x) };
}

// The quantity and the unit in a heading.
function readHeading(text) {
  const [, quantity, bracketed, written] = text.match(/^(.*?)\s*(?:[[(]\s*([^\])]*?)\s*[\])]|\bin\s+(\S+))?\s*$/i);
  return { text, quantity: quantity.trim(), unit: bracketed ?? written ?? "" };
}

// The first column besides the time whose unit suits the position; else the first without a unit, else the first.
function choosePosition(headings, timeColumn, unit) {
  const others = headings.map((heading, column) => ({ ...heading, column })).filter(({ column }) => column !== timeColumn);
  const suitable = others.find((heading) => heading.unit in positionUnits(unit)) ?? others.find((heading) => !heading.unit) ?? others[0];
  return suitable.column;
}

// What one unit of a column is in SI units.
function unitFactor(name, { text, unit }, units) {
  if (!unit) return 1;
  if (units[unit]) return units[unit];
  throw new MeasurementError(`${name}: the unit of "${text}" is ${unit}; give one of ${Object.keys(units).join(", ")}.`);
}
