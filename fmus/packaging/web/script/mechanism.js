// The mechanism that moves: what is drawn follows from what the model declares of its bodies.

import { told, ticks } from "./plot.js";
import { named } from "./state.js";

const WIDE = 800;
const FLOOR = 132; // of a lane with a block
const LANE = 170;
const TALL = 230; // of what turns
const CUT = 34; // of the first lane, where nothing is
const BLOCK = { width: 92, height: 62 };
const WALL = 44;
const REST = 190; // length of a spring at rest, as drawn
const [PIN_Y, ROD] = [34, 150];
const [SMALLEST, LARGEST] = [1e-150, 1e150]; // that is drawn
const NAMESPACE = "http://www.w3.org/2000/svg";

function element(name, attributes, parent) {
  const made = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return parent ? parent.appendChild(made) : made;
}

export class Mechanism {
  // `drag` is told what is dragged: grab(body), move(position), drop().
  constructor(host, drag) {
    Object.assign(this, { host, drag, parts: [] });
  }

  // Draw the bodies of a model anew.
  build(modelInfo) {
    this.modelInfo = modelInfo;
    const bodies = modelInfo.bodies.filter((body) => body.kind !== "none");
    const lanes = Math.max(bodies.length, 1);
    const [top, tall] = bodies.some((body) => body.kind !== "block") ? [0, TALL] : [CUT, LANE * lanes - CUT];
    this.svg = element("svg", { viewBox: `0 ${top} ${WIDE} ${tall}`, role: "img", "aria-label": "" });
    this.host.replaceChildren(this.svg);
    this.host.hidden = !bodies.length;
    this.parts = bodies.map((body, lane) => {
      const group = element("g", {}, this.svg);
      return { body, group, ...(body.kind === "block" ? this.block(body, group, lane) : this.turning(body, group, lane, lanes)) };
    });
    for (const part of this.parts) this.draggable(part);
  }

  // A block on its floor, with spring and damper to the wall, or to the driver.
  block(body, group, lane) {
    const y = lane * LANE;
    element("line", { class: "floor", x1: 0, x2: WIDE, y1: y + FLOOR, y2: y + FLOOR }, group);
    if (body.friction) {
      for (let x = 4; x < WIDE; x += 12) element("line", { class: "hatch", x1: x + 7, y1: y + FLOOR, x2: x, y2: y + FLOOR + 8 }, group);
    }
    const scale = element("g", { class: "scale" }, group);
    const part = { y, scale, middle: y + FLOOR - BLOCK.height / 2 };
    if (!body.driver && (body.spring || body.dampers)) {
      element("path", { class: "wall", d: `M${WALL} ${y + 40}V${y + FLOOR}` }, group);
      for (let h = y + 46; h < y + FLOOR; h += 12) element("line", { class: "hatch", x1: WALL, y1: h, x2: WALL - 8, y2: h + 8 }, group);
    }
    if (body.spring) part.spring = element("path", { class: "spring" }, group);
    if (body.dampers) part.damper = element("path", { class: "damper" }, group);
    if (body.driver) part.driver = element("path", { class: "driver" }, group);
    part.moving = element("g", { class: "body" }, group);
    const top = y + FLOOR - BLOCK.height - (body.friction ? 0 : 8);
    element("rect", { x: -BLOCK.width / 2, y: top, width: BLOCK.width, height: BLOCK.height, rx: 5 }, part.moving);
    if (!body.friction) for (const x of [-28, 28]) element("circle", { class: "wheel", cx: x, cy: y + FLOOR - 5, r: 5 }, part.moving);
    part.label = element("text", { x: 0, y: top + BLOCK.height / 2 + 5 }, part.moving);
    if (body.friction) part.force = element("path", { class: "force" }, group);
    return part;
  }

