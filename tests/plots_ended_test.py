#!/usr/bin/python3
"""Tests of a report that is ended while it draws."""
from __future__ import annotations

import contextlib
import io
import os
import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path
from unittest import mock

from plots_support import InFolder, kPlots

import report
from figure import Figure


class Named(InFolder):
    def test_a_file_whose_name_is_no_text_has_a_page(self):
        small = self.small()
        odd = Path(os.fsdecode(os.fsencode(self.folder) + b"/r\xff.json"))
        small.rename(odd)
        self.good("report.py", odd, "--out", self.folder / "out")
        self.assertIn("r?.json", (self.folder / "out/report.html").read_text(encoding="utf-8"))


class EndedEarly(InFolder):
    def test_an_interrupt_while_libraries_are_imported_is_one_line_and_status_130(self):
        (self.folder / "pandas.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
        for script in ("report.py", "throughput.py"):
            done = subprocess.run([sys.executable, "-B", kPlots / script, self.folder / "results.json"], text=True,
                                  stderr=subprocess.PIPE, check=False,
                                  env={**os.environ, "PYTHONPATH": str(self.folder)},
                                  preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
            self.assertEqual((done.returncode, done.stderr), (130, f"{script}: interrupted\n"))


class Ended(InFolder):
    """A report that is ended while several processes draw."""
    def setUp(self):
        super().setUp()
        self.addCleanup(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT))
        for patch in (mock.patch.object(report, "kForkPays", 0), mock.patch("os.sched_getaffinity", lambda _: {0, 1}),
                      mock.patch.object(sys, "argv", ["report.py", str(self.folder / "results.json")])):
            self.enterContext(patch)

    def drawing(self, build):
        """The report as if all it did was to draw four figures with this `build`."""
        figures = [Figure(f"figure_{number}", "", "", build) for number in range(4)]
        return mock.patch.object(report, "build", lambda *_, **__: list(report._outcomes(figures, None, self.folder)))

    def sleep(self, _):
        (self.folder / f"{os.getpid()}.pid").touch()
        time.sleep(120)

    def wait_until(self, condition):
        end = time.monotonic() + 60
        while not condition():
            self.assertLess(time.monotonic(), end, "nothing happens")
            time.sleep(0.02)

    def end(self, send) -> tuple[int, str]:
        """Exit status of a report and what it said when `send` ended it; then nothing of it may go on."""
        errors = self.folder / "errors"
        child = os.fork()
        if child == 0:
            status = 1
            try:
                os.setpgid(0, 0)
                signal.signal(signal.SIGINT, signal.default_int_handler)
                with errors.open("wb") as file, self.drawing(self.sleep):
                    os.dup2(file.fileno(), 2)
                    sys.stderr = open(2, "w", closefd=False)
                    status = report.main()
            finally:
                os._exit(status)
        self.wait_until(lambda: len(list(self.folder.glob("*.pid"))) == 2)
        workers = [int(file.stem) for file in self.folder.glob("*.pid")]
        for pid in workers:
            self.addCleanup(self.kill, pid)
        send(child)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        self.wait_until(lambda: not any(map(self.is_running, workers)))
        return status, errors.read_text()

    @staticmethod
    def is_running(pid: int) -> bool:
        try:
            return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
        except OSError:
            return False

    def kill(self, pid: int):
        if self.is_running(pid):
            os.kill(pid, signal.SIGKILL)

    def test_nothing_goes_on_when_it_is_killed(self):
        for number in (signal.SIGTERM, signal.SIGKILL):
            self.assertEqual(self.end(lambda child, n=number: os.kill(child, n)), (-number, ""))
            for file in self.folder.glob("*.pid"):
                file.unlink()

    def test_an_interrupt_is_one_line_and_status_130(self):
        self.assertEqual(self.end(lambda child: os.killpg(child, signal.SIGINT)), (130, "report.py: interrupted\n"))

    def test_a_process_that_outlived_the_report_before_it_could_know_ends(self):
        child = os.fork()
        if child == 0:
            report._end_with(os.getpid())  # which is not the parent's
            os._exit(0)
        self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), 1)

    def test_a_killed_process_that_draws_is_one_line_and_status_2(self):
        with self.drawing(lambda _: os.kill(os.getpid(), signal.SIGKILL)), \
                contextlib.redirect_stderr(io.StringIO()) as said:
            self.assertEqual(report.main(), 2)
        self.assertRegex(said.getvalue(), r"^report\.py: a process that draws was killed[^\n]+\n$")


if __name__ == "__main__":
    unittest.main()
