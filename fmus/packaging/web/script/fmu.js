// One instance of a model, spoken to by FMI 2.0.

const CO_SIMULATION = 1;
const WARNING = 1; // above it a status is a failure
const CALLBACKS = 32; // bytes of a table of callbacks, all left out

// The sentence of an FMU that cannot go on.
export class Refused extends Error {}

export class Fmu {
  // `portrait` is what the page knows of the model, `code` what load() gave.
  constructor(portrait, { exports, said }) {
    Object.assign(this, { portrait, exports, said, readers: new Map() });
    this.variables = new Map(portrait.variables.map((variable, reference) => [variable.name, { ...variable, reference }]));
    const callbacks = exports.malloc(CALLBACKS);
    new Uint8Array(exports.memory.buffer, callbacks, CALLBACKS).fill(0);
    this.references = exports.malloc(4 * portrait.variables.length);
    this.values = exports.malloc(8 * portrait.variables.length);
    const [name, guid] = [portrait.name, portrait.guid].map((text) => this.text(text));
    this.component = exports.fmi2Instantiate(name, CO_SIMULATION, guid, 0, callbacks, 0, 0);
    if (!this.component) throw new Refused(said());
  }

  text(words) {
    const bytes = new TextEncoder().encode(words + "\0");
    const place = this.exports.malloc(bytes.length);
    new Uint8Array(this.exports.memory.buffer, place, bytes.length).set(bytes);
    return place;
  }

  check(status) {
    if (status <= WARNING) return;
    const sentence = this.said().trim();
    throw new Refused(sentence.replace(/^\w+ \([^)]*\): /, "") || `${this.portrait.name} refuses the call`);
  }

  // Begin a run from zero to `stop` in s, with these values by name.
  begin(values, stop) {
    const { exports, component } = this;
    this.check(exports.fmi2Reset(component));
    for (const [name, value] of Object.entries(values)) this.set(name, value);
    this.check(exports.fmi2SetupExperiment(component, 0, 0, 0, 1, stop));
    this.check(exports.fmi2EnterInitializationMode(component));
    this.check(exports.fmi2ExitInitializationMode(component));
  }

  set(name, value) {
    const { type, reference } = this.variables.get(name);
    const memory = new DataView(this.exports.memory.buffer);
    memory.setUint32(this.references, reference, true);
    if (type === "Real") memory.setFloat64(this.values, value, true);
    else memory.setInt32(this.values, value, true);
    const call = type === "Real" ? "fmi2SetReal" : "fmi2SetInteger";
    this.check(this.exports[call](this.component, this.references, 1, this.values));
  }

  step(t, h) {
    this.check(this.exports.fmi2DoStep(this.component, t, h, 1));
  }

  // A function that reads these variables, all Real or none, into the same array each time it is called.
  reader(names) {
    const key = names.join(" ");
    if (!this.readers.has(key)) this.readers.set(key, this.reading(names));
    return this.readers.get(key);
  }

  reading(names) {
    const { exports, component } = this;
    const variables = names.map((name) => this.variables.get(name));
    const real = variables[0]?.type === "Real";
    const references = exports.malloc(4 * names.length);
    const values = exports.malloc(8 * names.length);
    new Uint32Array(exports.memory.buffer, references, names.length).set(variables.map((variable) => variable.reference));
    const get = real ? exports.fmi2GetReal : exports.fmi2GetInteger;
    const Values = real ? Float64Array : Int32Array;
    let view = new Values(exports.memory.buffer, values, names.length);
    return () => {
      if (names.length === 0) return view;
      this.check(get(component, references, names.length, values));
      if (view.length === 0) view = new Values(exports.memory.buffer, values, names.length); // the memory has grown
      return view;
    };
  }
}
