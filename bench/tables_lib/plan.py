"""Which jobs the tables of a scene need.

A plan is a function of the settings and, for most of it, of the scene's number of VPLs: so the jobs that are
left can be counted before they run, and those that are done are recognised after any interruption.

Methods: rt (Whitted), igi (instant global illumination, every VPL at every pixel), interleaved (IGI by
interleaved sampling), ic (instant caching, its cache cleared after each frame), tic (temporal instant
caching), cells (hash cells: what renderers on graphics processors share instead of a cache; their parameter is
the number of light paths from each visible point, not that of VPLs).
"""
from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import pictures
from jobs import Input, Job
from options import Settings

kIntegrators = {
    "rt": "whitted", "igi": "instant_gi", "interleaved": "instant_gi_interleaved", "ic": "instant_caching",
    "tic": "temporal_instant_caching", "cells": "hash_cells"
}
kTitles = {
    "rt": "RT", "igi": "IGI", "interleaved": "IGI interleaved", "ic": "IC", "tic": "TIC",
    "cells": "hash cells", "path": "path tracing", "lck": "LCK", "lw": "LW", "wf": "WF", "sequential": "sequential"
}
kCached = ("ic", "tic")
kSparse = ("igi", "interleaved")  # whose frames have no work in common, so that a few tell the time of all
kTableCache = "wait_free"
# Chapter 7: three mechanisms on one structure, and that structure for one thread alone as the base.
kMechanisms = {"lck": "global_mutex", "lw": "local_write", "wf": "wait_free"}
kBase = "sequential"

kPictureMetrics = "rmse,relmse,mean_ratio,flip,hdrvdp"
kCurveMetrics = "rmse,relmse"


def title(method: str) -> str:
    return kTitles[method]


@dataclass
class Plan:
    """The jobs of a scene by what they are for. The keys are those that tables.py asks for."""
    scene: str
    is_animation: bool
    halves: list[Job]
    reference: Job
    direct: Job  # RT with as many samples
    reference_error: Job
    accuracy: float  # of the caches
    sweep: dict[tuple[int, int], Job] = field(default_factory=dict)  # (vpls, seed): IGI's last frame
    sweep_errors: dict[tuple[int, int], Job] = field(default_factory=dict)
    vpls: int = 0  # of the rest
    frames: dict[str, Job] = field(default_factory=dict)  # method: all frames
    super: Job | None = None  # IGI supersampled, last frame
    quality: dict[str, Job] = field(default_factory=dict)  # comparisons of the last frame
    over_frames: dict[str, Job] = field(default_factory=dict)  # and of all frames, against IGI
    timing: dict[tuple[str, int], Job] = field(default_factory=dict)  # (method, round)
    converged: list[Job] = field(default_factory=list)  # IGI of many VPLs, the last frames
    curve: dict[tuple[str, int, float],
                Job | list[Job]] = field(default_factory=dict)  # (method, vpls or paths, accuracy)
    curve_errors: dict[tuple[str, int, float], Job] = field(default_factory=dict)
    mechanisms: dict[tuple[str, str, int, int],
                     Job] = field(default_factory=dict)  # (what, mechanism, threads, round)

    def choice(self) -> list[Job]:
        """What the number of VPLs is chosen from."""
        return with_inputs([
            *self.halves, self.reference, self.direct, self.reference_error, *self.sweep.values(),
            *self.sweep_errors.values()
        ])

    def jobs(self) -> list[Job]:
        """All jobs in the order in which they run: methods that are compared in time alternate."""
        curve = [
            job for entry in self.curve.values() for job in (entry if isinstance(entry, list) else [entry])
        ]
        return with_inputs([
            *self.choice(), *self.timing.values(), *self.frames.values(),
            *([self.super] if self.super else []), *self.quality.values(), *self.over_frames.values(),
            *self.converged, *curve, *self.curve_errors.values(), *self.mechanisms.values()
        ])


def with_inputs(jobs: list[Job]) -> list[Job]:
    """The jobs, each after those whose files it reads; none twice."""
    found: dict[Job, None] = {}

    def add(job: Job) -> None:
        if job not in found:
            for each in job.inputs:
                add(each.job)
            found[job] = None

    for job in jobs:
        add(job)
    return list(found)


