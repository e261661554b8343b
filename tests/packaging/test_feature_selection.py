"""FMUs built with --method, --law and --platform offer only these, carry only their code, and run alike."""

import re
from zipfile import ZipFile

import native_fmus
import pytest
from commands import build as command
from fmpy import read_model_description
from models import EXACT, FEW_CASES, MODELS, counts, declarations_of, label, outputs
from row_comparison import assert_identical
from variants import slow_after

from fmus.compiler.lowering import LAWS, METHODS, lowered_files
from fmus.compiler.lowering.feature_selection import FeatureSelection
from fmus.packaging import archive
from harness import describe, simulate

LABELS = {"solver.method": "--method", "friction": "--law"}


def choice_options(name, values):
    """Return the choice labels of a case, by command-line option."""
    choices = {}
    for variable, option in LABELS.items():
        for item in declarations_of(name)[variable].items if variable in values else ():
            if item[1] == values[variable]:
                choices[option] = item[0]
    return choices


@pytest.fixture(scope="module")
def lean(tmp_path_factory):
    """Return lean(case): the FMU with only the method and the law of a case, for Linux."""

    def build(case):
        options = choice_options(*case[:2])
        options_of_case = [[options[word]] if word in options else [] for word in LABELS.values()]
        return archive.build(case[0], tmp_path_factory.mktemp("lean"), *options_of_case, ["linux64"])

    return build


@pytest.mark.parametrize("case", slow_after(1, [(case,) for case in FEW_CASES]), ids=label)
def test_a_reduced_fmu_carries_one_method_and_runs_alike(lean, launch, worker, case):
    name, values, stop = case
    path = lean(case)
    options = choice_options(name, values)
    description = read_model_description(path, validate_model_structure=True)
    assert {variable.name for variable in description.modelVariables} <= {
        *declarations_of(name)
    }  # whose characters are allowed
    assert not LABELS.keys() & {variable.name for variable in description.modelVariables}
    assert describe(path).fixed == {variable: options[word] for variable, word in LABELS.items() if word in options}
    with ZipFile(path) as archive:
        files = {entry.rsplit("/", 1)[1] for entry in archive.namelist() if "/runtime/" in entry}
        assert {entry.split("/")[1] for entry in archive.namelist() if entry.startswith("binaries")} == {"linux64"}
        page = archive.read("documentation/index.html").decode()
    labels = {label for label in (*METHODS, *LAWS) if f"<b>{label}</b>" in page}
    assert labels == set(options.values())
    methods = {"linear_closed_form.py", "ode23.py", "ode45.py", "dop853.py", "rodas.py", "radau9.py"}
    assert files & methods == {f"{options['--method']}.py".replace("exact", "linear_closed_form")}
    times = [stop * i / 40 for i in range(41)]
    names = outputs(name) + counts(name)
    fmu = worker.instantiate(path).begin({v: x for v, x in values.items() if v not in LABELS}, stop=stop)
    assert_identical(fmu.run(times, names), launch(name, values, stop=stop).run(times, names), names)
    fmu.free()


@pytest.mark.parametrize(
    ("name", "methods", "laws", "has_comparisons"),
    [
        ("stickslip", ("exact", "ode23"), ("hybrid", "threshold"), True),
        ("stickslip", ("exact",), ("hybrid",), False),
        ("pendulum", ("dop853",), ("sign",), False),
        ("smd", ("ode23",), (), False),
    ],
)
def test_only_choices_with_alternatives_are_compared_in_a_run(name, methods, laws, has_comparisons):
    text = "\n".join(lowered_files(name, FeatureSelection(methods, laws)).values())
    assert bool(re.search("(method_number|method|friction) [!=]= ", text)) == has_comparisons
    assert ("def advance_with_method(" in text) == (methods != ("exact",))


@pytest.mark.parametrize(
    "options", slow_after(1, [((),), (("--native", "--platform", "linux64"),)]), ids=["python", "native"]
)
def test_an_enumeration_of_one_item_is_no_variable_and_stays_known(tmp_path, options):
    """The FMU says which law it has: one without stick and slip needs reports of steps, and has other dependencies."""
    if options:
        native_fmus.require_compiler()
    choice = ("--method", "ode23", "--method", "rodas", "--law", "sign")
    assert command("coulomb", *choice, *options, "--out", tmp_path).returncode == 0
    fmu = tmp_path / "coulomb.fmu"
    description = read_model_description(fmu)
    assert [v.name for v in description.modelVariables if v.type == "Enumeration"] == ["solver.method"]
    assert describe(fmu).laws == ("sign",)
    assert "Friction laws (friction): sign; fixed by the build" in str(describe(fmu))
    assert simulate(fmu, {"friction": "sign"}, stop=1.0, method="rodas").settings_label == "rodas, sign"
    exchange = description.modelExchange
    assert exchange is None or not exchange.completedIntegratorStepNotNeeded
    with ZipFile(fmu) as archive:
        assert not [name for name in archive.namelist() if name.startswith("extra/org.fmi-standard.fmi-ls-ref")]
        assert "<b>sign</b>" in archive.read("documentation/index.html").decode()


def test_several_may_be_selected_and_the_first_is_the_default(tmp_path):
    assert command("pendulum", "--method", "rodas", "--method", "ode45", "--out", tmp_path).returncode == 0
    (method,) = [
        v for v in read_model_description(tmp_path / "pendulum.fmu").modelVariables if v.name == "solver.method"
    ]
    assert [(item.name, item.value) for item in method.declaredType.items] == [("ode45", "3"), ("rodas", "5")]
    assert method.start == "3"


def test_a_reduced_build_is_reproducible_and_differs_from_the_full_one(lean, tmp_path, fmus):
    fmu = lean(("smd", {"solver.method": EXACT}))
    assert command("smd", "--method", "exact", "--platform", "linux64", "--out", tmp_path).returncode == 0
    assert (tmp_path / "smd.fmu").read_bytes() == fmu.read_bytes()
    guids = {read_model_description(path).guid for path in (fmu, fmus / "smd.fmu")}
    assert len(guids) == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("pacejka", "--method", "exact"), ("pacejka", "exact", "ode23, ode45, dop853, rodas, radau9")),
        (("smd", "--law", "sign"), ("smd", "sign", "none")),
        (("stickslip", "--law", "sign"), ("stickslip", "sign", "hybrid, threshold")),
        (("coulomb", "--law", "sign", "--method", "exact"), ("coulomb", "exact", "hybrid")),
        (("smd", "--platform", "amiga"), ("amiga", "linux64")),
    ],
)
def test_an_option_that_a_model_lacks_is_refused_in_one_sentence(arguments, words, tmp_path):
    run = command(*arguments, "--out", tmp_path)
    assert run.returncode == 1
    assert run.stderr.count("\n") == 1
    assert all(word in run.stderr for word in words), run.stderr
    assert list(tmp_path.iterdir()) == []


def test_every_model_is_among_the_cases():
    assert {case[0] for case in FEW_CASES} == set(MODELS)
