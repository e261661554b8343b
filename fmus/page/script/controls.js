// Sliders, number fields and drop-down lists for the variables of a model.

import { formatScientific, formatValue } from "./numbers.js";
import { findVariable } from "./state.js";

const SLIDER_STEPS = 400;
const FIELD_DIGITS = 7;
const UNBOUNDED_RANGE = 2; // range of a slider without bounds, in typical sizes of the variable

// Create an element with attributes and children.
export function makeElement(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "html") element.innerHTML = value; // only HTML from the build
    else if (typeof value === "boolean") element.toggleAttribute(key, value);
    else element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
}

// Create an element of an SVG in a parent.
export function makeSvg(name, attributes, parent) {
  const created = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) created.setAttribute(key, value);
  return parent ? parent.appendChild(created) : created;
}

// The range of a slider in SI units and whether it is logarithmic. `typicalSize` applies to variables that start at zero.
export function sliderRange(variable, typicalSize) {
  const { start, unit } = variable;
  const low = variable.low ?? variable.above;
  const high = variable.high ?? variable.below;
  if (variable.above === 0 && start > 0) return { low: start / 10, high: Math.min(start * 10, high ?? Infinity), log: true };
  if (unit === "rad" && low === undefined) return { low: -Math.PI, high: Math.PI, log: false };
  const size = UNBOUNDED_RANGE * (Math.abs(start) || typicalSize || 1);
  return { low: low ?? -size, high: high ?? size * (low === undefined ? 1 : 1.5), log: false };
}

function sliderPosition(value, { low, high, log }) {
  const fraction = log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.round(SLIDER_STEPS * Math.min(Math.max(fraction || 0, 0), 1));
}

// The value at a slider position, rounded to three digits of the slider's range.
function sliderValue(position, { low, high, log }, factor) {
  const fraction = position / SLIDER_STEPS;
  if (log) return Number((low * (high / low) ** fraction * factor).toPrecision(3)) / factor;
  const digits = Math.max(0, Math.ceil(-Math.log10(((high - low) * factor) / SLIDER_STEPS)) + 1);
  return Number(((low + fraction * (high - low)) * factor).toFixed(Math.min(digits, 12))) / factor;
}

// Return a function that estimates the typical size of a variable from its unit and the results of a run.
export function typicalSizes(run) {
  const { modelInfo } = run.fmu;
  const [{ position, speed }] = modelInfo.bodies;
  const firstStart = (unit) => modelInfo.variables.find((variable) => variable.unit === unit && variable.start > 0)?.start ?? 1;
  const length = findVariable(modelInfo, position).unit === "m" ? run.largestMagnitude(position) : firstStart("m");
  const time = run.largestMagnitude(position) / run.largestMagnitude(speed);
  const baseSizes = [firstStart("kg"), length, time, firstStart("A"), firstStart("K"), 1];
  return ({ unit, unit_exponents }) => {
    const sameUnit = run.reals.filter((name) => findVariable(modelInfo, name).unit === unit).map((name) => run.largestMagnitude(name));
    const size = Math.max(0, ...sameUnit) || unit_exponents.reduce((product, exponent, i) => product * baseSizes[i] ** exponent, 1);
    return Number.isFinite(size) && size > 0 ? Number(size.toPrecision(1)) : 1;
  };
}

// One row of a form: symbol, description, number field, unit and slider. Calls change(value) with the value in SI units,
// slide(position, valueOf) if the slider moves, and refuse(message) if the input is not a number.
export class Field {
  constructor(id, variable, range, { change, slide, refuse }) {
    const { name, text, display_unit, factor, symbol, allowed } = variable;
    Object.assign(this, { variable, range });
    const description = `${text}${display_unit ? `, in ${display_unit}` : ""}`;
    this.number = makeElement("input", { type: "text", autocomplete: "off", id, inputmode: "decimal", title: `${name}: ${allowed}` });
    this.slider = makeElement("input", { type: "range", min: 0, max: SLIDER_STEPS, step: 1, "aria-label": `${name}: ${description}` });
    const label = makeElement("label", { for: id }, makeElement("b", { html: symbol }), ` ${text}`);
    this.element = makeElement("div", { class: "field" }, label, makeElement("span", { class: "entry" }, this.number, makeElement("span", { class: "unit" }, display_unit)), this.slider);
    this.slider.addEventListener("input", () => slide(Number(this.slider.value), (position) => sliderValue(position, range, factor)));
    this.number.addEventListener("change", () => {
      const value = parseNumber(this.number.value);
      if (!Number.isNaN(value)) {
        const inSi = value === Number(this.textOf(variable.start)) ? variable.start : value / factor;
        this.show(inSi);
        return change(inSi);
      }
      this.number.value = this.text;
      refuse(`${name} must be a number; it remains ${`${this.text} ${display_unit}`.trim()}.`);
    });
  }

  textOf(value) {
    return String(Number((value * this.variable.factor).toPrecision(FIELD_DIGITS)));
  }

  // Show a value in SI units.
  show(value) {
    this.text = this.textOf(value);
    if (this.number.value !== this.text) this.number.value = this.text;
    this.slider.value = this.position = sliderPosition(value, this.range);
    this.slider.setAttribute("aria-valuetext", formatValue(this.variable, value));
  }
}

// A drop-down list with a label.
export class Choice {
  constructor(id, text, onChange) {
    this.list = makeElement("select", { id });
    this.element = makeElement("div", { class: "choice" }, makeElement("label", { for: id }, text), this.list);
    this.list.addEventListener("change", () => onChange(this.list.value));
  }

  // Fill the list with options [value, text, title] and select one.
  fill(options, selected) {
    const key = JSON.stringify(options);
    if (key !== this.key) this.list.replaceChildren(...options.map(([value, text, title]) => makeElement("option", { value, ...(title && { title }) }, text)));
    this.key = key;
    this.list.value = String(selected);
    this.element.hidden = options.length < 2;
  }
}

// Read a number as typed, with a point or a comma as decimal sign; NaN if it is not a number, or has separators of thousands.
export function parseNumber(text) {
  const plain = text.trim().replace("−", "-").replace(/^([^.,]*),([^.,]*)$/, "$1.$2");
  const value = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(plain) ? Number(plain) : NaN;
  return Number.isFinite(value) ? value : NaN;
}

const TOLERANCES = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12];

// The options for a relative tolerance; zero is the default of the model.
export function toleranceOptions(modelInfo, selected) {
  const all = selected && !TOLERANCES.includes(selected) ? [selected, ...TOLERANCES] : TOLERANCES;
  return [[0, `default, ${formatScientific(modelInfo.tolerance)}`], ...all.map((rtol) => [rtol, formatScientific(rtol)])];
}

// The options for an enumeration.
export function itemOptions(variable) {
  return variable ? variable.items.map(({ label, value, text }) => [value, label, text]) : [];
}
