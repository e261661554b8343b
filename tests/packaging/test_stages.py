"""`--stages` writes the texts of every stage of code generation, and they are those that FMUs carry."""

import re
from zipfile import ZipFile

import pytest
from click.testing import CliRunner
from models import MODELS, model_class

import build_fmus


@pytest.fixture(scope="module")
def stages(tmp_path_factory):
    """The folder with the texts of all models."""
    folder = tmp_path_factory.mktemp("stages")
    result = CliRunner().invoke(build_fmus.main, [*MODELS, "--stages", str(folder)])
    assert result.exit_code == 0, result.output
    assert result.output.split() == [str(folder / name) for name in MODELS]
    return folder


@pytest.mark.parametrize("name", MODELS)
def test_the_lowered_texts_are_those_inside_the_fmu(stages, fmus, name):
    lowered_folder = stages / name / "3-lowered"
    with ZipFile(fmus / f"{name}.fmu") as archive:
        package = next(path for path in archive.namelist() if path.endswith("/runtime/integrator.py")).split("/")[1]
        for path in (f"{name}.py", "runtime/integrator.py", "runtime/ode23.py"):
            assert archive.read(f"resources/{package}/{path}").decode() == (lowered_folder / path).read_text()


@pytest.mark.parametrize("name", MODELS)
def test_every_stage_has_its_text(stages, name):
    folder = stages / name
    assert f"class {model_class(name).__name__}" in (folder / "1-declared.py").read_text()
    assert re.search(r"_rates\(struct \w+ \*self", (folder / "4-c" / "model.h").read_text())


def test_the_analysis_states_load_limit_and_derivatives(stages):
    lines = (stages / "stickslip" / "2-analysis.txt").read_text().splitlines()
    assert "F_friction: load while stuck F_ext + k * (x_driver - x)" in lines
    assert "F_friction: holding limit mu_s * m * g" in lines
    assert "da/dx at constant friction force = -k / m" in lines
    assert "closed form: none" in (stages / "pendulum" / "2-analysis.txt").read_text()


@pytest.mark.parametrize("option", ["--native", "--web", "--fmi=3", "--out=elsewhere", "--platform=linux64"])
def test_options_of_a_build_are_refused(tmp_path, option):
    result = CliRunner().invoke(build_fmus.main, ["smd", "--stages", str(tmp_path / "stages"), option])
    assert result.exit_code == 2
    assert "remove" in result.output
    assert not (tmp_path / "stages").exists()
