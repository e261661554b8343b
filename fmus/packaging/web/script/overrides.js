// Changes of the state by the user: values, changes during playback, enumerations, comparison.

import { comparisonSettings, effectiveValues, findVariable, setValue } from "./state.js";

const CHATTERING_RTOL = 1e-3; // the default of many solvers
export const MIN_CHANGE_SPACING = 1 / 400; // of the run; closer changes of a variable replace each other

// Set the value in force at t in s: that of the last change up to then, or else the value from the start.
export function replaceValue(modelInfo, state, name, value, t) {
  const last = state.changes.findLast((change) => change.name === name && change.t <= t);
  if (last) last.value = value;
  else setValue(modelInfo, state.values, name, value);
}

// Set a value from t in s on. Removes later changes of the variable and replaces one just before.
export function addChange(state, name, value, t) {
  const remaining = state.changes.filter((change) => change.name !== name || change.t <= t);
  const recent = remaining.findLast((change) => change.name === name && t - change.t < MIN_CHANGE_SPACING * state.stop);
  if (recent) recent.value = value;
  else remaining.push({ t, name, value });
  state.changes = remaining.sort((a, b) => a.t - b.t);
}

// Set a friction law, a method or another enumeration. The exact method requires the hybrid law, so choosing one of them
// changes the other if necessary.
export function chooseItem(modelInfo, values, name, value) {
  setValue(modelInfo, values, name, value);
  const [method, law] = ["solver.method", "friction"].map((variable) => findVariable(modelInfo, variable));
  const [exact, hybrid] = [valueOfLabel(method, "exact"), valueOfLabel(law, "hybrid")];
  const now = effectiveValues(modelInfo, values);
  if (exact === undefined || hybrid === undefined || now["solver.method"] !== exact || now.friction === hybrid) return;
  if (name === "friction") values["solver.method"] = method.items.find((item) => item.value !== exact)?.value ?? exact;
  else values.friction = hybrid;
}

// Set an enumeration of the second run. The choice is kept even if it is the default, which the first run may not have.
export function chooseForComparison(models, state, name, value) {
  const other = models.get(state.comparison.model);
  const before = effectiveValues(other, comparisonSettings(models, state).values);
  const values = { ...before };
  chooseItem(other, values, name, value);
  for (const [key, chosen] of Object.entries(effectiveValues(other, values))) {
    if (key === name || chosen !== before[key]) state.comparison.values[key] = chosen;
  }
}

// The value of an enumeration item by its label.
export function valueOfLabel(variable, label) {
  return variable?.items.find((item) => item.label === label)?.value;
}

// Initial values of a comparison run: for the same model another law and method, for another model its defaults.
export function initialComparison(modelInfo, state, model) {
  if (model !== state.model) return {};
  const now = effectiveValues(modelInfo, state.values);
  const alternative = (name, excluded) => findVariable(modelInfo, name)?.items.find(({ label, value }) => label !== excluded && value !== now[name])?.value;
  const [law, method] = [alternative("friction"), alternative("solver.method", "exact")];
  const loose = { "solver.rtol": CHATTERING_RTOL }; // with another law the run may chatter at rest, at a tight tolerance for ever
  return { ...(law !== undefined && { friction: law, ...loose }), ...(method !== undefined && { "solver.method": method }) };
}
