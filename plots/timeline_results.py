"""Timelines of icbench sweep --timeline: reading the Trace Event format."""
from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import style  # first: it checks what is installed

import pandas as pd

from results import InputError, _slug, read_json

kFiles = "a timeline of icbench sweep --timeline"


@dataclass
class Timeline:
    """One trial."""
    label: str
    slug: str
    path: Path
    about: dict
    names: dict[int, str]  # of rows
    events: pd.DataFrame   # name, category, row, begin, length, off: microseconds


def _read(path: Path) -> Timeline:
    data = read_json(path, "icbench sweep --timeline FILE", kFiles)
    listed = data.get("traceEvents") if isinstance(data, dict) else None
    if not isinstance(listed, list):
        raise InputError(f"{path}: no \"traceEvents\" list; {kFiles} is expected")
    names, label, events = {}, path.stem, []
    for event in listed:
        if not isinstance(event, dict):
            continue
        if event.get("ph") == "M" and isinstance(event.get("args"), dict):
            if event.get("name") == "thread_name":
                names[event.get("tid")] = str(event["args"].get("name"))
            if event.get("name") == "process_name":
                label = str(event["args"].get("name"))
        if event.get("ph") != "X":
            continue
        try:
            off = event["args"]["off_processor_us"] if "args" in event else 0.0
            events.append((str(event["name"]), str(event.get("cat", "")), int(event["tid"]), float(event["ts"]),
                           float(event["dur"]), float(off)))
        except (KeyError, TypeError, ValueError):
            raise InputError(f"{path}: a complete event without name, tid, ts or dur") from None
    if not events:
        raise InputError(f"{path}: no complete events (\"ph\": \"X\"); {kFiles} is expected")
    frame = pd.DataFrame(events, columns=["name", "category", "row", "begin", "length", "off"])
    about = data.get("otherData")
    return Timeline(label, _slug(f"timeline {path.stem}"), path, about if isinstance(about, dict) else {}, names, frame)


def load(paths) -> list[Timeline]:
    """Raises InputError for a file that is no timeline."""
    return [_read(Path(path)) for path in paths]
