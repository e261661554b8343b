// The form with all settings: lists, sliders and number fields.

import { Choice, Field, itemOptions, makeElement, toleranceOptions } from "./controls.js";
import { formatNumber } from "./plot.js";
import { comparisonSettings, effectiveValues, findVariable, settableVariables, valueAt } from "./state.js";

const SOLVER_LISTS = { // id: variable, label, label for the comparison run
  friction: ["friction", "Friction law", "2nd run: law"],
  method: ["solver.method", "Method", "2nd run: method"],
  rtol: ["solver.rtol", "Tolerance", "2nd run: tolerance"],
};

export class Form {
  // `actions` has the functions to call on input: choose(name, value), compare(values), body(index),
  // setVariable(variable, value), slideVariable(variable, position, valueOf), setStopTime(seconds), clearChanges(), reportError(message).
  constructor(models, actions) {
    Object.assign(this, { models, actions, fields: new Map() });
    const list = (id, text, onChange) => [id, new Choice(id, text, onChange)];
    const solverLists = Object.entries(SOLVER_LISTS);
    this.lists = Object.fromEntries([
      ...solverLists.map(([id, [name, text]]) => list(id, text, (value) => actions.choose(name, Number(value)))),
      list("comparison", "Compare with", (model) => actions.compare({ model })),
      ...solverLists.map(([id, [name, , text]]) => list(`comparison-${id}`, text, (value) => actions.compare({ [name]: Number(value) }))),
      list("body", "Body", (value) => actions.body(Number(value))),
    ]);
  }

  // Create the fields of a model; `stop` is its default stop time, and `typicalSize` estimates the size of variables that
  // start at zero.
  build(modelInfo, stop, typicalSize) {
    const { actions, fields } = this;
    fields.clear();
    const rows = { fields: [], "solver-fields": [] };
    const addField = (variable, field) => {
      fields.set(variable.name, field);
      rows[variable.name.startsWith("solver.") ? "solver-fields" : "fields"].push(field.element);
    };
    const variables = settableVariables(modelInfo).filter(({ name }) => !Object.values(SOLVER_LISTS).some(([listed]) => listed === name));
    for (const variable of variables.filter(({ type }) => type === "Real")) {
      const slide = (position, valueOf) => actions.slideVariable(variable, position, valueOf);
      addField(variable, new Field(variable, typicalSize(variable), (value) => actions.setVariable(variable, value), actions.reportError, slide));
    }
    for (const variable of variables.filter(({ type }) => type !== "Real")) {
      const choice = new Choice(`field-${variable.name}`, variable.text, (value) => actions.choose(variable.name, Number(value)));
      addField(variable, { element: choice.element, show: (value) => choice.fill(itemOptions(variable), value) });
    }
    const stopTime = { name: ".stop", symbol: "T", text: "stop time", display_unit: "s", factor: 1, unit: "s", above: 0, start: stop, allowed: "above 0" };
    addField(stopTime, new Field(stopTime, 0, actions.setStopTime, actions.reportError));
    for (const [id, elements] of Object.entries(rows)) document.getElementById(id).replaceChildren(...elements);
  }

  // Show the values of a state at the cursor time.
  show(state) {
    const modelInfo = this.models.get(state.model);
    const values = effectiveValues(modelInfo, state.values);
    this.follow(modelInfo, state);
    const { comparison, body } = this.lists;
    body.fill(modelInfo.bodies.map(({ position }, i) => [i, position]), state.body);
    const comparable = [...this.models.values()].filter(({ bodies }) => bodies[0].position === modelInfo.bodies[0].position);
    comparison.fill([["", "nothing"], ...comparable.map(({ name }) => [name, name === state.model ? "same model" : name])], state.comparison?.model ?? "");
    this.fillSolverLists("", modelInfo, values);
    const other = state.comparison && this.models.get(state.comparison.model);
    this.fillSolverLists("comparison-", other, other ? effectiveValues(other, comparisonSettings(this.models, state).values) : {});
    this.showChanges(modelInfo, state.changes);
  }

  // Show the values at the cursor time.
  follow(modelInfo, state) {
    for (const [name, field] of this.fields) field.show(name === ".stop" ? state.stop : valueAt(modelInfo, state, name, state.t));
  }

  fillSolverLists(prefix, modelInfo, values) {
    for (const [id, [name]] of Object.entries(SOLVER_LISTS)) {
      const options = id === "rtol" ? toleranceOptions : (model) => itemOptions(findVariable(model, name));
      this.lists[prefix + id].fill(modelInfo ? options(modelInfo, values[name]) : [], values[name]);
    }
  }

  showChanges(modelInfo, changes) {
    const [paragraph, { length }] = [document.getElementById("changes"), changes];
    paragraph.hidden = !length;
    if (!length) return;
    const last = changes.slice(-3).map(({ t, name, value }) => {
      const { factor, display_unit } = findVariable(modelInfo, name);
      return `${name} = ${formatNumber(value * factor)} ${display_unit} at ${formatNumber(t)} s`;
    });
    const clear = makeElement("button", { type: "button" }, "Clear changes");
    clear.addEventListener("click", this.actions.clearChanges);
    paragraph.replaceChildren(`${length} change${length > 1 ? "s" : ""} during the run; last: ${last.join("; ")}. `, clear);
  }
}
