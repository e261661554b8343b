"""Files in the page: small figures as data URLs, within the size that the page may have."""

import re
from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

MAX_PAGE_BYTES = 950_000  # of the page, so that it loads at once and fits into a mail
MAX_DATA_BYTES = 30_000  # larger data files are named, not embedded
SAFE = " !$'()*+,/:;=?@[]<>{}|^`"  # characters that a data URL in double quotes keeps
# what a figure can lose without a visible change
METADATA = re.compile(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|(?<=<g) id=\"[^\"]*\"", re.S)
FALLBACK_FONTS = re.compile(r"(?<='DejaVu Sans', )'[^\"]*(?=sans-serif)")
BLANKS = re.compile(r"\s+")
BETWEEN_TAGS = re.compile(r"(?<=>) +(?=<)")
PLACE = re.compile(r' (x|y)="(-?\d+\.\d)\d*"')
PATH = re.compile(r' d="([^"]*)"')
LINES = re.compile(r"([ML]) (\S+) (\S+) ?|z ?")  # the commands of a path of straight lines
GENERATED_ID = re.compile(r"(?<=[\"#])[mp][0-9a-f]{10}\b")
MARKERS = re.compile(r'(?:<use href="#\w+"[^>]*(?P<style> style="[^"]*")/>)(?:<use [^>]*(?P=style)/>)+')
TEXT = re.compile(r"(?<=>)[^<]+")


def compact(svg: str) -> str:
    """Return a figure without metadata and unnecessary blanks, with coordinates in tenths of a point."""
    text = BLANKS.sub(" ", FALLBACK_FONTS.sub("", METADATA.sub("", svg)))
    text = PLACE.sub(r' \1="\2"', BETWEEN_TAGS.sub("", text)).strip()
    text = PATH.sub(lambda path: f' d="{shorten_path(path[1])}"', text).replace("xlink:href", "href")
    ids: dict[str, str] = {}
    text = GENERATED_ID.sub(lambda name: ids.setdefault(name[0], f"i{len(ids)}"), text)
    return MARKERS.sub(lambda uses: f"<g{uses['style']}>{uses[0].replace(uses['style'], '')}</g>", text)


def shorten_path(path: str) -> str:
    """Return a path of straight lines with relative coordinates, in tenths of its unit and without repeated points."""
    if LINES.sub("", path):
        return path
    parts, here = [], (0, 0)
    for command in LINES.finditer(path):
        if command[1] is None:
            parts.append("z")
            continue
        point = round(10 * float(command[2])), round(10 * float(command[3]))
        dx, dy = point[0] - here[0], point[1] - here[1]
        if command[1] == "M":
            parts.append(f"M{point[0] / 10:g} {point[1] / 10:g}")
        elif dx or dy:
            parts.append(f"l{dx / 10:g} {dy / 10:g}")
        here = point
    return "".join(parts)


def encode_figure(svg: str) -> str:
    """Return a figure as a data URL. Its quotes are single ones, which the attribute of a page need not escape."""
    text = compact(svg).replace("'", "&#39;")
    text = TEXT.sub(lambda content: content[0].replace('"', "&quot;"), text).replace('"', "'")
    return f"data:image/svg+xml,{quote(text, safe=SAFE)}"


def encode_data(file: Path) -> str:
    """Return a data file as a data URL; empty if it is large or cannot be read."""
    try:
        if file.stat().st_size > MAX_DATA_BYTES:
            return ""
        return f"data:text/csv;base64,{b64encode(file.read_bytes()).decode()}"
    except OSError:
        return ""


@dataclass
class Budget:
    """Bytes that the page can still take."""

    free: int

    def take(self, content: str, escape: Callable[[str], str] = str) -> str:
        """Return a content if its escaped text fits, and an empty text otherwise."""
        size = len(escape(content).encode())
        if size > self.free:
            return ""
        self.free -= size
        return content
