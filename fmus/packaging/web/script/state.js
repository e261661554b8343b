// The state of the page: all that a link carries.  Values are in SI units, by the names of variables; keys of the page
// begin with a dot, which no variable does.

const BESIDE = ".compare."; // before the names of what the run beside has

export function fresh(modelInfo) {
  return { model: modelInfo.name, values: {}, changes: [], stop: modelInfo.stop, t: 0, body: 0, comparison: null, preset: "" };
}

// A variable by its name.
export function named(modelInfo, name) {
  return modelInfo.variables.find((variable) => variable.name === name);
}

export function settable(modelInfo) {
  return modelInfo.variables.filter(({ causality }) => causality === "parameter" || causality === "input");
}

// Start value of every settable variable, and what is set.
export function inForce(modelInfo, values) {
  return { ...Object.fromEntries(settable(modelInfo).map(({ name, start }) => [name, start])), ...values };
}

// The value of a variable at a time in s: what the last change before it made of it.
export function valueAt(modelInfo, state, name, t) {
  const last = state.changes.filter((change) => change.name === name && change.t <= t).at(-1);
  return last ? last.value : inForce(modelInfo, state.values)[name];
}

// What the run beside takes: the values of the same names, and its own law, method and tolerance.
export function beside(models, state) {
  const [mine, theirs] = [models.get(state.model), models.get(state.comparison.model)];
  const known = new Map(settable(theirs).map((variable) => [variable.name, variable]));
  const same = mine === theirs;
  const takes = (name) => known.has(name) && (same || (known.get(name).type === "Real" && !name.includes(".")));
  const shared = Object.entries(inForce(mine, state.values)).filter(([name]) => takes(name));
  const changes = state.changes.filter(({ name }) => takes(name));
  return { values: { ...Object.fromEntries(shared), ...state.comparison.values }, changes };
}

export function written(state) {
  const words = new URLSearchParams({ ".model": state.model });
  for (const [name, value] of Object.entries(state.values)) words.set(name, value);
  for (const { t, name, value } of state.changes) words.append(".change", `${t} ${name} ${value}`);
  words.set(".stop", state.stop);
  if (state.t) words.set(".t", state.t);
  if (state.body) words.set(".body", state.body);
  if (state.preset) words.set(".preset", state.preset);
  if (state.comparison) {
    words.set(".compare", state.comparison.model);
    for (const [name, value] of Object.entries(state.comparison.values)) words.set(BESIDE + name, value);
  }
  return `#${words}`;
}

// The state in a link, and the words of it that mean nothing here; null without a model.
export function read(hash, models) {
  const words = new URLSearchParams(hash.replace(/^#/, ""));
  const modelInfo = models.get(words.get(".model"));
  if (!modelInfo) return null;
  const state = fresh(modelInfo);
  const lost = [];
  const isNumber = (word) => Boolean(word?.trim()) && isFinite(word);
  const number = (key, fallback) => (isNumber(words.get(key)) ? Number(words.get(key)) : fallback);
  const takes = (owner, name, word) => {
    const variable = settable(owner).find((each) => each.name === name);
    const among = variable?.items.length ? variable.items.some(({ value }) => value === Number(word)) : variable;
    return among && isNumber(word);
  };
  const comparison = models.get(words.get(".compare"));
  if (comparison) state.comparison = { model: comparison.name, values: {} };
  for (const [key, word] of words) {
    const theirs = key.startsWith(BESIDE);
    if (key === ".change") {
      const [t, name, value] = word.split(" ");
      if (takes(modelInfo, name, value) && isNumber(t) && Number(t) >= 0) state.changes.push({ t: Number(t), name, value: Number(value) });
      else lost.push(word);
    } else if (theirs || !key.startsWith(".")) {
      const [owner, values, name] = theirs ? [comparison, state.comparison?.values, key.slice(BESIDE.length)] : [modelInfo, state.values, key];
      if (owner && takes(owner, name, word)) values[name] = Number(word);
      else lost.push(key);
    }
  }
  state.changes.sort((a, b) => a.t - b.t);
  state.stop = number(".stop", state.stop) > 0 ? number(".stop", state.stop) : modelInfo.stop;
  state.t = Math.min(Math.max(number(".t", 0), 0), state.stop);
  state.body = modelInfo.bodies[number(".body", 0)] ? number(".body", 0) : 0;
  state.preset = words.get(".preset") ?? "";
  return { state, lost };
}
