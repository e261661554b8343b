// The stories of the page, as specifications for story.js.

import { becomeIdle } from "./background.js";
import { countOf, fixedDigits, significant } from "./prose.js";
import { charts, modeCurve, palette, readPalette } from "./chart.js";
import { HYBRID, ode23 } from "./story_models.js";
import { StoryBelt, StoryBlock, StoryPendulum } from "./story_bodies.js";
import { Story } from "./story.js";
import { showChatter } from "./chatter_story.js";
import { showOpening } from "./opening.js";

const DEGREE = Math.PI / 180;
const COST_TOLERANCE = 1e-3;

// Draw a friction law that holds any force up to `hold` and slides with `slide`, up to the speed `far`.
function branches(chart, x, y, { hold, slide, far }) {
  chart.line([[x(-far), y(-slide)], [x(0), y(-slide)]], palette.slip, 2);
  chart.line([[x(0), y(slide)], [x(far), y(slide)]], palette.slip, 2);
  chart.line([[x(0), y(-hold)], [x(0), y(hold)]], palette.stick, 4);
}

// The friction coefficient of the model pacejka at a slip speed, to draw its curve.
function magicFormula(v, x_m, mu_s, mu_d) {
  const C = 2 - (2 * Math.asin(mu_d / mu_s)) / Math.PI;
  const B = (2 * mu_s) / (x_m * C * mu_s);
  const peak = B * x_m;
  const E = (peak - Math.tan((0.5 * Math.PI) / C)) / (peak - Math.atan(peak));
  const z = B * v;
  return mu_s * Math.sin(C * Math.atan(z - E * (z - Math.atan(z))));
}

const beltLabel = (edge) => `friction can hold the spring: ±${fixedDigits(1000 * edge, 0)} mm`;
const relative = (run) => ({ at: run.columns.x.map((x, i) => x - run.columns.x_driver[i]), shift: run.columns.x_driver, v: run.columns.v, F: run.columns.F_friction });
const beltStory = { body: StoryBelt, range: 0.2, step: 0.01, stop: 12, speed: 2, unit: "mm", factor: 1000, y: 220, gridValues: [-200, -100, 0, 100, 200] };
const weight = ({ m, g }) => m * g;
const bold = (text) => `<b>${text}</b>`;
const stopText = (rest, distance) => (rest === 0 ? `stays where it is, ${bold(distance)} off` : `stops after ${bold(`${fixedDigits(rest, 2)} s`)}, ${bold(distance)} off`);
const cycles = (run) => {
  const slips = run.events.filter(({ row }) => run.columns.mode[row] !== 0).map(({ t }) => t);
  const holds = run.events.filter(({ row }) => run.columns.mode[row] === 0).map(({ t }) => t);
  return { slips, holds };
};