def neighbours(counts: tuple[int, ...], chosen: int) -> list[int]:
    """The chosen number of VPLs, and a quarter and four times of it if they were measured."""
    return sorted({count for count in counts if count in (chosen // 4, chosen * 4)} | {chosen})


kAccuracy = 0.1  # of the caches, on scenes from files


class Planner:
    """Makes the plans of all scenes from one set of settings."""
    def __init__(self, settings: Settings, accuracies: dict[str, float]):
        """`accuracies`: of the caches, by scene, where the settings name none."""
        self.settings, self.scale, self.accuracies = settings, settings.scale, accuracies
        self.pixels = self.scale.size[0] * self.scale.size[1]
        self.size = f"{self.scale.size[0]}x{self.scale.size[1]}"

    def accuracy(self, scene: str) -> float:
        """Of the caches, in every table of a scene."""
        return self.settings.accuracy or self.accuracies.get(scene, kAccuracy)

    def last(self, is_animation: bool) -> int:
        return self.scale.frames - 1 if is_animation else 0

    def frames(self, method: str, count: int | None = None) -> list[int]:
        """Which frames of an animation of `count` a method renders."""
        last = (count or self.scale.frames) - 1
        every = self.settings.igi_every if method in kSparse else 1
        return [*range(0, last, every), last]

    def _guess(self, integrator: str, vpls: int, paths: int, spp: int, frames: int) -> float:
        """Seconds, from rays at 20 million a second: the order of magnitude, until jobs of that kind have
        run.
        """
        rays = {
            "whitted": 4, "path": 30, "instant_gi": 3 + vpls, "instant_gi_interleaved": 3 + vpls / 16,
            "instant_caching": 8 + vpls / 10, "temporal_instant_caching": 8 + vpls / 50,
            "irradiance_cache": 30, "hash_cells": 30 * (paths or self.scale.cell_paths)
        }[integrator]
        return 0.3 + self.pixels * spp * rays * frames / 2e7

    def render(self, scene: str, method: str, label: str, frame: int, *, vpls: int = 0, paths: int = 0, spp: int = 1,
               seed: int | None = None, cache: str = kTableCache, accuracy: float | None = None,
               threads: int = 0, reference: bool = False, repetition: int = 0) -> Job:
        """One frame; `method` is one of this module's, or an integrator. With a repetition it is timed, and
        no picture is kept.
        """
        integrator = kIntegrators.get(method, method)
        arguments = [
            "render", "--scene", scene, "--integrator", integrator, "--frame",
            str(frame), "--size", self.size, "--spp",
            str(spp), *self._method(scene, integrator, vpls, paths, cache, accuracy, threads, seed), "--out",
            "picture.exr"
        ]
        return Job(scene, label, tuple(arguments), f"render {integrator}",
                   self._guess(integrator, vpls, paths, spp, 1), () if repetition else ("picture.exr", ),
                   is_reference=reference, repetition=repetition)

    def animate(self, scene: str, method: str, label: str, frames: int, *, vpls: int = 0,
                cache: str = kTableCache, accuracy: float | None = None, threads: int = 0, keep: bool = False,
                repetition: int = 0) -> Job:
        integrator = kIntegrators.get(method, method)
        every = self.settings.igi_every if method in kSparse else 1
        arguments = [
            "animate", "--scene", scene, "--integrator", integrator, "--frames",
            str(frames), *(["--every", str(every)] if every > 1 else []), "--size", self.size, "--spp", "1",
            *self._method(scene, integrator, vpls, 0, cache, accuracy, threads, None), "--format",
            "exr" if keep else "none", "--out", "frames"
        ]
        return Job(scene, label, tuple(arguments), f"animate {integrator}",
                   self._guess(integrator, vpls, 0, 1, len(self.frames(method, frames))), ("frames", ) if keep else (),
                   repetition=repetition)

    def _method(self, scene: str, integrator: str, vpls: int, paths: int, cache: str, accuracy: float | None,
                threads: int, seed: int | None) -> list[str]:
        """Options of an integrator; no paths: as many as in the tables."""
        options = ["--seed", str(self.settings.seed if seed is None else seed)]
        if integrator.startswith("instant_") or integrator.startswith("temporal_"):
            options += ["--vpls", str(vpls)]
        if integrator == kIntegrators["cells"]:
            options += ["--paths", str(paths or self.scale.cell_paths)]
        if integrator in ("irradiance_cache", *(kIntegrators[m] for m in kCached)):
            options += ["--cache", cache, "--accuracy", f"{accuracy or self.accuracy(scene):g}"]
            options += ["--interpolation", "gradients"]
        return options + (["--threads", str(threads)] if threads else [])

    def compare(self, scene: str, label: str, a: list[Input], b: list[Input], metrics: str,
                maps: bool = False) -> Job:
        """Two pictures ("a.exr", "b.exr") or two folders ("a/...", "b/...")."""
        names = [part[0].name.split("/")[0] for part in (a, b)]
        arguments = ["compare", *names, "--metrics", metrics, *(["--map", "maps"] if maps else [])]
        seconds = 0.05 + len(a) * self.pixels * (8e-6 if "hdrvdp" in metrics else 2e-7)
        return Job(scene, label, tuple(arguments), f"compare {metrics}", seconds, ("maps", ) if maps else (),
                   (*a, *b))

    def _pictures(self, scene: str, label: str, a: Job, b: Job, metrics: str = kPictureMetrics, *,
                  maps: bool = False, frame: int | None = None) -> Job:
        """b against a; a job that made all frames gives the frame asked for."""
        return self.compare(scene, label, [self._one("a.exr", a, frame)], [self._one("b.exr", b, frame)],
                            metrics, maps)

    @staticmethod
    def _one(name: str, job: Job, frame: int | None) -> Input:
        return Input(name, job, "picture.exr" if "picture.exr" in job.outputs else pictures.frame_path(frame))

    def _sum(self, scene: str, label: str, parts: list[tuple[Job, float]], frame: int,
             reference: bool = False) -> Job:
        """A picture made of others with weights."""
        inputs = tuple(self._one(f"{i}.exr", job, frame) for i, (job, _) in enumerate(parts))
        weights = {each.name: weight for each, (_, weight) in zip(inputs, parts)}
        return Job(scene, label, ("sum of pictures", *(f"{w:g}" for w in weights.values())), "sum",
                   0.1 + self.pixels * 1e-6, ("picture.exr", ), inputs, is_reference=reference,
                   internal=partial(pictures.write_sum, weights, "picture.exr"))

    def _clean(self, plan: Plan, label: str, job: Job, rt: Job, frame: int) -> Job:
        """A method's picture with its direct light exchanged for that of many samples: what is left of its
        error is the indirect light's, not the noise of area lights and the aliasing that all methods
        share. RT with the same seed has the same direct light, sample by sample.
        """
        return self._sum(plan.scene, f"{label}, with converged direct light", [(job, 1), (rt, -1),
                                                                               (plan.direct, 1)], frame)

    def start(self, scene: str, is_animation: bool) -> Plan:
        """What the number of VPLs is chosen from: references and IGI over VPL counts, on the last frame."""
        scale, last = self.scale, self.last(is_animation)
        half = max(1, scale.reference_spp // 2)
        halves = [
            self.render(scene, "path", f"path tracing, half {i + 1} of the reference", last, spp=half,
                        seed=self.settings.seed + i, reference=True) for i in range(2)
        ]
        reference = self._sum(scene, "mean of the reference's halves", [(halves[0], 0.5), (halves[1], 0.5)],
                              last, reference=True)
        direct = self.render(scene, "rt", f"RT, {scale.reference_spp} samples a pixel", last,
                             spp=scale.reference_spp)
        plan = Plan(scene, is_animation, halves, reference, direct,
                    self._pictures(scene, "halves of the reference", halves[0], halves[1]), self.accuracy(scene))
        for seed in range(self.settings.seed, self.settings.seed + scale.vpl_seeds):
            noisy = self.render(scene, "rt", f"RT, seed {seed}", last, seed=seed)
            for count in scale.vpl_counts:
                job = self.render(scene, "igi", f"IGI, {count} VPLs, seed {seed}", last, vpls=count,
                                  seed=seed)
                plan.sweep[count, seed] = job
                clean = self._clean(plan, f"IGI, {count} VPLs, seed {seed}", job, noisy, last)
                error = self._pictures(scene, f"error of IGI, {count} VPLs, seed {seed}", reference, clean)
                plan.sweep_errors[count, seed] = error
        return plan

    def finish(self, plan: Plan, vpls: int) -> Plan:
        """Adds to a plan all that needs the number of VPLs."""
        plan.vpls = vpls
        if plan.is_animation:
            self._timing(plan)
        self._quality(plan)
        if plan.is_animation:
            self._equal_error(plan)
        self._mechanisms(plan)
        return plan

    def _timing(self, plan: Plan) -> None:
        for round_ in range(self.scale.rounds):
            for method in kIntegrators:
                plan.timing[method,
                            round_] = self.animate(plan.scene, method, f"{title(method)}, round {round_ + 1}",
                                                   self.scale.frames, vpls=plan.vpls, repetition=round_ + 1)

    def _quality(self, plan: Plan) -> None:
        scene, last = plan.scene, self.last(plan.is_animation)
        for method in kIntegrators:
            if plan.is_animation:
                job = self.animate(scene, method, f"{title(method)}, frames", self.scale.frames,
                                   vpls=plan.vpls, keep=True)
            else:
                job = self.render(scene, method, f"{title(method)}, picture", 0, vpls=plan.vpls)
            plan.frames[method] = job
        plan.super = self.render(scene, "igi", f"IGI, {self.scale.super_spp} samples a pixel", last,
                                 vpls=plan.vpls, spp=self.scale.super_spp)
        made = plan.frames
        pairs = {
            "tic_path": (plan.reference, made["tic"]), "tic_igi": (made["igi"], made["tic"]),
            "ic_igi": (made["igi"], made["ic"]), "igi_path": (plan.reference, made["igi"]),
            "interleaved_path": (plan.reference, made["interleaved"]),
            "cells_path": (plan.reference, made["cells"]),
            "super_path": (plan.reference, plan.super)
        }
        for method in ("tic", "igi", "interleaved", "cells"):
            clean = self._clean(plan, title(method), made[method], made["rt"], last)
            pairs[f"{method}_path_clean"] = (plan.reference, clean)
        for name, (a, b) in pairs.items():
            plan.quality[name] = self._pictures(scene, f"last frame, {name.replace('_', ' ')}", a, b,
                                                maps=name in ("tic_path_clean", "tic_igi"), frame=last)
        if plan.is_animation:
            for method in ("tic", "ic", "interleaved", "cells"):
                label = f"{'all frames' if self.settings.igi_every == 1 else 'IGI’s frames'}, {title(method)} against IGI"
                a, b = ([Input(f"{name}/{pictures.frame_name(f)}", made[of], pictures.frame_path(f))
                         for f in self.frames("igi")] for name, of in (("a", "igi"), ("b", method)))
                plan.over_frames[method] = self.compare(scene, label, a, b, kPictureMetrics)

    def _equal_error(self, plan: Plan) -> None:
        """Error against time over VPLs and accuracy. Methods whose frames do not depend on one another render
        only the frames on which the error is measured.
        """
        scale, scene = self.scale, plan.scene
        measured = range(scale.frames - scale.converged_frames, scale.frames)
        plan.converged = [
            self.render(scene, "igi", f"converged IGI, frame {f}", f, vpls=scale.converged_vpls)
            for f in measured
        ]
        limit = [
            Input(f"a/{pictures.frame_name(f)}", job, "picture.exr")
            for f, job in zip(measured, plan.converged)
        ]

        def add(method: str, count: int, accuracy: float) -> None:
            key = (method, count, accuracy)
            counted = {"paths": count} if method == "cells" else {"vpls": count}
            setting = f"{count} {'paths' if method == 'cells' else 'VPLs'}"
            setting += f", accuracy {accuracy:g}" if method in kCached else ""
            if method == "tic":
                made = self.animate(scene, method, f"TIC, {setting}", scale.frames, vpls=count,
                                    accuracy=accuracy, keep=True)
                got = [Input(f"b/{pictures.frame_name(f)}", made, pictures.frame_path(f)) for f in measured]
                plan.curve[key] = made
            else:
                made = [
                    self.render(scene, method, f"{title(method)}, {setting}, frame {f}", f, **counted,
                                accuracy=accuracy) for f in measured
                ]
                got = [
                    Input(f"b/{pictures.frame_name(f)}", job, "picture.exr")
                    for f, job in zip(measured, made)
                ]
                plan.curve[key] = made

            plan.curve_errors[key] = self.compare(scene, f"error of {title(method)}, {setting}", limit, got,
                                                  kCurveMetrics)

        for method in ("igi", "interleaved"):
            for count in sorted({*scale.few_vpls, *scale.vpl_counts, plan.vpls}):
                add(method, count, self.accuracy(scene))
        for count in sorted({*scale.curve_paths, scale.cell_paths}):
            add("cells", count, self.accuracy(scene))
        counts = neighbours(scale.vpl_counts, plan.vpls) if scale.neighbour_vpls else [plan.vpls]
        for method in kCached:
            for count in counts:
                for accuracy in sorted({*scale.accuracies, self.accuracy(scene)}):
                    add(method, count, accuracy)

    def _mechanisms(self, plan: Plan) -> None:
        """Chapter 7 on one scene: the still by irradiance caching, the animation by IC and TIC."""
        whats = {"ic": "ic", "tic": "tic"} if plan.is_animation else {}
        if not plan.is_animation or self.scale.animated_stills:
            whats = {"still": "irradiance_cache", **whats}
        cells = [("sequential", kBase, 1)] + [(name, cache, threads) for threads in self.settings.threads
                                              for name, cache in kMechanisms.items()]
        for round_ in range(self.scale.rounds):
            for what, method in whats.items():
                for name, cache, threads in cells:
                    kind = "still" if what == "still" else title(what)
                    label = f"{kind}, {title(name)}, threads {threads}, round {round_ + 1}"
                    if what == "still":
                        job = self.render(plan.scene, method, label, 0, cache=cache, threads=threads,
                                          repetition=round_ + 1)
                    else:
                        job = self.animate(plan.scene, method, label, self.scale.mechanism_frames,
                                           vpls=plan.vpls, cache=cache, threads=threads,
                                           repetition=round_ + 1)
                    plan.mechanisms[what, name, threads, round_] = job
