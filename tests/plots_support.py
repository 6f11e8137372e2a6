"""What the tests of the plots share: folders, and the programs as a user starts them."""
from __future__ import annotations

import contextlib
import csv
import json
import os
import resource
import runpy
import subprocess
import sys
import tempfile
import traceback
import unittest
from html.parser import HTMLParser
from pathlib import Path

from plots_models import kFewWorkloads, kPlots, few_caches, model_results

import report  # noqa: F401  (for run(): whatever the scripts draw with)


def write_results(path: Path, results: dict) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(results), encoding="utf-8")
    return path


def run(script: str, *arguments) -> subprocess.CompletedProcess:
    """What plots/SCRIPT does and says with these arguments, in a process forked from this one: it has imported already
    what a program of its own would import for longer than it draws."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        sys.stdout.flush()
        sys.stderr.flush()
        child = os.fork()
        if child == 0:
            status = 1
            try:
                status = _as_program(kPlots / script, [str(a) for a in arguments], out, err)
            finally:
                os._exit(status)
        _, ended = os.waitpid(child, 0)
        said = []
        for stream in (out, err):
            stream.seek(0)
            said.append(stream.read().decode())
    return subprocess.CompletedProcess([script, *arguments], os.waitstatus_to_exitcode(ended), *said)


def _as_program(script: Path, arguments: list[str], out, err) -> int:
    """Runs the script as Python itself would, with its output to these two; returns the exit status."""
    os.dup2(out.fileno(), 1)
    os.dup2(err.fileno(), 2)
    sys.stdout, sys.stderr = (open(fd, "w", encoding="utf-8", closefd=False) for fd in (1, 2))
    sys.argv = [str(script), *arguments]
    try:
        runpy.run_path(str(script), run_name="__main__")
        status = 0
    except SystemExit as end:
        status = end.code
        if isinstance(status, str):
            print(status, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
        status = 1
    sys.stdout.flush()
    sys.stderr.flush()
    return status if isinstance(status, int) else int(status is not None)


def run_afresh(script: str, *arguments) -> subprocess.CompletedProcess:
    """The same in a new interpreter, as a user starts it."""
    return subprocess.run([sys.executable, str(kPlots / script), *map(str, arguments)], capture_output=True,
                          text=True, check=False)


@contextlib.contextmanager
def no_file_above(size: int):
    """Meanwhile writing more bytes to a file fails, as on a full disk: to this process and those it starts."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def read_csv(path: Path) -> list[dict]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


class References(HTMLParser):
    """Collects everything in a page that could load something."""

    def __init__(self, page: str):
        super().__init__()
        self.found: list[str] = []
        self.tags: set[str] = set()
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        self.found += [value or "" for key, value in attributes
                       if key in ("src", "href", "srcset", "data", "poster", "action", "background",
                                  "xlink:href")]


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def results(self, name="results.json", **options) -> Path:
        options = {"caches": few_caches(), "workloads": kFewWorkloads, "threads": (1, 2, 8, 32),
                   "errors": False} | options
        return write_results(self.folder / name, model_results(**options))

    def small(self, name="results.json", **options) -> Path:
        """The least that makes a report: drawing figures is what takes the time."""
        return self.results(name, **({"caches": few_caches()[:1], "workloads": ("read_only",), "threads": (1,),
                                      "repetitions": 1} | options))

    def good(self, script, *arguments) -> subprocess.CompletedProcess:
        done = run(script, *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr, "")
        return done
