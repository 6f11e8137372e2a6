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
    """The files, each once, under names of their own. Raises InputError for one that is no timeline."""
    once: dict[Path, Path] = {}
    for path in map(Path, paths):
        once.setdefault(path.resolve(), path)
    made = [_read(path) for path in once.values()]
    for number, one in enumerate(made):
        earlier = sum(other.slug == one.slug for other in made[:number])
        one.slug += f"-{earlier + 1}" if earlier else ""
    return made
