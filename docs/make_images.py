"""Make the pictures of the documentation in docs/images, and the outputs of its notebook.

`python docs/make_images.py [NAME...]` makes all pictures or those named (without the ending).  Pictures of results are
the figures that the code blocks of the pages write; this script draws the others.  The FMUs must be built, for
friction-laws also those of fmus/more; the pictures of the live page and of the report need chromium.
"""

import csv
import html
import os
import re
import shutil
import subprocess
import sys
from base64 import b64decode, b64encode
from collections.abc import Callable
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np
from run_blocks import run_page

DOCS = Path(__file__).resolve().parent
IMAGES = DOCS / "images"
FMUS = DOCS.parent / "fmus"

# Figures of results: the page whose code blocks write them, and their paths.
FIGURES_OF_PAGES = {
    "stickslip": ("tutorials/first_run.md", "results/stickslip/figure.svg"),
    "compare-laws": ("tutorials/first_run.md", "results/compare/*/figure.svg"),
    "cart": ("tutorials/own_model.md", "results/cart/figure.svg"),
    "shaken": ("tutorials/own_model.md", "results/shaken/figure.svg"),
    "chain": ("tutorials/contacts_and_events.md", "results/speeds/figure.svg"),
    "decay": ("tutorials/identify_decay.md", "results/decay/record/figure.svg"),
    "curve": ("how-to/friction_curve.md", "results/curve/bench/figure.svg"),
    "fit": ("tutorials/fit_parameters.md", "results/fit/pulled_block/figure.svg"),
    "sweep": ("tutorials/sweep.md", "results/sweep/map/figure.svg"),
    "squeal": ("tutorials/squeal.md", "results/orbit/belt-v_belt/figure.svg"),
    "planar": ("how-to/planar.md", "paths.svg"),
    "compare": ("how-to/test_tools.md", "results/compare/coulomb-coulomb-sign/figure.svg"),
}
# Figures of commands that pages show but do not run: the command and the path.
FIGURES_OF_COMMANDS = {
    "coulomb": ("harness run coulomb", "results/coulomb/figure.svg"),
    "pendulum": ("harness run pendulum", "results/pendulum/figure.svg"),
    "derivatives": (
        "harness sensitivity stickslip --by k --outputs x --stop 12",
        "results/sensitivity/stickslip/figure.svg",
    ),
    "precision": ("harness precision stickslip --quick", "results/precision/stickslip/figure.svg"),
    "rivals": ("benchmarks rivals", "results/rivals/figure.svg"),  # needs the extra rivals
}


def run_command(folder: Path, command: str) -> None:
    """Run a command of a package, as in "harness run coulomb", in a folder that has the built FMUs."""
    if not (folder / "fmus").exists():
        (folder / "fmus").symlink_to(FMUS.resolve())
    arguments = [sys.executable, "-m", *command.split()]
    subprocess.run(arguments, cwd=folder, check=True, env=os.environ | {"PYTHONPATH": str(DOCS.parent)})


def run_blocks_of_page(page: str, folder: Path) -> None:
    """Run the code blocks of a page in a folder."""
    (folder / "fmus").symlink_to(FMUS.resolve())
    (folder / "docs").symlink_to(DOCS)
    working_directory = os.getcwd()
    os.chdir(folder)
    try:
        failures = run_page(DOCS / page)
    finally:
        os.chdir(working_directory)
    if failures:
        sys.exit("\n".join(failures))


def copy_figure(figure: Path, picture: Path) -> None:
    """Copy a figure, with coordinates rounded to a tenth of a point, which halves the size of long curves."""
    text = figure.read_text(encoding="utf-8")
    text = re.sub(r' d="[^"]*"', lambda line: re.sub(r"(\.\d)\d+", r"\1", line[0]), text)
    picture.write_text(text, encoding="utf-8")


# ---- pictures that are drawn here

SCENE = """\
title = "Coulomb friction to a standstill, law {law}"
model = "coulomb"
law = "{law}"
method = "ode23"
rtol = 1e-3
atol = 1e-6
stop = 6.0
outputs = ["x", "v"]
plots = []
follow = true
grid = 0.005
"""
LIGHT = {"text": "#1f2328", "line": "#d0d7de", "hybrid": "#0072B2", "sign": "#D55E00"}
DARK = {"text": "#e6edf3", "line": "#3d444d", "hybrid": "#4aa8e0", "sign": "#f08a4b"}


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """Return the columns (n,) of a CSV file by name without unit."""
    with path.open(newline="") as file:
        headings, *rows = csv.reader(file)
    return dict(zip((heading.split(" ")[0] for heading in headings), np.array(rows, float).T, strict=True))


