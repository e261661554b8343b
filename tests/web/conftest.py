"""The interactive page of the project's models, in a browser that notes what the page logs and loads."""

import pytest
import web_page


@pytest.fixture(scope="module")
def page_in_browser(browser):
    return web_page.Page(browser, web_page.build_page())


@pytest.fixture
def quiet(browser):
    """The browser; the test fails if the page writes to the console or requests anything but itself."""
    browser.console.clear()
    yield browser
    browser.call("Emulation.setEmulatedMedia", media="", features=[])
    assert browser.console == []
    assert {
        address.split("#")[0] for address in browser.requested_urls if not address.startswith(("data:", "blob:"))
    } <= {address.split("#")[0] for address in browser.requested_urls[:1]}


@pytest.fixture
def page(page_in_browser, quiet):
    """The page of the shipped models, open in a browser that all tests share."""
    if not page_in_browser.run("Boolean(globalThis.app)"):  # no test of this module has opened it yet
        page_in_browser.open()
    return page_in_browser


@pytest.fixture
def still(page):
    """The page for a visitor who prefers reduced motion, complete: all results are there at once."""
    page.browser.size(1280)
    page.browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    page.open(anew=True)
    page.wait_until_drawn(".story")
    return page
