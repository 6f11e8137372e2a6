"""bench/tables after set-up and building: runs the jobs and writes tables.json, whose path it prints.

Status: 0 done, 1 a job failed, 2 bad usage or nothing can be written, 130 interrupted.
"""
from __future__ import annotations

import datetime
import hashlib
import json
import os
import platform
import re
import shlex
import subprocess
import sys
import tempfile
import time
import urllib.parse
from pathlib import Path

import options
import pictures
from claims import claims, targets
from folder_lock import Taken, lock_folder
from jobs import (JobFailed, Store, SpaceEnded, cpu_model, folder_of, identity_of_machine, identity_of_program,
                  sweep_scratch)
from options import BadUsage, Settings
from plan import Plan, Planner
from progress import Progress, clock
from tables import choose_vpls, method_titles, scene_tables
from thesis import kAnimations, kIndirectTimes, kPerceived, kSource, kStills, kWholeFrameRange

kSchema = 2
kMade = ".made.json"  # which pictures of a scene there are, and what of
kProbe = ("--integrator", "path", "--size", "48x36", "--spp", "4", "--seed", "1", "--out", "probe.exr")


def say(text: str) -> None:
    print(f"bench/tables: {text}", file=sys.stderr, flush=True)


def files_named_by(file: Path) -> list[Path]:
    """Files that a scene file names by a path from where it is: buffers, pictures, materials."""
    # A search that began within a word as well would take hours over a buffer of zeros in base64.
    words = re.findall(rb"(?<![\w%./-])[\w%./-]+\.\w+", file.read_bytes())
    names = {urllib.parse.unquote(word.decode("ascii")) for word in words}
    return sorted(file.parent / name for name in names if _is_file(file.parent / name))


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # longer than a name may be, or with a zero: a word of a buffer
        return False


