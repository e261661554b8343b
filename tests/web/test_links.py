"""Links to the live page, and the page inside another one."""

from html import escape
from urllib.parse import parse_qsl, urlencode

import web_page
from models import parameters


def test_a_link_stores_the_complete_setup(page):
    page.open(".model=stickslip")
    page.type_number("mu_d", "0.45")
    page.choose("comparison", "pacejka")
    page.seek(5.0)
    page.check("live", True)
    page.type_number("v_driver", "0.05")
    page.wait("location.hash.includes('.change=')")  # the link always has all values, the change only in the end
    hash, state = page.run("location.hash.slice(1)"), page.run("app.state()")
    end = page.run("app.runs.list.map(run => run.columns.x.at(-1))")
    page.open(hash, anew=True)
    assert page.run("app.state()") == state
    assert page.run("app.runs.list.map(run => run.columns.x.at(-1))") == end
    wrong = "mu_d=0.3&solver.method=7&friction=1.5&c=&.stop=&.change=1 nothing 2&.change=x k 2"
    page.open(f".model=coulomb&k=100&{wrong}")
    assert page.run("app.state()") | {"values": {"k": 100}, "changes": [], "stop": 4.3} == page.run("app.state()")
    result = "document.getElementById('status').textContent"
    page.wait(f"{result}.includes('unknown settings: mu_d, solver.method, friction, c, 1 nothing 2, x k 2. coulomb')")
    page.open(".model=nobody")
    page.wait(f"{result}.includes('unknown settings: nobody. coulomb')")
    page.run("Object.defineProperty(navigator, 'clipboard', { value: undefined })")
    page.click("#link")
    page.wait(f"{result}.includes('The link is in the address bar')")
    assert "works on this computer only" in page.run(result)  # a local file


def test_a_link_shows_the_same_when_defaults_have_changed_and_names_another_version(page):
    page.open(".model=coulomb&f=0.25&.compare=pacejka")
    page.wait("location.hash.includes('.version')")
    link = dict(parse_qsl(page.run("location.hash.slice(1)")))
    assert link[".version"] == page.run("app.library.version")
    assert {*parameters("coulomb"), "F_ext", ".stop"} <= {*link}
    assert {f".compare.{name}" for name in parameters("pacejka")} <= {*link}
    page.run("for (const v of app.library.models.get('coulomb').variables) if (v.name === 'k') v.start = 1")
    page.open(urlencode(link | {".version": "0.0.1"}))
    assert page.run("app.runs.main.setting.values.k") == 157.9
    page.wait("document.getElementById('status').textContent.includes('was made with version 0.0.1')")
    page.open(anew=True)


def test_a_link_opened_while_the_address_is_written_is_not_lost(page):
    page.open(".model=smd")
    page.wait("location.hash.includes('stop')")
    page.run(
        "(address => { location.hash = '.model=coulomb'; history.replaceState(null, '', address) })(location.href)"
    )
    page.wait("app.state().model === 'coulomb'")


def test_an_embedded_page_runs_without_an_address(page, tmp_path):
    outer = tmp_path / "outer.html"
    outer.write_text(f'<iframe srcdoc="{escape(page.file.read_text(encoding="utf-8"))}"></iframe>', encoding="utf-8")
    page.browser.open(outer.as_uri())
    page.wait("frames[0].app?.runs.done && frames[0].document.querySelector('#status').textContent")
    assert page.run("[frames[0].location.hash, frames[0].document.getElementById('link').hidden]") == ["", True]
    page.run("frames[0].document.querySelector('#to-explore').click()")  # its links lead to parts of itself
    page.run(web_page.NEXT_PICTURE)
    assert page.run("frames[0].app.state().model") == "coulomb"
    assert page.run("frames[0].location.href") == "about:srcdoc"
