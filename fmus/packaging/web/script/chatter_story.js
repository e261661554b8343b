// The story "It chatters": sign(v) enlarged, after the mass should have come to rest.

import { runInBackground } from "./background.js";
import { createFmu, HYBRID, ode23, SIGN, simulate, startValues, SteppedRun } from "./story_models.js";
import { Chart, gridLines, linearScale, palette, tickLabel } from "./chart.js";
import { ticks } from "./plot.js";
import { fixedDigits, groupDigits, powerOfTen, significant, withUnit } from "./prose.js";
import { makeAdjustable } from "./adjustable.js";

const CHATTER_STOP = 4.3; // s
const CLOSE_UP_FROM = 4.1; // s
const CHATTER_STEPS_PER_LOOK = 1000; // steps between two looks at the clock

// Fill the section of the story.
export async function showChatter(section, session) {
  const find = (name) => section.querySelector(`.${name}`);
  const outputs = new Map([...section.querySelectorAll("output")].map((output) => [output.dataset.out, output]));
  const fmu = await createFmu(session, "coulomb");
  const { f } = startValues(session, "coulomb");
  const closedForm = simulate(fmu, HYBRID, CHATTER_STOP, 0);
  const [rest, restPosition] = [closedForm.restTime(), closedForm.columns.x.at(-1)];
  let steps = []; // of sign(v), in the widest close-up
  const tolerance = makeAdjustable(find("rtol"), powerOfTen, begin);
  const width = makeAdjustable(find("wide"), (value) => `${significant(value, 2)} ms`, () => paint());
  const widest = Number(find("wide").dataset.max) / 1000;

  // Run both laws, one after the other.
  function begin() {
    const laws = [["true", HYBRID], ["sign", SIGN]];
    let run = null;
    let before = 0; // steps until the mass should stop
    let closeUp = [];
    runInBackground("chatter", (deadline) => {
      const [key, law] = laws[0];
      if (!run) {
        run = new SteppedRun(fmu, { ...law, ...ode23(10 ** tolerance.value) }, CHATTER_STOP);
        [before, closeUp] = [0, []];
      }
      for (let n = 1; !run.done; n++) {
        run.step();
        if (run.t <= rest) before = run.steps;
        if (run.t >= CLOSE_UP_FROM && !(closeUp.at(-1)?.t > CLOSE_UP_FROM + widest)) closeUp.push({ t: run.t, v: run.v, F: run.F_friction, spring: run.F_spring });
        if (n % CHATTER_STEPS_PER_LOOK === 0 && performance.now() > deadline) return false;
      }
      const texts = { before: groupDigits(before), after: groupDigits(run.steps - before), rejected: groupDigits(run.rejected), off: withUnit(Math.abs(run.x - restPosition), 2, "m") };
      for (const [name, text] of Object.entries(texts)) outputs.get(`${key}-${name}`).textContent = text;
      if (key === "sign") {
        steps = closeUp;
        outputs.get("friction").textContent = `${fixedDigits(Math.abs(run.F_friction), 2)} N`;
        outputs.get("spring").textContent = `${fixedDigits(Math.abs(run.F_spring), 2)} N`;
        section.classList.remove("pending");
        paint();
      }
      run = null;
      laws.shift();
      return !laws.length;
    });
  }

  const shownSteps = () => steps.filter(({ t }, i) => i === 0 || steps[i - 1].t <= steps[0].t + width.value / 1000);

  const enlarged = new Chart(find("course"), (chart) => {
    if (!steps.length) return;
    const shown = shownSteps();
    const [left, right, top, bottom] = [44, chart.w - 20, 26, chart.h - 32];
    const speeds = shown.map(({ v }) => 1e6 * v);
    const high = Math.max(...speeds, 0.001) * 1.2;
    const low = Math.min(...speeds, -0.25 * high) * 1.1;
    const x = linearScale(0, width.value, left, right);
    const y = linearScale(low, high, bottom, top);
    const isFast = high > 2000;
    chart.text(isFast ? "speed, mm/s" : "speed, µm/s", 0, 9, { colour: palette.ink });
    gridLines(chart, y, ticks(low, high, 4), left, right, isFast ? (value) => significant(value / 1000, 2) : undefined);
    const points = shown.map(({ t, v }) => [x(1000 * (t - shown[0].t)), y(1e6 * v)]);
    const hasDots = points.length < 260;
    chart.clipped(left, top - 6, right - left, bottom - top + 12, () => {
      chart.line(points, palette.slip, points.length > 400 ? 0.7 : 1.5);
      if (hasDots) for (const [px, py] of points) chart.dot(px, py, 3, palette.slip);
      chart.line([[left, y(0)], [right, y(0)]], palette.stick, 3);
    });
    chart.label("true sticking: at rest", left + 8, y(0) + 15, { colour: palette.stick });
    chart.text(hasDots ? "sign(v): each dot is a step" : "sign(v)", right - 4, 9, { colour: palette.slip, align: "right" });
    const all = ticks(0, width.value, 4);
    all.forEach((t, i) => chart.text(tickLabel(t, all) + (i === all.length - 1 ? " ms" : ""), x(t), chart.h - 12, { align: "center", size: 11 }));
  });
  const law = new Chart(find("law"), (chart) => {
    if (!steps.length) return;
    const shown = shownSteps();
    const [left, right, top, bottom] = [44, chart.w - 8, 22, chart.h - 30];
    const largest = Math.max(1e-9, ...shown.map(({ v }) => 1e6 * Math.abs(v))) * 1.25;
    const x = linearScale(-largest, largest, left, right);
    const y = linearScale(-1.5 * f, 1.5 * f, bottom, top);
    chart.text("friction in N over slip speed", 0, 9, { colour: palette.ink });
    gridLines(chart, y, [-f, 0, f], left, right);
    chart.line([[left, y(-f)], [x(0), y(-f)]], palette.slip, 2);
    chart.line([[x(0), y(f)], [right, y(f)]], palette.slip, 2);
    chart.line([[x(0), y(-f)], [x(0), y(f)]], palette.soft, 1, [3, 4]);
    for (const { v, F } of shown.slice(0, 400)) chart.dot(x(1e6 * v), y(F), 4, palette.slip);
    const needed = shown[0].spring;
    chart.dot(x(0), y(needed), 6, palette.stick);
    chart.label(`needed: ${fixedDigits(needed, 2)} N`, x(0) + 11, y(needed), { colour: palette.stick, key: "needed" });
    chart.label("nothing between", x(0) - 8, y(-0.16 * f), { align: "right" });
    for (const value of [-1, 0, 1]) {
      const speed = (value * largest) / 1.25;
      chart.text(significant(speed, 2) + (value === 1 ? " µm/s" : ""), x(speed), chart.h - 11, { align: value === 1 ? "right" : "center", size: 11 });
    }
  });
  const paint = () => [enlarged, law].forEach((chart) => chart.paint());
  begin();
}
