"""Two runs of the live page beside each other, and slow runs."""

import pytest
import web_page

pytestmark = pytest.mark.slow


def test_a_slow_method_is_previewed_with_a_fast_one(page):
    """For any run time: dragging a slider shows the last value up to the end of the run."""
    page.open(".model=pacejka&x_m=0.001&solver.method=2&solver.rtol=0.001")
    values = page.run(
        "new Promise(done => { const e = document.querySelector('.field:has(#field-k) [type=range]');"
        "for (const at of [100, 200, 300]) { e.value = at; e.dispatchEvent(new Event('input')) }"
        "requestAnimationFrame(() => { const { main, preview } = app.runs;"
        "const [first, second] = app.plots.get('x').panel.content.curves.slice(-2);"
        "done([main.done, main.setting.values.k, preview.setting.values, first.x.at(-1), second.x.at(-1)]) }) })"
    )
    is_done, k, preview_values, preview_end, run_end = values
    assert (is_done, preview_values) == (False, {"x_m": 0.001, "k": k})
    assert run_end < preview_end <= 16
    assert page.when_done("app.plots.get('x').panel.content.curves.slice(-2).map(curve => curve.x.at(-1))") == [
        16,
        16,
    ]
    assert page.run("app.runs.main.setting.values.k") == k


def test_comparing_two_laws_shows_the_difference_and_the_counters(page):
    page.open(".model=coulomb")
    page.choose("comparison", "coulomb")
    assert page.run("app.runs.comparison.setting.values.friction") == 2
    difference = page.run(
        "(() => { const { main, comparison } = app.runs; return Math.max(...main.grid.map((row, i) => "
        "Math.abs(main.columns.x[row] - comparison.columns.x[comparison.grid[i]]))) })()"
    )
    assert 1e-6 < difference < 1e-2
    rows = page.table("Cost and accuracy")
    assert web_page.number(rows["largest difference in x"][1]) == pytest.approx(difference, rel=1e-2)
    assert rows["largest error of x against the closed form"][0] == "closed form"
    first_count, second_count = (int(cell) for cell in rows["right-hand side evaluations"])
    assert second_count > 20 * first_count
    assert not any("time" in row for row in rows)  # the law that does more work may take less of it up to the stop
    assert not page.run("document.getElementById('panel-.error').hidden")


@pytest.mark.parametrize(
    ("link", "role"),
    [
        (".model=stickslip&mu_d=0.9&.compare=pacejka", "second run (pacejka"),  # which needs mu_d below mu_s
        (
            ".model=coulomb&.compare=coulomb&.compare.friction=2&.compare.solver.method=2&.stop=20",
            "second run (coulomb",
        ),
        (".model=coulomb&friction=2&solver.method=2&.stop=20&.compare=coulomb", "run (coulomb"),
    ],
)
def test_a_failed_run_of_a_comparison_is_named_and_has_no_error(page, link, role):
    page.open(link)
    assert page.run("document.getElementById('alert').textContent").startswith(f"The {role}")
    assert not any("difference" in row or "error" in row for row in page.table("Cost and accuracy"))
    assert page.run("app.plots.get('.error')?.figure.hidden ?? true")
    run = "comparison" if "second" in role else "main"
    *_, run_end = page.run(f"[0, ...app.runs.{run}.time]")
    curve = "app.plots.get('x').panel.content.curves.find(curve => curve.colour === {!r})"
    curve_end = page.run(f"{curve.format('b' if 'second' in role else 'a')}?.x.at(-1) ?? 0")
    assert curve_end == run_end < page.run("app.state().stop")


def test_another_model_keeps_values_of_the_same_names(page):
    page.open(".model=stickslip&k=500&.compare=pacejka&.compare.x_m=0.005")
    assert page.run("app.runs.comparison.setting.values.k") == 500
    assert page.run("app.runs.comparison.setting.values.x_m") == 0.005
    assert page.run("app.runs.comparison.columns.v.some((v, i) => i > 99 && v > 0 && v < 0.01)")  # it creeps


def test_the_second_run_can_have_the_default_where_the_first_has_another_value(page):
    page.open(".model=coulomb&friction=2&solver.method=2&solver.rtol=0.001&.stop=2&.compare=coulomb")
    assert page.run("app.runs.comparison.setting.values.friction") == 2
    page.choose("comparison-friction", 1)
    page.choose("comparison-rtol", 0)
    values = page.run("app.runs.comparison.setting.values")
    assert (values["friction"], values["solver.rtol"]) == (1, 0)
    selections = "['friction', 'rtol'].map(id => document.getElementById(`comparison-${id}`).value)"
    assert page.run(selections) == ["1", "0"]
    page.choose("comparison-method", 1)
    assert page.run("app.runs.comparison.setting.values['solver.method']") == 1
    assert page.run("app.runs.main.setting.values.friction") == 2