class Run:
    """One run of bench/tables."""
    def __init__(self, settings: Settings):
        self.settings = settings
        self.known = options.known_scenes(settings.icbench)
        self.scenes, self.absent = self._scenes()
        self.planner = Planner(settings, {name: e["accuracy"] for name, e in self.known.items()})
        self.store = Store(settings.icbench, settings.out / "jobs", settings.references,
                           identity_of_program(settings.icbench), identity_of_machine())
        self.load = _largest_load(settings.out / "tables.json")
        self.failures: list[dict] = []
        self.broken: set[str] = set()  # identities of jobs that failed or read files of such
        self.done: dict[str, dict] = {}

    def _scenes(self) -> tuple[list[str], list[str]]:
        """The scenes to run, and those of the thesis that the program does not have."""
        wanted = self.settings.scenes
        options.require_scenes(self.settings, self.known)
        all_ = [*kAnimations, *kStills]
        return ([str(Path(n).resolve()) if n not in self.known else n for n in wanted]
                or [n for n in all_ if n in self.known],
                [] if wanted else [n for n in all_ if n not in self.known])

    def fingerprint(self, scene: str) -> str:
        """How the scene looks to this program's path tracer, in the first frame and the last, or what its file
        and those that it names hold as well: results of other looks are not used. Raises JobFailed.
        """
        looks = hashlib.sha256(self._look(scene, 0))
        if scene not in self.known:
            for file in [Path(scene), *files_named_by(Path(scene))]:
                looks.update(file.read_bytes())
        elif scene not in kStills:
            looks.update(self._look(scene, self.settings.scale.frames - 1))
        return looks.hexdigest()[:16]

    def _look(self, scene: str, frame: int) -> bytes:
        with tempfile.TemporaryDirectory(prefix="icbench-tables-") as folder:
            command = [str(self.settings.icbench), "render", "--scene", scene, "--frame", str(frame), *kProbe]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True,
                                  stdin=subprocess.DEVNULL)
            probe = Path(folder) / "probe.exr"
            if done.returncode != 0 or not probe.exists():
                said = done.stderr.strip().splitlines()
                raise JobFailed(
                    f"{shlex.join(command)}: status {done.returncode}: {said[-1] if said else 'no message'}")
            return probe.read_bytes()

    def _moves(self, scene: str) -> bool:
        """Whether it is an animation: a file is one if it has a second frame."""
        if scene in self.known:
            return scene not in kStills
        try:
            self._look(scene, 1)
        except JobFailed:
            return False
        return True

    def start(self) -> tuple[dict[str, Plan], Progress]:
        """First plans of all scenes that render at all; those without a chosen number of VPLs are counted
        with a middle one.
        """
        plans, middle = {}, self.settings.scale.vpl_counts[len(self.settings.scale.vpl_counts) // 2]
        progress = Progress(self.store)
        for scene in self.scenes:
            try:
                self.store.fingerprints[scene] = self.fingerprint(scene)
            except JobFailed as error:
                self._failed(scene, "first look", str(error))
                continue
            is_animation = self._moves(scene)
            plan = plans[scene] = self.planner.start(scene, is_animation)
            progress.expect(
                scene,
                plan.choice() if self.settings.only_vpls else
                self.planner.finish(self.planner.start(scene, is_animation), middle).jobs())
        return plans, progress

    def _failed(self, scene: str, what: str, why: str) -> None:
        self.failures.append({"scene": scene, "job": what, "error": why})
        say(f"failed: {why}")

    def run_scene(self, plan: Plan, progress: Progress) -> None:
        """All jobs of a scene. A job that fails stops only those that read its files."""
        self._run(plan.choice(), progress)
        chosen = choose_vpls(self.store, plan)
        if chosen and self.settings.only_vpls:
            progress.wipe()
            say(f"{plan.scene}: {chosen[0]:,} VPLs{'' if chosen[1] else ', not levelled off below'}")
        elif chosen:
            self.planner.finish(plan, chosen[0])
            progress.expect(plan.scene, plan.jobs())
            self._run(plan.jobs(), progress)
        else:
            self._failed(
                plan.scene, "number of VPLs",
                f"{plan.scene}: IGI could not be compared with path tracing, so "
                "there is no number of VPLs to go on with")
        description = self.known.get(plan.scene, {}).get("description", "")
        self.done[plan.scene] = scene_tables(self.store, plan, self.settings, description)
        try:
            self.done[plan.scene]["pictures"] = self._pictures(plan)
        except (JobFailed, OSError, pictures.PictureError) as error:
            self._failed(plan.scene, "pictures", f"{plan.scene}: {error}")
        self.write(False)
        # Frames are large; whatever a later job needs of them is made again.
        for job in [*plan.frames.values(), *(j for j in plan.curve.values() if not isinstance(j, list))]:
            if "frames" in job.outputs:
                self.store.drop_files(job)

    def _run(self, jobs, progress: Progress) -> None:
        for job in jobs:
            name = self.store.identity(job)
            if name in self.broken or self.store.result(job) is not None:
                continue
            if any(self.store.identity(i.job) in self.broken for i in job.inputs):
                self.broken.add(name)
                continue
            progress.show(job)
            try:
                self.store.ensure(job)
            except (JobFailed, pictures.PictureError) as error:
                progress.wipe()
                self.broken.add(name)
                self._failed(job.scene, job.label, str(error))
            progress.advance(job)

    def _pictures(self, plan: Plan) -> dict:
        """Small pictures of the last frame, an animated preview, and the frames as PNG if they are to be
        kept.
        """
        out, last = self.settings.out, self.planner.last(plan.is_animation)
        if self.store.result(plan.reference) is None:
            return {}
        folder = out / "pictures" / folder_of(plan.scene)
        source = self._source_of_pictures(plan)
        if (earlier := self._pictures_made(folder, source)) is not None:
            return earlier
        (folder / kMade).unlink(missing_ok=True)  # it does not vouch for what is overwritten from here on
        reference = pictures.read(self.store.place(plan.reference) / "picture.exr")
        exposure = pictures.exposure_of(reference)
        made = {"exposure": exposure}

        def keep(name: str, picture, scale: float) -> None:
            path = folder / f"{name}.png"
            pictures.write_image(pictures.tone_mapped(picture, scale), path)
            made[name] = str(path.relative_to(out))

        keep("path", reference, exposure)
        for method, job in plan.frames.items():
            if self.store.result(job) is None:
                continue
            self.store.ensure(job, files=True)
            path = self.store.place(job) / (pictures.frame_path(last) if plan.is_animation else "picture.exr")
            keep(method, pictures.read(path), exposure)
            if plan.is_animation:
                self._frames(plan, method, path.parent, exposure, made)
        for name in ("tic_path_clean", "tic_igi"):
            job = plan.quality.get(name)
            if job and self.store.result(job) is not None:
                self.store.ensure(job, files=True)
                made.update(self._map(name, self.store.place(job) / "maps", folder))
        (folder / kMade).write_text(json.dumps({"source": source, "pictures": made}), encoding="utf-8")
        return made

    def _source_of_pictures(self, plan: Plan) -> list:
        """All that a scene's pictures follow from."""
        jobs = [plan.reference, *plan.frames.values(), *plan.quality.values()]
        return [[self.store.identity(job) for job in jobs if job and self.store.result(job) is not None],
                self.settings.keep_png, self.settings.scale.preview_side]

    def _pictures_made(self, folder: Path, source: list) -> dict | None:
        """What an earlier run made of the same, if it is all there: their frames were dropped."""
        try:
            made = json.loads((folder / kMade).read_text(encoding="utf-8"))
            if made["source"] != source:
                return None
            files = [self.settings.out / name for name in made["pictures"].values() if isinstance(name, str)]
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None
        return made["pictures"] if all(file.is_file() for file in files) else None

    def _map(self, name: str, maps: Path, folder: Path) -> dict:
        """The false-colour map of HDR-VDP, as the program painted it."""
        painted = maps / "hdrvdp.png"
        if not painted.exists():
            return {}
        path = folder / f"hdrvdp_{name}.png"
        path.write_bytes(painted.read_bytes())
        return {f"hdrvdp_{name}": str(path.relative_to(self.settings.out))}

    def _frames(self, plan: Plan, method: str, source: Path, exposure: float, made: dict) -> None:
        folder = self.settings.out / "animations" / folder_of(plan.scene)
        frames = {f: source / pictures.frame_name(f) for f in self.planner.frames(method)}
        preview = folder / f"{method}.webp"
        if method in ("tic", "igi"):
            pictures.write_preview(frames, exposure, self.settings.scale.preview_side, preview)
            made[f"animation_{method}"] = str(preview.relative_to(self.settings.out))
        if self.settings.keep_png:
            for earlier in (folder / method).glob("frame_*.png"):  # of other frames, perhaps
                earlier.unlink()
            for frame in frames.values():
                pictures.write_image(pictures.tone_mapped(pictures.read(frame), exposure),
                                     folder / method / f"{frame.stem}.png")

    def write(self, complete: bool) -> Path:
        """tables.json, whole or not at all."""
        s = self.settings
        measured = {
            "schema": kSchema, "title": "The thesis's tables, made in kind on our own scenes",
            "source": kSource, "complete": complete, "mode": s.mode,
            "command_line": shlex.join(["bench/tables",
                                        *sys.argv[1:]]), "build": self.store.build, "machine": _machine(self.load),
            "settings": {**s.scale.__dict__, "threads": s.threads,
                         "accuracy": s.accuracy or "each scene's own", "igi_every": s.igi_every, "seed": s.seed},
            "methods": method_titles(), "absent": self.absent, "failures": self.failures, "thesis": {
                "whole_frames": kWholeFrameRange,
                "indirect_times": {k: v.__dict__
                                   for k, v in kIndirectTimes.items()},
                "perceived": {k: v.__dict__
                              for k, v in kPerceived.items()}
            }, "scenes": self.done, "targets": targets(self.done), "claims": claims(self.done)
        }
        path = s.out / "tables.json"
        pictures.write_whole(path, json.dumps(measured, indent=1))
        return path


def _largest_load(tables: Path) -> list[float]:
    """The machine's load now, before this run adds to it, or as a run that this one goes on with began."""
    now = list(os.getloadavg())
    try:
        return max(now, [float(load) for load in json.loads(tables.read_text(encoding="utf-8"))["machine"]["load_avg"]])
    except (OSError, ValueError, LookupError, TypeError):
        return now


def _machine(load: list[float]) -> dict:
    return {
        "cpu": cpu_model(), "units": options.units(), "kernel": platform.release(), "load_avg": load,
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")
    }


def _is_complete(tables: Path) -> bool:
    try:
        return bool(json.loads(tables.read_text(encoding="utf-8")).get("complete"))
    except (OSError, ValueError):
        return False


def _prepare(settings: Settings) -> list[int]:
    """Makes the output folder and locks it for this process; returns the locks. Raises BadUsage, Taken."""
    try:
        settings.out.mkdir(parents=True, exist_ok=True)
        settings.references.mkdir(parents=True, exist_ok=True)
        locks = [lock_folder(settings.out, "--out")]
        # Two runs would sweep away one another's references under way.
        if settings.references != settings.out:
            locks.append(lock_folder(settings.references, "--references"))
    except OSError as error:
        raise BadUsage(f"--out: {error.filename}: {error.strerror}; choose another folder") from None
    finished = len(list((settings.out / "jobs").glob("*/*/job.json")))
    if finished and not settings.resume:
        raise BadUsage(
            f"'{settings.out}' holds {finished} finished jobs; go on with --resume, choose another --out, "
            "or remove the folder")
    if settings.only_vpls and _is_complete(settings.out / "tables.json"):
        raise BadUsage(f"'{settings.out}' holds finished tables, which say how many virtual lights were chosen; choose "
                       "another --out")
    sweep_scratch(settings.out / "jobs")
    sweep_scratch(settings.references)
    return locks


def work(settings: Settings) -> int:
    run = Run(settings)
    locks = _prepare(settings)
    start = time.monotonic()
    try:
        if foreign := run.store.foreign():
            say(f"{foreign} finished job{'' if foreign == 1 else 's'} of another program or machine in "
                f"'{settings.out}' {'is' if foreign == 1 else 'are'} not used")
        if run.absent:
            say(f"not in this program: {', '.join(run.absent)}")
        plans, progress = run.start()
        for plan in plans.values():
            run.run_scene(plan, progress)
        progress.wipe()
        path = run.write(not settings.only_vpls)
    finally:
        for lock in locks:
            os.close(lock)
    for failure in run.failures:
        say(f"failed, {failure['scene']}, {failure['job']}: {failure['error']}")
    count = len(run.done)
    say(f"{count} scene{'' if count == 1 else 's'} in {clock(time.monotonic() - start)}")
    print(path)
    return 1 if run.failures else 0


def main() -> int:
    try:
        return work(options.parse(sys.argv[1:]))
    except (BadUsage, JobFailed, SpaceEnded, Taken) as error:
        say(str(error))
    except KeyboardInterrupt:
        say("interrupted; go on with --resume")
        return 130
    except OSError as error:
        say(f"{error.filename or 'input or output'}: {error.strerror}; mend it and go on with --resume")
    return 2


if __name__ == "__main__":
    sys.exit(main())
