"""Builds the live page: models as WebAssembly in one HTML file that needs nothing but a browser.

    model_json.py    a model for the page, in JSON: variables, and what to draw
    html_page.py     compiles the C sources for the browser, and combines page.html, style.css and script/*.js
    stories.html     the opening, and what each story has: on pages with the models that they need

The modules in script/ are concatenated in the order of MODULES in html_page.py; each imports only from earlier ones.
"""

from .html_page import FILE, MORE_FILE, build

__all__ = ["FILE", "MORE_FILE", "build"]
