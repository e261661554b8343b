"""The interactive page of the project's models."""

import pytest
import web_page


@pytest.fixture(scope="session")
def page(browser):
    return web_page.Page(browser, web_page.build_page("web"))
