"""What the tests of the icbench program share.

ICBENCH in the environment is the program's path, by default that of the release build; ICBENCH_SANITIZE is
not empty when it was built with sanitizers. Nothing depends on how fast the machine is: the time-out only
turns a hang into a failure.
"""

import json
import os
import struct
import subprocess
import tempfile
import unittest
import zlib
from pathlib import Path

ICBENCH = os.environ.get("ICBENCH", Path(__file__).parent.parent / "build/release/bin/icbench")
SANITIZED = bool(os.environ.get("ICBENCH_SANITIZE"))
PATIENCE = 120  # seconds
PRECIOUS = "not to be touched\n"
SCENE = "desk"  # of small pictures: it moves, has indirect light, and is built in no time


def key_of(row):
    return row["name"], row["repetition_index"]


def arguments_of(command, options, changes):
    merged = {**options, **changes}
    return [command, *(part for name, value in merged.items() for part in ("--" + name, str(value)))]


def with_effect(options):
    """Without those that the integrator has no use for, of which the program would warn."""
    integrator = options.get("integrator", "irradiance_cache")
    is_cached = "cach" in integrator
    has_effect = {"vpls": "instant" in integrator, "rays": integrator == "irradiance_cache", "cache": is_cached,
                  "accuracy": is_cached}
    return {name: value for name, value in options.items() if has_effect.get(name, True)}


def small_render(**changes):
    """Arguments of a picture that takes milliseconds; `out="a.png"` stands for --out a.png."""
    return arguments_of("render", {}, with_effect({"scene": SCENE, "size": "16x16", "spp": 1, "rays": 4, **changes}))


def small_sweep(**changes):
    """Arguments of a sweep of one trial."""
    return arguments_of("sweep", {"caches": "wait_free", "workloads": "insert_only:records=50", "threads": 1,
                                  "repetitions": 1}, changes)


def small_pareto(**changes):
    """Arguments of a comparison of two methods on a few pixels."""
    return arguments_of("pareto", {"scene": SCENE, "size": "24x24", "methods": "path,hash_cells", "grid": "coarse",
                                   "repetitions": 1, "reference-spp": 4}, changes)


def small_repeatability(**changes):
    """Arguments of a few small pictures by one cache."""
    return arguments_of("repeatability", {}, with_effect({"scene": SCENE, "caches": "wait_free", "threads": "1,3",
                                                           "size": "24x24", "rays": 4, "repetitions": 2,
                                                           "reference-spp": 4, **changes}))


def small_capture(**changes):
    """Arguments of a trace of a small picture."""
    return ["trace", *arguments_of("capture", {}, with_effect({"scene": SCENE, "size": "48x32", "rays": 4,
                                                                "threads": 1, **changes}))]


class Case(unittest.TestCase):
    """A test in a folder of its own."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="icbench-cli-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def run_icbench(self, *arguments, **options):
        return subprocess.run([ICBENCH, *map(str, arguments)], cwd=self.folder, text=True, timeout=PATIENCE,
                              **{"capture_output": True, **options})

    def succeed(self, *arguments):
        """Runs the program, which must succeed; returns its standard output."""
        done = self.run_icbench(*arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("no effect", done.stderr)
        return done.stdout

    def succeed_but_for(self, idle, *arguments):
        """Runs the program, which must succeed, and say in one line each that nothing but these has no effect."""
        done = self.run_icbench(*arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual([line for line in done.stderr.splitlines() if "effect" in line],
                         [f"icbench: {one}" for one in idle])

    def assert_refused(self, done, *parts):
        """Status 2 and one line on standard error that contains `parts`."""
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertRegex(done.stderr, r"\Aicbench: [^\n]+\n\Z")
        for part in parts:
            self.assertIn(part, done.stderr)

    def refuse(self, *arguments, says=()):
        """Runs the program, which must refuse and leave the folder as it is."""
        before = self.contents()
        done = self.run_icbench(*arguments)
        self.assert_refused(done, *says)
        self.assertEqual(done.stdout, "")
        self.assertEqual(self.contents(), before)

    def contents(self):
        return {path.name: os.readlink(path) if path.is_symlink()
                else path.read_bytes() if path.is_file() else None
                for path in self.folder.iterdir()}

    def load(self, name):
        return json.loads((self.folder / name).read_text())


def write_white_png(path, width, height):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = (b"\0" + b"\xff" * (3 * width)) * height
    path.write_bytes(b"\x89PNG\r\n\x1a\n" +
                     chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
                     + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
