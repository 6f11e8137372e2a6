"""tables.json of bench/tables: loading, and what its figures and tables share."""
from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import style  # first: it checks what is installed

from matplotlib.lines import Line2D

from results import InputError, read_json

kSchema = 2
kFiles = "tables.json of bench/tables"
kTimed = ("rt", "igi", "interleaved", "ic", "tic", "cells")
kMechanisms = {"lck": "global_mutex", "lw": "local_write", "wf": "wait_free"}
kColours = {
    "rt": style.kGrey, "igi": style.kVermilion, "interleaved": style.kOrange, "ic": style.kGreen,
    "tic": style.kBlue, "cells": style.kSky, "path": style.kBlack
}
kMarkers = {"rt": "x", "igi": "s", "interleaved": "D", "ic": "^", "tic": "o", "cells": "h", "path": "p"}


@dataclass
class Measured:
    """One tables.json."""
    label: str
    slug: str
    path: Path
    data: dict

    @property
    def scenes(self) -> dict[str, dict]:
        return self.data["scenes"]

    @property
    def animations(self) -> dict[str, dict]:
        return {name: s for name, s in self.scenes.items() if s["time"]}

    def title(self, method: str) -> str:
        return self.data["methods"].get(method, method)


def load(paths) -> list[Measured]:
    """Raises InputError for a file that is none of bench/tables."""
    made = []
    for path in map(Path, paths):
        data = read_json(path, "bench/tables", kFiles)
        if not isinstance(data, dict) or not isinstance(data.get("scenes"), dict) or "claims" not in data:
            raise InputError(f"{path}: no \"scenes\" and \"claims\"; {kFiles} is expected")
        if data.get("schema") != kSchema:
            raise InputError(
                f"{path}: schema {data.get('schema')}, and {kSchema} is expected; run bench/tables --resume")
        made.append(Measured(path.stem, f"{path.stem}-{len(made)}", path, data))
    return made


def method_line(measured: Measured, method: str, layout: style.Layout) -> dict:
    """Options for plot that draw a method."""
    return dict(color=kColours[method], marker=kMarkers[method], markersize=layout.marker,
                linewidth=layout.line, label=measured.title(method))


def method_handles(measured: Measured, methods, layout: style.Layout) -> list:
    return [Line2D([], [], **method_line(measured, method, layout)) for method in methods]
