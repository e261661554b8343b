// Exports: results as CSV, diagrams as one PNG image.

import { drawLegend } from "./legend.js";

const PLOT_WIDTH = 520; // CSS pixels
const PLOT_HEIGHT = 240;
const TITLE_HEIGHT = 26;
const LINE_HEIGHT = 16;
const TEXT_FONT = "12px system-ui, sans-serif";
const RESOLUTION = 2; // image pixels per CSS pixel

// The results of a run in SI units, or of two runs at the points of their common grid. Begins with the settings as comments.
export function toCsv(main, comparison, settings) {
  const column = (run, prefix) => (name) => {
    const variable = run.fmu.variables.get(name);
    return { head: `${prefix}${name}${variable.unit ? ` [${variable.unit}]` : ""}`, values: run.columns[name], run };
  };
  const names = (run) => [...run.reals, ...run.modes, "solver.h"];
  const columns = names(main).map(column(main, ""));
  if (comparison) columns.push(...names(comparison).map(column(comparison, "compare.")));
  const rows = comparison ? Math.min(main.grid.length, comparison.grid.length) : main.time.length;
  const gridRow = (run, row) => (comparison ? run.grid[row] : row);
  const lines = [...settings.map((line) => `# ${line}`), ["t [s]", ...columns.map(({ head }) => head)].join(",")];
  for (let row = 0; row < rows; row++) {
    lines.push([main.time[gridRow(main, row)], ...columns.map(({ values, run }) => values[gridRow(run, row)])].join(","));
  }
  return `${lines.join("\n")}\n`;
}

// Divide text into lines of a width in pixels.
function wrap(context, text, width) {
  const lines = [""];
  for (const word of text.split(" ")) {
    const longer = `${lines.at(-1)} ${word}`.trim();
    if (context.measureText(longer).width <= width) lines[lines.length - 1] = longer;
    else lines.push(word);
  }
  return lines;
}

// All diagrams [{plot, heading}] in one image, two in a row, each below its title, below the settings and the legend.
export function toPng(diagrams, title, settings, legend) {
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("2d");
  context.font = TEXT_FONT;
  const text = settings.flatMap((line) => wrap(context, line, 2 * PLOT_WIDTH - 20));
  const legendTop = TITLE_HEIGHT + (text.length + 0.5) * LINE_HEIGHT;
  const top = legendTop + drawLegend(context, legend, 0, 0, 2 * PLOT_WIDTH - 20);
  const rows = Math.ceil(diagrams.length / 2);
  [canvas.width, canvas.height] = [RESOLUTION * 2 * PLOT_WIDTH, RESOLUTION * (rows * (PLOT_HEIGHT + TITLE_HEIGHT) + top + TITLE_HEIGHT / 2)];
  const style = getComputedStyle(document.documentElement);
  const drawText = (text, x, y, font) => {
    context.font = font;
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillStyle = style.getPropertyValue("--ink");
    context.fillText(text, x, y);
  };
  context.scale(RESOLUTION, RESOLUTION);
  context.fillStyle = style.getPropertyValue("--paper");
  context.fillRect(0, 0, 2 * PLOT_WIDTH, canvas.height);
  drawText(title, 10, 18, "bold 14px system-ui, sans-serif");
  text.forEach((line, i) => drawText(line, 10, TITLE_HEIGHT + (i + 0.75) * LINE_HEIGHT, TEXT_FONT));
  drawLegend(context, legend, 10, legendTop, 2 * PLOT_WIDTH - 20, (name) => style.getPropertyValue(`--${name}`));
  diagrams.forEach(({ plot, heading }, i) => {
    const [x, y] = [(i % 2) * PLOT_WIDTH, top + Math.floor(i / 2) * (PLOT_HEIGHT + TITLE_HEIGHT)];
    drawText(heading.textContent, x + 10, y + 18, TEXT_FONT);
    context.save();
    context.translate(x, y + TITLE_HEIGHT);
    plot.draw(context, PLOT_WIDTH, PLOT_HEIGHT);
    context.restore();
  });
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

// Offer a file for download.
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
