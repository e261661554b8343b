"""No input ends a command in a traceback: it succeeds, or fails with one sentence and a specific exit status."""

import os
import random
import re
import shlex
import subprocess
import sys
import threading
from itertools import zip_longest
from math import cos, exp
from pathlib import Path

import pytest
from build_cache import ROOT
from commands import harness
from variants import campaign_after, slow_after

pytestmark = pytest.mark.usefixtures("in_workspace")

SCENE = {"title": '"a title"', "model": '"smd"', "outputs": '["x", "v"]', "stop": "0.1", "plots": "[]"}
TIMES = ("start", "stop", "follow", "h_max")
PLOTS = '["position", "phase", "steps"]'
KEYS = (
    *(
        "about",
        "analyses",
        "atol",
        "citation",
        "decay",
        "fmu",
        "h_max",
        "law",
        "method",
        "model",
        "outputs",
        "parameter",
    ),
    *("plots", "published", "reference", "remark", "rtol", "title"),
)
HUGE = "9" * 400
VALUES = (  # as written in TOML
    *("0", "-1", "1e308", "-1e308", "1e-300", "5e-324", "inf", "nan", HUGE, "9" * 5000, "true", "1979-05-27", "{}"),
    *('""', '"x"', '"$x_{$"', '"\\u0000"', '"\\uFFFF\\U0001F600"', '"%s%n"', '"../../x"', '"' + "t" * 200_000 + '"'),
    *("[]", "[1]", '["x", "x"]', '["x", "$_{"]', "[[1]]", "[" * 3000 + "]" * 3000, '[1, "s"]', '["gives"]', "["),
    *(
        '{gives = "f"}',
        '{source = "me", steps = 1e308}',
        '{"solver.method" = [1]}',
        '{m = "a\\u0000b"}',
        f"{{k = {HUGE}}}",
    ),
)
FILES = (  # complete scenes
    *(b"\xef\xbb\xbf", b"\xff\xfe", b"\0", b"title", b"[[[[", b"=" * 10_000, b'title = """', b"[values", b"a.b.c = 1"),
    *(b"[values]\n" * 2, b"\xc3\x28 = 1", b"title = 'a'\rmodel = 'smd'", b"{" * 100_000, b"#" * 2_000_000),
)
TABLES = (  # CSV tables
    *(
        "",
        ",",
        "t\n",
        "t,x\n",
        "t,x\n0\n",
        "t,x\n0,1\n",
        '"t,x\n0,1\n1,2\n',
        't,"x\n0,1\n1,2\n',
        "t,x,x\n0,1,1\n1,2,2\n",
    ),
    *(
        "t,x\n0,1e308\n1,-1e308\n2,1e308\n",
        "t,x\n0,nan\n1,2\n2,3\n",
        "t,x\n0,inf\n1,-inf\n2,0\n",
        "t,x\nnan,1\nnan,2\n",
    ),
    *(f"t,x\n0,{HUGE}\n1,1\n", "t,x\n1,1\n0,2\n", "t,x\n0,1\n0,2\n", "t,x\n-1e308,1\n1e308,2\n", "t,$x_{$\n0,1\n1,2\n"),
    *("t [ms],x [%s]\n0,1\n1,2\n", "t [\0],x\n0,1\n1,2\n", "t,x\n0,0\n1,0\n2,0\n", "t;x\n0;1,5\n1;2,5\n", "\0\0\0"),
    *("t,x\n" + "0,1\n" * 3, f"t,{'x' * 200_000}\n0,1\n1,2\n", "t,x,y\n0,1,2\n1,1,2\n", "t,\n0,1\n1,2\n"),
)
WORDS = (
    "",
    " ",
    "=",
    "m",
    "m=",
    "=1",
    "m=x",
    "m=1e999",
    "m=nan",
    f"m={HUGE}",
    "m=1=2",
    "x=1",
    "solver.method=2.5",
    "$",
    "%s",
)
SPANS = (
    *("m=1:2", "m=1:2:0", "m=1:2:-1", "m=1:2:999999999999", f"m=1:2:{HUGE}", "m=::", "m=:log", "m=0:1:2:log", "m=a,b"),
    *(
        "m=1,1",
        "m=1e308:-1e308:3",
        "m=nan:1:2",
        "m=1:2:3:4:5",
        "m=,",
        "=1:2:3",
        "m=1:2:3:log:log",
        "m=" + "1," * 50_000,
    ),
)


def run_command(*arguments, figures=True):
    """Return exit status and error message of a command; any unexpected exception fails the test."""
    result = harness(Path.cwd(), *arguments, figures=figures)
    return result.returncode, result.stderr


def scene_text(scene):
    """Return a scene as TOML text."""
    return "".join(f"{name} = {text}\n" for name, text in scene.items())


def check(status, output, figures):
    assert status in (0, 1, 2), figures
    assert len(output) < 3000, figures
    assert "Traceback" not in output, figures
    if status:
        assert output.strip(), figures