def draw_stick(folder: Path) -> None:
    """Draw the first picture of the pages, a stop with true sticking and with sign(v), for light and for dark pages."""
    runs = {}
    for law in ("hybrid", "sign"):
        (folder / f"{law}.toml").write_text(SCENE.format(law=law))
        run_command(folder, f"harness run {law}.toml")
        result = folder / "results" / law
        runs[law] = read_columns(result / "trajectory.csv") | {"steps": read_columns(result / "steps.csv")["t"]}
    sys.path.insert(0, str(DOCS.parent))
    import harness as api

    closed_form = api.simulate(FMUS / "coulomb.fmu", stop=6.0)["x"][-1]
    for name, colours in (("light", LIGHT), ("dark", DARK)):
        plot_stick(runs, closed_form, colours, IMAGES / f"stick-{name}.svg")


def round_count(value: float) -> str:
    """Return a number of steps with two digits, because step counts of a chattering run depend on rounding errors."""
    return f"{float(f'{value:.1e}'):,.0f}".replace(",", " ")


def plot_stick(runs: dict[str, dict[str, np.ndarray]], closed_form: float, colours: dict[str, str], path: Path) -> None:
    """Plot the motion to a standstill, the creep and the speed after the stop, and the number of steps.

    `closed_form` is the position at the end in m.
    """
    style = {
        "font.size": 10,
        "font.family": "DejaVu Sans",
        "svg.fonttype": "path",
        "svg.hashsalt": "friction",
        "axes.spines.top": False,
        "axes.spines.right": False,
        **dict.fromkeys(("text.color", "axes.labelcolor", "xtick.color", "ytick.color"), colours["text"]),
        **dict.fromkeys(("axes.edgecolor", "grid.color"), colours["line"]),
        "axes.facecolor": "none",
        "figure.facecolor": "none",
        "axes.grid": True,
        "axes.titlesize": 10,
        "axes.titlelocation": "left",
    }
    begin, span = 4.001, 4e-4  # s; the mass has stopped at 4.0002 s
    labels = {"sign": "sign(v)", "hybrid": "true sticking"}
    with plt.rc_context(style):
        figure = plt.figure(figsize=(8.0, 5.1), layout="constrained")
        grid = figure.add_gridspec(2, 3, height_ratios=(1.15, 1.0))
        position = figure.add_subplot(grid[0, :])
        creep, speed, count = (figure.add_subplot(grid[1, i]) for i in range(3))
        for law in ("sign", "hybrid"):
            run, line_style = runs[law], {"color": colours[law], "zorder": 3 if law == "hybrid" else 2}
            t, x, v = run["t"], run["x"], run["v"]
            samples = np.unique(np.searchsorted(t, np.arange(0.0, 6.0, 0.01)))
            position.plot(
                t[samples], 100 * x[samples], lw=1.8 if law == "hybrid" else 3.4, label=labels[law], **line_style
            )
            after_stop = samples[t[samples] >= begin]
            creep.plot(t[after_stop], 1e6 * (x[after_stop] - x[after_stop[0]]), lw=1.8, **line_style)
            close_up = (t >= begin) & (t <= begin + span)
            if law == "sign":
                speed.plot(1e3 * (t[close_up] - begin), 1e6 * v[close_up], lw=1.4, **line_style)
            else:  # one internal step covers the standstill
                speed.plot([0.0, 1e3 * span], [0.0, 0.0], lw=1.8, **line_style)
            steps = run["steps"]
            indices = np.unique(np.searchsorted(steps, np.linspace(0.0, 6.0, 301)[1:]).clip(0, len(steps) - 1))
            count.plot(steps[indices], indices + 1, lw=1.8, **line_style)
            count.annotate(
                f"about {round_count(len(steps))}",
                (5.95, len(steps) * (2.5 if law == "sign" else 0.15)),
                ha="right",
                color=colours[law],
            )
        off = {law: f"{1e3 * abs(run['x'][-1] - closed_form):.1f} mm" for law, run in runs.items()}
        figure.supxlabel(
            "Solver on both sides: ode23, tolerance 0.001, absolute 1e-6 (MATLAB's defaults)\n"
            f"Distance from the closed form at the end: {off['sign']} with sign(v), {off['hybrid']} with true sticking",
            fontsize=9,
        )
        position.set(xlabel="time, s", ylabel="position, cm", xlim=(0, 6))
        position.set_title("A mass on a spring, stopped by dry friction")
        position.legend(loc="upper right", frameon=False, ncols=2)
        creep.set(xlabel="time, s", ylabel="µm", title="Creep after the stop")
        speed.set(xlabel="time after 4.001 s, ms", ylabel="µm/s", title="Speed after the stop")
        count.set(xlabel="time, s", title="Solver steps so far", yscale="log", ylim=(1, 2e6), xlim=(0, 6))
        figure.savefig(path, transparent=True, metadata={"Date": None})
    plt.close(figure)


