// What people take away: the numbers as CSV, the diagrams as main picture.

const WIDTH = 520; // of a diagram in the picture
const HEIGHT = 240;
const TITLE = 26;
const SHARP = 2; // pixels of the picture for main of the page

// The rows of main run, or of two side by side at the points of their grid; SI units.
export function csv(main, comparison) {
  const column = (run, prefix) => (name) => {
    const variable = run.fmu.variables.get(name);
    return { head: `${prefix}${name}${variable.unit ? ` [${variable.unit}]` : ""}`, values: run.columns[name], run };
  };
  const names = (run) => [...run.reals, ...run.modes, "solver.h"];
  const columns = names(main).map(column(main, ""));
  if (comparison) columns.push(...names(comparison).map(column(comparison, "compare.")));
  const rows = comparison ? Math.min(main.grid.length, comparison.grid.length) : main.time.length;
  const place = (run, row) => (comparison ? run.grid[row] : row);
  const lines = [["t [s]", ...columns.map(({ head }) => head)].join(",")];
  for (let row = 0; row < rows; row++) {
    lines.push([main.time[place(main, row)], ...columns.map(({ values, run }) => values[place(run, row)])].join(","));
  }
  return `${lines.join("\n")}\n`;
}

// All diagrams [{plot, heading}] in main picture, two in a row, each under its title.
export function picture(titled, title) {
  const canvas = document.createElement("canvas");
  const rows = Math.ceil(titled.length / 2);
  [canvas.width, canvas.height] = [SHARP * 2 * WIDTH, SHARP * (rows * (HEIGHT + TITLE) + TITLE)];
  const context = canvas.getContext("2d");
  const style = getComputedStyle(document.documentElement);
  const text = (words, x, y, font) => {
    context.font = font;
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillStyle = style.getPropertyValue("--ink");
    context.fillText(words, x, y);
  };
  context.scale(SHARP, SHARP);
  context.fillStyle = style.getPropertyValue("--paper");
  context.fillRect(0, 0, 2 * WIDTH, canvas.height);
  text(title, 10, 18, "bold 14px system-ui, sans-serif");
  titled.forEach(({ plot, heading }, i) => {
    const [x, y] = [(i % 2) * WIDTH, TITLE + Math.floor(i / 2) * (HEIGHT + TITLE)];
    text(heading.textContent, x + 10, y + 18, "12px system-ui, sans-serif");
    context.save();
    context.translate(x, y + TITLE);
    plot.drawn(context, WIDTH, HEIGHT);
    context.restore();
  });
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
