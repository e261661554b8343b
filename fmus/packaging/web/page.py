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
from ..native.fmu import frozen
from .portrait import Portrait, portrait
from .presets import presets
from .wasm import packed

FILE = "index.html"
HERE = Path(__file__).parent
MODULES = (
    *("libc", "wasm", "fmu", "run", "state", "edit", "measure", "desk", "plot", "mechanism", "hand", "controls"),
    *("panels", "diagrams", "form", "tables", "take", "main"),
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
        models = list(pool.map(lambda source: with_code(source, methods, laws), sources))
    data = {"version": __version__, "models": models, "presets": presets(scenes, [source.name for source in sources])}
    return write(folder / FILE, page(data).encode())


def with_code(source: ModelFile, methods: Sequence[str], laws: Sequence[str]) -> Portrait:
    """All that the page needs of a model."""
    model = lowered_model(source, select_features(source, methods, laws))
    files, description = frozen(model, source.name, build_date(), "2")
    told = portrait(source, model)
    return told | {"guid": fromstring(description).attrib["guid"], "code": packed(source.name, files)}


def page(data: object) -> str:
    """The HTML text around the data."""
    style = (HERE / "style.css").read_text(encoding="utf-8")
    code = script()
    policy = (
        f"default-src 'none'; script-src {digest(code)} 'wasm-unsafe-eval'; style-src {digest(style)}; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    frame = Template((HERE / "page.html").read_text(encoding="utf-8"))
    return frame.substitute(policy=policy, style=style, script=code, data=text)


def script() -> str:
    """The modules in one: what they import from each other stands before it."""
    texts = ((HERE / "script" / f"{name}.js").read_text(encoding="utf-8") for name in MODULES)
    lines = (line.removeprefix("export ") for text in texts for line in text.splitlines())
    return "\n".join(line for line in lines if not line.startswith("import "))


def digest(text: str) -> str:
    """A text, as a policy names it."""
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"
