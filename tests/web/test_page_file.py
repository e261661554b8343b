"""The file of the live page: its size, what it loads, and its script."""

import re

from commands import build

from fmus.page.html_page import MODULES, PAGE_FOLDER


def test_five_models_take_less_than_600_kb_and_load_nothing(page):
    text = page.file.read_text(encoding="utf-8")
    assert len(text.encode()) < 600_000
    assert "default-src 'none'" in text
    assert not re.findall(r"(?:src|href)\s*=\s*[\"'](?!data:|#)", text)
    page.open(anew=True)
    request = "fetch('data:text/plain,x').then(() => 'came', () => 'refused')"
    assert page.run(request) == "refused"
    assert page.browser.console.pop()  # reported by the content security policy
    assert len(page.browser.console) <= 1
    page.browser.console.clear()


def test_a_model_unsuitable_for_the_page_is_reported_in_one_sentence(tmp_path):
    for words, sentence in (
        (("--web", "--native"), "--web writes a page, not FMUs: remove --native, --real-only, --platform and --fmi 3."),
        (("--web", "nobody"), "There is no model 'nobody'"),
        (("--web", "smd", "--law", "sign"), "smd has no friction law 'sign'"),
    ):
        result = build(*words, "--out", str(tmp_path))
        assert result.returncode
        assert sentence in result.stderr
        assert "Traceback" not in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_every_module_imports_existing_names_from_earlier_modules_only():
    exports = {}
    assert {path.stem for path in (PAGE_FOLDER / "script").glob("*.js")} == set(MODULES)
    for name in MODULES:
        text = (PAGE_FOLDER / "script" / f"{name}.js").read_text(encoding="utf-8")
        for names, source in re.findall(r'^import \{ ([^}]+) \} from "\./(\w+)\.js";$', text, re.M):
            assert set(names.split(", ")) <= exports[source], (name, source)
            body = re.sub(r"^import .*$", "", text, flags=re.M)
            assert all(re.search(rf"\b{item}\b", body) for item in names.split(", ")), (name, names)
        exports[name] = set(re.findall(r"^export (?:async )?(?:function|class|const) (\w+)", text, re.M))


def test_only_one_model_is_compiled_before_the_first_picture(page):
    count = (
        "const { instantiate } = WebAssembly; globalThis.compiled = 0; globalThis.first = null;"
        "WebAssembly.instantiate = (...all) => (compiled++, instantiate(...all));"
        "new MutationObserver(changes => {"
        "if (changes.some(change => change.target === document.body && change.oldValue?.includes('starting'))"
        " && !document.body.classList.contains('starting')) first ??= compiled"
        "}).observe(document, { subtree: true, attributeFilter: ['class'], attributeOldValue: true })"
    )
    script = page.browser.call("Page.addScriptToEvaluateOnNewDocument", source=count)
    page.open(anew=True)
    page.browser.call("Page.removeScriptToEvaluateOnNewDocument", **script)
    page.wait("first !== null")
    assert page.run("first") == 1
    assert page.run(
        "document.querySelector('#panel-x canvas').getContext('2d').getImageData(0, 0, 300, 200).data.some(Boolean)"
    )


def test_without_scripts_the_page_shows_its_claim_and_a_text(page):
    page.browser.call("Emulation.setScriptExecutionDisabled", value=True)
    page.browser.open(page.file.as_uri())

    def is_shown(selector):
        node = page.browser.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        styles = page.browser.call("CSS.getComputedStyleForNode", nodeId=node)["computedStyle"]
        return {item["name"]: item["value"] for item in styles}["display"] != "none"

    page.browser.call("DOM.enable")
    page.browser.call("CSS.enable")
    root = page.browser.call("DOM.getDocument")["root"]["nodeId"]
    visibility = {
        selector: is_shown(selector) for selector in ("h1", "#no-script", "#lede", ".lane", "#explore", "main")
    }
    page.browser.call("CSS.disable")
    page.browser.call("DOM.disable")
    page.browser.call("Emulation.setScriptExecutionDisabled", value=False)
    page.open(anew=True)
    assert [selector for selector, value in visibility.items() if value] == ["h1", "#no-script"]
