"""The page that runs: models as WebAssembly in one HTML file, which needs nothing but a browser.

    portrait.py      what the page knows of a model: its variables, and what moves, from its declaration
    presets.py       published cases, from the scenes
    wasm.py          the native sources, compiled for the browser
    page.py          the file: page.html, style.css and script/*.js, put together

The script is modules, in the order of MODULES in page.py, each importing only from those before it.
"""

from .html_page import build

__all__ = ["build"]
