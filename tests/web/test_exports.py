"""CSV and PNG files and prints of the live page."""

import pytest

pytestmark = pytest.mark.slow


def test_the_csv_file_holds_the_run_and_the_picture_is_a_png(page):
    page.open(".model=coulomb&.stop=4&.compare=coulomb&.compare.friction=2&.compare.solver.method=2")
    page.run("HTMLAnchorElement.prototype.click = function () { globalThis.taken = fetched(this.href, this.download) }")
    page.run("URL.createObjectURL = blob => { globalThis.blob = blob; return 'blob:x' }; URL.revokeObjectURL = () => 0")
    page.run("globalThis.fetched = (href, name) => name")
    page.click("#csv")
    lines = page.run("blob.text()").splitlines()
    settings = [line for line in lines if line.startswith("# ")]
    assert any("k = 157.9 N/m" in line and "f = 0.5 N" in line for line in settings)
    assert any("solver.method = exact" in line for line in settings)
    assert any(line.startswith("# Second run, coulomb") and "friction = sign" in line for line in settings)
    head, *rows = lines[len(settings) :]
    assert head.startswith("t [s],x [m],v [m/s],a [m/s2]")
    assert "compare.x [m]" in head
    assert len(rows) == 1601
    assert float(rows[-1].split(",")[1]) == page.run("app.session.runs.main.columns.x.at(-1)")
    page.run("globalThis.drawn = []; globalThis.fill = CanvasRenderingContext2D.prototype.fillText")
    page.run(
        "CanvasRenderingContext2D.prototype.fillText = function (t, ...at) { drawn.push(t); fill.call(this, t, ...at) }"
    )
    page.click("#png")
    page.wait("taken === 'coulomb.png'")
    assert page.run("blob.slice(1, 4).text()") == "PNG"
    assert page.run("blob.size") > 20000
    drawn = page.run("drawn.join(' ')")
    assert all(line.removeprefix("# ") in drawn for line in settings)
    page.open(anew=True)  # with the methods of the browser


def test_a_printout_is_white_and_complete(page):
    """Except the cursor, whose canvas would cover the curves in a PDF file."""
    page.browser.dark()
    page.open(".model=stickslip")
    page.run(
        "addEventListener('beforeprint', () => { globalThis.seen = [...document.querySelectorAll('.plot')].map(plot =>"
        "getComputedStyle(plot).getPropertyValue('--a').trim()) })"
    )
    assert page.browser.pdf().startswith(b"%PDF")
    assert set(page.run("seen")) == {"#1c2126"}
    page.browser.call("Emulation.setEmulatedMedia", media="print")
    shown = "[...document.querySelectorAll('.plot canvas')].map(canvas => getComputedStyle(canvas).display)"
    assert page.run(shown) == ["block" if i % 2 == 0 else "none" for i in range(page.run(f"{shown}.length"))]
    page.browser.call("Emulation.setEmulatedMedia", media="")
    page.browser.dark(False)


@pytest.mark.parametrize(("paper", "width"), [("A5", 483), ("A4", 718), ("Letter", 740)])  # without margins
def test_a_printout_of_any_size_holds_all_diagrams_and_settings(page, paper, width):
    page.browser.size(360)
    page.open(".model=coulomb&.compare=pacejka")
    page.run("dispatchEvent(new Event('beforeprint'))")
    page.browser.size(width)
    page.browser.call("Emulation.setEmulatedMedia", media="print")
    boxes = page.run(
        "[...document.querySelectorAll('figure')].filter(figure => !figure.hidden).map(figure => {"
        "const { left, right, height } = figure.getBoundingClientRect(); return [left, right, height] })"
    )
    text = page.run("document.body.innerText")
    page.browser.call("Emulation.setEmulatedMedia", media="")
    page.run("dispatchEvent(new Event('afterprint'))")
    page.browser.size(1280)
    assert len(boxes) == page.run("[...app.plots.values()].filter(({ figure }) => !figure.hidden).length")
    for left, right, height in boxes:
        assert 0 <= left < right <= width
        assert height > 60
    for part in ("k = 157.9 N/m", "solver.method = exact", "Second run, pacejka"):
        assert part in text
