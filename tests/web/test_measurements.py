"""A visitor's measurement, dropped onto the live page."""

import json

import pytest

DROP = (
    "(() => {{ const transfer = new DataTransfer(); transfer.items.add(new File([{}], 'bench.csv'));"
    "dispatchEvent(new DragEvent('drop', {{ dataTransfer: transfer, cancelable: true }})) }})()"
)

MEASURED = "app.plots.get('{}').panel.content.curves.find(({{ legend }}) => legend === 'bench.csv')"


@pytest.mark.parametrize(
    ("model", "name", "text"),
    [
        ("coulomb", "x", "t [ms],x [mm]\n0,100\n500,87.5\n1000,75\n"),
        ("coulomb", "x", "# bench 3\ntime (s);force (N);position (cm)\n0;9;10\n0,5;9;8,75\n1;9;7,5\n"),
        ("coulomb", "x", "0\t0.1\n0.5\t0.0875\n1\t0.075\n"),
        ("pendulum", "theta", "t [s],theta [deg]\n0,100\n0.5,87.5\n1,75\n"),
    ],
)
def test_a_dropped_measurement_is_drawn_over_the_run_in_the_units_of_its_heading(page, model, name, text):
    page.open(f".model={model}")
    page.run(DROP.format(json.dumps(text)))
    page.wait(f"{MEASURED.format(name)} !== undefined")
    curve = page.run(MEASURED.format(name))
    factor = 1 if model == "pendulum" else 1e-3  # the diagram of theta is in degrees
    assert curve["x"] == pytest.approx([0, 0.5, 1])
    assert curve["y"] == pytest.approx([100 * factor, 87.5 * factor, 75 * factor])
    assert "bench.csv" in page.run("document.getElementById('legend').innerText")
    page.click("#remove-measurement")
    page.wait(f"{MEASURED.format(name)} === undefined")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("t [s],x [furlong]\n0,1\n1,2\n", 'the unit of "x [furlong]" is furlong; give one of m, mm'),
        ("hello", "has no two columns"),
        ("t,x\na,b\n", "fewer than two rows"),
    ],
)
def test_a_measurement_that_cannot_be_read_is_refused_with_the_reason(page, text, sentence):
    page.open(".model=coulomb")
    page.run(DROP.format(json.dumps(text)))
    page.wait("!document.getElementById('alert').hidden")
    assert sentence in page.run("document.getElementById('alert').textContent")
    assert page.run(f"{MEASURED.format('x')} === undefined")
