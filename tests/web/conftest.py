"""One browser for all tests of the page, and the page of the project's models."""

import pytest
import web_page
from browser import CHROMIUM, Browser


@pytest.fixture(scope="session")
def browser():
    if CHROMIUM is None:
        pytest.skip("there is no chromium here")
    browser = Browser()
    yield browser
    browser.close()


@pytest.fixture(scope="session")
def page(browser):
    return web_page.Page(browser, web_page.built("web"))
