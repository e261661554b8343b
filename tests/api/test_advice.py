"""Who follows the advice of a message gets a result."""

import math
import re

import commands
import numpy as np
import pytest
from variants import campaign_after

import harness
from fmus.compiler.equations.expressions import FUNCTIONS, Expression, ModelError


def interrupt(share):
    if share > 0.3:
        raise KeyboardInterrupt


def run_sweep(folder, progress=False):
    return harness.sweep("smd", {"m": np.linspace(1.0, 2.0, 50)}, stop=0.01, folder=folder, progress=progress)


def test_an_interrupted_sweep_says_what_becomes_of_its_runs(in_workspace):
    with pytest.raises(harness.HarnessError, match="finished; they are lost, because `folder` is not set"):
        run_sweep(None, interrupt)
    with pytest.raises(
        harness.HarnessError, match=r"(\d+) of 50 runs are finished; repeat the call to resume"
    ) as error:
        run_sweep("here", interrupt)
    assert run_sweep("here").n_resumed == int(re.findall(r"\d+", str(error.value))[0])


@pytest.mark.parametrize(
    ("fmu", "arguments"),
    [
        ("fmus/stickslip.fmu", ""),
        ("fmus/more/belt.fmu", " belt"),
        ("elsewhere/stickslip.fmu", " stickslip --out elsewhere"),
        ("two words/cart.fmu", " 'two words/cart.py'"),
        ("fmus/cart.fmu", None),
    ],
)
def test_a_missing_fmu_names_the_command_that_builds_it(fmu, arguments, tmp_path):
    (tmp_path / "two words").mkdir()
    (tmp_path / "two words" / "cart.py").touch()
    result = commands.harness(tmp_path, "run", fmu)
    remedy = "" if arguments is None else f"build it with `friction-fmus build{arguments}`, or "
    assert result.stderr == f"Error: there is no {fmu}: {remedy}specify another file\n"


def test_an_fmu_in_another_folder_is_built_as_the_message_says(tmp_path):
    (command,) = re.findall(r"`friction-fmus (.*?)`", commands.harness(tmp_path, "run", "there/smd.fmu").stderr)
    assert commands.harness(tmp_path, *command.split()).returncode == 0
    assert commands.harness(tmp_path, "run", "there/smd.fmu").returncode == 0


@pytest.mark.parametrize("native", [(), pytest.param(("--native",), marks=pytest.mark.campaign)])
def test_an_unknown_platform_lists_those_that_exist(native, tmp_path):
    message = commands.build("smd", "--platform", "vax", *native, "--out", tmp_path).stderr
    platform = re.search(r"choose from (\w+)", message)[1]
    assert commands.build("smd", "--platform", platform, *native, "--out", tmp_path).returncode == 0


@pytest.mark.parametrize("exponent", [-10, -3, -1, -0.5, 0, 0.5, 1, 1.5, 2, 2.5, 3.5, 7, 10, 11, -1.5, 1.7, math.pi])
def test_the_product_in_place_of_a_power_has_its_value(exponent):
    variable = Expression()
    variable.name = "x"
    with pytest.raises(ModelError) as error:
        variable**exponent
    text, _, domain = str(error.value).partition("write ")[2].partition(", for ")
    signs = (1.0,) if domain == "x > 0" or "sqrt" in text else (1.0, -1.0)
    for x in (sign * size for sign in signs for size in (0.3, 1.0, 2.5)):
        value = eval(text, {"x": x} | {name: getattr(math, name) for name in FUNCTIONS})
        assert value == pytest.approx(x**exponent, rel=1e-13)


@pytest.mark.parametrize(
    ("quantity", "unit"), campaign_after(1, [("position", "V"), ("velocity", "V"), ("acceleration", "V")])
)
def test_a_record_in_volts_is_converted_as_the_remark_says(quantity, unit, tmp_path):
    t = np.linspace(0.0, 10.0, 2001)
    x = np.exp(-0.1 * t) * np.sin(6 * t)
    file = tmp_path / "decay.csv"
    np.savetxt(file, np.c_[t, x], delimiter=",", header=f"t [s],u [{unit}]", comments="")
    (remark,) = (text for text in harness.identify_decay(file, k=36.0, quantity=quantity).remarks if "forces" in text)
    (size,) = re.findall(r"unit='(.*?)'", remark)
    record = harness.read_record(file, quantity=quantity, unit=size)
    result = harness.identify_decay(record, k=36.0)
    assert result["c"].unit == "N.s/m"
    assert not any("forces" in text for text in result.remarks)


def test_another_method_of_the_fmu_runs_the_law_that_the_closed_form_refuses(tmp_path):
    choices = ("--method", "exact", "--method", "radau9", "--law", "hybrid", "--law", "sign")
    assert commands.build("coulomb", *choices, "--out", tmp_path).returncode == 0
    fmu = tmp_path / "coulomb.fmu"
    with pytest.raises(harness.HarnessError, match=r"or choose another solver\.method if the FMU has one"):
        harness.simulate(fmu, {"friction": "sign"}, stop=0.1)
    assert len(harness.simulate(fmu, {"friction": "sign", "solver.method": "radau9"}, stop=0.1).time) > 1
    assert len(harness.simulate(fmu, {"friction": "hybrid"}, stop=0.1).time) > 1
