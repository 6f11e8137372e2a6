"""The report's first page: what to use, for rays a record, cores and a tolerable error, and how sure that is."""
from __future__ import annotations

import math

import interactive
import simulated
import style
from choice import (Answer, Choice, answer, choice, errors_at, evidence, kExtrapolated, kMeasured, kNegligible,
                    kSimulated, tails)
from figure import Omitted
from intervals import kFewRepetitions, summarise
from over_threads import cache_rows
from results import Setup
from tables import note_line, table, text

kRows = (4, 16, 64, 256, 1024)   # of the static table
kColumns = 4                     # likewise, numbers of cores
kMicrosecondRows = (0, 1, 10, 100, 1000)
kCertainties = (kMeasured, kSimulated, kExtrapolated)
kTitle = "Which scheme to use"


def how_sure(found: Answer) -> str:
    """The certainty in words, never without what it is worth."""
    if found.certainty == kSimulated and not found.inside:
        return "simulated at another cost of a record, not validated"
    if found.certainty == kSimulated:
        return simulated.in_words(found.validated_to, found.place)
    return {kMeasured: "measured", kExtrapolated: "extrapolated, not measured"}[found.certainty]


def _mechanisms(setup: Setup) -> dict[str, str]:
    made = dict(zip(setup.rows["cache"], setup.rows["mechanism"]))
    if len(setup.simulated):
        made |= dict(zip(setup.simulated["cache"], setup.simulated["mechanism"]))
    return made


def _three(value: tuple) -> list:
    return [interactive.short(v) for v in value]


def _path(setup: Setup, made: Choice) -> dict[int, list]:
    """By threads: relMSE and seconds of path tracing, the cheapest first."""
    rows = setup.rows
    rows = rows[(rows["integrator"] == "path") & (rows["relmse"] > 0) & (rows["seconds_indirect"] > 0)
                & ~rows["oversubscribed"] & (rows["scene"].str.replace("_", " ") == made.scene)]
    found: dict[int, list] = {}
    errors = summarise(rows, ["threads", "workload"], "relmse")
    times = summarise(rows, ["threads", "workload"], "seconds_indirect")
    for one, other in zip(errors.to_dict("records"), times.to_dict("records")):
        found.setdefault(int(one["threads"]), []).append([interactive.short(one["median"]),
                                                          interactive.short(other["median"])])
    return {threads: sorted(pairs, key=lambda p: p[1]) for threads, pairs in found.items()}


def collected(setup: Setup, made: Choice) -> dict:
    """All answers as the script looks them up."""
    mechanisms = _mechanisms(setup)
    structures = dict(zip(setup.rows["cache"], setup.rows["structure"].str.replace("_", " ")))
    kinds: dict[str, int] = {}
    caches: dict[str, int] = {}
    sures: dict[str, int] = {}
    ways: dict[str, int] = {}
    answers: dict[str, list] = {}

    def number(known: dict[str, int], name: str) -> int:
        return known.setdefault(name, len(known))
    for i, x in enumerate(made.x):
        for threads in made.threads:
            for a in made.accuracies or [None]:
                plane = evidence(made, x, threads, a)
                key = f"{i} {threads}" + (f" {a:g}" if plane and plane[0].rendered else "")
                found = answer(made, mechanisms, x, threads, a) if plane and key not in answers else None
                if not found:
                    continue
                lines = [[number(kinds, one.kind), number(caches, one.cache), *_three(one.ratio), *_three(one.loss),
                          interactive.short(one.redundant), interactive.short(one.time)] for one in found.lines]
                answers[key] = [kCertainties.index(found.certainty), number(sures, how_sure(found)),
                                number(ways, found.how), found.repetitions, int(found.rendered), lines]
    errors = [[[e.accuracy, *_three(e.relmse), int(e.measured)] for e in errors_at(made, x)] if made.in_rays else []
              for x in made.x]
    threads, known = tails(setup)
    costs = [interactive.short(made.microseconds(x)) for x in made.x]
    return {"inRays": made.in_rays, "x": made.x, "microseconds": costs,
            "threads": made.threads, "accuracies": made.accuracies, "errors": errors, "answers": answers,
            "kinds": list(kinds), "caches": list(caches), "structures": [structures.get(c, "") for c in caches],
            "ways": list(ways), "scene": made.scene, "negligible": [kNegligible[c] for c in kCertainties],
            "simulated": kCertainties.index(kSimulated),
            "sures": list(sures), "few": kFewRepetitions,
            "machine": setup.label, "cores": setup.cores, "path": _path(setup, made),
            "tailThreads": threads, "tails": [interactive.short(known.get(c)) for c in caches]}


def _share(value: tuple) -> str:
    low, high = (round(v * 100) if math.isfinite(v) else None for v in value[1:])
    return f"{round(value[0] * 100)} %" + (f" [{low}, {high}]" if low is not None else "")


def _columns(made: Choice) -> list[int]:
    """At most kColumns of the numbers of cores: the most that was measured and the most of all are among them."""
    measured = [p.threads for p in made.planes if p.certainty == kMeasured]
    wanted = {made.threads[-1], max(measured, default=made.threads[0])}
    rest = [n for n in made.threads if n not in wanted]
    while rest and len(wanted) < kColumns:  # what lies farthest from all that is there
        best = max(rest, key=lambda n: min(abs(math.log(n / w)) for w in wanted))
        wanted.add(best)
        rest.remove(best)
    return sorted(wanted)


