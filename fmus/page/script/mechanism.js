// The animated mechanism. What it shows follows from the bodies that the model declares.

import { makeSvg } from "./controls.js";
import { formatNumber, formatValue } from "./numbers.js";
import { ticks } from "./plot.js";
import { findVariable } from "./state.js";

const WIDTH = 800;
const FLOOR_Y = 132; // in the lane of a block
const LANE_HEIGHT = 170;
const ROTATION_HEIGHT = 230; // of a pendulum or rotor
const TOP_MARGIN = 34; // empty part of the first lane
const BLOCK = { width: 92, height: 62 };
const WALL_X = 44;
const REST_LENGTH = 190; // drawn length of a relaxed spring
const [PIN_Y, ROD_LENGTH] = [34, 150];
const [SMALLEST, LARGEST] = [1e-150, 1e150]; // limits of drawn values
const SHORTEST_SPRING = 40; // drawn length to which a dragged block can compress its spring
const SCALE_MARGIN = 40; // drawn length by which a motion may exceed the scale before the scale changes
const DRAG_RESOLUTION = 0.1; // drawn length, or degrees
const [KEY_STEP, KEY_ANGLE] = [0.05, Math.PI / 180]; // of the range of a block, and for a rotation, by one key

export class Mechanism {
  // Calls `drag` while a body is dragged: grab(body, position), move(position), drop().
  constructor(host, drag) {
    Object.assign(this, { host, drag, parts: [], held: null }); // held: the part that is dragged
  }

  // Create the drawing of a model.
  build(modelInfo) {
    this.modelInfo = modelInfo;
    const bodies = modelInfo.bodies.filter((body) => body.kind !== "none");
    const lanes = Math.max(bodies.length, 1);
    const [top, height] = bodies.some((body) => body.kind !== "block") ? [0, ROTATION_HEIGHT] : [TOP_MARGIN, LANE_HEIGHT * lanes - TOP_MARGIN];
    this.svg = makeSvg("svg", { viewBox: `0 ${top} ${WIDTH} ${height}`, role: "group", "aria-label": "" });
    this.host.replaceChildren(this.svg);
    this.host.hidden = !bodies.length;
    this.held = null;
    this.parts = bodies.map((body, lane) => {
      const group = makeSvg("g", {}, this.svg);
      const part = body.kind === "block" ? this.block(body, group, lane) : this.rotating(body, group, lane, lanes);
      return { body, group, pull: makeSvg("path", { class: "pull" }, group), ...part };
    });
    for (const part of this.parts) this.makeDraggable(part);
  }

  // A block on the floor, with spring and damper to the wall or to the driver.
  block(body, group, lane) {
    const y = lane * LANE_HEIGHT;
    makeSvg("line", { class: "floor", x1: 0, x2: WIDTH, y1: y + FLOOR_Y, y2: y + FLOOR_Y }, group);
    if (body.friction) {
      for (let x = 4; x < WIDTH; x += 12) makeSvg("line", { class: "hatch", x1: x + 7, y1: y + FLOOR_Y, x2: x, y2: y + FLOOR_Y + 8 }, group);
    }
    const scale = makeSvg("g", { class: "scale" }, group);
    const part = { y, scale, middle: y + FLOOR_Y - BLOCK.height / 2 };
    if (!body.driver && (body.spring || body.dampers)) {
      makeSvg("path", { class: "wall", d: `M${WALL_X} ${y + 40}V${y + FLOOR_Y}` }, group);
      for (let h = y + 46; h < y + FLOOR_Y; h += 12) makeSvg("line", { class: "hatch", x1: WALL_X, y1: h, x2: WALL_X - 8, y2: h + 8 }, group);
    }
    if (body.spring) part.spring = makeSvg("path", { class: "spring" }, group);
    if (body.dampers) part.damper = makeSvg("path", { class: "damper" }, group);
    if (body.driver) part.driver = makeSvg("path", { class: "driver" }, group);
    part.moving = makeSvg("g", { class: "body" }, group);
    const top = y + FLOOR_Y - BLOCK.height - (body.friction ? 0 : 8);
    makeSvg("rect", { x: -BLOCK.width / 2, y: top, width: BLOCK.width, height: BLOCK.height, rx: 5 }, part.moving);
    if (!body.friction) for (const x of [-28, 28]) makeSvg("circle", { class: "wheel", cx: x, cy: y + FLOOR_Y - 5, r: 5 }, part.moving);
    part.label = makeSvg("text", { x: 0, y: top + BLOCK.height / 2 + 5 }, part.moving);
    if (body.friction) part.force = makeSvg("path", { class: "force" }, group);
    if (body.friction) part.forceValue = makeSvg("text", { class: "value", y: y + FLOOR_Y - BLOCK.height - 8 }, group);
    return part;
  }

