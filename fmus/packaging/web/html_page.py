"""Builds the HTML file from models, style and script, with a content security policy that blocks all requests."""

import json
from base64 import b64encode
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path
from string import Template
from xml.etree.ElementTree import fromstring

from .. import __version__
from ..archive import build_date, write
from ..equations.model_file import ModelFile
from ..lowering import lowered_model, select_features
from ..native.fmu import generate_c_sources
from .model_json import ModelJson, build_model_json
from .presets import read_presets
from .wasm import compile_to_base64

FILE, MORE_FILE = "index.html", "more.html"  # pages of the shipped models and of those in fmus/more
HERE = Path(__file__).parent
MODULES = (
    *(
        "libc",
        "wasm",
        "fmu",
        "run",
        "state",
        "overrides",
        "setting_lines",
        "measure",
        "holding_band",
        "energy_budget",
        "session",
        "plot",
        "mechanism",
        "drag",
        "controls",
    ),
    *("measurement", "legend", "panels", "diagrams", "form", "tables", "export", "sound", "friction_map"),
    *("animation", "prose", "chart", "adjustable", "story_models", "story_bodies", "opening", "chatter_story", "story"),
    *("stories", "main"),
)
CLAIM = "Real things stop. Most solvers can\N{RIGHT SINGLE QUOTATION MARK}t."
STORY_MODELS = ("coulomb", "stickslip", "pacejka", "pendulum")


def build(
    sources: Sequence[ModelFile],
    folder: Path,
    methods: Sequence[str] = (),
    laws: Sequence[str] = (),
    scenes: Iterable[Path] = (),
    file: str = FILE,
) -> Path:
    """Build the live page of models and write it to `folder`.

    Parameters
    ----------
    sources
        The models.
    folder
        Output folder.
    methods, laws
        Labels of the methods and friction laws to include; none: all.
    scenes
        Scene files. Those with published values of one of the models become presets.
    file
        Name of the page.
    """
    with ThreadPoolExecutor() as pool:
        models = list(pool.map(lambda source: model_with_code(source, methods, laws), sources))
    data = {
        "version": __version__,
        "models": models,
        "presets": read_presets(scenes, [source.name for source in sources]),
    }
    is_complete = not methods and not laws and {source.name for source in sources}.issuperset(STORY_MODELS)
    return write(folder / file, render_page(data, with_stories=is_complete).encode())


def model_with_code(source: ModelFile, methods: Sequence[str], laws: Sequence[str]) -> ModelJson:
    """Return a model for the page, with its compiled code."""
    model = lowered_model(source, select_features(source, methods, laws))
    files, description = generate_c_sources(model, source.name, build_date(), "2")
    described = build_model_json(source, model)
    return described | {"guid": fromstring(description).attrib["guid"], "code": compile_to_base64(source.name, files)}


def render_page(data: object, with_stories: bool) -> str:
    """Return the HTML text of the page, with the opening and the stories, which need STORY_MODELS, or without."""
    style, stories, css = (
        (HERE / name).read_text(encoding="utf-8") for name in ("style.css", "stories.html", "stories.css")
    )
    style += css if with_stories else ""
    title = CLAIM if with_stories else "Dry friction, live"
    heading = "<h2>Explore</h2>" if with_stories else f"<h1>{title}</h1>"
    code = bundle_script()
    policy = (
        f"default-src 'none'; script-src {csp_hash(code)} 'wasm-unsafe-eval'; style-src {csp_hash(style)}; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    template = Template((HERE / "page.html").read_text(encoding="utf-8"))
    parts = {"title": title, "heading": heading, "stories": stories if with_stories else ""}
    return template.substitute(policy=policy, style=style, script=code, data=text, **parts)


def bundle_script() -> str:
    """Concatenate the JavaScript modules, without their imports and exports."""
    texts = ((HERE / "script" / f"{name}.js").read_text(encoding="utf-8") for name in MODULES)
    lines = (line.removeprefix("export ") for text in texts for line in text.splitlines())
    return "\n".join(line for line in lines if not line.startswith("import "))


def csp_hash(text: str) -> str:
    """Return the hash of an inline script or style for the content security policy."""
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"
