// Sliders, number fields and choices, made from the declared variables.

import { told } from "./plot.js";
import { named } from "./state.js";

const STEPS = 400; // of a slider
const DIGITS = 7; // that a number field shows
const WIDER = 2; // where nothing bounds a slider: so many times the size that is usual

// An element with attributes, and what is in it.
export function make(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "html") made.innerHTML = value; // only what the page brings along
    else if (typeof value === "boolean") made.toggleAttribute(key, value);
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

// Where a slider begins and ends, in SI units, and whether in equal ratios.  `usual` is the size of what is zero.
export function span(variable, usual) {
  const { start, unit } = variable;
  const low = variable.low ?? variable.above;
  const high = variable.high ?? variable.below;
  if (variable.above === 0 && start > 0) return { low: start / 10, high: Math.min(start * 10, high ?? Infinity), log: true };
  if (unit === "rad" && low === undefined) return { low: -Math.PI, high: Math.PI, log: false };
  const size = WIDER * (Math.abs(start) || usual || 1);
  return { low: low ?? -size, high: high ?? size * (low === undefined ? 1 : 1.5), log: false };
}

function placeOf(value, { low, high, log }) {
  const share = log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.round(STEPS * Math.min(Math.max(share || 0, 0), 1));
}

// The value at a place of a slider, in three digits of what the slider spans.
function valueAtPlace(place, { low, high, log }, factor) {
  const share = place / STEPS;
  if (log) return Number((low * (high / low) ** share * factor).toPrecision(3)) / factor;
  const digits = Math.max(0, Math.ceil(-Math.log10(((high - low) * factor) / STEPS)) + 1);
  return Number(((low + share * (high - low)) * factor).toFixed(Math.min(digits, 12))) / factor;
}

// Gives the size that a variable usually has, where its start is zero: from the default run `main`, by its unit.
export function sizes(main) {
  const { modelInfo } = main.fmu;
  const [{ position, speed }] = modelInfo.bodies;
  const first = (unit) => modelInfo.variables.find((each) => each.unit === unit && each.start > 0)?.start ?? 1;
  const length = named(modelInfo, position).unit === "m" ? main.largest(position) : first("m");
  const bases = [first("kg"), length, main.largest(position) / main.largest(speed), 1];
  return ({ unit, powers }) => {
    const alike = main.reals.filter((name) => named(modelInfo, name).unit === unit).map((name) => main.largest(name));
    const size = Math.max(0, ...alike) || powers.reduce((product, power, i) => product * bases[i] ** power, 1);
    return Number.isFinite(size) && size > 0 ? Number(size.toPrecision(1)) : 1;
  };
}

// One row: name, words, number, unit, slider.  `onChange(value)` is told the value in SI, `refuse(sentence)` what was
// typed that is no number.
export class Field {
  constructor(variable, usual, onChange, refuse) {
    const { name, text, shown, factor, symbol, allowed } = variable;
    Object.assign(this, { variable, span: span(variable, usual) });
    const id = `field-${name}`;
    const words = `${text}${shown ? `, in ${shown}` : ""}`;
    this.number = make("input", { type: "number", step: "any", id, inputmode: "decimal", title: `${name}: ${allowed}` });
    this.slider = make("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": `${name}: ${words}` });
    const label = make("label", { for: id }, make("b", { html: symbol }), ` ${text}`);
    this.element = make("div", { class: "field" }, label, make("span", { class: "entry" }, this.number, make("span", { class: "unit" }, shown)), this.slider);
    this.slider.addEventListener("input", () => this.take(valueAtPlace(Number(this.slider.value), this.span, factor), onChange));
    this.number.addEventListener("change", () => {
      const { value } = this.number; // "" if it is no number
      if (value) return this.take(value === this.begun ? variable.start : Number(value) / factor, onChange);
      this.number.value = this.shown;
      refuse(`${name} takes a number: it stays ${`${this.shown} ${shown}`.trim()}.`);
    });
    this.begun = this.spelled(variable.start);
  }

  spelled(value) {
    return String(Number((value * this.variable.factor).toPrecision(DIGITS)));
  }

  take(value, onChange) {
    this.put(value);
    onChange(value);
  }

  // Show a value in SI, which changes nothing.
  put(value) {
    const { shown, factor } = this.variable;
    this.shown = this.spelled(value);
    if (this.number.value !== this.shown) this.number.value = this.shown;
    this.slider.value = placeOf(value, this.span);
    this.slider.setAttribute("aria-valuetext", `${told(value * factor)} ${shown}`);
  }
}

// A list to choose from: [value, text] pairs under a label.
export class Choice {
  constructor(id, text, onChange) {
    this.list = make("select", { id });
    this.element = make("div", { class: "choice" }, make("label", { for: id }, text), this.list);
    this.list.addEventListener("change", () => onChange(this.list.value));
  }

  fill(pairs, chosen) {
    const key = JSON.stringify(pairs);
    if (key !== this.key) this.list.replaceChildren(...pairs.map(([value, text, title]) => make("option", { value, ...(title && { title }) }, text)));
    this.key = key;
    this.list.value = String(chosen);
    this.element.hidden = pairs.length < 2;
  }
}

export const TOLERANCES = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12];

// The pairs for a choice of a relative tolerance; zero is that of the model.
export function tolerances(modelInfo, chosen) {
  const all = chosen && !TOLERANCES.includes(chosen) ? [chosen, ...TOLERANCES] : TOLERANCES;
  const power = (value) => value.toExponential().replace("-", "−");
  return [[0, `default, ${power(modelInfo.tolerance)}`], ...all.map((each) => [each, power(each)])];
}

// The pairs for an enumeration.
export function items(variable) {
  return variable ? variable.items.map(({ label, value, text }) => [value, label, text]) : [];
}
