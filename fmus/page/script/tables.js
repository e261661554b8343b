// The tables below the diagrams.

import { makeElement } from "./controls.js";
import { COUNTS } from "./fmu.js";
import { difference } from "./measure.js";
import { formatNumber, formatScientific, formatValue } from "./numbers.js";
import { effectiveValues } from "./state.js";

const MAX_LISTED_EVENTS = 60;
const CLOSED_FORM_DIGITS = 9;
const LEAST_DIGITS = 4;

// A table that scrolls on narrow screens. The first cell of a row is its heading.
export function table(caption, headings, rows) {
  const head = makeElement("tr", {}, ...headings.map((text) => (text ? makeElement("th", { scope: "col" }, text) : makeElement("td"))));
  const body = rows.map(([first, ...cells]) => makeElement("tr", {}, makeElement("th", { scope: "row" }, first), ...cells.map((cell) => makeElement("td", {}, cell))));
  return makeElement("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption },
    makeElement("table", {}, makeElement("caption", {}, caption), makeElement("thead", {}, head), makeElement("tbody", {}, ...body)));
}

// The digits of a result that its tolerance supports; CLOSED_FORM_DIGITS for a closed form.
function significantDigits(run) {
  const values = effectiveValues(run.fmu.modelInfo, run.setting.values);
  const method = run.fmu.variables.get("solver.method")?.items.find(({ value }) => value === values["solver.method"]);
  if (method?.label === "exact") return CLOSED_FORM_DIGITS;
  const rtol = values["solver.rtol"] || run.fmu.modelInfo.tolerance;
  return Math.min(Math.max(Math.ceil(-Math.log10(rtol)), LEAST_DIGITS), CLOSED_FORM_DIGITS);
}

// Model, friction law, method and tolerance of a run.
export function describeSettings(run) {
  const values = effectiveValues(run.fmu.modelInfo, run.setting.values);
  const rtol = values["solver.rtol"] ? `rtol ${formatScientific(values["solver.rtol"])}` : "";
  return [run.fmu.modelInfo.name, run.itemLabel("friction"), run.itemLabel("solver.method"), rtol].filter(Boolean).join(", ");
}

// Steps and errors of the runs.
export function costTable({ runs: { main, comparison, reference }, body }) {
  const runs = [main, comparison].filter(Boolean);
  const rows = Object.entries(COUNTS).map(([name, label]) => [label, ...runs.map((run) => String(run.counts?.[name] ?? ""))]);
  const hasFailed = [main, comparison, reference].some((run) => run?.failure);
  const failure = (run) => (!run.failure ? "" : run.time.length ? `at ${formatNumber(run.time.at(-1))} s` : "does not start");
  if (runs.some((run) => run.failure)) rows.unshift(["fails", ...runs.map(failure)]);
  const largest = (from, to, name) => formatValue(main.fmu.variables.get(name), difference(from, to, name).largest, 3);
  const largestError = (run) => (run === reference ? "closed form" : largest(reference, run, body.position));
  const hasReference = (run) => run.fmu.modelInfo === reference?.fmu.modelInfo;
  if (reference?.done && !hasFailed) rows.push([`largest error of ${body.position} against the closed form`, ...runs.map((run) => (hasReference(run) ? largestError(run) : ""))]);
  if (!hasFailed && comparison?.columns[body.position] && comparison.columns[body.speed]) {
    rows.push(...[body.position, body.speed].map((name) => [`largest difference in ${name}`, "", largest(main, comparison, name)]));
  }
  return table("Cost and accuracy", ["", ...runs.map(describeSettings)], rows);
}

// The events with their times.
export function eventTable({ runs: { main }, modelInfo: { contacts } }) {
  if (!main.events.length) return null;
  const stateAfter = { "-1": "slides backward", 0: "sticks", 1: "slides forward" };
  const describe = ({ name, mode }) => (contacts.length > 1 ? `${name} ${stateAfter[mode]}` : stateAfter[mode]);
  const rows = main.events.slice(0, MAX_LISTED_EVENTS).map(({ t, row }, i) => [String(i + 1), formatNumber(t, significantDigits(main)), main.changedContacts(row).map(describe).join(", ")]);
  const more = main.events.length - rows.length;
  const eventList = table("Events", ["", "t in s", contacts.length > 1 ? "then" : "then it"], rows);
  eventList.classList.add("long");
  if (more > 0) eventList.append(makeElement("p", {}, `${more} more events; the CSV file contains all.`));
  return eventList;
}