def _cell(made: Choice, found: Answer | None) -> str:
    if not found:
        return "<td>–</td>"
    first, tied = found.lines[0], found.tied
    also = f" ≈ {', '.join(dict.fromkeys(t.kind for t in tied))}" if tied else ""
    rest = [one for one in found.lines[1:] if one not in tied]
    words = []
    if math.isfinite(first.loss[0]):
        words.append(f"sharing loses {_share(first.loss)}")
    if rest:
        words.append(f"next, {rest[0].kind}: {style.interval(*rest[0].ratio, '×')}")
    return (f'<td class="sure-{found.certainty}"><b>{text(first.kind)}</b>{text(also)}'
            f'<span class="under wrap">{text(first.cache)}; {text("; ".join(words))}</span>'
            f'<span class="under wrap">{text(how_sure(found))}: {text(found.how)}</span></td>')


def static_table(setup: Setup, made: Choice) -> str:
    """The answers for round numbers, for print and for pages without scripts."""
    mechanisms, coarsest = _mechanisms(setup), made.accuracies[0] if made.accuracies else None
    counts = _columns(made)
    head = (f'<th>{"rays a record" if made.in_rays else "cost of a record"}</th>'
            + "".join(f"<th>{style.plural(n, 'core')}</th>" for n in counts))
    lines = []
    for x in kRows if made.in_rays else kMicrosecondRows:
        cost = made.microseconds(x)
        under = f'<span class="under">{style.number(cost)} µs a record</span>' if math.isfinite(cost) else ""
        name = f"{x:,}{under}" if made.in_rays else f"{x:,} µs"
        cells = "".join(_cell(made, answer(made, mechanisms, x, n, coarsest)) for n in counts)
        lines.append(f'<tr><td class="key">{name}</td>{cells}</tr>')
    return f'<div class="scroll">{table(head, lines, "wide choices")}</div>'


def error_table(made: Choice) -> str:
    """relMSE by rays and accuracy, as measured."""
    if made.errors.empty:
        return ""
    accuracies = sorted(made.errors["accuracy"].unique(), reverse=True)
    cells = {(r.rays_per_record, r.accuracy): style.interval(r.median, r.low, r.high)
             for r in made.errors.itertuples()}
    head = "<th>relMSE, rays a record</th>" + "".join(f'<th class="n">a = {a:g}</th>' for a in accuracies)
    lines = []
    for rays in sorted(made.errors["rays_per_record"].unique()):
        shown = "".join(f'<td class="n">{cells.get((rays, a), "–")}</td>' for a in accuracies)
        lines.append(f"<tr><td>{rays:,.0f}</td>{shown}</tr>")
    return table(head, lines)


def tolerable(made: Choice, rays: float) -> float:
    """The error to begin with: two digits, which the middle one of the accuracies keeps at so many rays."""
    found = errors_at(made, rays)
    median, _, high = found[len(found) // 2].relmse
    error = high if math.isfinite(high) else median
    if not error > 0:
        return 0.0
    digit = math.floor(math.log10(error)) - 1
    return float(f"{math.ceil(error / 10.0 ** digit)}e{digit}")


def _form(setup: Setup, made: Choice) -> str:
    first = 64 if made.in_rays else 10
    words = "Rays a record" if made.in_rays else "Cost of a record, µs"
    error = ""
    if made.in_rays and not made.errors.empty:
        error = ('<label>Tolerable error, relMSE <input name="error" type="number" min="0" step="any" '
                 f'value="{tolerable(made, first):g}" placeholder="any"></label>')
    cores = setup.cores if setup.cores in made.threads else made.threads[-1]
    return (f'<form class="question"><label>{words} <input name="x" type="number" min="0" step="any" value="{first}" '
            f'required></label><label>Cores <input name="cores" type="number" min="1" step="1" value="{cores}" '
            f'required></label>{error}</form><div class="answer" role="status" aria-live="polite"></div>')


def _trifle(certainty: str) -> str:
    return f"{(kNegligible[certainty] - 1) * 100:.0f}"


def section(setup: Setup, prefix: str) -> str:
    """The first page of one setup."""
    if cache_rows(setup).empty:
        return ""
    try:
        made = choice(setup)
    except Omitted as why:
        return note_line(f"which scheme to use cannot be said: {why}")
    identity = f"{prefix}choice-data"
    most = made.threads[-1]
    sources = ["measured on this machine"]
    if any(p.certainty == kSimulated and p.threads == most for p in made.planes):
        sources.append("simulated, as far validated as each answer says")
    elif most > max((p.threads for p in made.planes if p.certainty == kMeasured), default=0):
        sources.append("extrapolated by scaling laws")
    else:
        sources.append(f"nothing is known past {style.plural(most, 'core')}; icbench simulate tells more")
    notes = [*made.notes]
    if made.in_rays and math.isfinite(made.microseconds_a_ray[0]):
        notes.append(f"a ray of a record costs {style.interval(*made.microseconds_a_ray)} µs here, with what belongs "
                     f"to it ({made.scene}, {style.threads_text(min(p.threads for p in made.planes if p.rendered))})")
    coarse = f" At accuracy a = {made.accuracies[0]:g}." if made.accuracies else ""
    known = interactive.data(identity, collected(setup, made))
    return (f'<div class="choice" data-from="{identity}">{_form(setup, made)}</div>{known}'
            f'<details class="plain" open><summary>The answers for round numbers ({text("; ".join(sources))})</summary>'
            f'<p class="note">Bold: the access mechanism that took least time, by its fastest cache; ≈ what could not '
            f"be told from it by more than {_trifle(kMeasured)} % (where simulated, {_trifle(kSimulated)} %). × is "
            f"time over that of the fastest, with its 95 % interval. Sharing loses what one thread alone "
            f"would not have needed. A mechanism stands for its fastest cache, whatever its structure; what mechanisms "
            f"cost on one and the same structure, the figures tell.{coarse}</p>"
            f'{static_table(setup, made)}{error_table(made)}{"".join(map(note_line, notes))}</details>')
