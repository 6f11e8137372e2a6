"""The report's page on correctness, as HTML: what caches promise, what was found, what was not examined."""
from __future__ import annotations

import style
from correctness import bound_of, Caught, Correctness, cycle_of, kHeld, words
from tables import note_line, table, text

kTitle = "Are the caches correct?"
kHowToGet = ("No verdicts of <code>icstress</code> lie beside the results, so this page says nothing about "
             "correctness. <code>bench/run</code> makes them; or run <code>icstress --json "
             "correctness.json</code> and give that file by <code>--correctness</code>.")
kLead = """<p>Threads ran random operations on the caches that ship, and noted what each of them was told and
when. A program then decided, exactly, whether some order of the operations explains every answer. Caches that
are broken on purpose went the same way: a check that does not catch them would prove nothing.</p>"""
kConditions = {
    "integrity": "No record lost, doubled, torn, invented, or back after it was cleared.",
    "regular": "A query sees every record whose insert had returned before, and none inserted after it.",
    "per_record_linearizable": "Also: once a query has seen a record, no later query misses it.",
    "linearizable": "Also: every query sees all records as they were at one moment.",
    "frame": "A query sees its own thread's records, and those of others from the next frame on."}
kOlder = "The file has no section on this: it was written by an icstress that did not examine it."


def _card(title: str, value: str, said: str, grave: bool = False) -> str:
    return (f'<div class="card{" grave" if grave else ""}"><div class="what">{text(title)}</div>'
            f'<div class="value">{text(value)}</div><div>{text(said)}</div></div>')


def alarm(c: Correctness) -> str:
    """What must not be overlooked: broken promises, and a stress too weak to find any; "" if neither."""
    broken, weak = c.broken_promises(), c.weaknesses()
    made = ""
    if broken:
        made += f'<div class="banner">Broken promise: {text("; ".join(broken))}.</div>'
    if weak:
        made += (f'<div class="banner">The stress was too weak: {text("; ".join(weak))}. What held may have '
                 "held for that reason.</div>")
    return made


def _cards(c: Correctness) -> str:
    promised = [cell for cell in c.cells if cell.promised]
    kept = sum(cell.state == kHeld for cell in promised)
    judged = {entry["cache"]: entry for entry in c.checks}.values()
    operations, pairs = (sum(int(e[key]) for e in judged) for key in ("operations", "concurrent_pairs"))
    made = _card("Promises kept", f"{kept} of {len(promised)}",
                 f"conditions promised by {style.plural(len(c.caches), 'cache')}, none of them seen violated"
                 if kept == len(promised) else "conditions promised; the others were BROKEN, see the banner",
                 kept != len(promised))
    made += _card("Operations judged", f"{operations:,}",
                  f"with {pairs:,} overlapping pairs of a query and an insert that concerned it, which is "
                  "where races show")
    broken = c.broken_caches
    if broken:
        caught = sum(b.is_caught for b in broken)
        by_schedule = sum(bool(b.explored and b.explored["caught"]) for b in broken)
        said = "caches broken on purpose"
        if c.explored_controls is not None:
            said += f"; {by_schedule} of them by a schedule that can be replayed"
        if excused := [b.control for b in broken if not b.is_caught and b.is_excused]:
            said += f"; this processor cannot show {', '.join(excused)}"
        made += _card("Broken caches caught", f"{caught} of {len(broken)}", said, bool(c.weaknesses()))
    if c.schedules:
        made += _card("Schedules examined", f"{_schedules(c.schedules):,}",
                      "interleavings of small scenarios, one by one, with the stale reads that the memory "
                      "model allows")
    if c.progress:
        free = [p for p in c.progress if p["declared"] == "wait_free"]
        good = sum(p["verdict"] != "violated" for p in free)
        made += _card("Wait-free operations", f"{good} of {len(free)}",
                      "stayed within their documented number of steps, and were not hindered by a thread "
                      "that stopped for ever", good != len(free))
    return f'<div class="cards">{made}</div>'


def _conditions(c: Correctness) -> str:
    lines = [f"<tr><td><b>{text(words(name))}</b></td><td>{text(kConditions.get(name, ''))}</td></tr>"
             for name in c.conditions]
    return table("<th>condition</th><th>in words</th>", lines)


