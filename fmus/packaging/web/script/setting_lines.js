// The settings behind the results in words, for CSV files.

import { comparisonSettings, effectiveValues, findVariable } from "./state.js";

const DIGITS = 12;

function quantity({ name, factor, display_unit }, value) {
  return `${name} = ${Number((value * factor).toPrecision(DIGITS))} ${display_unit}`.trim();
}

// Parameters and inputs, or the settings of the solver (law, method and options).
function listValues(modelInfo, values, ofSolver) {
  const variables = modelInfo.variables.filter(({ name, causality, items }) =>
    (causality === "parameter" || causality === "input") && (items.length > 0 || name.startsWith("solver.")) === ofSolver);
  const all = effectiveValues(modelInfo, values);
  return variables.map((variable) => {
    const label = variable.items.find(({ value }) => value === all[variable.name])?.label;
    if (variable.name === "solver.rtol" && !all[variable.name]) return `${variable.name} = ${modelInfo.tolerance}`; // 0: the default
    return label ? `${variable.name} = ${label}` : quantity(variable, all[variable.name]);
  }).join(", ");
}

// The lines of text: model, parameters, solver, changes during the run and the second run.
export function settingLines(session, state) {
  const modelInfo = session.models.get(state.model);
  const lines = [
    `${modelInfo.name}: ${modelInfo.title} friction-fmus ${session.version}`,
    `Parameters: ${listValues(modelInfo, state.values, false)}`,
    `Solver: ${listValues(modelInfo, state.values, true)}, stop time = ${state.stop} s`,
  ];
  const changes = state.changes.map(({ t, name, value }) => `${quantity(findVariable(modelInfo, name), value)} from ${Number(t.toPrecision(DIGITS))} s on`);
  if (changes.length) lines.push(`Changes: ${changes.join("; ")}`);
  if (state.comparison) {
    const other = session.models.get(state.comparison.model);
    const { values } = comparisonSettings(session.models, state);
    lines.push(`Second run, ${other.name}: ${listValues(other, values, false)}, ${listValues(other, values, true)}`);
  }
  return lines;
}
