// The bodies of the stories: a block on its floor, or a pendulum. The scale depends on the width only, never on the motion,
// so that a dragged body stays under the pointer.

const STORY_NAMESPACE = "http://www.w3.org/2000/svg";

function createSvg(name, attributes, parent) {
  const created = document.createElementNS(STORY_NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) created.setAttribute(key, value);
  return parent ? parent.appendChild(created) : created;
}

function storySpring(from, to, y) {
  const [turns, end] = [30, 12];
  const step = (to - from - 2 * end) / turns;
  let path = `M${from.toFixed(2)} ${y}h${end}`;
  for (let i = 0; i < turns; i++) path += `l${(step / 2).toFixed(3)} ${i % 2 ? 9 : -9}l${(step / 2).toFixed(3)} ${i % 2 ? -9 : 9}`;
  return `${path}H${to.toFixed(2)}`;
}

// A body that can be dragged by a pointer or moved by keys.
class StoryBody {
  // `handlers`: {grab(), move(value), drop()}; `range` is how far the body can be moved to either side, `step` by one key.
  constructor(host, { range, step, name, describe, handlers }) {
    Object.assign(this, { host, range, step, describe, handlers, value: 0, held: false });
    this.svg = createSvg("svg", { role: "group", "aria-label": name });
    host.append(this.svg);
    this.build();
    this.handle.setAttribute("tabindex", 0);
    this.handle.setAttribute("role", "slider");
    this.handle.setAttribute("aria-label", name);
    this.handle.setAttribute("aria-valuemin", -range);
    this.handle.setAttribute("aria-valuemax", range);
    this.handle.setAttribute("class", "grip");
    new ResizeObserver(([{ contentRect: { width, height } }]) => {
      if (width && height && !this.held) this.layOut(width, height); // no size before the first picture
    }).observe(host);
    this.listen();
  }

  listen() {
    const { handle } = this;
    let offset = 0;
    const target = (event) => Math.min(Math.max(this.positionAt(event) - offset, -this.range), this.range);
    handle.addEventListener("pointerdown", (event) => {
      handle.setPointerCapture(event.pointerId);
      this.frame = this.svg.getBoundingClientRect(); // scale and origin stay as they are until the pointer is up
      offset = this.positionAt(event) - this.value;
      this.held = true;
      handle.classList.add("held", "pointed");
      handle.focus({ preventScroll: true });
      this.handlers.grab();
      this.handlers.move(this.value);
      event.preventDefault();
    });
    handle.addEventListener("pointermove", (event) => this.held && this.handlers.move(target(event)));
    for (const end of ["pointerup", "pointercancel"]) {
      handle.addEventListener(end, () => {
        if (!this.held) return;
        this.held = false;
        handle.classList.remove("held");
        this.handlers.drop();
      });
    }
    handle.addEventListener("keydown", (event) => {
      handle.classList.remove("pointed");
      const change = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
      if (change) {
        if (!this.keyed) this.handlers.grab();
        this.keyed = true;
        this.handlers.move(Math.min(Math.max(this.value + change * this.step, -this.range), this.range));
      } else if (event.key === "Enter" || event.key === " ") {
        if (this.keyed) this.handlers.drop();
        this.keyed = false;
      } else return;
      event.preventDefault();
    });
    handle.addEventListener("blur", () => {
      if (this.keyed) this.handlers.drop();
      this.keyed = false;
    });
  }

  announce(stuck) {
    if (this.wasStuck !== stuck) this.handle.classList.toggle("stuck", stuck);
    this.wasStuck = stuck;
    const description = this.describe(this.value, stuck);
    if (description === this.description) return;
    this.description = description;
    this.handle.setAttribute("aria-valuenow", this.value.toPrecision(3));
    this.handle.setAttribute("aria-valuetext", description);
  }
}

// A block between a spring and its floor; with `belt` the spring hangs at the right and the floor moves under it.
export class StoryBlock extends StoryBody {
  build() {
    const { svg } = this;
    this.band = createSvg("rect", { class: "band" }, svg);
    this.tag = createSvg("text", { class: "tag" }, svg);
    this.floor = createSvg("path", { class: "floor" }, svg);
    this.marks = createSvg("path", { class: "marks" }, svg);
    this.wall = createSvg("path", { class: "wall" }, svg);
    this.spring = createSvg("path", { class: "spring" }, svg);
    this.handle = createSvg("g", {}, svg);
    this.pad = createSvg("rect", { class: "pad" }, this.handle);
    this.box = createSvg("rect", { class: "body", rx: 5 }, this.handle);
    this.label = createSvg("text", { class: "mode" }, this.handle);
    this.hint = createSvg("path", { class: "hint" }, this.handle);
    this.edge = 0;
    this.shift = 0;
  }