  // A pendulum on its pin, or a rotor.
  rotating(body, group, lane, lanes) {
    const x = (WIDTH * (lane + 0.5)) / lanes;
    const part = { x, pin: body.kind === "pendulum" ? PIN_Y : 115 };
    const atPin = { transform: `translate(${x} ${part.pin})` };
    const fixed = makeSvg("g", atPin, group);
    if (body.kind === "pendulum") {
      makeSvg("path", { class: "wall", d: "M-46 -18H46" }, fixed);
      for (let h = -40; h < 46; h += 12) makeSvg("line", { class: "hatch", x1: h, y1: -18, x2: h + 8, y2: -26 }, fixed);
      makeSvg("path", { class: "bracket", d: "M-16 -18L0 0L16 -18" }, fixed);
      makeSvg("line", { class: "plumb", x1: 0, y1: 0, x2: 0, y2: ROD_LENGTH + 26 }, fixed);
    } else {
      makeSvg("circle", { class: "rim", r: 96 }, fixed);
      if (body.driver) part.driver = makeSvg("path", { class: "driver", d: "M0 82V110M-7 104L0 112L7 104" }, fixed);
    }
    part.moving = makeSvg("g", { class: "body" }, fixed);
    if (body.kind === "pendulum") {
      makeSvg("path", { class: "rod", d: `M-7 -8L-7 ${ROD_LENGTH}L7 ${ROD_LENGTH}L7 -8Z` }, part.moving);
      makeSvg("circle", { cx: 0, cy: ROD_LENGTH, r: 24 }, part.moving);
      part.pinDot = makeSvg("circle", { class: "pin", r: 6 }, fixed);
    } else {
      makeSvg("circle", { r: 74 }, part.moving);
      makeSvg("path", { class: "spoke", d: "M0 0V74" }, part.moving);
      part.pinDot = makeSvg("circle", { class: "pin", r: 7 }, fixed);
    }
    part.label = makeSvg("text", { x: 150, y: 20 }, fixed);
    if (body.friction) part.force = makeSvg("path", { class: "force" }, fixed);
    return part;
  }

  // Scale the drawing to the range of a run. A scale that still suits the run stays, and so does any while a body is
  // dragged: otherwise the body would move away from the pointer.
  fit(run) {
    this.canStick = run.itemLabel("friction") !== "sign"; // whose mode is 0 at a speed of 0
    if (this.held) return;
    for (const part of this.parts.filter(({ body }) => body.kind === "block")) {
      const names = [part.body.position, part.body.driver].filter(Boolean);
      const largest = clamp(Math.max(...names.map((name) => run.largestMagnitude(name))) || 1, SMALLEST);
      if (part.pixels && largest > part.range / 3 && (largest - part.range) * part.pixels < SCALE_MARGIN) continue;
      const step = ticks(0, largest, 4).at(1);
      part.range = step * Math.ceil(largest / step - 1e-9);
      const movesForward = part.body.driver && run.columns[part.body.position].every((x) => x >= -0.05 * part.range);
      part.origin = movesForward ? 110 : part.body.spring || part.body.dampers ? WALL_X + REST_LENGTH + BLOCK.width + 120 : WIDTH / 2;
      const space = movesForward ? WIDTH - part.origin - BLOCK.width - REST_LENGTH - 30 : Math.min(part.origin - WALL_X - BLOCK.width - 60, WIDTH - part.origin - 60);
      part.pixels = space / part.range;
      this.drawScale(part, movesForward ? 0 : -part.range, step);
    }
    this.largestForce = Math.max(0, ...this.parts.map(({ body }) => run.largestMagnitude(body.friction)));
  }

  // Draw the scale below the floor, in the display unit of the position.
  drawScale(part, low, step) {
    const { display_unit, factor } = findVariable(this.modelInfo, part.body.position);
    const y = part.y + FLOOR_Y;
    part.scale.replaceChildren();
    for (const value of ticks(low, part.range, Math.round((part.range - low) / step))) {
      const x = part.origin + part.pixels * value;
      makeSvg("line", { x1: x, x2: x, y1: y + 10, y2: y + 16 }, part.scale);
      makeSvg("text", { x, y: y + 31 }, part.scale).textContent = formatNumber(value * factor, 3) + (Math.abs(value) < 1e-12 ? ` ${display_unit}` : "");
    }
  }

