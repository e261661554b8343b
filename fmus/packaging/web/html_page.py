"""The file: models, style and script put together, and a policy that lets the page load nothing."""

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

FILE = "index.html"
HERE = Path(__file__).parent
MODULES = (
    *(
        "libc",
        "wasm",
        "fmu",
        "run",
        "state",
        "overrides",
        "measure",
        "session",
        "plot",
        "mechanism",
        "drag",
        "controls",
    ),
    *("panels", "diagrams", "form", "tables", "export", "main"),
)


def build(
    sources: Sequence[ModelFile],
    folder: Path,
    methods: Sequence[str] = (),
    laws: Sequence[str] = (),
    scenes: Iterable[Path] = (),
) -> Path:
    """Write the page of these models, with the published cases among the scenes, into `folder`.

    Methods and friction laws may be chosen, as for an FMU.
    """
    with ThreadPoolExecutor() as pool:
        models = list(pool.map(lambda source: model_with_code(source, methods, laws), sources))
    data = {
        "version": __version__,
        "models": models,
        "presets": read_presets(scenes, [source.name for source in sources]),
    }
    return write(folder / FILE, render_page(data).encode())


def model_with_code(source: ModelFile, methods: Sequence[str], laws: Sequence[str]) -> ModelJson:
    """All that the page needs of a model."""
    model = lowered_model(source, select_features(source, methods, laws))
    files, description = generate_c_sources(model, source.name, build_date(), "2")
    told = build_model_json(source, model)
    return told | {"guid": fromstring(description).attrib["guid"], "code": compile_to_base64(source.name, files)}


def render_page(data: object) -> str:
    """The HTML text around the data."""
    style = (HERE / "style.css").read_text(encoding="utf-8")
    code = bundle_script()
    policy = (
        f"default-src 'none'; script-src {csp_hash(code)} 'wasm-unsafe-eval'; style-src {csp_hash(style)}; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    frame = Template((HERE / "page.html").read_text(encoding="utf-8"))
    return frame.substitute(policy=policy, style=style, script=code, data=text)


def bundle_script() -> str:
    """The modules in one: what they import from each other stands before it."""
    texts = ((HERE / "script" / f"{name}.js").read_text(encoding="utf-8") for name in MODULES)
    lines = (line.removeprefix("export ") for text in texts for line in text.splitlines())
    return "\n".join(line for line in lines if not line.startswith("import "))


def csp_hash(text: str) -> str:
    """A text, as a policy names it."""
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"