@pytest.mark.slow
@pytest.mark.parametrize("key", [*KEYS, "nosuch"])
def test_any_scene_content_runs_or_is_refused(workspace, key):
    default = (
        SCENE if key in TIMES else SCENE | {"grid": "0.01"}
    )  # without a grid there would be 4096 points, which test nothing more
    for value in VALUES:
        text = scene_text(default | {key: value})
        (workspace / "mine.toml").write_text(text, encoding="utf-8")
        check(*run_command("run", "mine.toml"), text[:300])


@pytest.mark.slow
def test_any_file_content_is_a_scene_or_is_refused(workspace):
    for content in FILES:
        (workspace / "mine.toml").write_bytes(content)
        status, output = run_command("run", "mine.toml")
        check(status, output, content[:100])
        assert status == 2, content[:100]
    (workspace / "folder.toml").mkdir()
    (workspace / "null.toml").symlink_to(os.devnull)
    for file in ("folder.toml", "null.toml", os.devnull, "nosuch.toml", "x" * 1000 + ".toml", "\udcff.toml", ""):
        try:
            status, output = run_command("run", file)
        except OSError as error:  # which main reports in one sentence
            status, output = 1, str(error)
        check(status, output, file[:100])
        assert status, file[:100]


@pytest.mark.parametrize("title", slow_after(2, ["$x_{$", "$", "\\$", "a_{b^c", "\u5b57\u0378", "%d {0} {x}"]))
def test_a_title_is_drawn_literally(workspace, title):
    text = scene_text(SCENE | {"title": f"'{title}'", "plots": '["position"]'})
    (workspace / "mine.toml").write_text(text, encoding="utf-8")
    assert run_command("run", "mine.toml") == (0, "")
    assert (workspace / "results/mine/figure.svg").stat().st_size > 1000


@pytest.mark.campaign
def test_extreme_numbers_are_drawn_or_refused(workspace):
    for values in ("x0 = 1e308", "x0 = 1e-308", "k = 1e300", "v0 = -1e300", "x0 = 5e-324\nv0 = 1e250", "m = 1e308"):
        (workspace / "mine.toml").write_text(f"{scene_text(SCENE | {'plots': PLOTS})}[values]\n{values}\n")
        check(*run_command("run", "mine.toml"), values)


@pytest.mark.campaign
def test_any_table_content_is_compared_or_refused(workspace):
    names = []
    for i, text in enumerate(TABLES):
        (workspace / f"{i}.csv").write_text(text, encoding="utf-8", newline="")
        names.append(f"{i}.csv")
    (workspace / "good.csv").write_text("t [s],x [m]\n0,1\n1,2\n2,3\n")
    (workspace / "\udcff$_{.csv").write_text("t [s],x [m]\n0,1\n1,2.5\n2,3\n")
    for name in (*names, "\udcff$_{.csv"):
        check(*run_command("compare", name, "good.csv"), (name, Path(name).read_text()[:200]))
    for name in names:  # the same tables are drawn
        for pair in (("good.csv", name), (name, name)):
            check(*run_command("compare", *pair, figures=False), (pair, Path(name).read_text()[:200]))
    check(*run_command("report"), "the report on all of these")
    assert (workspace / "results/report.html").stat().st_size > 1000


@pytest.mark.parametrize("option", ["--set", "--vary"])
def test_an_invalid_sweep_is_refused_before_a_worker_starts(workspace, option):
    vary = () if option == "--vary" else ("--vary", "m=1:2:2")
    for text in (*WORDS, *(SPANS if option == "--vary" else ())):
        status, output = run_command("sweep", "smd", *vary, option, text)
        check(status, output, text[:100])
        assert status, text[:100]
    for name, value in (
        ("--seed", "-1"),
        ("--samples", "9" * 30),
        ("--workers", "0"),
        ("--workers", "9" * 9),
        ("--name", "../x"),
    ):
        status, output = run_command("sweep", "smd", "--vary", "m=1:2", "--samples", "2", name, value)
        check(status, output, (name, value))
        assert status == 2, (name, value)
    assert not list(workspace.glob("results/sweep/*"))


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "1e999", "", "x", HUGE, "0x10", "-0"])
@pytest.mark.parametrize("option", ["--stop", "--rtol", "--within"])
def test_numbers_on_the_command_line_are_finite_or_refused(workspace, option, word):
    (workspace / "a.csv").write_text("t [s],x [m]\n0,1\n1,2\n2,3\n")
    check(*run_command("compare", "a.csv", "a.csv", option, word), word)
    if option != "--within":
        check(*run_command("run", "fmus/smd.fmu", option, word), word)


@pytest.mark.campaign
def test_randomly_mutated_scenes_run_or_are_refused(workspace):
    """The shipped scenes with a few characters changed; the same ones every time."""
    dice = random.Random(10)
    base = scene_text(SCENE) + "grid = 0.01\n[values]\nm = 1.5\n"
    for _ in range(150):
        text = list(base)
        for _ in range(dice.randint(1, 4)):
            text[dice.randrange(len(text))] = dice.choice('"[]{}=.,#\\\n0-e$\0\u00e9 ')
        (workspace / "mine.toml").write_text("".join(text), encoding="utf-8")
        check(*run_command("run", "mine.toml"), "".join(text))