def _witness(c: Correctness) -> str:
    found = cycle_of(c)
    if not found:
        return "<p>No violation was found that would make an example.</p>"
    cache, witness, steps = found
    items = []
    for i, step in enumerate(steps):
        end = "and never returned" if step.end is None else f"returned at {step.end:,}"
        after = f"operation {i + 2}" if i + 1 < len(steps) else "operation 1"
        reason = step.reason.replace("the next", after).replace("the first", after)
        items.append(f"<li>Thread {step.thread}: {text(step.what)}; called at {step.begin:,}, {end}. It "
                     f"{text(reason)}, so it comes before {after}.</li>")
    why = ", which does not promise that a query is an atomic snapshot" if cache == "wait_free" else ""
    return (f'<p>In words, for <code>{text(cache)}</code>{why}:</p><ol>{"".join(items)}</ol>'
            "<p>Each would have to come before the next, and the last before the first: no order explains "
            f"the answers. As icstress printed it:</p><pre>{text(witness)}</pre>")


def _histories(c: Correctness) -> str:
    lines = []
    for cache in c.caches:
        mine = [entry for entry in c.checks if entry["cache"] == cache]
        if not mine:
            continue
        promised = [entry["check"] for entry in mine if entry["promised"]]
        broken = [e for e in mine if e["promised"] and e["verdict"] == "violated"]
        beyond = [e for e in mine if not e["promised"] and e["verdict"] == "violated"]
        found = "".join(f'<b class="alarm">BROKEN: {_violations(e)}</b><br>' for e in broken)
        found += "; ".join(map(_violations, beyond)) or ("" if broken else "–")
        strongest = words(promised[-1]) if promised else "nothing"
        lines.append(f'<tr><td>{text(cache)}</td><td>{text(strongest)}</td>'
                     f'<td class="n">{int(mine[0]["operations"]):,}</td>'
                     f'<td class="n">{int(mine[0]["concurrent_pairs"]):,}</td><td>{found}</td></tr>')
    alone = [cache for cache in dict.fromkeys(e["cache"] for e in c.checks)
             if all(not e["concurrent_pairs"] for e in c.checks if e["cache"] == cache)]
    head = ('<th>cache</th><th>strictest promise</th><th class="n">operations</th>'
            '<th class="n">overlapping pairs</th><th>violations (no promise unless BROKEN)</th>')
    note = (f"without an overlapping pair, so nothing concurrent was tested: {', '.join(alone)}" if alone
            else "")
    return ("<h3>Histories: long and random</h3>" + table(head, lines) + note_line(note)
            + note_line("violations are counted in faulty records (integrity), in pairs of a query and a "
                        "record, or in stretches between two barriers (linearizable)")
            + _broken_witnesses(c))


def _violations(entry: dict) -> str:
    return f'{text(words(entry["check"]))} {int(entry["violations"]):,}'


def _broken_witnesses(c: Correctness) -> str:
    made = ""
    for kind, entries in (("a history", c.checks), ("a schedule", c.schedules or [])):
        for entry in entries:
            if entry["promised"] and entry["verdict"] == "violated":
                replay = f", replay {entry['replay']}" if entry.get("replay") else ""
                made += (f'<p class="alarm">{text(entry["cache"])} broke {text(words(entry["check"]))} in '
                         f"{kind}{text(replay)}:</p><pre>{text(entry['witness'] or 'no witness')}</pre>")
    return made


def _schedules(entries: list[dict]) -> int:
    """Schedules run: one exploration may be judged by several checks."""
    runs: dict[tuple, int] = {}
    for e in entries:
        key = (e["cache"], e["scenario"], e["threads"], e["preemptions"], str(e.get("stamps")))
        runs[key] = max(runs.get(key, 0), int(e["schedules"]))
    return sum(runs.values())


def _how_far(entries: list[dict]) -> str:
    """"2 scenarios: every interleaving; 1 scenario: up to 3 preemptions"."""
    reach: dict[str, set] = {}
    for e in entries:
        said = ("cut short" if not e["complete"] else "every interleaving" if e["preemptions"] is None
                else f"all interleavings with up to {style.plural(int(e['preemptions']), 'preemption')}")
        reach.setdefault(said, set()).add((e["scenario"], e["threads"]))
    return "; ".join(f"{style.plural(len(names), 'scenario')}: {said}" for said, names in reach.items())


