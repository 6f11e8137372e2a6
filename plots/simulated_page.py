"""The report's part on what was simulated: what it is from, how far it was validated, and how far it was off."""
from __future__ import annotations

import style  # first: it checks what is installed

import numpy as np
import pandas as pd

from results import workload_label, workload_order
from simulated import Simulated
from tables import note_line, table, text

kTitle = "Simulated: what more cores would do"
kLead = ("<p>No line drawn in this part was measured, and no other figure or table of this page takes any of it; "
         "the first question's answers do past the machine's cores, and then say so. <code>icbench simulate</code> "
         "carries out the caches' operations in virtual time on cores that are not there.</p>")


def _points(one: Simulated) -> pd.DataFrame:
    """Those that `icbench simulate --validate` measured, too."""
    return one.rows[(one.rows["measured_items_per_second"] > 0) & np.isfinite(one.rows["error_items_per_second"])]


def _validated(one: Simulated) -> str:
    """To how many threads, and what of it: "validated to 2 threads on this machine"."""
    cells = one.rows.groupby(["workload", "cache"])["validated_to_threads"].min().fillna(0)
    known = cells[cells > 0]
    if known.empty and len(_points(one)):
        return "not validated; how far they are from measured ones stands below"
    if known.empty:
        return "not validated: nobody has found such figures near measured ones"
    said = f"validated to {style.threads_text(int(known.min()))} on {one.place}"
    if len(known) < len(cells):
        return f"{said}, but {len(cells) - len(known)} of {len(cells)} pairs of cache and workload not at all"
    validation = one.calibration.get("validation")
    if isinstance(validation, dict) and isinstance(validation.get("throughput_error"), (int, float)):
        said += f", where throughput was off by {style.number(100 * validation['throughput_error'])} % in the median"
        if isinstance(validation.get("file_error"), (int, float)):
            said += f" ({style.number(100 * validation['file_error'])} % by the costs that these figures have)"
    return said


def about(one: Simulated) -> str:
    """What one file is."""
    calibration = one.calibration
    source = calibration.get("file") or one.rows.get("calibration", [None])[0]
    costs = f" <code>{text(source)}</code>" if source else ", a file that these results do not name"
    when = f", {text(str(calibration['date'])[:10])}" if calibration.get("date") else ""
    cut = " <b>Incomplete:</b> the run was cut short." if one.context.get("complete") is False else ""
    return (f"<p>From <code>{text(one.path.name)}</code>, up to "
            f"{style.plural(int(one.rows['threads'].max()), 'virtual core')}; <b>{text(_validated(one))}</b>. Costs "
            f"are those of the calibration{costs} (measured on {text(one.host)}{when}).{cut}</p>")


def compared(one: Simulated) -> str:
    """Simulated against measured throughput where both are known; "" elsewhere."""
    rows = _points(one)
    if rows.empty:
        return ""
    lines = []
    for workload in workload_order(rows):
        mine = rows[rows["workload"] == workload]
        for cache in style.cache_order(mine["cache"]):
            for line in mine[mine["cache"] == cache].sort_values("threads").to_dict("records"):
                numbers = (f"{line['threads']:.0f}", style.number(1e-6 * line["measured_items_per_second"]),
                           style.number(1e-6 * line["items_per_second"]),
                           style.number(100 * line["error_items_per_second"]))
                lines.append(f"<tr><td>{text(cache)}</td><td>{text(workload_label(workload))}</td>"
                             + "".join(f'<td class="n">{n}</td>' for n in numbers) + "</tr>")
    head = ('<th>cache</th><th>workload</th><th class="n">threads</th><th class="n">measured, M operations/s</th>'
            '<th class="n">simulated, M operations/s</th><th class="n">off by, %</th>')
    note = ("Medians; off by: the median of the rounds' ratios, which need not be the ratio of the two medians. One "
            "thread's costs are what the simulation starts from, so that to be near there proves nothing")
    several = rows.loc[rows["threads"] > 1, "error_items_per_second"]
    if len(several):
        note = (f"With several threads off by {style.number(100 * several.median())} % in the median of "
                f"{style.plural(len(several), 'point')}, and by {style.number(100 * several.max())} % at most. {note}")
    rounds = rows["rounds"].dropna()
    if len(rounds):
        note = f"{style.plural(int(rounds.min()), 'round')}, each simulated with the costs of that moment. {note}"
    return f"<h3>Simulated against measured</h3>{table(head, lines)}{note_line(note)}"