UNREADABLE = "\udcff\udcfe"
ONE_TABLE = '"tables": [{"headings": ["a"], "rows": [["b", "c"]]}]'
RESULTS = {
    "smd/summary.json": ["", "{}", "[]", '"', "\0", "[" * 100_000],
    "decay/mine/summary.json": ['{"version": 1}', '{"version": 2}', '{"version": "1"}', "null", "{"],
    "compare/a-b/summary.json": ['{"version": 1, "study": "compare", "title": 1, "tables": {}}'],
    "stability/summary.json": ['{"version": 1, "study": "stability", "title": "t", "outcome": 1}'],
    "importers/summary.json": ['{"version": 1, "study": "importers", "title": "t", ' + ONE_TABLE + "}"],
    "sweep/mine/summary.json": ['{"version": 1, "study": "sweep", "title": "t", "files": ["../a.csv"]}'],
    "precision/smd/figure.svg": ["", "no picture"],
}


@pytest.mark.slow
def test_the_report_survives_any_content_of_a_result(tmp_path):
    """The first content of each file, then the second of each, and so on; finally each is a folder."""
    summary = '{"version": 1, "study": "%s", "title": "right hand %s", "picture": "a figure"}'
    for study, folder in (("run", "coulomb"), ("precision", "precision/smd")):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "summary.json").write_text(summary % (study, folder))
        (tmp_path / folder / "figure.svg").write_text("<svg></svg>")
    for file in RESULTS:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
    for contents in (*zip_longest(*RESULTS.values(), fillvalue=""), [UNREADABLE] * len(RESULTS), None):
        for file, content in zip(RESULTS, contents or RESULTS, strict=True):
            (tmp_path / file).unlink(missing_ok=True)
            if contents is None:
                (tmp_path / file).mkdir()
            else:
                (tmp_path / file).write_bytes(content.encode("utf-8", "surrogateescape"))
        assert run_command("report", "--out", tmp_path) == (0, ""), contents
        page = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert "right hand coulomb" in page
        unreadable = re.findall(f"{re.escape(str(tmp_path))}/([^ ]+) cannot be shown", page)
        assert sorted(unreadable) == sorted(str(Path(file).parent) for file in RESULTS), contents


def python(folder, *arguments, shell=None, **environment):
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    command = f"{shlex.join([sys.executable, '-m', 'harness', *map(str, arguments)])} {shell or ''}"
    return subprocess.run(
        ["sh", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, timeout=120
    )


FULL = "Error: No space left on device\n"


@pytest.mark.parametrize(
    ("command", "shell", "status", "message"),
    campaign_after(
        2,
        [
            (("info",), "| head -1", 0, ""),
            (("info",), ">&- 2>&-", 0, ""),
            (("info", "--json"), "> /dev/full", 1, FULL),
            (("run", "mine.toml"), ">&-", 0, ""),
            (("run", "mine.toml"), "> /dev/full", 1, FULL),
        ],
    ),
)
def test_an_unwritable_standard_output_is_no_crash(workspace, command, shell, status, message):
    (workspace / "mine.toml").write_text(scene_text(SCENE))
    result = python(workspace, *command, shell=shell)
    assert (result.returncode, result.stderr) == (status, message)


@pytest.mark.campaign
def test_a_closed_standard_input_is_empty(user_folder, tmp_path):
    result = python(user_folder, "decay", "-", "--out", tmp_path, shell="<&-")
    assert (result.returncode, result.stderr) == (2, "Error: standard input is empty\n")


def test_a_record_is_read_from_a_named_pipe(tmp_path):
    """As a shell does for `decay <(zcat swing.gz)`."""
    os.mkfifo(tmp_path / "63")
    writer = threading.Thread(target=(tmp_path / "63").write_text, args=("t [s],x [m]\n0.5,1\n1.5,2\n",))
    writer.start()
    message = "Error: 63 has 2 samples in this interval; at least 12 are required\n"
    assert run_command("decay", tmp_path / "63") == (2, message)
    writer.join()


ASCII, C = {"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.mark.parametrize(
    ("command", "coding"),
    [
        pytest.param(("decay", "swing.csv", "--no-drag"), C, marks=pytest.mark.campaign),  # draws
        (("run", "mine.toml"), ASCII),
        (("sweep", "--help"), C),
    ],
)
def test_an_ascii_standard_output_is_no_crash(workspace, command, coding):
    rows = [f"{0.04 * i},{exp(-0.04 * i) * cos(0.48 * i)}" for i in range(50)]
    (workspace / "swing.csv").write_text("\n".join(["t [s],x [m]", *rows]))
    (workspace / "mine.toml").write_text(scene_text(SCENE))
    result = python(workspace, *command, **coding)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.isascii()