  // Move everything to a point in time; `value(name)` returns an output there.
  move(value) {
    const limited = (name) => clamp(value(name), -LARGEST);
    for (const part of this.parts) {
      const { body } = part;
      const position = limited(body.position);
      const stuck = body.mode && this.canStick && value(body.mode) === 0;
      part.moving.classList.toggle("stuck", Boolean(stuck));
      part.moving.classList.toggle("slipping", Boolean(body.friction) && !stuck);
      Object.assign(part, { position, stuck });
      part.driverPosition = body.driver ? value(body.driver) : 0;
      if (body.kind === "block") this.moveBlock(part, position, limited);
      else this.rotate(part, position, limited);
      part.pull.setAttribute("d", part === this.held && Number.isFinite(part.target) ? this.pullLine(part) : "");
      if (part.label && body.mode) part.label.textContent = stuck ? "sticks" : "slips";
    }
    this.svg?.setAttribute("aria-label", `Mechanism: ${this.parts.map((part) => this.describe(part)).join("; ")}`);
    for (const part of this.parts) this.describeHandle(part);
  }

  moveBlock(part, position, value) {
    const { body, middle } = part;
    const x = part.origin + part.pixels * position;
    part.moving.setAttribute("transform", `translate(${x.toFixed(2)} 0)`);
    const [left, right] = [x - BLOCK.width / 2, x + BLOCK.width / 2];
    const driver = body.driver ? part.origin + BLOCK.width / 2 + REST_LENGTH + part.pixels * value(body.driver) : 0;
    const [from, to] = body.driver ? [right, driver] : [WALL_X, left];
    const spacing = part.damper && part.spring && !part.damper.hasAttribute("hidden") ? 17 : 0;
    part.spring?.setAttribute("d", coil(from, to, middle - spacing));
    part.damper?.setAttribute("d", dashpot(from, to, middle + spacing));
    part.driver?.setAttribute("d", `M${driver} ${middle - 26}V${middle + 26}M${driver} ${middle}H${driver + 34}m-9 -6l9 6l-9 6`);
    if (part.forceValue) {
      part.forceValue.setAttribute("x", x);
      part.forceValue.textContent = this.describeForce(body, value);
    }
    if (part.force) part.force.setAttribute("d", arrow(x, part.y + FLOOR_Y - 6, -value(body.friction) / (this.largestForce || 1)));
  }

  rotate(part, angle, value) {
    part.moving.setAttribute("transform", rotation(angle));
    part.driver?.setAttribute("transform", rotation(value(part.body.driver)));
    if (part.force) part.force.setAttribute("d", arc(part.body.kind === "pendulum" ? 34 : 86, -value(part.body.friction) / (this.largestForce || 1)));
  }

  // The friction on a body: the negative of the variable, in the direction of the arrow.
  describeForce({ friction }, value) {
    return `friction ${formatValue(findVariable(this.modelInfo, friction), -value(friction), 3)}`;
  }

  // Hide dampers with a coefficient of zero.
  showDampers(values) {
    for (const { body, damper } of this.parts) {
      damper?.toggleAttribute("hidden", body.dampers.some((name) => values[name] === 0));
    }
  }

  describe({ body, position, stuck }) {
    const mode = body.mode ? (stuck ? ", stuck" : ", sliding") : "";
    return `${body.position} = ${formatValue(findVariable(this.modelInfo, body.position), position, 3)}${mode}`;
  }

  // State the position of a body to readers who move it by keys.
  describeHandle(part) {
    const { factor } = findVariable(this.modelInfo, part.body.position);
    const range = part.range ?? Math.PI;
    const numbers = { "aria-valuemin": -range * factor, "aria-valuemax": range * factor, "aria-valuenow": part.position * factor };
    for (const [name, number] of Object.entries(numbers)) part.moving.setAttribute(name, number.toPrecision(3));
    part.moving.setAttribute("aria-valuetext", this.describe(part));
  }

  // The line from a dragged body to the pointer; only a body that is pulled while it moves is not under the pointer.
  pullLine({ body, x, pin, origin, pixels, middle, position, target }) {
    if (body.kind === "block") return `M${origin + pixels * position} ${middle}H${origin + pixels * target}`;
    const point = (angle) => `${(x + ROD_LENGTH * Math.sin(angle)).toFixed(1)} ${(pin + ROD_LENGTH * Math.cos(angle)).toFixed(1)}`;
    return `M${point(position)}L${point(target)}`;
  }

  // The positions to which a block can be dragged: it stays in the picture and does not pass the ends of its spring.
  dragRange({ body, origin, pixels, driverPosition }) {
    const half = BLOCK.width / 2;
    const left = !body.driver && (body.spring || body.dampers) ? WALL_X + SHORTEST_SPRING + half : half;
    const driver = origin + half + REST_LENGTH + pixels * driverPosition - SHORTEST_SPRING - half;
    const right = body.driver ? Math.min(driver, WIDTH - half) : WIDTH - half;
    return [left, right].map((x) => (x - origin) / pixels);
  }

