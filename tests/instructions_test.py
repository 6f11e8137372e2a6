"""bench/instructions: what it counts, by anatomy as it was built here, and what it refuses."""

import json
import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

kRoot = Path(__file__).resolve().parent.parent
kPrograms = Path(os.environ.get("ICBENCH", kRoot / "build/release/bin/icbench")).parent
PATIENCE = 500  # seconds
kRecords = 2000


class Instructions(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="icbench-instructions-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.results = self.folder / "anatomy.json"

    def count(self, *arguments):
        return subprocess.run([kRoot / "bench/instructions", self.results, "--programs", kPrograms, *arguments],
                              capture_output=True, text=True, timeout=PATIENCE)

    def refused(self, says, *arguments):
        done = self.count(*arguments)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertRegex(done.stderr, r"\Abench/instructions: [^\n]+\n\Z")
        self.assertIn(says, done.stderr)

    @unittest.skipUnless(shutil.which("valgrind"), "no valgrind")
    def test_the_queries_of_every_structure_are_counted(self):
        subprocess.run([kPrograms / "anatomy", "--scene", "white_furnace", "--records", str(kRecords), "--repetitions", "2",
                        "--out", self.results], check=True, capture_output=True, timeout=PATIENCE)
        before = json.loads(self.results.read_text())
        done = self.count()
        if done.returncode == 2 and "--preset counted" in done.stderr:
            self.skipTest("built for more than valgrind knows")
        self.assertEqual(done.returncode, 0, done.stderr)
        after = json.loads(self.results.read_text())
        self.assertEqual(after["context"]["counted"]["last_level_bytes"], 2**22)
        told = {}
        for old, new in zip(before["benchmarks"], after["benchmarks"], strict=True):
            counted = {name: new.pop(name) for name in ("instructions", "lines_from_memory") if name in new}
            self.assertEqual(old, new)  # nothing that was measured is changed
            if counted:
                self.assertEqual(new["repetition_index"], 0)
                told[new["points"], new["part"]] = counted
        self.assertEqual(set(told), {(row["points"], row["part"]) for row in after["benchmarks"] if "part" in row})
        for (points, part), one in told.items():
            self.assertLess(20, one["instructions"], (points, part))
            self.assertLessEqual(0, one["lines_from_memory"])
        for points in ("random", "coherent"):
            # To know the valid records spares work, and so do vectors.
            of = {part: one["instructions"] for (where, part), one in told.items() if where == points}
            self.assertLess(of["told"], of["packed_wait_free"])
            self.assertLess(of["packed_wait_free"], of["packed_scalar"])
            # What other threads execute meanwhile is in none: it came to tens of thousands in the first.
            self.assertLess(of["packed_scalar"], of["wait_free"])
            self.assertLess(of["wait_free"], 20_000)

    def test_a_scene_that_is_refused_leaves_results_as_they_were(self):
        self.results.write_text("kept")
        done = subprocess.run([kPrograms / "anatomy", "--scene", "nosuch", "--out", self.results], capture_output=True,
                              text=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertRegex(done.stderr, r"\Aanatomy: unknown scene 'nosuch'; [^\n]+\n\Z")
        self.assertEqual([(path.name, path.read_text()) for path in self.folder.iterdir()], [("anatomy.json", "kept")])

    def test_a_scene_is_not_overwritten_by_results(self):
        scene = self.folder / "room.rad"
        scene.write_text("void plastic wall\n0\n0\n5 .5 .5 .5 0 0\n")
        before = scene.read_text()
        done = subprocess.run([kPrograms / "anatomy", "--scene", scene, "--out", scene], capture_output=True, text=True,
                              timeout=PATIENCE)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertRegex(done.stderr, r"\Aanatomy: --out '[^\n]+' would overwrite what is read[^\n]+\n\Z")
        self.assertEqual(scene.read_text(), before)

    def test_numbers_of_anatomy_are_whole_and_in_range(self):
        for option, number in (("--seed", "-1"), ("--seed", "1e3"), ("--records", "1e4"), ("--records", "0x1000"),
                               ("--repetitions", "0")):
            done = subprocess.run([kPrograms / "anatomy", "--scene", "nosuch", option, number, "--out", self.results],
                                  capture_output=True, text=True, timeout=PATIENCE)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertRegex(done.stderr, rf"\Aanatomy: {option} '{number}' is not a whole number from [^\n]+\n\Z")

    def test_wrong_input_is_one_line(self):
        self.refused("no results of anatomy")
        self.results.write_text("{}")
        self.refused("no results of anatomy")
        whole = {"context": {"complete": True, "configuration": {"command": "anatomy", "scene": "desk", "records": 1,
                                                                   "seed": 1}}, "benchmarks": []}
        self.results.write_text(json.dumps(whole | {"context": whole["context"] | {"complete": False}}))
        self.refused("no whole results")
        for configuration in ({"command": "sweep"}, {"command": "anatomy", "records": 1, "seed": 1}):
            self.results.write_text(json.dumps(whole | {"context": {"complete": True, "configuration": configuration}}))
            self.refused("no whole results")
        self.results.write_text(json.dumps(whole))
        if shutil.which("valgrind"):
            self.refused("a power of two", "--last-level", "5000000")
            self.refused("no /nosuch/anatomy", "--programs", "/nosuch")
        else:
            self.refused("apt-get install valgrind")
        self.assertEqual(json.loads(self.results.read_text()), whole)


if __name__ == "__main__":
    unittest.main()
