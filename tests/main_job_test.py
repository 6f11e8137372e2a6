#!/usr/bin/python3
"""Tests of bench/run, with stand-ins for the programs that measure."""
from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
import unittest
from pathlib import Path

from plots_models import (kFewWorkloads, kPlots, kRoot, model_anatomy, model_pareto, model_repeatability,
                          model_simulated, model_verdicts)
from plots_support import InFolder, write_results


class MainJob(InFolder):
    """bench/run around programs that hand out what was made before."""

    def setUp(self):
        super().setUp()
        self.root, self.out = self.folder / "root", self.folder / "results"
        (self.root / "bench").mkdir(parents=True)
        for name in ("run", "setup", "packages.txt"):
            shutil.copy(kRoot / "bench" / name, self.root / "bench" / name)
        (self.root / "plots").symlink_to(kPlots)
        self.program("../../../../tools/cmake", "")
        compared = write_results(self.folder / "compared.json", model_pareto())
        repeated = write_results(self.folder / "repeated.json", model_repeatability())
        imagined = write_results(self.folder / "imagined.json", model_simulated((1, 4), 0, workloads=kFewWorkloads[:1]))
        self.program("anatomy", f'cp {write_results(self.folder / "apart.json", model_anatomy())} "$OUT"')
        self.program("icbench", f'[[ $1 != sweep ]] || cp {self.small("made.json")} "$OUT"\n'
                                f'[[ $1 != simulate ]] || cp {imagined} "$OUT"\n'
                                '[[ " $* " != *" --validate "* ]] || exit 1\n'  # figures were far off
                                f'[[ $1 != pareto ]] || cp {compared} "$OUT"\n'
                                f'[[ $1 != repeatability ]] || cp {repeated} "$OUT"')

    def program(self, name: str, body: str):
        """A program that runs `body` with $OUT set to the value of its --out or --json."""
        path = self.root / "build/release/bin" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        (self.folder / "root/build/release/bin").mkdir(parents=True, exist_ok=True)
        path.write_text('#!/usr/bin/env bash\necho "${0##*/} $1" >>"$CALLS"\n'
                        'for i in "$@"; do [[ $last != --out && $last != --json ]] || OUT=$i; last=$i; done\n'
                        f"{body}\n")
        path.chmod(0o755)

    def job(self, *mode: str) -> subprocess.CompletedProcess:
        """A quick run, or one of another mode."""
        self.calls = self.folder / "calls"
        self.calls.write_text("")
        environment = os.environ | {"ICBENCH_PYTHON": sys.executable, "CALLS": str(self.calls),
                                    "PATH": f"{self.folder / 'tools'}:{os.environ['PATH']}"}
        return subprocess.run([self.root / "bench/run", *(mode or ["--quick"]), "--no-install", "--out", self.out],
                              capture_output=True, text=True, env=environment, check=False)

    def verdicts(self, broken: bool) -> Path:
        data = model_verdicts()
        if broken:
            data["checks"][0] |= {"verdict": "violated", "violations": 1}
        return write_results(self.folder / "verdicts.json", data)

    def test_a_sound_run_ends_with_the_report(self):
        self.program("icstress", f'cp {self.verdicts(False)} "$OUT"')
        done = self.job()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.splitlines()[-1], str(self.out / "report.html"))
        page = (self.out / "report.html").read_text()
        self.assertIn('id="correctness-promises"', page)
        self.assertIn('id="pareto-pareto"', page)
        self.assertIn('id="repeatability-repeatability"', page)
        self.assertIn("icbench pareto", self.calls.read_text())
        self.assertIn("icbench repeatability", self.calls.read_text())
        self.assertIn("icbench preempt", self.calls.read_text())
        self.assertEqual(self.calls.read_text().count("icbench simulate"), 2)
        self.assertIn("more-cores", page)
        self.assertEqual(json.loads((self.out / "run.json").read_text()) | {"start": "", "end": ""},
                         {"mode": "quick", "commit": "unknown", "start": "", "end": ""})

    def test_a_scene_that_fails_loses_nothing_and_is_taken_up_again(self):
        self.program("icstress", f'cp {self.verdicts(False)} "$OUT"')
        program = self.root / "build/release/bin/icbench"
        sound = program.read_text()
        program.write_text(sound.replace("\n[[ $1 != sweep ]]", '\necho "$*" >>"$CALLS"\n'
                                         '[[ $1 != pareto || " $* " != *" cornell_box "* ]] || exit 1\n[[ $1 != sweep ]]'))
        done = self.job()
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("not measured on cornell_box;", done.stderr)
        self.assertEqual(done.stdout.splitlines()[-1], str(self.out / "report.html"))
        self.assertIn("<b>sibenik</b>", (self.out / "report.html").read_text())
        self.assertIn("icbench simulate", self.calls.read_text())
        self.assertTrue((self.out / "pareto_sibenik.json").exists())
        self.assertFalse((self.out / "run.json").exists())
        program.write_text(sound.replace("\n[[ $1 != sweep ]]", '\necho "$*" >>"$CALLS"\n[[ $1 != sweep ]]'))
        done = self.job()
        self.assertEqual(done.returncode, 0, done.stderr)
        for scene in ("cornell_box", "sibenik"):
            self.assertRegex(self.calls.read_text(),
                             f"pareto --scene {scene} .*--out [^ ]*pareto_{scene}.json .*--resume")
        self.assertTrue((self.out / "run.json").exists())
        self.assertTrue((self.out / "pareto_sibenik.json").exists())

    @unittest.skipUnless(platform.machine() == "x86_64", "another program is built for x86-64 alone")
    def test_where_valgrind_does_not_know_the_processor_one_built_for_less_is_counted(self):
        self.program("icstress", f'cp {self.verdicts(False)} "$OUT"')
        (self.root / "plots").unlink()  # runs end before their report, which would take most of the time
        counter = self.root / "bench/instructions"
        for knows, calls in (("True", [[]]), ("'--programs' in sys.argv", [[], ["--programs", "build/counted/bin"]]),
                             ("False", [[], ["--programs", "build/counted/bin"]])):
            counter.write_text("import os, sys\nprint('count', *sys.argv[1:], file=open(os.environ['CALLS'], 'a'))\n"
                               f"sys.exit(0 if {knows} else 2)\n")
            done = self.job("--full")
            said = [line.replace(f"{self.root}/", "").split() for line in self.calls.read_text().splitlines()]
            self.assertEqual([words[2:] for words in said if words[0] == "count"], calls)
            self.assertEqual(["cmake", "--build"] in said[said.index(["anatomy", "--repetitions"]):], len(calls) > 1)
            self.assertEqual("nothing of instructions" in done.stderr, knows == "False")

    def test_verdicts_of_another_run_are_not_taken_for_those_of_a_crash(self):
        self.program("icstress", f'cp {self.verdicts(False)} "$OUT"')
        self.assertEqual(self.job().returncode, 0)
        self.program("icstress", "kill -SEGV $$")
        self.assertEqual(self.job().returncode, 1)
        self.assertTrue((self.out / "correctness.previous.json").exists())
        self.assertNotIn('id="correctness-promises"', (self.out / "report.html").read_text())

    def test_rows_that_only_a_journal_has_are_kept_with_the_results_of_an_earlier_run(self):
        self.program("icbench", "exit 1")  # the run ends at its first step
        self.out.mkdir()
        ends = (".json", ".json.partial", ".previous.json", ".previous.json.partial")
        cases = []
        for kind, there, kept in (
                ("results", ("16 rows", "31 rows", "old", "old"), ("16 rows", "31 rows")),
                ("preempt", ("complete", None, "old", "old"), ("complete", None)),
                # An earlier run was killed between the two moves.
                ("breakdown", (None, "31 rows", "16 rows", None), ("16 rows", "31 rows")),
                # It was killed before its results were there.
                ("anatomy", (None, "", "16 rows", "31 rows"), ("16 rows", "31 rows"))):
            files = [self.out / f"{kind}{end}" for end in ends]
            for file, text in zip(files, there):
                if text is not None:
                    file.write_text(text)
            cases.append((kind, files, kept))
        self.assertEqual(self.job().returncode, 1)
        for kind, files, kept in cases:
            self.assertFalse(files[0].exists(), kind)
            self.assertEqual(tuple(file.read_text() if file.exists() else None for file in files[2:]), kept, kind)

    def test_a_broken_promise_hides_nothing_ends_with_status_1_and_is_kept_by_a_resumed_run(self):
        self.program("icstress", f'cp {self.verdicts(True)} "$OUT"; exit 1')
        plots = self.root / "plots"
        plots.unlink()  # no plots, no report: the run ends unfinished
        self.assertEqual(self.job().returncode, 1)
        self.assertFalse((self.out / "run.json").exists())
        start = (self.out / ".unfinished").read_text().splitlines()[1]
        plots.symlink_to(kPlots)
        done = self.job()
        self.assertEqual(json.loads((self.out / "run.json").read_text())["start"], start)
        self.assertNotIn("icstress", self.calls.read_text())
        self.assertEqual(done.returncode, 1)
        self.assertIn("broken promise: sequential promises integrity", done.stderr)
        self.assertIn("not every cache was shown to be correct", done.stderr)
        self.assertEqual(done.stdout.splitlines()[-1], str(self.out / "report.html"))
        self.assertIn('class="banner">Broken promise', (self.out / "report.html").read_text())


if __name__ == "__main__":
    unittest.main()
