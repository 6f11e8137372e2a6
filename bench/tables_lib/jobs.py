"""Jobs of bench/tables: one run of the program each, cached on disk.

A job has an identity: its command line, the program and the machine that ran it, and the identities of the jobs
whose files it reads. It runs in a scratch folder, and the rename of that folder to its final name is what
completes it: so a job that is there is whole, at whatever moment the run was killed. job.json in it holds the
identity and what the program said.

Large files of a finished job (frames) may be dropped; they are made again if a later job needs them.
"""
from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import shutil
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable

kResult = "result.json"  # what the program is told to write
kRecord = "job.json"
kScratch = ".scratch"


class JobFailed(Exception):
    """The program failed, or a file that it was to write is not there; one line."""


class SpaceEnded(Exception):
    """Nothing can be written any more; one line."""


@dataclass(frozen=True)
class Input:
    """A file or folder of another job, known as `name` in the folder of the one that reads it."""
    name: str
    job: "Job"
    path: str


@dataclass(frozen=True)
class Job:
    scene: str
    label: str  # for people: "IGI, round 2"
    arguments: tuple[str, ...]  # of the program, without --json; or the name of a function of Store
    kind: str  # jobs of a kind are alike in how their time follows from `guess`
    guess: float  # seconds, a priori
    outputs: tuple[str, ...] = ()  # files and folders that other jobs read
    inputs: tuple[Input, ...] = ()
    repetition: int = 0  # from 1 where a command is timed again and again
    is_reference: bool = False  # kept with the references: identified by the scene's looks, not by the build
    internal: Callable[[Path], dict] | None = field(default=None, compare=False)  # instead of the program