const specs = {
  stops: {
    model: "coulomb", body: StoryBlock, range: 0.12, step: 0.005, stop: 5, speed: 1, unit: "mm", factor: 1000, y: 125, gridValues: [-100, -50, 0, 50, 100],
    name: "Mass on a dry floor: drag it, or press the arrow keys and then Enter",
    title: "position, mm", startKey: "x0",
    formats: { f: (value) => `${fixedDigits(value, 2)} N`, x0: (value) => `${fixedDigits(value, 0)} mm` },
    values: ({ f, x0 }, start) => ({ ...HYBRID, f, x0: start ?? x0 / 1000 }),
    of: (run) => ({ at: run.columns.x, v: run.columns.v, F: run.columns.F_friction }),
    band: ({ f }, { k }) => f / k,
    bandLabel: (edge) => `friction can hold the spring: ±${fixedDigits(1000 * edge, 1)} mm`,
    results: ({ run, rest, edge }) => {
      const turns = run.events.filter(({ t }) => t > 0).length; // the last one is the stop
      const off = `${fixedDigits(1000 * Math.abs(run.columns.x.at(-1)), 1)} mm`;
      return {
        loss: bold(`${fixedDigits(4000 * edge, 1)} mm`), band: bold(`±${fixedDigits(1000 * edge, 1)} mm`),
        end: rest === undefined ? "still swings when the picture ends" : `${rest > 0 ? `makes ${bold(countOf(turns, "half-swing"))} and ` : ""}${stopText(rest, off)} centre`,
      };
    },
    picture: ({ rest }) => `Position over time: the swings shrink along a straight line, and the mass ${rest === undefined ? "still moves at the end" : `stops after ${fixedDigits(rest, 2)} s`}`,
    extra: (chart, x, y, { run, edge, rest, start }) => {
      const begin = 1000 * Math.abs(run.columns.x[0]);
      const period = 2 * Math.PI * Math.sqrt(start.m / start.k);
      const end = rest ?? 5;
      for (const sign of [1, -1]) chart.line([[x(0), y(sign * begin)], [x(end), y(sign * (begin - (4000 * edge * end) / period))]], palette.soft, 1, [3, 4]);
    },
    labels: ({ run, rest, edge }) => [
      ...(rest > 0 && rest < 4.4 ? [{ label: "holds", t: Math.min(rest + 0.3, 4.7), at: 1000 * run.columns.x.at(-1) + 14, colour: "stick" }] : []),
      ...(Math.abs(run.columns.x[0]) > 0.06 ? [{ label: `a straight line, ${fixedDigits(4000 * edge, 1)} mm a swing`, t: 1.15, at: 1000 * Math.abs(run.columns.x[0]) - 8000 * edge + 9, colour: "soft", align: "left" }] : []),
    ],
    law: {
      title: "friction in N over slip speed", from: -1.5, to: 1.5, low: -2.3, high: 2.3, gridValues: [-2, -1, 0, 1, 2], speeds: [-1, 0, 1], unit: "m/s", speedFactor: 1, forceFactor: 1,
      draw: (chart, x, y, { values: { f } }) => branches(chart, x, y, { hold: f, slide: f, far: 2 }),
      label: (chart, x, y, story, { F, stuck }) => chart.label(stuck ? `holds with ${fixedDigits(Math.abs(F), 2)} N` : "slips", x(0) + 12, stuck ? y(F) : y(0) - 2, { colour: stuck ? palette.stick : palette.slip, key: "mode" }),
    },
  },
  squeaks: {
    ...beltStory, model: "stickslip", name: "Sled on a moving floor: drag it, or press the arrow keys and then Enter", title: "position of the sled in mm, zero where the spring is slack",
    formats: { v_driver: (value) => `${fixedDigits(value, 0)} mm/s`, mu_d: (value) => fixedDigits(value, 2) },
    values: ({ v_driver, mu_d }, start = 0) => ({ v_driver: v_driver / 1000, mu_d, x0: start }),
    of: relative, band: (values, start) => (start.mu_s * weight(start)) / start.k, bandLabel: beltLabel,
    results: ({ run, start, spec }) => {
      const { slips, holds } = cycles(run);
      const hold = holds.find((t) => t > slips[0]);
      const lasts = hold ? `lasting ${bold(`${fixedDigits(hold - slips[0], 2)} s`)}` : "without an end";
      const cycle = slips.length > 1 ? `${bold(countOf(slips.length, "slip"))} in ${spec.stop} s, one every ${bold(`${fixedDigits(slips.at(-1) - slips.at(-2), 2)} s`)}, each ${lasts}`
        : slips.length ? `one slip in the first ${spec.stop} s, ${lasts}` : `no slip in the first ${spec.stop} s`;
      return { mu_s: bold(fixedDigits(start.mu_s, 2)), cycle };
    },
    picture: ({ run }) => `Stretch of the spring over time: a sawtooth with ${cycles(run).slips.length} slips`,
    labels: ({ run }) => {
      const { slips } = cycles(run);
      return slips[0] > 1.6 ? [{ label: "holds: rides along", t: slips[0] * 0.5 + 0.35, at: -32, colour: "stick" }, { label: "slips back", t: slips[0] + 0.4, at: -24, colour: "slip" }] : [];
    },
    law: {
      title: "friction in N over slip speed", from: -0.12, to: 0.6, low: -125, high: 125, gridValues: [-100, 0, 100], speeds: [0, 0.2, 0.4], unit: "m/s", speedFactor: 1, forceFactor: 1,
      draw: (chart, x, y, { values: { mu_d }, start }) => branches(chart, x, y, { hold: start.mu_s * weight(start), slide: mu_d * weight(start), far: 1 }),
      label: (chart, x, y, story, { F, stuck }) => chart.label(stuck ? `holds with ${fixedDigits(Math.abs(F), 0)} N` : "slips", x(0.05), stuck ? y(F) + (F > 60 ? 26 : 0) : y(30), { colour: stuck ? palette.stick : palette.slip, key: "mode" }),
    },
  },
  creeps: {
    ...beltStory, model: "pacejka", name: "Sled with a smooth friction curve: drag it, or press the arrow keys and then Enter", title: "distance slipped over the floor, mm", low: -40, y: 520, gridValues: [0, 100, 200, 300, 400, 500],
    formats: { x_m: (value) => `${significant(10 ** value, 2)} mm/s`, v_driver: (value) => `${fixedDigits(value, 0)} mm/s` },
    values: ({ x_m, v_driver }, start = 0) => ({ x_m: 10 ** x_m / 1000, v_driver: v_driver / 1000, x0: start }),
    of: (run) => ({ ...relative(run), y: run.columns.x.map((x) => x - run.columns.x[0]) }), band: () => 0, bandLabel: () => "no band: this law cannot hold",
    reference: { model: "stickslip", values: ({ v_driver }, start = 0) => ({ v_driver: v_driver / 1000, x0: start }), of: (run) => ({ at: run.columns.x.map((x) => x - run.columns.x[0]), time: run.time, stuck: (i) => run.columns.mode[i] === 0, breaksAway: run.columns.mode[0] === 0 ? cycles(run).slips[0] : 0 }) },
    costs: { // step counts of the same solver
      steps: { model: "pacejka", values: ({ x_m, v_driver }, start = 0) => ({ x_m: 10 ** x_m / 1000, v_driver: v_driver / 1000, x0: start, ...ode23(COST_TOLERANCE) }) },
      "true-steps": { model: "stickslip", values: ({ v_driver }, start = 0) => ({ v_driver: v_driver / 1000, x0: start, ...HYBRID, ...ode23(COST_TOLERANCE) }) },
    },
    results: ({ run, values, spec, reference: { breaksAway } }) => {
      const { time, columns: { x, v } } = run;
      const peak = 10 ** values.x_m / 1000;
      const row = v.findIndex((speed) => speed > peak);
      const share = row > 0 ? (peak - v[row - 1]) / (v[row] - v[row - 1]) : 1; // of the interval before that row
      const at = (column) => column.at(row - 1) + share * (column.at(row) - column.at(row - 1));
      const slid = (position) => bold(`${significant(1000 * Math.abs(position - x[0]), 2)} mm`);
      const seconds = (t) => bold(`${fixedDigits(t, 2)} s`);
      const smooth = row < 0 ? `creeps ${slid(x.at(-1))} in ${spec.stop} s` : row === 0 ? "slips from the start" : `creeps ${slid(at(x))} before it breaks away, after ${seconds(at(time))}`;
      const exact = breaksAway === undefined ? "does not move" : breaksAway === 0 ? "slips from the start" : `does not move for ${seconds(breaksAway)}`;
      return { creep: `${smooth}; with true sticking, it ${exact}` };
    },
    picture: () => "Stretch of the spring over time, beside that of a sled that truly sticks",
    extra: (chart, x, y, { reference }) => reference && modeCurve(chart, reference.time.length, (i) => [x(reference.time[i]), y(1000 * reference.at[i])], reference.stuck, 1.5, [5, 3]),
    labels: ({ run }) => {
      const slip = run.columns.v.findIndex((v) => v > 0.1);
      if (slip < 0 || run.time[slip] < 2) return [];
      return [{ label: "smooth curve: creeps", t: run.time[slip] * 0.5, at: 45, colour: "slip" }, { label: "true sticking: stands", t: 5.4, at: 84, colour: "stick", align: "left" }];
    },
    law: {
      title: "friction in N over slip speed", from: -12, to: 60, low: -125, high: 125, gridValues: [-100, 0, 100], speeds: [0, 20, 40], unit: "mm/s", speedFactor: 1000, forceFactor: 1,
      draw: (chart, x, y, { values, start }) => {
        const x_m = 10 ** values.x_m / 1000;
        const points = [];
        for (let i = -180; i <= 900; i++) {
          const v = (i * 0.06) / 900;
          points.push([x(1000 * v), y(magicFormula(v, x_m, start.mu_s, start.mu_d) * weight(start))]);
        }
        chart.line(points, palette.slip, 2);
      },
      label: (chart, x, y, { values }, { v }) => chart.label(v > 60 ? "slips, far to the right" : v < 10 ** values.x_m ? `creeps at ${significant(v, 2)} mm/s` : "slips", x(58), y(-40), { colour: palette.slip, align: "right", key: "mode" }),
    },
  },
  swings: {
    model: "pendulum", body: StoryPendulum, range: 0.436, step: 0.0175, stop: 6, speed: 1, unit: "°", factor: 1 / DEGREE, y: 26, gridValues: [-20, -10, 0, 10, 20],
    name: "Pendulum: drag it, or press the arrow keys and then Enter", title: "angle, degrees", startKey: "theta0",
    formats: { mu: (value) => fixedDigits(value, 2), theta0: (value) => `${fixedDigits(value, 0)}°` },
    values: ({ mu, theta0 }, start) => ({ mu, theta0: start ?? theta0 * DEGREE }),
    of: (run) => ({ at: run.columns.theta, v: run.columns.omega, F: run.columns.T_friction }),
    band: ({ mu }, { r, a }) => Math.asin((mu * r) / a), bandLabel: (edge) => `±${fixedDigits(edge / DEGREE, 1)}°`,
    results: ({ run, rest, edge }) => ({
      end: rest === undefined ? "still swings when the picture ends" : `${stopText(rest, `${fixedDigits(Math.abs(run.columns.theta.at(-1)) / DEGREE, 2)}°`)} the vertical`,
      band: bold(`±${fixedDigits(edge / DEGREE, 2)}°`),
    }),
    picture: ({ rest }) => `Angle over time: the pendulum ${rest === undefined ? "still swings at the end" : `stops after ${fixedDigits(rest, 2)} s`}`,
    labels: ({ run, rest }) => (rest > 0 && rest < 5.4 ? [{ label: "holds", t: rest + 0.4, at: run.columns.theta.at(-1) / DEGREE + 3.2, colour: "stick" }] : []),
    law: {
      title: "friction in mN·m over turning speed", from: -240, to: 240, low: -7.5, high: 7.5, gridValues: [-5, 0, 5], speeds: [-200, 0, 200], unit: "°/s", speedFactor: 1 / DEGREE, forceFactor: 1000,
      draw: (chart, x, y, { values: { mu }, start }) => {
        const torque = 1000 * mu * start.r * weight(start); // mN·m
        branches(chart, x, y, { hold: torque, slide: torque, far: 400 });
      },
      label: (chart, x, y, story, { F, stuck }) => chart.label(stuck ? `holds ${fixedDigits(Math.abs(F), 2)} mN·m` : "slips", x(0) + 10, y(F > 0 ? -3 : 3), { colour: stuck ? palette.stick : palette.slip, key: "mode" }),
    },
  },
};

// Start the opening at once, and the stories while the browser is idle.
export async function startStories(session, firstPicture) {
  readPalette();
  for (const query of ["(prefers-color-scheme: dark)", "(forced-colors: active)"]) matchMedia(query).addEventListener("change", readPalette);
  await firstPicture;
  const opening = await showOpening(session);
  const stories = {};
  for (const [name, spec] of Object.entries(specs)) {
    await becomeIdle();
    stories[name] = new Story(document.getElementById(name), session, spec);
    await stories[name].begin();
  }
  await showChatter(document.getElementById("chatters"), session);
  return { opening, stories, charts };
}
