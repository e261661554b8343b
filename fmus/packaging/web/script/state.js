// The state of the page: all that a link carries.  Values are in SI units, by the names of variables; keys of the page
// begin with a dot, which no variable does.

const BESIDE = ".beside."; // before the names of what the run beside has

export function fresh(portrait) {
  return { model: portrait.name, values: {}, changes: [], stop: portrait.stop, t: 0, body: 0, other: null, preset: "" };
}

// A variable by its name.
export function named(portrait, name) {
  return portrait.variables.find((variable) => variable.name === name);
}

export function settable(portrait) {
  return portrait.variables.filter(({ causality }) => causality === "parameter" || causality === "input");
}

// Start value of every settable variable, and what is set.
export function inForce(portrait, values) {
  return { ...Object.fromEntries(settable(portrait).map(({ name, start }) => [name, start])), ...values };
}

// The value of a variable at a time in s: what the last change before it made of it.
export function valueAt(portrait, state, name, t) {
  const last = state.changes.filter((change) => change.name === name && change.t <= t).at(-1);
  return last ? last.value : inForce(portrait, state.values)[name];
}

// What the run beside takes: the values of the same names, and its own law, method and tolerance.
export function beside(portraits, state) {
  const [mine, theirs] = [portraits.get(state.model), portraits.get(state.other.model)];
  const known = new Map(settable(theirs).map((variable) => [variable.name, variable]));
  const same = mine === theirs;
  const takes = (name) => known.has(name) && (same || (known.get(name).type === "Real" && !name.includes(".")));
  const shared = Object.entries(inForce(mine, state.values)).filter(([name]) => takes(name));
  const changes = state.changes.filter(({ name }) => takes(name));
  return { values: { ...Object.fromEntries(shared), ...state.other.values }, changes };
}

export function written(state) {
  const words = new URLSearchParams({ ".model": state.model });
  for (const [name, value] of Object.entries(state.values)) words.set(name, value);
  for (const { t, name, value } of state.changes) words.append(".change", `${t} ${name} ${value}`);
  words.set(".stop", state.stop);
  if (state.t) words.set(".t", state.t);
  if (state.body) words.set(".body", state.body);
  if (state.preset) words.set(".preset", state.preset);
  if (state.other) {
    words.set(".beside", state.other.model);
    for (const [name, value] of Object.entries(state.other.values)) words.set(BESIDE + name, value);
  }
  return `#${words}`;
}

// The state in a link, and the words of it that mean nothing here; null without a model.
export function read(hash, portraits) {
  const words = new URLSearchParams(hash.replace(/^#/, ""));
  const portrait = portraits.get(words.get(".model"));
  if (!portrait) return null;
  const state = fresh(portrait);
  const lost = [];
  const isNumber = (word) => Boolean(word?.trim()) && isFinite(word);
  const number = (key, fallback) => (isNumber(words.get(key)) ? Number(words.get(key)) : fallback);
  const takes = (owner, name, word) => {
    const variable = settable(owner).find((each) => each.name === name);
    const among = variable?.items.length ? variable.items.some(({ value }) => value === Number(word)) : variable;
    return among && isNumber(word);
  };
  const other = portraits.get(words.get(".beside"));
  if (other) state.other = { model: other.name, values: {} };
  for (const [key, word] of words) {
    const theirs = key.startsWith(BESIDE);
    if (key === ".change") {
      const [t, name, value] = word.split(" ");
      if (takes(portrait, name, value) && isNumber(t) && Number(t) >= 0) state.changes.push({ t: Number(t), name, value: Number(value) });
      else lost.push(word);
    } else if (theirs || !key.startsWith(".")) {
      const [owner, values, name] = theirs ? [other, state.other?.values, key.slice(BESIDE.length)] : [portrait, state.values, key];
      if (owner && takes(owner, name, word)) values[name] = Number(word);
      else lost.push(key);
    }
  }
  state.changes.sort((one, next) => one.t - next.t);
  state.stop = number(".stop", state.stop) > 0 ? number(".stop", state.stop) : portrait.stop;
  state.t = Math.min(Math.max(number(".t", 0), 0), state.stop);
  state.body = portrait.bodies[number(".body", 0)] ? number(".body", 0) : 0;
  state.preset = words.get(".preset") ?? "";
  return { state, lost };
}
