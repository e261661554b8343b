// A number in the text that can be dragged with the pointer or changed with the arrow keys.

const PIXELS_PER_STEP = 6;
const LARGE_STEP = 10; // steps of the keys PageUp and PageDown

// Make an element adjustable; its data attributes are min, max, step, value and name. `format(value)` returns the HTML of the
// number; `onChange(value, isFinal)` is called on every change and when the pointer is released. Returns {value, set(value)}.
export function makeAdjustable(element, format, onChange) {
  const [low, high, step, start] = ["min", "max", "step", "value"].map((key) => Number(element.dataset[key]));
  let value = start;
  let drag = null; // where it began: {x, value}
  const attributes = { role: "slider", tabindex: 0, "aria-valuemin": low, "aria-valuemax": high, "aria-label": element.dataset.name };
  for (const [key, attribute] of Object.entries(attributes)) element.setAttribute(key, attribute);

  function show() {
    element.innerHTML = format(value); // HTML from the stories
    element.setAttribute("aria-valuenow", value);
    element.setAttribute("aria-valuetext", element.textContent);
  }
  // Set the nearest possible value. Returns whether it differs from the one before.
  function set(next) {
    const steps = Math.round((Math.min(Math.max(next, low), high) - low) / step);
    const before = value;
    value = Number((low + steps * step).toPrecision(9));
    show();
    return value !== before;
  }
  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    drag = { x: event.clientX, value };
    element.focus({ preventScroll: true });
    element.classList.add("held");
    event.preventDefault();
  });
  element.addEventListener("pointermove", (event) => {
    if (drag && set(drag.value + step * Math.round((event.clientX - drag.x) / PIXELS_PER_STEP))) onChange(value, false);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    element.addEventListener(end, () => {
      if (drag && drag.value !== value) onChange(value, true);
      drag = null;
      element.classList.remove("held");
    });
  }
  element.addEventListener("keydown", (event) => {
    const change = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: LARGE_STEP, PageDown: -LARGE_STEP }[event.key];
    const next = change ? value + change * step : { Home: low, End: high }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    if (set(next)) onChange(value, true);
  });
  show();
  return { get value() { return value; }, set };
}
