#!/usr/bin/env python3
"""bench/targets keeps what it has measured, and what it refuses it refuses before it measures.

Environment: TARGETS, the program.
"""

import json
import os
import resource
import subprocess
import tempfile
import unittest
from pathlib import Path

TARGETS = os.environ["TARGETS"]
QUICK, LONG = "packed_memory_100000", "interleaved_over_tic_sibenik"  # a second; minutes


class Targets(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file = Path(folder.name) / "rows.json"
        self.unfinished = Path(folder.name) / "rows.json.unfinished"

    @staticmethod
    def run_rows(*options, seconds="1"):
        return subprocess.run([TARGETS, "--seconds", seconds, *options], text=True, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, check=False)

    def test_a_finished_run_leaves_one_complete_file(self):
        self.assertEqual(self.run_rows("--rows", QUICK, "--json", str(self.file)).returncode, 0)
        (row,) = json.loads(self.file.read_text(encoding="utf-8"))
        self.assertEqual((row["name"], row["verdict"]), (QUICK, "pass"))
        self.assertLessEqual(row["low"], row["median"])
        self.assertFalse(self.unfinished.exists())

    # Guards against: an hour of rows lost with the one during which the machine went down.
    def test_an_interrupted_run_keeps_its_rows_and_does_not_look_complete(self):
        command = [TARGETS, "--rows", f"{QUICK},{LONG}", "--json", str(self.file)]
        with subprocess.Popen(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as run:
            self.assertIn(QUICK, [next(run.stdout), next(run.stdout)][1])
            run.kill()
        self.assertFalse(self.file.exists())
        self.assertEqual([row["name"] for row in json.loads(self.unfinished.read_text(encoding="utf-8"))], [QUICK])

    def test_standard_output_takes_rows_too(self):
        done = self.run_rows("--rows", QUICK, "--json", "/dev/stdout")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual([row["name"] for row in json.loads(done.stdout)], [QUICK])
        self.assertIn(QUICK, done.stderr)

    # Guards against: rows that take several processing units end a run on one, and those behind them go unmeasured.
    def test_rows_that_one_processing_unit_cannot_have_are_skipped(self):
        unit = min(os.sched_getaffinity(0))
        rows = ["simulator_error_throughput", "wait_free_read_only_scaling", QUICK]
        done = subprocess.run([TARGETS, "--seconds", "1", "--rows", ",".join(rows), "--json", str(self.file)],
                              capture_output=True, text=True, check=False,
                              preexec_fn=lambda: os.sched_setaffinity(0, {unit}))
        self.assertEqual(done.returncode, 0, done.stderr)
        verdicts = [(row["name"], row["verdict"]) for row in json.loads(self.file.read_text(encoding="utf-8"))]
        self.assertEqual(verdicts, list(zip(rows, ("skipped", "skipped", "pass"))))

    @unittest.skipIf(os.environ.get("ICBENCH_SANITIZE"), "sanitizers need their terabytes of address space")
    def test_an_error_names_its_row(self):
        limit = 1_000_000_000
        done = subprocess.run([TARGETS, "--rows", "packed_memory_1000000"], capture_output=True, text=True, check=False,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))
        self.assertEqual(done.returncode, 2)
        self.assertIn("row packed_memory_1000000: ", done.stderr)

    def test_streams_that_cannot_be_written_end_in_its_own_status(self):
        with open("/dev/full", "w", encoding="utf-8") as full:
            self.assertEqual(subprocess.run([TARGETS, "--rows", "none"], stderr=full, check=False).returncode, 2)
            done = subprocess.run([TARGETS, "--list"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, "^targets: cannot write to .*\n$")

    def test_bad_usage_is_one_line(self):
        for options, hint in ((["--rows", "packed_memory_100"], f"did you mean '{QUICK}'"),
                              (["--rows", ""], "no row is named"),
                              (["--rows", f"{QUICK},{QUICK}"], f"--rows names {QUICK} twice"),
                              (["--rows", QUICK, "--json", "/nowhere/rows.json"], "there is no folder"),
                              (["--rows", QUICK, "--samples", "5"], "6 to 2000"),
                              (["--list", "--seed", "-1"], "--seed '-1' is not a whole number"),
                              (["--list", "--seed", "1e3"], "--seed '1e3' is not a whole number"),
                              (["--list", "--samples", "010x"], "--samples '010x' is not a whole number")):
            with self.subTest(options=options):
                self.refuses(self.run_rows(*options), hint)
        self.refuses(self.run_rows("--rows", QUICK, seconds="nan"), "not a number")

    def refuses(self, done, hint):
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        self.assertIn(hint, done.stderr)


if __name__ == "__main__":
    unittest.main()