def draw_laws(folder: Path) -> None:
    """Draw the friction force over the speed, for the four laws."""
    mu_s, mu_d, x_m = 0.9, 0.6, 0.2
    C = 2 - 2 * np.arcsin(mu_d / mu_s) / np.pi
    B = 2 * mu_s / (x_m * C * mu_s)
    peak = B * x_m
    E = (peak - np.tan(0.5 * np.pi / C)) / (peak - np.arctan(peak))
    v = np.linspace(-1, 1, 801)
    z = B * v
    magic = mu_s * np.sin(C * np.arctan(z - E * (z - np.arctan(z))))
    sliding_curves = {side: ([0, side], [side * mu_d] * 2) for side in (-1, 1)}
    style = {"font.size": 9, "svg.fonttype": "path", "svg.hashsalt": "friction", "axes.titlelocation": "left"}
    style |= {"axes.titlesize": 9, "axes.grid": True, "grid.color": "#dddddd"}
    with plt.rc_context(style):
        figure, axes = plt.subplots(1, 4, figsize=(8.0, 2.3), sharey=True, layout="constrained")
        titles = ("hybrid", "sign", "threshold (wide)", "magic formula")
        for axis, title in zip(axes, titles, strict=True):
            axis.set(title=title, xlabel="relative speed", xticks=[0], ylim=(-1.1, 1.1))
            if title != "magic formula":
                for x, y in sliding_curves.values():
                    gap = 0.08 if title.startswith("threshold") else 0.0
                    axis.plot([x[0] + gap * np.sign(x[1]), x[1]], y, color="#0072B2", lw=2)
        axes[0].plot([0, 0], [-mu_s, mu_s], color="#009E73", lw=3, label="stuck")
        axes[0].legend(loc="lower right", fontsize=8)
        axes[1].plot(0, 0, "o", color="#0072B2", ms=5)
        axes[2].fill_between([-0.08, 0.08], -mu_s, mu_s, color="#D55E00", alpha=0.35, lw=0, label="balances the load")
        axes[2].legend(loc="lower right", fontsize=8)
        axes[3].plot(v, magic, color="#0072B2", lw=2)
        axes[0].set(ylabel="friction / weight", yticks=[-mu_s, -mu_d, 0, mu_d, mu_s])
        figure.savefig(IMAGES / "laws.svg", metadata={"Date": None})
    plt.close(figure)


def draw_friction_laws(folder: Path) -> None:
    """Draw the speed in a slip under four laws, and the displacement under a load below the limit."""
    sys.path.insert(0, str(DOCS.parent))
    import harness as api

    names = {"stickslip": "hybrid", "pacejka": "magic formula", "lugre": "LuGre", "elastoplastic": "elasto-plastic"}
    weight = {"g": 10.0, "mu_s": 0.15, "mu_d": 0.1}
    colours = dict(zip(names, ("#0072B2", "#009E73", "#D55E00", "#CC79A7"), strict=True))
    load = {"time": [0, 10, 10, 20, 20, 30, 30, 40], "F_ext": [0.5, 0.5, 0, 0, 0.5, 0.5, 0, 0]}
    style = {"font.size": 9, "svg.fonttype": "path", "svg.hashsalt": "friction", "axes.titlelocation": "left"}
    style |= {"axes.titlesize": 9, "axes.grid": True, "grid.color": "#dddddd"}
    with plt.rc_context(style):
        figure, (slip, displacement) = plt.subplots(1, 2, figsize=(8.0, 3.0), layout="constrained")
        for name, label in names.items():
            values = weight if name in ("stickslip", "pacejka") else {"sigma_2": 0.0}
            values |= {"x_m": 0.001} if name == "pacejka" else {}
            fmu = FMUS / ("more" if "sigma_2" in values else "") / f"{name}.fmu"
            run = api.simulate(fmu, values | {"m": 1.0, "k": 2.0, "v_driver": 0.1}, stop=10.0, rtol=1e-6)
            in_slip = run.time > 7.2
            line_style = {"color": colours[name], "label": label}
            slip.plot(run.time[in_slip], run.columns["v"][in_slip], **line_style)
            free = values | {"m": 1.0, "k": 0.0, "v_driver": 0.0}
            run = api.simulate(fmu, free, stop=40.0, interval=0.1, inputs=load, rtol=1e-8)
            displacement.plot(run.time, 1e6 * np.asarray(run.columns["x"]), **line_style)
        slip.set(title="The first slip", xlabel="time, s", ylabel="speed, m/s")
        slip.legend(fontsize=8)
        displacement.set(
            title="Under 0.5 N, on and off", xlabel="time, s", ylabel="displacement, µm", ylim=(-0.5, 12.0)
        )
        figure.savefig(IMAGES / "friction-laws.svg", metadata={"Date": None})
    plt.close(figure)