  // A pendulum on its pin, or a rotor.
  turning(body, group, lane, lanes) {
    const x = (WIDE * (lane + 0.5)) / lanes;
    const part = { x, pin: body.kind === "pendulum" ? PIN_Y : 115 };
    const turned = { transform: `translate(${x} ${part.pin})` };
    const still = element("g", turned, group);
    if (body.kind === "pendulum") {
      element("path", { class: "wall", d: "M-46 -18H46" }, still);
      for (let h = -40; h < 46; h += 12) element("line", { class: "hatch", x1: h, y1: -18, x2: h + 8, y2: -26 }, still);
      element("path", { class: "bracket", d: "M-16 -18L0 0L16 -18" }, still);
      element("line", { class: "plumb", x1: 0, y1: 0, x2: 0, y2: ROD + 26 }, still);
    } else {
      element("circle", { class: "rim", r: 96 }, still);
      if (body.driver) part.driver = element("path", { class: "driver", d: "M0 82V110M-7 104L0 112L7 104" }, still);
    }
    part.moving = element("g", { class: "body" }, still);
    if (body.kind === "pendulum") {
      element("path", { class: "rod", d: `M-7 -8L-7 ${ROD}L7 ${ROD}L7 -8Z` }, part.moving);
      element("circle", { cx: 0, cy: ROD, r: 24 }, part.moving);
      part.pinDot = element("circle", { class: "pin", r: 6 }, still);
    } else {
      element("circle", { r: 74 }, part.moving);
      element("path", { class: "spoke", d: "M0 0V74" }, part.moving);
      part.pinDot = element("circle", { class: "pin", r: 7 }, still);
    }
    part.label = element("text", { x: 150, y: 20 }, still);
    if (body.friction) part.force = element("path", { class: "force" }, still);
    return part;
  }

  // How far the bodies of a run go, so that all of it fits.
  fit(run) {
    for (const part of this.parts.filter(({ body }) => body.kind === "block")) {
      const names = [part.body.position, part.body.driver].filter(Boolean);
      const largest = within(Math.max(...names.map((name) => run.largest(name))) || 1, SMALLEST);
      const step = ticks(0, largest, 4).at(1);
      part.reach = step * Math.ceil(largest / step - 1e-9);
      const forward = part.body.driver && run.columns[part.body.position].every((x) => x >= -0.05 * part.reach);
      part.origin = forward ? 110 : part.body.spring || part.body.dampers ? WALL + REST + BLOCK.width + 120 : WIDE / 2;
      const room = forward ? WIDE - part.origin - BLOCK.width - REST - 30 : Math.min(part.origin - WALL - BLOCK.width - 60, WIDE - part.origin - 60);
      part.pixels = room / part.reach;
      this.rule(part, forward ? 0 : -part.reach, step);
    }
    this.strongest = Math.max(0, ...this.parts.map(({ body }) => run.largest(body.friction)));
  }

  // The rule under the floor, in the unit of the position.
  rule(part, low, step) {
    const { shown, factor } = named(this.modelInfo, part.body.position);
    const y = part.y + FLOOR;
    part.scale.replaceChildren();
    for (const value of ticks(low, part.reach, Math.round((part.reach - low) / step))) {
      const x = part.origin + part.pixels * value;
      element("line", { x1: x, x2: x, y1: y + 10, y2: y + 16 }, part.scale);
      element("text", { x, y: y + 31 }, part.scale).textContent = told(value * factor, 3) + (Math.abs(value) < 1e-12 ? ` ${shown}` : "");
    }
  }

  // Where everything is at a time; `value(name)` is that of an output.
  move(value) {
    const size = (name) => within(value(name), -LARGEST);
    for (const part of this.parts) {
      const { body } = part;
      const at = size(body.position);
      const stuck = body.mode && value(body.mode) === 0;
      part.moving.classList.toggle("stuck", Boolean(stuck));
      part.at = at;
      if (body.kind === "block") this.slide(part, at, size);
      else this.turn(part, at, size);
      if (part.label && body.mode) part.label.textContent = stuck ? "sticks" : "slips";
    }
    this.svg?.setAttribute("aria-label", this.words(value));
  }

  slide(part, at, value) {
    const { body, middle } = part;
    const x = part.origin + part.pixels * at;
    part.moving.setAttribute("transform", `translate(${x.toFixed(2)} 0)`);
    const [left, right] = [x - BLOCK.width / 2, x + BLOCK.width / 2];
    const driver = body.driver ? part.origin + BLOCK.width / 2 + REST + part.pixels * value(body.driver) : 0;
    const [from, to] = body.driver ? [right, driver] : [WALL, left];
    const apart = part.damper && part.spring && !part.damper.hasAttribute("hidden") ? 17 : 0;
    part.spring?.setAttribute("d", coil(from, to, middle - apart));
    part.damper?.setAttribute("d", dashpot(from, to, middle + apart));
    part.driver?.setAttribute("d", `M${driver} ${middle - 26}V${middle + 26}M${driver} ${middle}H${driver + 34}m-9 -6l9 6l-9 6`);
    if (part.force) part.force.setAttribute("d", arrow(x, part.y + FLOOR - 6, -value(body.friction) / (this.strongest || 1)));
  }

