"""Descriptions of FMUs: `describe` and the command info."""

import json

import commands
import external_fmus
import pytest
from fmpy import read_model_description

import harness

MODELS = ("smd", "coulomb", "stickslip", "pacejka", "pendulum")


@pytest.mark.parametrize("model", MODELS)
def test_a_description_has_every_variable_of_the_fmu_with_its_unit_and_default(fmus, model):
    """Read from the model description by fmpy."""
    description = harness.describe(fmus / f"{model}.fmu")
    expected = read_model_description(str(fmus / f"{model}.fmu"))
    assert [item.name for item in description.variables] == [item.name for item in expected.modelVariables]
    assert [item.unit or None for item in description.variables] == [
        None if item.unit == "1" else item.unit for item in expected.modelVariables
    ]
    for item in expected.modelVariables:
        variable = description[item.name]
        if item.type == "Enumeration":
            assert variable.choices == tuple(choice.name for choice in item.declaredType.items)
            assert variable.start == variable.choices[[c.value for c in item.declaredType.items].index(item.start)]
        elif item.start is not None:
            assert variable.start == float(item.start)
    text = str(description)
    assert all(f"\n{item.name} " in text for item in expected.modelVariables)
    assert description["solver.rtol"].range == "from 0 to below 1"
    assert description["m"].range == "above 0"


def test_laws_and_methods_are_those_of_the_contract(fmus):
    descriptions = {model: harness.describe(fmus / f"{model}.fmu") for model in MODELS}
    assert {model: item.laws for model, item in descriptions.items()} == {
        "smd": (),
        "coulomb": ("hybrid", "sign"),
        "stickslip": ("hybrid", "threshold"),
        "pacejka": (),
        "pendulum": ("hybrid", "sign"),
    }
    assert [item["solver.method"].start for item in descriptions.values()] == [
        "exact",
        "exact",
        "exact",
        "radau9",
        "dop853",
    ]
    assert all("ode23" in item.methods for item in descriptions.values())


def test_a_description_is_one_line_a_table_and_html(fmus):
    description = harness.describe(fmus / "stickslip.fmu")
    assert repr(description).startswith("<FmuDescription stickslip: FMI 2.0, parameters: 14, inputs: 1, outputs: 8")
    assert "\n" not in repr(description)
    frame = description.to_pandas()
    assert frame.loc["k", ["start", "unit"]].tolist() == [742.5, "N/m"]
    html = description._repr_html_()
    assert html.count("<tr>") == len(description.variables) + html.count("<table>")
    assert "Friction laws (friction): hybrid, threshold; default hybrid" in html


@pytest.mark.parametrize("name", ["Arrays", "Midpoint", "ModelExchangeOnly", "Fmi3Midpoint"])
def test_the_command_describes_any_fmu(tmp_path, name):
    path = external_fmus.build_external_fmus() / f"{name}.fmu"
    result = commands.harness(tmp_path, "info", path, "--json")
    assert (result.returncode, result.stderr) == (0, "")
    data, description = json.loads(result.stdout), harness.describe(path)
    assert [item["name"] for item in data["variables"]] == [item.name for item in description.variables]
    assert data["interfaces"] == list(description.interfaces)
    text = commands.harness(tmp_path, "info", path, COLUMNS="80").stdout
    assert max(map(len, text.splitlines())) <= 80
    assert all(item.name in text for item in description.variables)
    assert not (tmp_path / "results").exists()


def test_what_is_no_model_and_no_fmu_is_refused_in_one_sentence(tmp_path):
    (tmp_path / "text.fmu").write_text("no archive")
    for source, words in (
        ("stikslip", "nearest: 'stickslip'"),
        ("none.fmu", "none.fmu"),
        ("text.fmu", "cannot be read"),
    ):
        result = commands.harness(tmp_path, "info", source)
        assert result.returncode in (1, 2)
        assert words in result.stderr
        assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"{}", b'{"tables": 1}', b"\xff"])
def test_damaged_model_data_of_an_fmu_end_in_one_sentence(fmus, tmp_path, content):
    copy = external_fmus.edited_copy(
        fmus / "coulomb.fmu", tmp_path / "coulomb.fmu", {"resources/model_data.json": content}
    )
    for use in (harness.describe, harness.simulate):
        with pytest.raises(
            harness.HarnessError, match=r"^coulomb.fmu cannot be read: its resources/model_data.json is damaged; "
        ):
            use(copy)