class Store:
    """The finished jobs of an output folder. `build` identifies the program, `machine` what it runs on;
    `fingerprints` the looks of scenes, without which there are no references.
    """
    def __init__(self, icbench: Path, folder: Path, references: Path, build: str, machine: str = ""):
        self.icbench, self.folder, self.references = icbench, folder, references
        self.build, self.machine = build, machine
        self.fingerprints: dict[str, str] = {}
        self._records: dict[str, dict] = {}
        self._identities: dict[Job, str] = {}

    def identity(self, job: Job) -> str:
        if job not in self._identities:
            parts = [
                list(job.arguments), job.repetition,
                self.fingerprints[job.scene]
                if job.is_reference else [self.build, self.machine, self.fingerprints.get(job.scene)],
                [[i.name, self.identity(i.job), i.path] for i in job.inputs]
            ]
            self._identities[job] = hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]
        return self._identities[job]

    def place(self, job: Job) -> Path:
        words = "-".join(job.kind.replace(",", "_").split())
        root = self.references if job.is_reference else self.folder
        return root / folder_of(job.scene) / f"{words}-{self.identity(job)}"

    def record(self, job: Job) -> dict | None:
        """What job.json says, or None if the job is not finished. A damaged record counts as unfinished."""
        key = self.identity(job)
        if key not in self._records:
            try:
                record = json.loads((self.place(job) / kRecord).read_text(encoding="utf-8"))
            except (OSError, ValueError):
                return None
            if not isinstance(record, dict) or record.get("identity") != key or not isinstance(
                    record.get("result"), dict):
                return None
            self._records[key] = record
        return self._records[key]

    def seconds(self, job: Job) -> float | None:
        """What the program took, as it says, if it was this one on this machine: references may be others'."""
        record = self.record(job)
        if not record or (record.get("build"), record.get("machine")) != (self.build, self.machine):
            return None
        return record["result"].get("seconds")

    def foreign(self) -> int:
        """Finished jobs in the folder that another program made, or this one on another machine."""
        count = 0
        for path in self.folder.glob(f"*/*/{kRecord}"):
            try:
                record = json.loads(path.read_text(encoding="utf-8"))
                count += (record.get("build"), record.get("machine")) != (self.build, self.machine)
            except (OSError, ValueError, AttributeError):
                continue
        return count

    def result(self, job: Job) -> dict | None:
        record = self.record(job)
        return record["result"] if record else None

    def has_files(self, job: Job) -> bool:
        return all((self.place(job) / name).exists() for name in job.outputs)

    def command(self, job: Job) -> str:
        program = [str(self.icbench), *job.arguments, "--json", kResult
                   ] if job.internal is None else job.arguments
        return shlex.join(program)

    def ensure(self, job: Job, files: bool = False) -> None:
        """Runs the job unless it is finished; with `files`, also if files of it were dropped. Raises
        JobFailed.
        """
        if self.record(job) is not None and (not files or self.has_files(job)):
            return
        for each in job.inputs:
            self.ensure(each.job, files=True)
        place = self.place(job)
        scratch = place.parent / f"{place.name}{kScratch}"
        try:
            shutil.rmtree(scratch, ignore_errors=True)
            scratch.mkdir(parents=True)
            self._run(job, scratch)
            self._commit(job, scratch, place)
        except OSError as error:
            raise SpaceEnded(
                f"{error.filename or scratch}: {error.strerror}; mend it and go on with --resume") from None
        finally:
            shutil.rmtree(scratch, ignore_errors=True)

    def _run(self, job: Job, scratch: Path) -> None:
        for each in job.inputs:
            link = scratch / each.name
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to((self.place(each.job) / each.path).resolve())
        start = time.monotonic()
        if job.internal is not None:
            result = job.internal(scratch)
        else:
            result = self._run_program(job, scratch)
        seconds = time.monotonic() - start
        for name in job.outputs:
            if not (scratch / name).exists():
                raise JobFailed(f"{self.command(job)}: wrote no {name}")
        record = {
            "identity": self.identity(job), "scene": job.scene, "label": job.label, "kind": job.kind,
            "command": self.command(job), "build": self.build, "machine": self.machine, "seconds": seconds,
            "guess": job.guess, "result": result
        }
        with open(scratch / kRecord, "w", encoding="utf-8") as file:
            json.dump(record, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        for path in scratch.iterdir():
            if path.name not in (kRecord, *job.outputs):
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()

    def _run_program(self, job: Job, scratch: Path) -> dict:
        command = [str(self.icbench), *job.arguments, "--json", kResult]
        done = subprocess.run(command, cwd=scratch, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                              stderr=subprocess.PIPE, text=True, errors="replace")
        if done.returncode != 0:
            said = [line for line in done.stderr.splitlines() if line.strip()]
            why = said[-1] if said else "no message"
            raise JobFailed(f"{self.command(job)}: status {done.returncode}: {why}")
        try:
            result = json.loads((scratch / kResult).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            raise JobFailed(f"{self.command(job)}: wrote no JSON that can be read") from None
        if not isinstance(result, dict):
            raise JobFailed(f"{self.command(job)}: its JSON is no object")
        return result

    def _commit(self, job: Job, scratch: Path, place: Path) -> None:
        """Makes the scratch folder the job's. Of a job that ran again for its files, the first record stays.
        """
        if self.record(job) is not None:
            for name in job.outputs:
                remove(place / name)
                os.rename(scratch / name, place / name)
            return
        remove(place)
        os.rename(scratch, place)

    def drop_files(self, job: Job) -> None:
        for name in job.outputs:
            remove(self.place(job) / name)


def remove(path: Path) -> None:
    """Away with a file or folder, at once as far as others can see."""
    if not path.exists() and not path.is_symlink():
        return
    gone = path.parent / f"{path.name}.dropped{kScratch}"
    shutil.rmtree(gone, ignore_errors=True)
    os.rename(path, gone)
    shutil.rmtree(gone) if gone.is_dir() and not gone.is_symlink() else gone.unlink()


def sweep_scratch(folder: Path) -> None:
    """Removes what killed runs left behind."""
    for left in folder.glob(f"*/*{kScratch}"):
        shutil.rmtree(left, ignore_errors=True)
    for left in folder.glob(f"*/*/*{kScratch}"):
        shutil.rmtree(left, ignore_errors=True)


def folder_of(scene: str) -> str:
    """The name of a scene's folder. Files of one name have folders of their own."""
    words = "".join(c if c.isalnum() or c in "_-." else "-" for c in Path(scene).name).lstrip(".")
    return words if words == scene else f"{words}-{hashlib.sha256(os.fsencode(scene)).hexdigest()[:8]}"


def identity_of_machine() -> str:
    """What times depend on beside the program: host, processor, and how many units this process may use."""
    return f"{platform.node()}, {cpu_model()}, {len(os.sched_getaffinity(0))} processing units"


def cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def identity_of_program(icbench: Path) -> str:
    """Version, commit and compiler of the program, and its bytes' hash: flags and changes are in no version.

    Raises JobFailed if it cannot be run.
    """
    try:
        done = subprocess.run([str(icbench), "--version"], capture_output=True, text=True,
                              stdin=subprocess.DEVNULL)
    except OSError as error:
        raise JobFailed(f"{icbench}: {error.strerror}; build it, or name another with --icbench") from None
    version = done.stdout.strip()
    if done.returncode != 0 or not version:
        raise JobFailed(
            f"{icbench} --version: status {done.returncode}; build it, or name another with --icbench")
    return f"{version}, program {hashlib.sha256(icbench.read_bytes()).hexdigest()[:12]}"