  turn(part, at, value) {
    part.moving.setAttribute("transform", rotation(at));
    part.driver?.setAttribute("transform", rotation(value(part.body.driver)));
    if (part.force) part.force.setAttribute("d", arc(part.body.kind === "pendulum" ? 34 : 86, -value(part.body.friction) / (this.strongest || 1)));
  }

  // Which dampers are there: one whose constant is zero is not.
  equip(values) {
    for (const { body, damper } of this.parts) {
      damper?.toggleAttribute("hidden", body.dampers.some((name) => values[name] === 0));
    }
  }

  words(value) {
    const each = this.parts.map(({ body }) => {
      const { shown, factor } = named(this.modelInfo, body.position);
      const mode = body.mode ? (value(body.mode) === 0 ? ", stuck" : ", sliding") : "";
      return `${body.position} = ${told(value(body.position) * factor, 3)} ${shown}${mode}`;
    });
    return `The mechanism: ${each.join("; ")}`;
  }

  draggable(part) {
    const grip = part.moving;
    const place = (event) => {
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
      if (part.body.kind === "block") return (x - part.origin) / part.pixels;
      return Math.atan2(x - part.x, y - part.pin);
    };
    let offset = null;
    grip.addEventListener("pointerdown", (event) => {
      grip.setPointerCapture(event.pointerId);
      offset = place(event) - part.at;
      this.drag.grab(part.body);
      event.preventDefault();
    });
    grip.addEventListener("pointermove", (event) => offset !== null && this.drag.move(place(event) - offset));
    for (const end of ["pointerup", "pointercancel"]) {
      grip.addEventListener(end, () => {
        if (offset !== null) this.drag.drop();
        offset = null;
      });
    }
  }
}

function within(value, low) {
  return Math.min(Math.max(value, low), LARGEST);
}

// Positive angles turn against the clock.
function rotation(angle) {
  return `rotate(${(((-angle % (2 * Math.PI)) * 180) / Math.PI).toFixed(3)})`;
}

function coil(from, to, y) {
  const [turns, end] = [18, 16];
  const step = (to - from - 2 * end) / turns;
  let path = `M${from.toFixed(1)} ${y}h${end}`;
  for (let i = 0; i < turns; i++) path += `l${(step / 2).toFixed(2)} ${i % 2 ? 13 : -13}l${(step / 2).toFixed(2)} ${i % 2 ? -13 : 13}`;
  return `${path}H${to.toFixed(1)}`;
}

function dashpot(from, to, y) {
  const middle = from + 0.45 * (to - from);
  const cup = Math.min(60, Math.abs(to - from) / 3);
  return `M${from} ${y}H${middle}M${middle + cup} ${y - 9}H${middle}V${y + 9}H${middle + cup}M${middle + cup * 0.6} ${y - 6}v12m0 -6H${to}`;
}

// An arrow whose length is a share of the longest.
function arrow(x, y, share) {
  const length = 70 * share;
  if (Math.abs(length) < 2) return "";
  const tip = 7 * Math.sign(share);
  return `M${x} ${y}h${length}m${-tip} -5l${tip} 5l${-tip} 5`;
}

// An arc about the pin that turns by a share of a third of a turn; positive angles turn against the clock.
function arc(radius, share) {
  const angle = (2 * Math.PI * share) / 3;
  if (Math.abs(angle) < 0.03) return "";
  const point = (a, r) => `${(r * Math.sin(a)).toFixed(2)} ${(r * Math.cos(a)).toFixed(2)}`;
  const back = angle - 0.16 * Math.sign(angle);
  return `M${point(0, radius)}A${radius} ${radius} 0 0 ${angle > 0 ? 0 : 1} ${point(angle, radius)}` +
    `M${point(back, radius - 6)}L${point(angle, radius)}L${point(back, radius + 6)}`;
}
