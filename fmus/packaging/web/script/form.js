// All that can be set: lists, sliders and number fields, made for a model and kept at what is in force.

import { Choice, Field, items, make, tolerances } from "./controls.js";
import { told } from "./plot.js";
import { beside, inForce, named, settable, valueAt } from "./state.js";

const DIRECT = { // lists of their own: variable, words, words for the run beside
  friction: ["friction", "Friction law", "its law"],
  method: ["solver.method", "Method", "its method"],
  rtol: ["solver.rtol", "Tolerance", "its tolerance"],
};

export class Form {
  // `act` is told what people do: preset(name), choose(name, value), beside(words), body(number), put(variable, value),
  // length(s), forget(), refuse(sentence).
  constructor(models, presets, act) {
    Object.assign(this, { models, presets, act, fields: new Map() });
    const list = (id, text, onChange) => [id, new Choice(id, text, onChange)];
    const direct = Object.entries(DIRECT);
    this.lists = Object.fromEntries([
      list("preset", "Published case", act.preset),
      ...direct.map(([id, [name, text]]) => list(id, text, (value) => act.choose(name, Number(value)))),
      list("comparison", "Beside it", (model) => act.beside({ model })),
      ...direct.map(([id, [name, , text]]) => list(`comparison-${id}`, text, (value) => act.beside({ [name]: Number(value) }))),
      list("body", "Body", (value) => act.body(Number(value))),
    ]);
  }

  // The fields of another model; `usual` gives the size of a variable that starts at zero.
  build(modelInfo, usual) {
    const { act, fields } = this;
    fields.clear();
    const rows = { fields: [], rare: [] };
    const place = (variable, field) => {
      fields.set(variable.name, field);
      rows[variable.name.includes(".") ? "rare" : "fields"].push(field.element);
    };
    const own = settable(modelInfo).filter(({ name }) => !Object.values(DIRECT).some(([direct]) => direct === name));
    for (const variable of own.filter(({ type }) => type === "Real")) {
      place(variable, new Field(variable, usual(variable), (value) => act.put(variable, value), act.refuse));
    }
    for (const variable of own.filter(({ type }) => type !== "Real")) {
      const choice = new Choice(`field-${variable.name}`, variable.text, (value) => act.choose(variable.name, Number(value)));
      place(variable, { element: choice.element, put: (value) => choice.fill(items(variable), value) });
    }
    const length = { name: ".stop", symbol: "T", text: "length of the run", shown: "s", factor: 1, unit: "s", above: 0, start: modelInfo.stop, allowed: "above 0" };
    place(length, new Field(length, 0, act.length, act.refuse));
    for (const [id, elements] of Object.entries(rows)) document.getElementById(id).replaceChildren(...elements);
  }

  // What is in force; with `live`, at the cursor.
  show(state, live) {
    const modelInfo = this.models.get(state.model);
    const now = inForce(modelInfo, state.values);
    if (live) this.follow(modelInfo, state);
    else for (const [name, field] of this.fields) field.put(name === ".stop" ? state.stop : now[name]);
    const { preset, comparison, body } = this.lists;
    preset.fill([["", "none: my own"], ...[...this.presets.values()].map(({ name, title }) => [name, `${name}: ${title}`])], state.preset);
    body.fill(modelInfo.bodies.map(({ position }, i) => [i, position]), state.body);
    const comparable = [...this.models.values()].filter(({ bodies }) => bodies[0].position === modelInfo.bodies[0].position);
    comparison.fill([["", "nothing"], ...comparable.map(({ name }) => [name, name === state.model ? `${name}, otherwise` : name])], state.comparison?.model ?? "");
    this.fill("", modelInfo, now);
    const theirs = state.comparison && this.models.get(state.comparison.model);
    this.fill("comparison-", theirs, theirs ? inForce(theirs, beside(this.models, state).values) : {});
    this.tellChanges(modelInfo, state.changes);
  }

  // The fields at the cursor.
  follow(modelInfo, state) {
    for (const [name, field] of this.fields) field.put(name === ".stop" ? state.stop : valueAt(modelInfo, state, name, state.t));
  }

  fill(prefix, owner, values) {
    for (const [id, [name]] of Object.entries(DIRECT)) {
      const pairs = id === "rtol" ? tolerances : (modelInfo) => items(named(modelInfo, name));
      this.lists[prefix + id].fill(owner ? pairs(owner, values[name]) : [], values[name]);
    }
  }

  tellChanges(modelInfo, changes) {
    const [place, { length }] = [document.getElementById("changes"), changes];
    place.hidden = !length;
    if (!length) return;
    const last = changes.slice(-3).map(({ t, name, value }) => {
      const { factor, shown } = named(modelInfo, name);
      return `${name} = ${told(value * factor)} ${shown} at ${told(t)} s`;
    });
    const clear = make("button", { type: "button" }, "Forget changes");
    clear.addEventListener("click", this.act.forget);
    place.replaceChildren(`${length} change${length > 1 ? "s" : ""} while it runs; last: ${last.join("; ")}. `, clear);
  }
}
