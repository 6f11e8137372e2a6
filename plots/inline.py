"""Pictures and drawings inside a page, so that it is one file."""
from __future__ import annotations

import base64
import re
from pathlib import Path

from tables import text

kPixelsPerPoint = 1.72  # a figure of full width fills the page on a laptop


def data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _small(path: Path) -> bytes:
    """The drawing made small: no document type or metadata (they name addresses elsewhere), no needless
    digits, and each style spelled out once.
    """
    drawing = path.read_text(encoding="utf-8")
    drawing = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", drawing[drawing.index("<svg"):], flags=re.S)
    drawing = re.sub(r'<g id="[A-Za-z0-9]+_\d+">', "<g>", drawing)
    drawing = re.sub(r"(scale\([^)]*\))|(\d\.\d\d)\d+", lambda m: m[1] or m[2], drawing)
    names: dict[str, str] = {}
    drawing = re.sub(r'(?<= )style="([^"]*)"',
                     lambda m: f'class="{names.setdefault(m[1], f"s{len(names)}")}"', drawing)
    sheet = "".join(f".{name}{{{rule}}}" for rule, name in names.items())
    drawing = drawing.replace("<defs>", f"<style>{sheet}</style><defs>", 1)
    return re.sub(r"\s+", " ", drawing).replace("> <", "><").encode()


def image(uri: str, about: str, width: float = 0, height: float = 0) -> str:
    """A picture that is decoded when it comes into view (a page of many opens at once), with room kept for it where its
    size in pixels is given.
    """
    room = f' width="{width:.0f}" height="{height:.0f}"' if width and height else ""
    return f'<img loading="lazy" decoding="async"{room} src="{uri}" alt="{text(about)}">'


def drawing(path: Path, title: str) -> str:
    """An SVG file as a figure of the page."""
    data = _small(path)
    width, height = (float(re.search(rb'%s="([0-9.]+)pt"' % side, data)[1]) * kPixelsPerPoint
                     for side in (b"width", b"height"))
    return f'<figure>{image(data_uri("image/svg+xml", data), title, width, height)}</figure>'
