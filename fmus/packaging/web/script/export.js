// Exports: results as CSV, diagrams as one PNG image.

const PLOT_WIDTH = 520; // CSS pixels
const PLOT_HEIGHT = 240;
const TITLE_HEIGHT = 26;
const RESOLUTION = 2; // image pixels per CSS pixel

// The results of a run in SI units, or of two runs at the points of their common grid.
export function toCsv(main, comparison) {
  const column = (run, prefix) => (name) => {
    const variable = run.fmu.variables.get(name);
    return { head: `${prefix}${name}${variable.unit ? ` [${variable.unit}]` : ""}`, values: run.columns[name], run };
  };
  const names = (run) => [...run.reals, ...run.modes, "solver.h"];
  const columns = names(main).map(column(main, ""));
  if (comparison) columns.push(...names(comparison).map(column(comparison, "compare.")));
  const rows = comparison ? Math.min(main.grid.length, comparison.grid.length) : main.time.length;
  const gridRow = (run, row) => (comparison ? run.grid[row] : row);
  const lines = [["t [s]", ...columns.map(({ head }) => head)].join(",")];
  for (let row = 0; row < rows; row++) {
    lines.push([main.time[gridRow(main, row)], ...columns.map(({ values, run }) => values[gridRow(run, row)])].join(","));
  }
  return `${lines.join("\n")}\n`;
}

// All diagrams [{plot, heading}] in one image, two in a row, each below its title.
export function toPng(diagrams, title) {
  const canvas = document.createElement("canvas");
  const rows = Math.ceil(diagrams.length / 2);
  [canvas.width, canvas.height] = [RESOLUTION * 2 * PLOT_WIDTH, RESOLUTION * (rows * (PLOT_HEIGHT + TITLE_HEIGHT) + TITLE_HEIGHT)];
  const context = canvas.getContext("2d");
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
  diagrams.forEach(({ plot, heading }, i) => {
    const [x, y] = [(i % 2) * PLOT_WIDTH, TITLE_HEIGHT + Math.floor(i / 2) * (PLOT_HEIGHT + TITLE_HEIGHT)];
    drawText(heading.textContent, x + 10, y + 18, "12px system-ui, sans-serif");
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
