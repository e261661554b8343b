// Numbers as text, for readers.

const SUPERSCRIPTS = { "-": "⁻", ...Object.fromEntries([..."⁰¹²³⁴⁵⁶⁷⁸⁹"].map((digit, i) => [String(i), digit])) };
const PREFIXES = [[1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];
const [SMALLEST_PLAIN, LARGEST_PLAIN] = [1e-3, 1e5]; // other numbers have a power of ten

// A power of ten, as in 10⁻⁶.
export function formatPower(exponent) {
  return `10${[...String(exponent)].map((character) => SUPERSCRIPTS[character]).join("")}`;
}

// A number with at most `digits` digits, unless it is whole, without trailing zeros, with a typographic minus sign; very
// large and small ones with a power of ten, as in 2.5·10⁻⁶.
export function formatNumber(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size >= LARGEST_PLAIN || (size > 0 && size < SMALLEST_PLAIN)) return formatScientific(value, digits);
  return String(Number.isInteger(value) ? value : Number(value.toPrecision(digits))).replace("-", "−");
}

// A number with a power of ten, whatever its size.
export function formatScientific(value, digits = 4) {
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e").map(Number);
  return (mantissa === 1 ? formatPower(exponent) : `${mantissa}·${formatPower(exponent)}`).replace("-", "−");
}

// A quantity with a prefix that suits its size, as in 1.3 mm.
export function formatQuantity(value, unit, digits = 3) {
  const [size, prefix] = (value !== 0 && PREFIXES.find(([least]) => Math.abs(value) >= 0.9995 * least)) || [1, ""];
  return `${formatNumber(value / size, digits)}\u00a0${prefix}${unit}`;
}

// A whole number in groups of three digits.
export function formatCount(value) {
  return String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

// A value of a variable in its display unit.
export function formatValue({ factor, display_unit }, value, digits) {
  return `${formatNumber(value * factor, digits)} ${display_unit}`.trim();
}
