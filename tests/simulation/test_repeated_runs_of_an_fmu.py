"""Runs of one sweep do not depend on each other."""

import pytest
from external_fmus import build_external_fmus, edited_copy

import harness


@pytest.mark.parametrize(
    ("fmu", "name", "values", "message"),
    [
        ("smd", "m", (2.0, -1.0, 3.0), "m = -1.0 kg is refused"),
        pytest.param("Faulty", "kind", (0, 2, 4), "its binary crashed", marks=pytest.mark.campaign),
    ],
)
def test_a_refused_run_changes_no_later_one(fmus, fmu, name, values, message):
    """Neither in one process, nor in a worker, which is replaced when an external FMU crashes."""
    path = (fmus if fmu == "smd" else build_external_fmus()) / f"{fmu}.fmu"
    runs = harness.sweep(path, {name: list(values)}, measures=["final"], workers=1, stop=1.0).to_pandas()
    assert [bool(error) for error in runs.error] == [False, True, False]
    assert message in runs.error.iloc[1]
    for number in (0, 2):
        assert runs.final_x.iloc[number] == harness.simulate(path, {name: values[number]}, stop=1.0)["x"][-1]


@pytest.mark.campaign
def test_an_fmu_for_one_instance_in_a_process_has_a_process_for_each_run(tmp_path):
    """Such an FMU may keep values of an earlier instance; here its output is the number of its process."""
    changes = {
        "resources/Gain.py": lambda text: (
            "import os\n" + text.replace("self.k * self.u + self.c", "float(os.getpid())")
        ),
        "modelDescription.xml": lambda text: text.replace('OncePerProcess="false"', 'OncePerProcess="true"'),
    }
    fmu = edited_copy(build_external_fmus() / "Gain.fmu", tmp_path / "Gain.fmu", changes)
    runs = harness.sweep(fmu, {"k": [1.0, 2.0]}, measures=["final"], workers=1, stop=1.0).to_pandas()
    assert runs.final_y.nunique() == 2