  // The position at the pointer, without rounding.
  pointerPosition(part, event) {
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    return part.body.kind === "block" ? (x - part.origin) / part.pixels : Math.atan2(x - part.x, y - part.pin);
  }

  // The position to which a body is dragged: one that the drawing can show, with the digits that it resolves.
  dragTarget(part, position) {
    const { factor } = findVariable(this.modelInfo, part.body.position);
    let target = position;
    if (part.body.kind === "block") {
      const [low, high] = this.dragRange(part);
      target = Math.min(Math.max(target, low), high);
    }
    const resolution = part.body.kind === "block" ? (DRAG_RESOLUTION * factor) / part.pixels : DRAG_RESOLUTION;
    const digits = Math.min(Math.max(Math.ceil(-Math.log10(resolution)), 0), 100);
    return Number((target * factor).toFixed(digits)) / factor;
  }

  // Let the pointer and the arrow keys drag a body.
  makeDraggable(part) {
    const handle = part.moving;
    const { text } = findVariable(this.modelInfo, part.body.position);
    const attributes = { role: "slider", tabindex: 0, "aria-label": `${text}: drag, or press the arrow keys and then Enter` };
    for (const [name, value] of Object.entries(attributes)) handle.setAttribute(name, value);
    let offset = 0;
    const grab = () => {
      this.held = part;
      part.target = this.dragTarget(part, part.position);
      this.drag.grab(part.body, part.target);
    };
    const move = (position) => {
      part.target = this.dragTarget(part, position);
      this.drag.move(part.target);
    };
    const drop = () => {
      if (this.held !== part) return;
      this.held = part.target = null;
      this.drag.drop();
    };
    handle.addEventListener("pointerdown", (event) => {
      if (this.held) return;
      handle.setPointerCapture(event.pointerId);
      offset = this.pointerPosition(part, event) - part.position;
      grab();
      event.preventDefault();
    });
    handle.addEventListener("pointermove", (event) => this.held === part && move(this.pointerPosition(part, event) - offset));
    for (const end of ["pointerup", "pointercancel", "blur"]) handle.addEventListener(end, drop);
    handle.addEventListener("keydown", (event) => {
      const direction = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
      if (direction) {
        if (!this.held) grab();
        move(part.target + direction * (part.range ? KEY_STEP * part.range : KEY_ANGLE));
      } else if (event.key === "Enter") drop();
      else return;
      event.preventDefault();
    });
  }
}

function clamp(value, low) {
  return Math.min(Math.max(value, low), LARGEST);
}

// The transform for an angle; positive angles are counterclockwise.
function rotation(angle) {
  return `rotate(${(((-angle % (2 * Math.PI)) * 180) / Math.PI).toFixed(3)})`;
}

// The path of a spring.
function coil(from, to, y) {
  const [windings, end] = [18, 16];
  const step = (to - from - 2 * end) / windings;
  let path = `M${from.toFixed(1)} ${y}h${end}`;
  for (let i = 0; i < windings; i++) path += `l${(step / 2).toFixed(2)} ${i % 2 ? 13 : -13}l${(step / 2).toFixed(2)} ${i % 2 ? -13 : 13}`;
  return `${path}H${to.toFixed(1)}`;
}

// The path of a damper.
function dashpot(from, to, y) {
  const middle = from + 0.45 * (to - from);
  const cup = Math.min(60, Math.abs(to - from) / 3);
  return `M${from} ${y}H${middle}M${middle + cup} ${y - 9}H${middle}V${y + 9}H${middle + cup}M${middle + cup * 0.6} ${y - 6}v12m0 -6H${to}`;
}

// The path of a horizontal arrow; `fraction` of the maximum length.
function arrow(x, y, fraction) {
  const length = 70 * fraction;
  if (Math.abs(length) < 2) return "";
  const tip = 7 * Math.sign(fraction);
  return `M${x} ${y}h${length}m${-tip} -5l${tip} 5l${-tip} 5`;
}

// The path of an arc with an arrowhead; `fraction` of 120 degrees, positive counterclockwise.
function arc(radius, fraction) {
  const angle = (2 * Math.PI * fraction) / 3;
  if (Math.abs(angle) < 0.03) return "";
  const point = (a, r) => `${(r * Math.sin(a)).toFixed(2)} ${(r * Math.cos(a)).toFixed(2)}`;
  const back = angle - 0.16 * Math.sign(angle);
  return `M${point(0, radius)}A${radius} ${radius} 0 0 ${angle > 0 ? 0 : 1} ${point(angle, radius)}` +
    `M${point(back, radius - 6)}L${point(angle, radius)}L${point(back, radius + 6)}`;
}
