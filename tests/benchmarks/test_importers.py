"""The built FMUs in other tools: the table of `python -m benchmarks importers`, row by row.

Tools that are not installed are skipped with the reason; they are in the extra `importers`.
"""

import pickle
from pathlib import Path

import fmi3_fixtures
import native_fmus
import pytest
from build_cache import build_user_model, cached_folder
from models import EXAMPLE_MODELS, LARGER_MODELS, MODELS

from benchmarks.importers import checks, table
from benchmarks.importers.checks import CHECKS, IMPORTERS, NOT_RUN, CheckFailedError
from benchmarks.importers.request import ImporterRequest
from harness import HarnessError
from harness.scenes.run_spec import RunSpec

pytestmark = pytest.mark.slow

# Both backends of a model agree bit for bit (native/test_python_native_agreement.py), and the code specific to a
# backend is the same for all models: each model is checked with one backend, the sled with both.
CHECKED_MODELS = {"python": ["stickslip"], "native": sorted(MODELS)}


@pytest.fixture(scope="module", params=CHECKED_MODELS)
def check_results(request, fmus, tmp_path_factory):
    """Return the models to check with a backend, and all rows of their table, computed once per test run."""
    names, source = (
        CHECKED_MODELS[request.param],
        fmus if request.param == "python" else native_fmus.build_native_fmus(),
    )

    def make(out):
        folder = tmp_path_factory.mktemp("checked")
        for name in names:
            (folder / f"{name}.fmu").symlink_to(source / f"{name}.fmu")
        (out / "rows").write_bytes(pickle.dumps(table.run_checks(folder, lambda name, share: None)))

    return names, pickle.loads((cached_folder(f"importers-{request.param}", make) / "rows").read_bytes())


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("importer", IMPORTERS, ids=lambda importer: importer.name)
def test_the_importer_passes(check_results, importer, check):
    names, rows = check_results
    importer_rows = [row for row in rows if row.importer.startswith(importer.name)]
    if importer_rows[0].reason:
        pytest.skip(importer_rows[0].reason)
    (row,) = [row for row in importer_rows if row.check == check]
    assert row.failed == ()
    unfit = [row for row in rows if row.importer.endswith(".fmu")]
    assert len(row.cells) + len(unfit) == len(names)


def test_the_table_lists_every_model_and_names_missing_tools(check_results):
    names, rows = check_results
    unfit = [row.importer.removesuffix(".fmu") for row in rows if row.importer.endswith(".fmu")]
    assert sorted([*table.fmu_names(rows), *unfit]) == names
    assert {row.importer for row in rows if row.reason} >= set(NOT_RUN)


@pytest.mark.campaign
def test_an_fmu_unsuitable_for_the_checks_is_skipped_with_a_reason(tmp_path, monkeypatch):
    """The brake has no mass m; the other models are still checked."""
    monkeypatch.setattr(table, "IMPORTERS", ())
    path = next(path for path in EXAMPLE_MODELS if path.stem == "rotor_brake")
    (tmp_path / "rotor_brake.fmu").symlink_to(build_user_model(path) / "rotor_brake.fmu")
    with pytest.raises(HarnessError, match="the checks require a mass m, an input, and an output of the same unit"):
        table.run_checks(tmp_path, print)
    path = next(path for path in LARGER_MODELS if path.stem == "belt")
    (tmp_path / "belt.fmu").symlink_to(build_user_model(path) / "belt.fmu")
    first, *_ = table.run_checks(tmp_path, print)
    assert (first.importer, first.reason.split(",")[0]) == ("rotor_brake.fmu", "the checks require a mass m")


ADAPTER = """
import os, sys, time
from benchmarks.importers.request import ImporterReply

def run(module, request):
    (name,) = request.instances
    print(f"{name} speaks", file=sys.stderr)
    if name == "crash":
        os.kill(os.getpid(), 11)
    time.sleep(60 * (name == "hang"))
    if name == "leak":
        __import__("atexit").register(os.kill, os.getpid(), 9)
    return ImporterReply(name, [], [], os.getpid())
"""


@pytest.mark.campaign
def test_a_crash_or_timeout_affects_only_its_own_check(make_module, monkeypatch):
    """The checks that follow run in another process; a process that ends badly loses its last answer."""
    monkeypatch.setattr(checks, "run_in_adapter", make_module("adapter_that_crashes", ADAPTER).run)
    monkeypatch.setattr(checks, "RESULTS", {})
    monkeypatch.setattr(checks, "TIMEOUT", 2.0)
    tool, *_ = (importer for importer in IMPORTERS if importer.name == "Ecos")
    names = ["one", "crash", "two", "hang", "three", "leak"]
    requests = [ImporterRequest(RunSpec(Path("a.fmu"), stop=1.0, grid=1.0), {}, instances=[name]) for name in names]
    checks.prepare(tool, requests[:3])
    checks.prepare(tool, requests)
    versions, processes = {}, []
    for name, request in zip(names, requests, strict=True):
        try:
            answer = checks.run_request(tool, request)
            versions[name] = answer.reply.version, answer.stderr
            processes.append(answer.reply.n_accepted)
        except CheckFailedError as wrong:
            versions[name] = str(wrong)
    endings = {
        "crash": "it ended with exit status -11: crash speaks",
        "leak": "it ended with exit status -9: leak speaks",
    }
    assert versions == {
        **{name: (name, f"{name} speaks\n") for name in ("one", "two", "three")},
        **endings,
        "hang": "no answer after 2 s",
    }
    assert len(set(processes)) == 3
    assert [table.name_with_version(tool, request) for request in requests[:2]] == ["Ecos one", "Ecos"]


def test_an_excluded_tool_is_listed_with_the_reason():
    text = table.legend_lines(
        [table.CheckResult("Ecos", "", reason="it is not installed: python -m pip install 'friction-fmus[importers]'")]
    )
    assert "Ecos was skipped: it is not installed: python -m pip install 'friction-fmus[importers]'" in text


def test_fmus_of_another_fmi_version_are_refused_in_one_sentence():
    with pytest.raises(HarnessError, match=r"\.fmu is an FMU for FMI 3\.0; the checks require FMI 2\.0"):
        table.run_checks(fmi3_fixtures.build_fmi3_fmus(), lambda name, share: None)
