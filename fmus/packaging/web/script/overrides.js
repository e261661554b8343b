// What people do to the state of the page.

import { fresh, inForce, named } from "./state.js";

export const CLOSE = 1 / 400; // of a run: changes of one variable nearer than that are one

// A value from the start on.
export function put(modelInfo, values, name, value) {
  if (value === named(modelInfo, name).start) delete values[name];
  else values[name] = value;
}

// A value from t in s on: what would change it later is gone, and what did just before.
export function change(state, name, value, t) {
  const kept = state.changes.filter((each) => each.name !== name || each.t <= t);
  const same = kept.findLast((each) => each.name === name && t - each.t < CLOSE * state.stop);
  if (same) same.value = value;
  else kept.push({ t, name, value });
  state.changes = kept.sort((a, b) => a.t - b.t);
}

// A law or a method.  The closed form holds for the hybrid law: whoever takes one of the two chooses the other, too.
export function choose(modelInfo, values, name, value) {
  put(modelInfo, values, name, value);
  const [method, law] = ["solver.method", "friction"].map((each) => named(modelInfo, each));
  const [exact, hybrid] = [labelled(method, "exact"), labelled(law, "hybrid")];
  const now = inForce(modelInfo, values);
  if (exact === undefined || hybrid === undefined || now["solver.method"] !== exact || now.friction === hybrid) return;
  if (name === "friction") values["solver.method"] = method.items.find((item) => item.value !== exact)?.value ?? exact;
  else values.friction = hybrid;
}

// The value of the item of that label.
export function labelled(variable, label) {
  return variable?.items.find((item) => item.label === label)?.value;
}

// What stands beside a run at first: of the same model its next law or method, of another what it has by itself.
export function besideAtFirst(modelInfo, state, model) {
  if (model !== state.model) return {};
  const now = inForce(modelInfo, state.values);
  const other = (name, but) => named(modelInfo, name)?.items.find(({ label, value }) => label !== but && value !== now[name])?.value;
  const [law, method] = [other("friction"), other("solver.method", "exact")];
  return { ...(law !== undefined && { friction: law }), ...(method !== undefined && { "solver.method": method }) };
}

// The state of a published case.
export function asPublished(preset, modelInfo) {
  const state = { ...fresh(modelInfo), preset: preset.name, stop: preset.stop ?? modelInfo.stop };
  const chosen = Object.entries(preset.labels).map(([name, label]) => [name, labelled(named(modelInfo, name), label)]);
  for (const [name, value] of [...Object.entries(preset.values), ...chosen]) put(modelInfo, state.values, name, value);
  return state;
}
