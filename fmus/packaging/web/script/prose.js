// Numbers in the prose of the stories.

const NARROW_SPACE = "\u202f"; // between groups of three digits
const MAX_DECIMALS = 8;

function typographicMinus(text) {
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

// A number with `count` significant digits, never with a power of ten.
export function significant(value, count) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const decimals = Math.max(0, count - 1 - Math.floor(Math.log10(Math.abs(value)) + 1e-9));
  return typographicMinus(value.toFixed(Math.min(decimals, MAX_DECIMALS)));
}

export function fixedDigits(value, decimals) {
  return typographicMinus(value.toFixed(decimals));
}

const STORY_PREFIXES = [[1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];

// A quantity with a unit that suits its size, as 1.3 mm.
export function withUnit(value, digits, unit) {
  if (value === 0) return `0 ${unit}`;
  const [size, prefix] = STORY_PREFIXES.find(([least]) => Math.abs(value) >= 0.9995 * least) ?? PREFIXES.at(-1);
  return `${significant(value / size, digits)}\u00a0${prefix}${unit}`;
}

// A number and the noun it counts.
export const countOf = (value, noun) => `${groupDigits(value)} ${noun}${value === 1 ? "" : "s"}`;

// A power of ten, as HTML.
export const powerOfTen = (exponent) => `10<sup>${typographicMinus(String(exponent))}</sup>`;

// A whole number in groups of three digits.
export function groupDigits(value) {
  return String(Math.round(value)).replace(/\B(?=(\d{3})+$)/g, NARROW_SPACE);
}
