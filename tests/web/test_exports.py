"""CSV files of the live page."""

import pytest

pytestmark = pytest.mark.slow


def test_the_csv_file_holds_both_runs_and_all_settings(page):
    page.open(".model=coulomb&.stop=4&.compare=coulomb&.compare.friction=2&.compare.solver.method=2")
    page.run("HTMLAnchorElement.prototype.click = function () { globalThis.taken = fetched(this.href, this.download) }")
    page.run("URL.createObjectURL = blob => { globalThis.blob = blob; return 'blob:x' }; URL.revokeObjectURL = () => 0")
    page.run("globalThis.fetched = (href, name) => name")
    page.click("#csv")
    lines = page.run("blob.text()").splitlines()
    settings = [line for line in lines if line.startswith("# ")]
    assert {"# model = coulomb", "# k = 157.9", "# f = 0.5", "# stop = 4", "# solver.method = 1"} <= {*settings}
    assert {"# compare = coulomb", "# compare.friction = 2", "# compare.solver.method = 2"} <= {*settings}
    head, *rows = lines[len(settings) :]
    assert head.startswith("t [s],x [m],v [m/s],a [m/s2]")
    assert "compare.x [m]" in head
    assert len(rows) == 1601
    assert float(rows[-1].split(",")[1]) == page.run("app.runs.main.columns.x.at(-1)")
    page.open(anew=True)  # with the methods of the browser