def _explored(c: Correctness) -> str:
    head = "<h3>Schedules: short and exhaustive</h3>"
    if c.schedules is None:
        return head + note_line(kOlder.rstrip("."))
    lines = []
    for cache in dict.fromkeys(e["cache"] for e in c.schedules):
        mine = [e for e in c.schedules if e["cache"] == cache]
        bad = [e for e in mine if e["verdict"] == "violated"]
        found = []
        for check in dict.fromkeys(e["check"] for e in bad):
            entry = next(e for e in bad if e["check"] == check)
            replay = f', <code>{text(entry["replay"])}</code>' if entry["replay"] else ""
            found.append(f'<b class="alarm">BROKEN: {text(words(check))}{replay}</b>' if entry["promised"]
                         else f"{text(words(check))} (not promised{replay})")
        lines.append(f'<tr><td>{text(cache)}</td><td class="n">{_schedules(mine):,}</td>'
                     f'<td>{text(_how_far(mine))}</td>'
                     f'<td>{text(", ".join(words(k) for k in dict.fromkeys(e["check"] for e in mine)))}</td>'
                     f'<td>{"<br>".join(found) or "–"}</td></tr>')
    return (head + "<p>Two or three threads with a few operations each, on the code that ships, driven "
            "through their interleavings step by step. A violation found here happens every time its schedule is "
            "replayed.</p>"
            + table('<th>cache</th><th class="n">schedules</th><th>how far</th><th>judged by</th>'
                    "<th>violated, with the schedule to replay</th>", lines))


def _controls(c: Correctness) -> str:
    lines = [f"<tr><td>{text(b.control)}<span class=\"under\">{text(b.fault)}</span></td>"
             f"<td>{_by_histories(b)}</td><td>{_by_schedules(b, c)}</td></tr>" for b in c.broken_caches]
    if not lines:
        return "<h3>Caches broken on purpose</h3>" + note_line("none were run")
    notes = "".join(note_line(f"the correct cache {o['control']}, held to {words(o['check'])}, which it does "
                              f"not promise, was seen violating it {_seen_how(o)}") for o in c.overstated)
    return ("<h3>Caches broken on purpose</h3><p>Each has one fault; the checks have to find it.</p>"
            + table("<th>broken cache and its fault</th><th>caught by histories</th>"
                    "<th>caught by a schedule</th>", lines) + notes)


def _seen_how(control: dict) -> str:
    if "rounds" in control:
        return f"in {_rounds(control)}"
    tried = style.plural(int(control["schedules"]), "schedule")
    return f"after {tried} (replay {control['replay']})" if control["caught"] else f"in none of {tried}"


def _rounds(control: dict) -> str:
    return f"{int(control['rounds_violated'])} of {style.plural(int(control['rounds']), 'round')}"


def _by_histories(b: Caught) -> str:
    h = b.histories
    if h is None:
        return "–"
    rounds = _rounds(h)
    if h["seen"]:
        return f'{text(words(h["check"]))}<span class="under">in {text(rounds)}</span>'
    if not h["required"]:
        return 'no<span class="under">needs a processor that reorders stores, or a schedule</span>'
    return (f'<b class="alarm">NOT CAUGHT</b><span class="under">{text(words(h["check"]))}, {text(rounds)}'
            "</span>")


def _by_schedules(b: Caught, c: Correctness) -> str:
    e = b.explored
    if e is None:
        if c.explored_controls is None:
            return "not examined"
        return 'not explored<span class="under">no scenario does what its fault takes</span>'
    tried = style.plural(int(e["schedules"]), "schedule")
    if e["caught"]:
        replay = f', replay <code>{text(e["replay"])}</code>' if e["replay"] else ""
        return f'{text(words(e["check"]))}<span class="under">after {text(tried)}{replay}</span>'
    kind = "no" if b.is_caught else '<b class="alarm">NOT CAUGHT</b>'
    return f'{kind}<span class="under">in {text(tried)}</span>'