def draw_stability(folder: Path) -> None:
    """Draw the error of each stiff or extreme case of stickslip as a share of its bound, for each method."""
    run_command(folder, "harness stability stickslip")
    plot_stability(folder / "results" / "stability" / "stability.csv", IMAGES / "stability.svg")


def plot_stability(table: Path, path: Path) -> None:
    """Plot the cases of stickslip in a table of `stability`."""
    with table.open(newline="") as file:
        cases = list(csv.DictReader(file))
    finished_cases = [case for case in cases if case["expected"].startswith("finished within ") and case["error [1]"]]
    methods = list(dict.fromkeys(case["method"] for case in finished_cases))
    style = {"font.size": 9, "svg.fonttype": "path", "svg.hashsalt": "friction", "axes.titlelocation": "left"}
    style |= {"axes.titlesize": 9, "axes.grid": True, "grid.color": "#dddddd"}
    with plt.rc_context(style):
        figure, axis = plt.subplots(figsize=(5.6, 2.4), layout="constrained")
        for row, method in enumerate(methods):
            method_cases = [case for case in finished_cases if case["method"] == method]
            pairs = [(float(case["error [1]"]), float(case["expected"].rsplit(" ", 1)[1])) for case in method_cases]
            shares = [error / bound if error else 0.0 for error, bound in pairs]  # a bound may be 0
            axis.semilogx(np.maximum(shares, 1e-6), [row] * len(shares), "o", color="#0072B2", ms=5, alpha=0.5)
        axis.axvline(1.0, color="#D55E00")
        n_refused = sum(not case["expected"].startswith("finished") for case in cases)
        axis.set(yticks=range(len(methods)), yticklabels=methods, xlim=(5e-7, 20.0), ylim=(len(methods) - 0.5, -0.5))
        axis.set_xlabel("error / bound (1e-6 and less at the left edge)")
        axis.set_title(f"stickslip: {len(finished_cases)} stiff and extreme cases; {n_refused} more are refused")
        figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def draw_measured(folder: Path) -> None:
    """Draw the decay of the measured pendulum, whose record is not a part of the project."""
    sys.path.insert(0, str(DOCS.parent / "tests" / "support"))
    from measured_records import COMMAND, find_record, write_original

    record = find_record()
    if record is None:
        print("measured.svg: skipped, the record is not available")
        return
    write_original(record, folder)
    run_command(folder, f"harness {COMMAND}")
    (figure,) = folder.glob("results/decay/*/figure.svg")
    copy_figure(figure, IMAGES / "measured.svg")


def draw_live_page(folder: Path) -> None:
    """Save a screenshot of the beginning of the live page, with the text of its opening."""
    build = [sys.executable, "-m", "build_fmus", "--web", "--out", str(folder / "live")]
    environment = os.environ | {"PYTHONPATH": str(DOCS.parent)}
    subprocess.run(build, cwd=folder, check=True, env=environment, capture_output=True)
    save_screenshot(folder / "live" / "index.html", IMAGES / "live.png", folder, 900, read_text_of_opening)


def read_text_of_opening(page: str) -> str:
    """Return the title, the introduction and the counts of steps of the live page, in HTML as the browser shows it."""
    (opening,) = re.findall(r'<h1 id="claim">.*?<div class="transport">', page, re.DOTALL)
    text = read_text(opening)
    return re.sub(r"\d+ \d{3}", lambda count: round_count(float(count[0].replace(" ", ""))), text)


def read_text(page: str) -> str:
    """Return the text of a part of an HTML page, without figures, scripts and collapsed parts."""
    page = re.sub(r"<(head|svg|script|style|details)\b.*?</\1>|<[^>]+>", " ", page, flags=re.DOTALL)
    return " ".join(html.unescape(page).split())


def draw_report(folder: Path) -> None:
    """Save a screenshot of the report of the page on reports, up to the end of its first section, with its text."""
    run_blocks_of_page("how-to/share.md", folder)
    report = folder / "results" / "report.html"
    save_screenshot(report, IMAGES / "report.png", folder, 930, read_text_of_report)


