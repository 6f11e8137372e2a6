"""What the tests of bench/tables share: its modules within reach, the stand-in for icbench, and runs in folders."""
from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).resolve().parent.parent
FAKE = ROOT / "tests" / "tables_fake_icbench.py"
sys.path.insert(0, str(ROOT / "bench" / "tables_lib"))

import main  # noqa: E402
import options  # noqa: E402

SMALL = ("--quick", "--size", "4x3", "--threads", "1,2", "--accuracy", "0.2", "--icbench", str(FAKE))
# What --quick is in the tests.
SCALE = options.Scale((4, 3), frames=3, rounds=3, reference_spp=8, vpl_counts=(64, 128, 256, 512),
                      vpl_seeds=1, super_spp=4, converged_vpls=1024, converged_frames=2, few_vpls=(32, ),
                      neighbour_vpls=False, accuracies=(0.4, 0.2), cell_paths=16, curve_paths=(1, 4, 16, 64),
                      mechanism_frames=2, animated_stills=False, preview_side=16)
PATIENCE = 120  # seconds; turns a hang into a failure


class Case(unittest.TestCase):
    """A test in a folder of its own."""
    def setUp(self):
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory(prefix="icbench-tables-test-")))
        self.out = self.folder / "out"

    def start(self, *arguments, **environment):
        """Runs bench/tables after its set-up, in a child of this process; `status` is negative where a signal
        ended it.
        """
        said = self.folder / "said"
        with open(said, "wb") as file:
            child = os.fork()
            if child == 0:
                os.dup2(file.fileno(), sys.stderr.fileno())
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
                os.environ.update(environment)
                signal.alarm(PATIENCE)
                status = 99
                with mock.patch.dict(options.kScales, quick=SCALE), \
                        mock.patch("sys.argv", ["main.py", *SMALL, "--out", str(self.out), *arguments]):
                    try:
                        status = main.main()
                    finally:
                        os._exit(status)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        return subprocess.CompletedProcess(arguments, status, stderr=said.read_text())

    def finished(self):
        """Identity of every finished job, and when it was finished."""
        records = [*(self.out / "jobs").glob("*/*/job.json"), *(self.out / "references").glob("*/*/job.json")]
        return {json.loads(r.read_text())["identity"]: r.stat().st_mtime_ns for r in records}

    def tables(self):
        return json.loads((self.out / "tables.json").read_text())

    def numbers(self):
        """All that was measured, without what tells two runs apart."""
        return {key: self.tables()[key] for key in ("scenes", "targets", "claims", "failures", "settings")}
