// The story "It chatters": sign(v) enlarged, after the mass should have come to rest.

import { animate, stopAnimation } from "./animation.js";
import { createFmu, SIGN_ODE23 } from "./story_models.js";
import { Chart, gridLines, linearScale, palette, tickLabel } from "./chart.js";
import { ticks } from "./plot.js";
import { groupDigits, significant } from "./prose.js";
import { makeAdjustable } from "./adjustable.js";
import { Run } from "./run.js";

const CHATTER_STOP = 4.3; // s
const CHATTER_REST = 4.0002; // s, when the mass that sticks has stopped
const REST_POSITION = -0.00132996; // m, where it stops
const CHATTER_SLICE = 6; // ms of a frame

// Fill the section of the story; the run starts when the section comes near.
export async function showChatter(section, session) {
  const find = (name) => section.querySelector(`.${name}`);
  const outputs = new Map([...section.querySelectorAll("output")].map((output) => [output.dataset.out, output]));
  const fmu = await createFmu(session, "coulomb");
  let run = null;
  const tolerance = makeAdjustable(find("rtol"), (value) => `10<sup>${String(value).replace("-", "−")}</sup>`, begin);
  const width = makeAdjustable(find("wide"), (value) => `${significant(value, 2)} ms`, () => paint());

  function begin() {
    const rtol = 10 ** tolerance.value;
    run = new Run(fmu, { values: { ...SIGN_ODE23, "solver.rtol": rtol, "solver.atol": rtol / 1000 }, stop: CHATTER_STOP, points: 0, changes: [] });
    stopAnimation(continueRun);
    animate(continueRun);
  }

  function continueRun() {
    run.advance(performance.now() + CHATTER_SLICE);
    const row = run.row(CHATTER_REST);
    outputs.get("before").textContent = run.t < CHATTER_REST ? "–" : groupDigits(row);
    outputs.get("after").textContent = run.t < CHATTER_REST ? "–" : groupDigits(run.time.length - 1 - row);
    if (run.done && !run.failure) {
      outputs.get("refused").textContent = groupDigits(run.counts["solver.rejected"]);
      outputs.get("off").textContent = `${significant(1000 * Math.abs(run.columns.x.at(-1) - REST_POSITION), 2)} mm`;
      paint();
    }
    return !run.done;
  }

  const shownRows = () => {
    const from = Math.max(run.row(4.1), 0);
    const to = run.row(run.time[from] + width.value / 1000) + 1;
    return { from, to, start: run.time[from] };
  };

  const enlarged = new Chart(find("course"), (chart) => {
    if (!run?.done) return;
    const { from, to, start } = shownRows();
    const [left, right, top, bottom] = [44, chart.w - 20, 26, chart.h - 32];
    const speeds = run.columns.v.slice(from, to + 1).map((v) => 1e6 * v);
    const high = Math.max(...speeds, 0.001) * 1.2;
    const low = Math.min(...speeds, -0.25 * high) * 1.1;
    const x = linearScale(0, width.value, left, right);
    const y = linearScale(low, high, bottom, top);
    const isFast = high > 2000;
    chart.text(isFast ? "speed, mm/s" : "speed, µm/s", 0, 9, { colour: palette.ink });
    gridLines(chart, y, ticks(low, high, 4), left, right, isFast ? (value) => significant(value / 1000, 2) : undefined);
    const points = [];
    for (let i = from; i <= Math.min(to, run.time.length - 1); i++) points.push([x(1000 * (run.time[i] - start)), y(1e6 * run.columns.v[i])]);
    chart.clipped(left, top - 6, right - left, bottom - top + 12, () => {
      chart.line(points, palette.slip, points.length > 400 ? 0.7 : 1.5);
      if (points.length < 260) for (const [px, py] of points) chart.dot(px, py, 3, palette.slip);
      chart.line([[left, y(0)], [right, y(0)]], palette.stick, 3);
    });
    chart.text("true sticking: at rest", left + 8, y(0) + 13, { colour: palette.stick });
    chart.text(points.length < 260 ? "sign(v): each dot is a step" : "sign(v)", right - 4, 9, { colour: palette.slip, align: "right" });
    const all = ticks(0, width.value, 4);
    all.forEach((t, i) => chart.text(tickLabel(t, all) + (i === all.length - 1 ? " ms" : ""), x(t), chart.h - 12, { align: "center", size: 11 }));
  });
  const law = new Chart(find("law"), (chart) => {
    if (!run?.done) return;
    const { from, to } = shownRows();
    const [left, right, top, bottom] = [44, chart.w - 8, 22, chart.h - 30];
    const largest = Math.max(1e-9, ...run.columns.v.slice(from, to + 1).map((v) => 1e6 * Math.abs(v))) * 1.25;
    const x = linearScale(-largest, largest, left, right);
    const y = linearScale(-0.75, 0.75, bottom, top);
    chart.text("friction in N over slip speed", 0, 9, { colour: palette.ink });
    gridLines(chart, y, [-0.5, 0, 0.5], left, right);
    chart.line([[left, y(-0.5)], [x(0), y(-0.5)]], palette.slip, 2);
    chart.line([[x(0), y(0.5)], [right, y(0.5)]], palette.slip, 2);
    chart.line([[x(0), y(-0.5)], [x(0), y(0.5)]], palette.line, 2, [3, 4]);
    for (let i = from; i <= Math.min(to, from + 400); i++) chart.dot(x(1e6 * run.columns.v[i]), y(run.columns.F_friction[i]), 4, palette.slip);
    chart.dot(x(0), y(0.21), 6, palette.stick);
    chart.text("needed: 0.21 N", x(0) + 11, y(0.21), { colour: palette.stick });
    chart.text("nothing between", x(0) - 8, y(-0.08), { align: "right" });
    for (const value of [-1, 0, 1]) {
      const speed = (value * largest) / 1.25;
      chart.text(significant(speed, 2) + (value === 1 ? " µm/s" : ""), x(speed), chart.h - 11, { align: value === 1 ? "right" : "center", size: 11 });
    }
  });
  const paint = () => [enlarged, law].forEach((chart) => chart.paint());
  new IntersectionObserver(([{ isIntersecting }], observer) => {
    if (!isIntersecting) return;
    observer.disconnect();
    begin();
  }, { rootMargin: "200px" }).observe(section);
}
