// Exports results as CSV.

// The results of a run in SI units, or of two runs at the points of their common grid. Begins with the settings, which the
// link contains, as comments.
export function toCsv({ main, comparison }, link) {
  const column = (run, prefix) => (name) => {
    const variable = run.fmu.variables.get(name);
    return { head: `${prefix}${name}${variable.unit ? ` [${variable.unit}]` : ""}`, values: run.columns[name], run };
  };
  const names = (run) => [...run.reals, ...run.modes, "solver.h"];
  const columns = names(main).map(column(main, ""));
  if (comparison) columns.push(...names(comparison).map(column(comparison, "compare.")));
  const rows = comparison ? Math.min(main.grid.length, comparison.grid.length) : main.time.length;
  const gridRow = (run, row) => (comparison ? run.grid[row] : row);
  const settings = [...new URLSearchParams(link.slice(1))].map(([key, value]) => `# ${key.replace(/^\./, "")} = ${value}`);
  const lines = ["# friction-fmus; all values in SI units", ...settings, ["t [s]", ...columns.map(({ head }) => head)].join(",")];
  for (let row = 0; row < rows; row++) {
    lines.push([main.time[gridRow(main, row)], ...columns.map(({ values, run }) => values[gridRow(run, row)])].join(","));
  }
  return `${lines.join("\n")}\n`;
}

// Offer a file for download.
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
