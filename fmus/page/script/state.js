// The state of the page, as stored in links. Values are in SI units, by names of variables. Keys of the page itself start
// with a dot; no variable does.

const COMPARISON_PREFIX = ".compare."; // of the variables of the comparison run
const CHATTERING_RTOL = 1e-3; // the default of many solvers
export const MIN_CHANGE_SPACING = 1 / 400; // of the run; closer changes of a variable replace each other

// The default state of a model. A stop time of null is replaced when the model is compiled.
export function defaultState(modelInfo) {
  return { model: modelInfo.name, values: {}, changes: [], stop: null, t: 0, body: 0, comparison: null };
}

export function findVariable(modelInfo, name) {
  return modelInfo.variables.find((variable) => variable.name === name);
}

export function settableVariables(modelInfo) {
  return modelInfo.variables.filter(({ causality }) => causality === "parameter" || causality === "input");
}

// The values of all settable variables: the given ones, otherwise the start values.
export function effectiveValues(modelInfo, values) {
  return { ...Object.fromEntries(settableVariables(modelInfo).map(({ name, start }) => [name, start])), ...values };
}

// The value of a variable at a time in s, after the changes up to then.
export function valueAt(modelInfo, state, name, t) {
  const last = state.changes.filter((change) => change.name === name && change.t <= t).at(-1);
  return last ? last.value : effectiveValues(modelInfo, state.values)[name];
}

// Values and changes of the comparison run. It shares the physical values with the same names; friction law, method and
// tolerance are its own, unless the model is the same.
export function comparisonSettings(models, state) {
  const [own, other] = [models.get(state.model), models.get(state.comparison.model)];
  const known = new Map(settableVariables(other).map((variable) => [variable.name, variable]));
  const same = own === other;
  const isShared = (name) => known.has(name) && (same || (known.get(name).type === "Real" && !name.startsWith("solver.")));
  const shared = Object.entries(effectiveValues(own, state.values)).filter(([name]) => isShared(name));
  const changes = state.changes.filter(({ name }) => isShared(name));
  return { values: { ...Object.fromEntries(shared), ...state.comparison.values }, changes };
}

// Encode a state as a link with all values, so that it shows the same in a version with other defaults.
export function encodeState(state, models, version) {
  const modelInfo = models.get(state.model);
  const parameters = new URLSearchParams({ ".version": version, ".model": state.model });
  for (const [name, value] of Object.entries(effectiveValues(modelInfo, state.values))) parameters.set(name, value);
  for (const { t, name, value } of state.changes) parameters.append(".change", `${t} ${name} ${value}`);
  parameters.set(".stop", state.stop);
  if (state.t) parameters.set(".t", state.t);
  if (state.body) parameters.set(".body", state.body);
  if (state.comparison) {
    parameters.set(".compare", state.comparison.model);
    const { values } = comparisonSettings(models, state);
    for (const [name, value] of Object.entries(effectiveValues(models.get(state.comparison.model), values))) parameters.set(COMPARISON_PREFIX + name, value);
  }
  return `#${parameters}`;
}

// Decode a link. Returns {state, unknownKeys, version}, the version being that of the page that made the link, or null if the link names no model.
export function decodeState(hash, models) {
  const parameters = new URLSearchParams(hash.replace(/^#/, ""));
  const modelInfo = models.get(parameters.get(".model"));
  if (!modelInfo) return null;
  const state = defaultState(modelInfo);
  const unknownKeys = [];
  const isNumber = (text) => Boolean(text?.trim()) && isFinite(text);
  const number = (key, fallback) => (isNumber(parameters.get(key)) ? Number(parameters.get(key)) : fallback);
  const isValid = (owner, name, text) => {
    const variable = settableVariables(owner).find((item) => item.name === name);
    const isKnown = variable?.items.length ? variable.items.some(({ value }) => value === Number(text)) : variable;
    return isKnown && isNumber(text);
  };
  const comparison = models.get(parameters.get(".compare"));
  if (comparison) state.comparison = { model: comparison.name, values: {} };
  for (const [key, text] of parameters) {
    const isComparison = key.startsWith(COMPARISON_PREFIX);
    if (key === ".change") {
      const [t, name, value] = text.split(" ");
      if (isValid(modelInfo, name, value) && isNumber(t) && Number(t) >= 0) state.changes.push({ t: Number(t), name, value: Number(value) });
      else unknownKeys.push(text);
    } else if (isComparison || !key.startsWith(".")) {
      const [owner, values, name] = isComparison ? [comparison, state.comparison?.values, key.slice(COMPARISON_PREFIX.length)] : [modelInfo, state.values, key];
      if (!owner || !isValid(owner, name, text)) unknownKeys.push(key);
      else if (isComparison) values[name] = Number(text);
      else setValue(owner, values, name, Number(text));
    }
  }
  if (comparison) { // keeps the values that differ from those it shares with the first run
    const { values } = state.comparison;
    const shared = effectiveValues(comparison, comparisonSettings(models, { ...state, comparison: { ...state.comparison, values: {} } }).values);
    for (const name of Object.keys(values)) if (values[name] === shared[name]) delete values[name];
  }
  state.changes.sort((a, b) => a.t - b.t);
  state.stop = number(".stop", 0) > 0 ? number(".stop", 0) : null;
  state.t = Math.max(number(".t", 0), 0);
  state.body = modelInfo.bodies[number(".body", 0)] ? number(".body", 0) : 0;
  return { state, unknownKeys, version: parameters.get(".version") };
}

// Set a value from the start. Values equal to the default are left out.
export function setValue(modelInfo, values, name, value) {
  if (value === findVariable(modelInfo, name).start) delete values[name];
  else values[name] = value;
}

// ---- changes by the user

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
