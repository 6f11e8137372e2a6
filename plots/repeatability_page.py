"""The report's part on the error that threads add: how large it is beside the error that is there anyway."""
from __future__ import annotations

import style  # first: it checks what is installed

import numpy as np
import pandas as pd

from pareto_results import Measured
from repeatability_results import about, groups, points
from tables import interval, note_line, table, text

kTitle = "The error that threads add"
kLead = ("<p>Which thread asks first decides where the records of a shared cache lie. So pictures of one seed are not "
         "the same once several threads make them: none is wrong, each is one of many that the same seed may give. "
         "Below stands how far they lie apart, as root-mean-square differences of the indirect light at identical "
         "primary hits, and beside it how far they are from path tracing anyway. One thread always makes the same "
         "picture.</p>")
kShown = {"rms_to_single": "from one thread's", "rms_to_last_run": "run to run",
          "rms_to_fewer_threads": "from fewer threads'"}


def _most(part: pd.DataFrame, kind: str) -> str:
    """The largest share, and whose it is."""
    line = part.loc[part[kind].idxmax()]
    return f"{style.number(100 * line[kind])} % ({line['cache'].replace('_', ' ')})"


def sentence(name: str, part: pd.DataFrame) -> str:
    """The largest differences at the largest number of threads, in words."""
    shared = part[part["threads"] > 1]
    if shared.empty:
        return f"<p><b>{text(style.capital(name))}: measured with one thread only.</b></p>"
    threads = shared["threads"].max()
    most = shared[(shared["threads"] == threads) & (shared["rms_to_single"] > 0)]
    if most.empty:
        return (f"<p><b>{text(style.capital(name))}: with {style.threads_text(threads)} no picture differs from "
                "that of one thread.</b></p>")
    if not (most.get("rms_to_single_share_of_mean", pd.Series(dtype=float)) >= 0).any():
        return ""
    shares = most["rms_to_single_share_of_mean"]
    said = (f"{style.capital(name)}: with {style.threads_text(threads)} a picture differs from that of one thread by "
            f"{style.number(100 * shares.min())} to {_most(most, 'rms_to_single_share_of_mean')} of its mean")
    if most.get("rms_to_single_share_of_error", pd.Series(dtype=float)).max() > 0:
        said += f", by at most {_most(most, 'rms_to_single_share_of_error')} of its own error"
    return f"<p><b>{text(said)}.</b></p>"


def _shares(line: pd.Series, kind: str) -> str:
    """A difference as a share of the mean, and below it of the error."""
    if kind not in line or not np.isfinite(line[kind]):
        return '<td class="n">–</td>'
    of_mean = "0"
    if line[kind] > 0:
        of_mean = interval(*(line[f"{kind}_share_of_mean{end}"] for end in ("", "_low", "_high")), scale=100)
    of_error = line.get(f"{kind}_share_of_error", np.nan)
    under = f'<span class="under">{style.number(100 * of_error)} % of the error</span>' if of_error > 0 else ""
    return f'<td class="n">{of_mean}&nbsp;%{under}</td>'


def numbers(part: pd.DataFrame) -> str:
    """A line for every cache on every number of threads."""
    shown = [kind for kind in kShown if kind in part and f"{kind}_share_of_mean" in part]
    has = [n for n in ("records_made", "redundant_records") if n in part]
    head = ("<th>cache</th><th class=\"n\">threads</th>"
            + "".join(f'<th class="n">{kShown[kind]}</th>' for kind in shown)
            + "".join(f'<th class="n">{text(n.replace("_", " "))}</th>' for n in has)
            + '<th class="n">seconds</th>')
    lines = []
    for cache in style.cache_order(part["cache"]):
        for _, line in part[part["cache"] == cache].sort_values("threads").iterrows():
            alone = '<span class="under">serves one thread</span>' if line.get("single_thread") is True else ""
            cells = [f'<td>{text(cache.replace("_", " "))}{alone}</td>', f'<td class="n">{line["threads"]}</td>']
            cells += [_shares(line, kind) for kind in shown]
            cells += [f'<td class="n">{line[n]:,.0f}</td>' if np.isfinite(line[n]) else '<td class="n">–</td>'
                      for n in has]
            cells.append(f'<td class="n">{style.number(line["seconds_indirect"])}</td>')
            lines.append(f"<tr>{''.join(cells)}</tr>")
    return table(head, lines, "wide")


def _legend(part: pd.DataFrame) -> str:
    own, mean = part["error"].median(), part["mean"].median()
    said = (f"Medians over {style.plural(int(part['n'].max()), 'run')} of one seed. Differences are in percent of the "
            f"picture's mean, {style.number(mean)} W/(m² sr). The error of the pictures, against path tracing at the "
            f"same hits, is {style.number(own)} W/(m² sr) or {style.number(100 * own / mean)} % of it")
    if "reference_rmse" in part:
        floor = part["reference_rmse"].median()
        said += f"; the reference's own, already taken off, is {style.number(floor)} W/(m² sr)"
        if floor > own:
            said += ", which is more, so that shares of the error are rough"
    said += (". From run to run is on as many threads, and sqrt(2) times the deviation of one run; from fewer threads' "
             "is from the same run on the next smaller number. Redundant records are those made beyond the records of "
             "one thread through the same cache, below 0 if fewer were made. Seconds are those of the indirect light")
    return said


def section(measured: Measured, anchor: str, figure: str) -> str:
    """The page. `figure`: HTML of the figure."""
    everything = groups(points(measured))
    made = f'<h2 id="{anchor}">{text(kTitle)}</h2>{kLead}'
    if not measured.complete:
        made += '<div class="banner">Incomplete: this part shows what was measured until the run was cut short.</div>'
    made += "".join(sentence(name, part) for name, part in everything) + figure
    for name, part in everything:
        made += f"<h3>{text(name)}</h3>{note_line(about(part))}{numbers(part)}{note_line(_legend(part))}"
    names = ", ".join(path.name for path in measured.paths)
    return made + f'<p class="note">From <code>{text(names)}</code>, measured on {text(measured.label)}.</p>'