def _progress(c: Correctness, drawn: str) -> str:
    head = "<h3>Progress: can a thread be held up by others?</h3>"
    if c.progress is None:
        return head + note_line(kOlder.rstrip("."))
    lines = []
    for p in c.progress:
        steps, said = bound_of(p)
        bound = "–" if steps is None else f"{steps:,.6g}"
        blocked = f'{int(p["blocked_positions"]):,} of {int(p["positions"]):,}' if p["positions"] else "–"
        remark = text("; ".join(part for part in (p["note"], said and f"bound: {said}") if part))
        if p["verdict"] == "violated":
            remark = f'<b class="alarm">BROKEN</b> {remark}'
        lines.append(f'<tr><td>{text(p["cache"])}</td><td>{text(p["operation"])}</td>'
                     f'<td>{text(words(p["declared"]))}</td><td class="n">{int(p["most_steps"]):,}</td>'
                     f'<td class="n">{bound}</td><td class="n">{blocked}</td><td>{remark}</td></tr>')
    return (head + "<p>Atomic steps were counted while others interfered, and a thread was stopped for ever "
            "after each of its steps in turn. A cache with locks is held up then, as it declares: that is "
            "reported, no fault.</p>" + drawn
            + table('<th>cache</th><th>operation</th><th>declared</th><th class="n">most steps</th>'
                    '<th class="n">bound</th><th class="n">stops that held others up</th><th>remark</th>',
                    lines) + _progress_controls(c))


def _progress_controls(c: Correctness) -> str:
    if not c.progress_controls:
        return ""
    lines = []
    for p in c.progress_controls:
        seen = text(p["note"]) if p["seen"] else '<b class="alarm">NOT SEEN</b>'
        lines.append(f'<tr><td>{text(p["control"])}<br><span class="note">{text(p["fault"])}</span></td>'
                     f'<td>{text(p["operation"])} must {text(p["must"])}</td><td>{seen}</td></tr>')
    return ("<p>These small lists had to be seen through, or the check would prove nothing.</p>"
            + table("<th>list and its fault</th><th>expected</th><th>what was seen</th>", lines))


def _not_examined(c: Correctness) -> str:
    items = ["A history that holds is evidence from the operations that were run on this machine, no proof. "
             "Only schedules that were run through to the end leave nothing out, and they are short."]
    missing = [what for what, entries in (("interleavings one by one", c.schedules),
                                          ("broken caches by schedule", c.explored_controls),
                                          ("step bounds and stopped threads", c.progress)) if entries is None]
    if missing:
        items.append(f"By the run that wrote this file: {', '.join(missing)}.")
    excused = [b.control for b in c.broken_caches if not b.is_caught and b.is_excused]
    if excused:
        items.append(f"The fault of {', '.join(excused)}: this processor does not show it, and no schedule "
                     "was tried.")
    items += c.not_examined or []
    made = "".join(f"<li>{text(item)}</li>" for item in items)
    said = "" if c.not_examined is not None else note_line("the file does not list what icstress left out")
    return f"<h3>What was not examined</h3><ul>{made}</ul>{said}"


def section(c: Correctness, prefix: str, figures: dict[str, str], left_out: list[str]) -> str:
    """The page. `figures`: HTML of those that were drawn, by name."""
    seeds = dict.fromkeys(str(entry["seed"]) for entry in c.checks if "seed" in entry)
    again = f" Seed{'s' if len(seeds) > 1 else ''}: {', '.join(seeds)}." if seeds else ""
    return (f'<h2 id="{prefix}">{kTitle}</h2>{alarm(c)}{kLead}{_cards(c)}{figures.get("promises", "")}'
            f'{_conditions(c)}{figures.get("witness", "")}{_witness(c)}{_histories(c)}{_explored(c)}'
            f'{_controls(c)}{_progress(c, figures.get("steps", ""))}{_not_examined(c)}'
            f'{"".join(map(note_line, left_out))}'
            f'<p class="note">From <code>{text(c.label)}</code>.{text(again)} How verdicts are reached, and '
            "why that is sound: <code>stress/README.md</code>.</p>")


def absent() -> str:
    """The section where there is no file of icstress."""
    return f'<h2 class="flow" id="correctness">{kTitle}</h2><p>{kHowToGet}</p>'
