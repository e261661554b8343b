"""Builds the HTML file from models, style and script; its content security policy blocks all requests."""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from gzip import compress
from hashlib import sha256
from pathlib import Path
from string import Template
from xml.etree.ElementTree import fromstring

from ..compiler import __version__
from ..compiler.equations.model_file import ModelFile
from ..compiler.lowering import lowered_model, select_features
from ..packaging.archive import build_date, write
from ..packaging.native.binaries import CompilerPool, compile_and_link
from ..packaging.native.native_fmu import MAIN_SOURCE, generate_c_sources
from .model_json import ModelJson, build_model_json

FILE, MORE_FILE = "index.html", "more.html"  # pages of the shipped models and of those in fmus/more
PAGE_FOLDER = Path(__file__).parent
MODULES = (
    *("numbers", "libc", "fmu", "state", "run", "library", "run_set", "measure", "plot", "panels", "controls"),
    *("diagrams", "tables", "export", "mechanism", "drag", "scene", "explore"),
    *("story", "stories", "main"),
)
CLAIM = "Real things stop. sign(v) never does."
STORY_MODELS = ("coulomb", "stickslip", "pacejka", "pendulum")


def build(
    sources: Sequence[ModelFile],
    folder: Path,
    methods: Sequence[str] = (),
    laws: Sequence[str] = (),
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
    file
        Name of the page.
    """
    models, futures = [], []
    with CompilerPool() as pool:  # for the compiler only: ast.parse may fail in threads of Python 3.11
        for source in sources:
            model, files = model_with_sources(source, methods, laws)
            models.append(model)
            futures.append(pool.submit(compile_to_base64, source.name, files))
    data = {
        "version": __version__,
        "models": [model | {"code": code.result()} for model, code in zip(models, futures, strict=True)],
    }
    is_complete = not methods and not laws and {source.name for source in sources}.issuperset(STORY_MODELS)
    return write(folder / file, render_page(data, with_stories=is_complete).encode())


def model_with_sources(
    source: ModelFile, methods: Sequence[str], laws: Sequence[str]
) -> tuple[ModelJson, Mapping[str, str]]:
    """Return a model for the page, and its C sources by file name."""
    model = lowered_model(source, select_features(source, methods, laws))
    files, description = generate_c_sources(model, source.name, build_date(), "2")
    return build_model_json(source, model) | {"guid": fromstring(description).attrib["guid"]}, files


def render_page(data: object, with_stories: bool) -> str:
    """Return the HTML text of the page, with the opening and the stories, which need STORY_MODELS, or without."""
    style, stories = ((PAGE_FOLDER / name).read_text(encoding="utf-8") for name in ("style.css", "stories.html"))
    title = CLAIM if with_stories else "Dry friction, live"
    heading = "<h2>Explore</h2>" if with_stories else f"<h1>{title}</h1>"
    code = bundle_script()
    policy = (
        f"default-src 'none'; script-src {csp_hash(code)} 'wasm-unsafe-eval'; style-src {csp_hash(style)}; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    template = Template((PAGE_FOLDER / "page.html").read_text(encoding="utf-8"))
    stories = Template(stories).substitute(title=title) if with_stories else ""
    parts = {"title": title, "heading": heading, "stories": stories}
    return template.substitute(policy=policy, style=style, script=code, data=text, **parts)


def bundle_script() -> str:
    """Concatenate the JavaScript modules, without their imports and exports."""
    texts = ((PAGE_FOLDER / "script" / f"{name}.js").read_text(encoding="utf-8") for name in MODULES)
    lines = (line.removeprefix("export ") for text in texts for line in text.splitlines())
    return "\n".join(line for line in lines if not line.startswith("import "))


def csp_hash(text: str) -> str:
    """Return the hash of an inline script or style for the content security policy."""
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


TARGET = "wasm32-wasi"
EXPORTED_FUNCTIONS = (  # called by script/fmu.js
    *("fmi2Instantiate", "fmi2Reset", "fmi2SetupExperiment"),
    *("fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2DoStep"),
    *("fmi2GetReal", "fmi2GetInteger", "fmi2SetReal", "fmi2SetInteger"),
)
# Headers of a C library without the library itself, which the compiler would have to build first: script/libc.js
# implements the functions.
HEADERS = [f"-isystem{{compiler}}/lib/libc/include/{kind}-musl" for kind in ("wasm-wasi", "generic")]
LINK_OPTIONS = ("-Wl,--no-entry", "-Wl,--import-symbols", *(f"-Wl,--export={name}" for name in EXPORTED_FUNCTIONS))
OPTIONS = ("-nostdlib", *HEADERS, *LINK_OPTIONS, "-fvisibility=hidden")


def compile_to_base64(name: str, files: Mapping[str, str]) -> str:
    """Compile an FMU to WebAssembly; return it compressed and base64-encoded."""
    return b64encode(
        compress(compile_and_link(files, MAIN_SOURCE["2"], TARGET, f"{name}.wasm", OPTIONS), mtime=0)
    ).decode()