  layOut(w, h) {
    const belt = this.belt;
    const wide = Math.max(46, Math.min(78, w * 0.09));
    const tall = Math.min(50, h - 42);
    const ground = h - 26;
    const spring = Math.max(40, w * 0.07); // its least length
    const space = w - wide - spring - 34;
    Object.assign(this, { w, h, wide, tall, ground, k: space / 2 / this.range, origin: belt ? 8 + wide / 2 + space / 2 : w - 14 - wide / 2 - space / 2 });
    this.svg.setAttribute("viewBox", `0 0 ${w} ${h}`);
    this.floor.setAttribute("d", `M0 ${ground}H${w}`);
    let marks = "";
    for (let x = -10; x < w + 20; x += 10) marks += `M${x + 6} ${ground}l-5 7`;
    this.marks.setAttribute("d", marks);
    const wall = belt ? w - 8 : 8;
    this.wallAt = wall;
    this.wall.setAttribute("d", belt ? `M${wall} ${ground - tall - 4}V${ground - 4}` : `M${wall} ${ground - tall - 8}V${ground}`);
    for (const rect of [this.box, this.pad]) {
      const more = rect === this.pad ? 6 : 0;
      Object.entries({ x: -wide / 2 - more, y: ground - tall - more, width: wide + 2 * more, height: tall + 2 * more }).forEach(([key, value]) => rect.setAttribute(key, value));
    }
    this.label.setAttribute("y", ground - tall / 2 + 4);
    const [edge, middle] = [wide / 2 + (belt ? -wide - 6 : 6), ground - tall / 2];
    this.hint.setAttribute("d", belt ? `M${edge} ${middle - 7}l-6 7l6 7` : `M${edge} ${middle - 7}l6 7l-6 7`);
    this.showBand(this.edge, this.bandLabel);
    this.moveTo(this.value, this.stuck);
  }

  // Where friction can hold the spring: within +-edge.
  showBand(edge, label = "") {
    Object.assign(this, { edge, bandLabel: label });
    if (!this.w) return;
    const { origin, k, ground } = this;
    const half = edge && Math.max(edge * k, 1);
    Object.entries({ x: origin - half, y: ground + 1, width: 2 * half, height: 7 }).forEach(([key, value]) => this.band.setAttribute(key, value));
    this.tag.setAttribute("x", origin);
    this.tag.setAttribute("y", ground + 21);
    this.tag.textContent = label;
  }

  positionAt(event) {
    return (event.clientX - this.frame.left - this.origin) / this.k;
  }

  // Put the block; `shift` in m is how far the floor has moved to the left.
  moveTo(value, stuck, shift = this.shift) {
    Object.assign(this, { value, stuck, shift });
    if (!this.w) return;
    const x = this.origin + this.k * value;
    this.handle.setAttribute("transform", `translate(${x.toFixed(2)} 0)`);
    const y = this.ground - this.tall / 2;
    this.spring.setAttribute("d", this.belt ? storySpring(x + this.wide / 2, this.wallAt, y) : storySpring(this.wallAt, x - this.wide / 2, y));
    if (this.belt) this.marks.setAttribute("transform", `translate(${(-(this.k * shift) % 10).toFixed(2)} 0)`);
    this.announce(Boolean(stuck));
    const mode = stuck ? "holds" : "slips";
    if (this.label.textContent !== mode) this.label.textContent = mode;
  }
}

export class StoryBelt extends StoryBlock {
  belt = true;
}

// A pendulum; the value is its angle in rad, positive to the right.
export class StoryPendulum extends StoryBody {
  build() {
    const { svg } = this;
    this.band = createSvg("path", { class: "wedge" }, svg);
    this.wall = createSvg("path", { class: "wall" }, svg);
    this.plumb = createSvg("path", { class: "plumb" }, svg);
    this.tag = createSvg("text", { class: "tag" }, svg);
    this.handle = createSvg("g", {}, svg);
    this.rod = createSvg("path", { class: "rod" }, this.handle);
    this.pad = createSvg("circle", { class: "pad", r: 34 }, this.handle);
    this.box = createSvg("circle", { class: "body", r: 26 }, this.handle);
    this.label = createSvg("text", { class: "mode" }, this.handle);
    this.pin = createSvg("circle", { class: "pin", r: 5 }, svg);
    this.edge = 0;
  }

  layOut(w, h) {
    Object.assign(this, { w, h, x: w / 2, y: 18, long: h - 74 });
    this.svg.setAttribute("viewBox", `0 0 ${w} ${h}`);
    const { x, y, long } = this;
    this.wall.setAttribute("d", `M${x - 46} ${y - 10}H${x + 46}M${x - 12} ${y - 10}L${x} ${y}L${x + 12} ${y - 10}`);
    this.plumb.setAttribute("d", `M${x} ${y}V${h - 16}`);
    this.rod.setAttribute("d", `M0 0V${long}`);
    this.box.setAttribute("cy", long);
    this.pad.setAttribute("cy", long);
    this.label.setAttribute("y", long + 4);
    this.pin.setAttribute("cx", x);
    this.pin.setAttribute("cy", y);
    this.showBand(this.edge, this.bandLabel);
    this.moveTo(this.value, this.stuck);
  }

  showBand(edge, label = "") {
    Object.assign(this, { edge, bandLabel: label });
    if (!this.w) return;
    const { x, y, h } = this;
    const r = h - 30;
    const a = edge;
    this.band.setAttribute("d", `M${x} ${y}L${x - r * Math.sin(a)} ${y + r * Math.cos(a)}A${r} ${r} 0 0 0 ${x + r * Math.sin(a)} ${y + r * Math.cos(a)}Z`);
    this.tag.setAttribute("x", x);
    this.tag.setAttribute("y", h - 3);
    this.tag.textContent = label;
  }

  positionAt(event) {
    return Math.atan2(event.clientX - this.frame.left - this.x, event.clientY - this.frame.top - this.y);
  }

  moveTo(value, stuck) {
    Object.assign(this, { value, stuck });
    if (!this.w) return;
    this.handle.setAttribute("transform", `translate(${this.x} ${this.y}) rotate(${((-value * 180) / Math.PI).toFixed(3)})`);
    this.announce(Boolean(stuck));
    const mode = stuck ? "holds" : "slips";
    if (this.label.textContent !== mode) this.label.textContent = mode;
  }
}