def read_text_of_report(page: str) -> str:
    """Return the text of a report up to the end of its first section.

    It has no date and version, and no number that is a rounding error.
    """
    text = read_text(page.partition("</section>")[0])
    return re.sub(r"Written on .*? by \S+ \S+ |\S+·10⁻¹\S+ ", "", text)


def save_screenshot(page: Path, picture: Path, folder: Path, height: int, read: Callable[[str], str]) -> None:
    """Save a screenshot of a page by chromium; its description is what `read` returns of the HTML that it shows.

    `height` is in pixels.
    """
    chromium = next((path for word in ("chromium", "google-chrome") if (path := shutil.which(word))), None)
    if chromium is None:
        print(f"{picture.name}: skipped, chromium is not installed")
        return
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--window-size=1200,{height}"]
    options += [
        "--virtual-time-budget=8000",
        "--force-prefers-reduced-motion",  # shows the first animation of the live page at its end
        f"--user-data-dir={folder / 'profile'}",
    ]
    for action in (f"--screenshot={folder / picture.name}", "--dump-dom"):
        command = [chromium, *options, action, page.as_uri()]
        process = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120)
    from PIL import Image, PngImagePlugin

    image, information = Image.open(folder / picture.name).convert("RGB"), PngImagePlugin.PngInfo()
    information.add_itxt("Description", read(process.stdout))
    image.quantize(64).save(picture, optimize=True, pnginfo=information)


def run_notebook(folder: Path) -> None:
    """Run the notebook and store its outputs in it."""
    import nbformat
    from nbclient import NotebookClient

    path = DOCS / "tutorials" / "python_api.ipynb"
    (folder / "fmus").symlink_to(FMUS.resolve())
    content = nbformat.read(path, as_version=4)
    client = NotebookClient(content, timeout=300, record_timing=False, resources={"metadata": {"path": str(folder)}})
    client.execute(env=os.environ | {"PYTHONPATH": str(DOCS.parent), "MPLBACKEND": INLINE})
    for output in (output for cell in content.cells for output in cell.get("outputs", ())):
        if "image/png" in output.get("data", {}):
            output.data["image/png"] = reduce_colours(output.data["image/png"])
    nbformat.write(content, path)


def reduce_colours(png: str) -> str:
    """Return a PNG picture in base64 with 64 colours, which makes it smaller."""
    from PIL import Image

    image, picture = Image.open(BytesIO(b64decode(png))).convert("RGB"), BytesIO()
    image.quantize(64).save(picture, "png", optimize=True)
    return b64encode(picture.getvalue()).decode()


INLINE = "module://matplotlib_inline.backend_inline"
DRAWINGS: dict[str, Callable[[Path], None]] = {
    "stick": draw_stick,
    "laws": draw_laws,
    "friction-laws": draw_friction_laws,
    "stability": draw_stability,
    "measured": draw_measured,
    "live": draw_live_page,
    "report": draw_report,
    "notebook": run_notebook,
}


def main() -> None:
    """Make the pictures."""
    bin = str(Path(sys.executable).parent)
    os.environ.update(PATH=f"{bin}{os.pathsep}{os.environ['PATH']}", MPLBACKEND="agg", COLUMNS="80")
    names = sys.argv[1:] or [*FIGURES_OF_PAGES, *FIGURES_OF_COMMANDS, *DRAWINGS]
    IMAGES.mkdir(exist_ok=True)
    for page in dict.fromkeys(page for name, (page, _) in FIGURES_OF_PAGES.items() if name in names):
        with TemporaryDirectory() as folder:
            run_blocks_of_page(page, Path(folder))
            for name, (source, file) in FIGURES_OF_PAGES.items():
                if source == page and name in names:
                    (figure,) = Path(folder).glob(file)
                    copy_figure(figure, IMAGES / f"{name}.svg")
    for name, (command, file) in FIGURES_OF_COMMANDS.items():
        if name == "rivals" and find_spec("mujoco") is None:
            print("rivals.svg: skipped, the extra rivals is not installed")
        elif name in names:
            with TemporaryDirectory() as folder:
                run_command(Path(folder), command)
                copy_figure(Path(folder, file), IMAGES / f"{name}.svg")
    for name, draw in DRAWINGS.items():
        if name in names:
            with TemporaryDirectory() as folder:
                draw(Path(folder))
    for picture in sorted(IMAGES.iterdir()):
        print(f"{picture.name}  {picture.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    sys.path[:0] = [str(DOCS.parent)]
    main()
