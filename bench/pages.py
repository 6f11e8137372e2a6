"""What the pages show of the claims (bench/claims.json): all tables of ARTIFACT.md, and those of bench/MEASURED.md that
a comment `<!-- table NAME -->` stands above. `bench/artifact --write` brings both up to date.
"""
from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import claims

kArtifact = claims.kRoot / "ARTIFACT.md"
kMeasured = claims.kRoot / "bench/MEASURED.md"

Rows = dict[str, tuple[str, str]]  # target and meaning of each row of bench/targets, by name

# Above a figure of another machine than the column's.
kMarks = {"EPYC": "ᴱ", "Xeon": "ˣ", "EPYC 25": "²⁵", "Genoa": "ᴳ", "Xeon 167": "¹⁶⁷"}
kScenes = {"cornell_box": "Cornell box", "wobble": "Wobble", "desk": "Desk", "bunnies_1": "Bunnies 1",
           "bunnies_2": "Bunnies 2", "bunnies_4": "Bunnies 4", "bunnies_9": "Bunnies 9", "conference": "Conference",
           "sibenik": "Sibenik", "cornell_specular": "Cornell specular", "cornell_indirect": "Cornell indirect",
           "office": "Office"}
# How rows' names end, by number of records and where queries go.
kSizes = {"10^5 records": "", "10^5, image": "_coherent",
          "10^6 records": "_million", "10^6, image": "_million_coherent"}
kSizeInWords = r"; 10\^5 records, random points, 1 thread| with 10\^5 of them|10\^5 (?=records into)"
kSizesOfInserts = {"10^5 records": "_100000", "10^6 records": "_1000000"}


def line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def grid(head: Sequence[str], body: Sequence[Sequence[str]]) -> list[str]:
    return [line(head), "|" + "---|" * len(head), *map(line, body)]


def with_note(told: dict) -> str:
    return told["claimed"] + (f" ({told['note']})" if "note" in told else "")


def verdict_of(told: dict) -> str:
    return {"fail": "**fail**"}.get(told["verdict"], told["verdict"])


def shown(told: dict | None) -> str:
    """A figure and its verdict."""
    return f"{with_note(told)}, {verdict_of(told)}" if told else ""


class Claims:
    """The claims of rows, by name."""

    def __init__(self, rows: Rows):
        self.rows = rows
        self.machines, self.sections = claims.load_claims()
        self.by_row = {c["row"]: c for _, section in self.sections for c in section if "row" in c}

    def figures(self, row: str) -> dict[str, dict]:
        """By machine, the usual one first; none where the row is no claim."""
        found = claims.figures_of(self.by_row[row], self.machines) if row in self.by_row else {}
        return {machine: found[machine] for machine in self.machines if machine in found}

    def own(self, row: str) -> tuple[str, dict]:
        """The machine that is the claim's own, and its figure there."""
        return next(iter(claims.figures_of(self.by_row[row], self.machines).items()))


# --- bench/MEASURED.md ------------------------------------------------------------------------------------------------

def by_machine(names: Sequence[str], machines: Sequence[str]) -> Callable[[Claims], list[str]]:
    """A row of bench/targets a line, a machine a column."""
    def table(told: Claims) -> list[str]:
        return grid(["row", "what", "target", *machines],
                    [[f"`{name}`", told.rows[name][1], told.rows[name][0],
                      *(shown(told.figures(name).get(machine)) for machine in machines)] for name in names])
    return table


def by_size(names: Sequence[str], machines: Sequence[str]) -> Callable[[Claims], list[str]]:
    """Rows whose names differ by their end alone; a line for their targets, and one a machine. Sizes without any figure
    are left out.
    """
    def table(told: Claims) -> list[str]:
        rows_of = {}  # name: {size: row}
        for name in names:
            ends = kSizes if name in told.rows else kSizesOfInserts
            rows_of[name] = {size: f"{name}{end}" for size, end in ends.items()}
        sizes = [size for size in kSizes if any(set(told.figures(of.get(size, ""))) & set(machines)
                                                for of in rows_of.values())]
        body = []
        for name, row_of in rows_of.items():
            _, what = told.rows[next(iter(row_of.values()))]
            what = re.sub(kSizeInWords, "", what)
            body.append([f"`{name}`: {what}", "", *(told.rows.get(row_of.get(size), [""])[0] for size in sizes)])
            for machine in machines:
                cells = [shown(told.figures(row_of.get(size, "")).get(machine)) for size in sizes]
                if any(cells):
                    body.append(["", machine, *cells])
        return grid(["row, target", "", *sizes], body)
    return table


def by_scene(columns: Sequence[tuple[str, str, str]], lights: bool = False) -> Callable[[Claims], list[str]]:
    """A scene a line, figures of the claims' own machines.

    Columns are a heading, how rows' names begin, and the machine whose figures have no mark. `lights`: with the scene's
    number of virtual lights.
    """
    def lights_of(told: Claims, scene: str) -> str:
        return f"{int(re.search(r'([0-9]+) virtual lights', told.rows[f'tic_visible_{scene}'][1])[1]):,}"

    def cell(told: Claims, row: str, usual: str, one_target: bool) -> str:
        if row not in told.rows:
            return "no row"
        if row not in told.by_row:
            return "not measured"
        machine, figure = told.own(row)
        mark = "" if machine == usual else f" {kMarks[machine]}"
        target = "" if one_target else f"; {told.rows[row][0]}"
        verdict = "" if figure["verdict"] == "pass" else f", {verdict_of(figure)}"
        return f"{with_note(figure)}{mark}{target}{verdict}"

    def table(told: Claims) -> list[str]:
        targets = [{told.rows[f"{begin}_{scene}"][0] for scene in kScenes if f"{begin}_{scene}" in told.rows}
                   for _, begin, _ in columns]
        lines = [
            ["", "VPLs", *(heading for heading, _, _ in columns)],
            ["row", "", *(f"`{begin}_...`" for _, begin, _ in columns)],
            ["machine", "", *(usual for _, _, usual in columns)],
            ["target", "", *(next(iter(each)) if len(each) == 1 else "its own" for each in targets)],
            *([name, lights_of(told, scene), *(cell(told, f"{begin}_{scene}", usual, len(each) == 1)
                                               for (_, begin, usual), each in zip(columns, targets))]
              for scene, name in kScenes.items())]
        if not lights:
            lines = [[first, *rest] for first, _, *rest in lines]
        return grid(lines[0], lines[1:])
    return table


kTables = {
    "caches": by_machine(
        ["wait_free_query_over_twin", "wait_free_read_only_scaling", "wait_free_over_global_mutex",
         "snapshot_query_over_wait_free", "snapshot_mix_over_wait_free", "snapshot_latency_1000",
         "snapshot_latency_10000", "snapshot_latency_100000", "snapshot_latency_1000000", "checker_speed"],
        ["EPYC", "Xeon"]),
    "packed": by_size(
        ["packed_query_speed", "packed_query_bound", "packed_live_over_frozen", "packed_query_replicated",
         "packed_simd_speed", "packed_simd_kernels", "packed_batch_speed", "packed_query_over_twin",
         "packed_snapshot_query", "packed_query_tbb_hash_grid", "packed_query_append_log", "packed_insert_over_ward",
         "packed_memory", "packed_memory_resident"], ["Xeon", "Xeon 167"]),
    "packed_earlier": by_size(
        ["packed_query_speed", "packed_query_bound", "packed_live_over_frozen", "packed_query_replicated",
         "packed_simd_speed", "packed_simd_kernels", "packed_batch_speed", "packed_query_over_twin",
         "packed_snapshot_query", "packed_query_tbb_hash_grid", "packed_insert_over_ward", "packed_memory"],
        ["EPYC", "EPYC 25", "Genoa"]),
    "packed_tidied": by_size(
        ["packed_tidied_live_over_frozen", "packed_tidied_query_speed", "packed_tidied_query_replicated",
         "packed_tidied_simd_speed", "packed_tidied_gain", "packed_tidy_over_insert"], ["Xeon", "Xeon 167"]),
    "packed_sharing": by_machine(
        ["packed_insert_latency", "packed_snapshot_mix", "packed_oversubscribed_throughput",
         "packed_oversubscribed_slowest", "packed_oversubscribed_spread", "packed_frame_share",
         "packed_read_only_scaling", "packed_over_global_mutex", "packed_over_global_spin", "packed_over_shared_mutex",
         "packed_over_queuing_mutex", "packed_over_spin_rw_mutex", "packed_over_distributed_rw",
         "packed_over_node_lock", "packed_over_tbb_hash_grid", "packed_over_append_log"],
        ["Xeon", "EPYC", "EPYC 25", "Genoa"]),
    "temporal": by_scene(
        [("IGI / TIC", "igi_over_tic", "Xeon"), ("interleaved IGI / TIC", "interleaved_over_tic", "Xeon"),
         ("IC / TIC", "ic_over_tic", "Xeon"), ("visible pixels, percent", "tic_visible", "Xeon")], lights=True),
    "rays": by_machine(["gather_over_bare_rays", "vpl_gather_over_bare_rays"],
                       ["EPYC", "Xeon", "EPYC 25", "Genoa", "Xeon 167"]),
    "pictures": by_scene(
        [("mean, by gradients", "mean_off", "EPYC"),
         ("mean, by the occlusion Hessian", "mean_off_ellipses", "Xeon 167"),
         ("records at equal error", "records", "Xeon 167"),
         ("error in the time of 16 paths", "error_at_16_paths", "Xeon 167"),
         ("in that of 64", "error_at_64_paths", "Xeon 167")]),
    "light": by_machine(["cached_mean_at_least", "cached_mean_at_most", "furnace_at_least", "furnace_at_most",
                         "block_error"], ["EPYC"]),
    "deterministic": by_scene(
        [("irradiance_cache, 256 rays", "deterministic", "EPYC"),
         ("instant_caching, 1,024 VPLs", "deterministic_ic", "EPYC"),
         ("irradiance_cache, occlusion Hessian, 16 samples a pixel", "deterministic_ellipses", "Xeon 167"),
         ("the same, one sample", "deterministic_ellipses_once", "Xeon 167")]),
}


def measured(text: str, rows: Rows) -> str:
    """bench/MEASURED.md with the figures of the claims."""
    told = Claims(rows)

    def table(there: re.Match) -> str:
        if there[1] not in kTables:
            raise claims.Refused(f"{kMeasured.name}: no table '{there[1]}'; there are {', '.join(kTables)}")
        return "\n".join([f"<!-- table {there[1]} -->", "", *kTables[there[1]](told), "", ""])

    return re.sub(r"<!-- table (.*?) -->\n+(?:\|.*\n)*\n*", table, text)


# --- ARTIFACT.md ------------------------------------------------------------------------------------------------------

def misses(told: Claims) -> list[str]:
    """The rows that pass not everywhere, with the machines on which they miss or stay undecided."""
    short = []
    for row in told.by_row:
        on = {verdict: [machine + (f" ({figure['note']})" if "note" in figure else "")
                        for machine, figure in told.figures(row).items() if figure["verdict"] == verdict]
              for verdict in ("fail", "undecided", "pass")}
        if on["fail"] or on["undecided"]:
            short.append([f"`{row}`", told.rows[row][0], *(", ".join(names) for names in on.values())])
    return ["### Which figures are not reached", "",
            f"Of {len(told.by_row)} rows {len(told.by_row) - len(short)} reach their targets on every machine on which "
            f"they were measured, and {len(short)} do not:", "",
            *grid(["row", "target", "fails on", "undecided on", "passes on"], short), ""]


def time_of(claim: dict) -> str:
    seconds = claim.get("seconds")
    fewer = f" (`--samples {claim['samples']}`)" if "samples" in claim else ""
    if seconds is None:
        return "not timed" + fewer
    return (f"{seconds} s" if seconds < 120 else f"{seconds / 60:.0f} min") + fewer


def path_of(claim: dict) -> str:
    """Whether the claim is on the quick path, and why not where it should be."""
    return "yes" if claim.get("quick") else f"no: {claim['outside']}" if "outside" in claim else ""


def section_of_rows(told: Claims, section: list[dict]) -> list[str]:
    usual = next(iter(told.machines))
    body = []
    for c in section:
        target, what = told.rows[c["row"]]
        figures, verdicts = [], []
        for machine, figure in told.figures(c["row"]).items():
            where = "" if machine == usual else f"{machine}: "
            also = f"; another day {figure['also']}" if "also" in figure else ""
            figures.append(f"{where}{with_note(figure)}{also}")
            verdicts.append(f"{where}{verdict_of(figure)}")
        body.append([f"`{c['row']}`", what, target, "; ".join(figures), "; ".join(verdicts), time_of(c),
                     path_of(c)])
    return [*grid(["row", "what", "target", "claimed", "verdict", "time", "quick"], body), ""]


def section_of_checks(section: list[dict]) -> list[str]:
    lines = []
    for c in section:
        lines += [f"- `{c['check']}` (quick: {path_of(c)}; {time_of(c)}): {c['claim']}", "",
                  *(f"      {part}" for part in claims.command_of(c, "results/artifact").split(" && ")), ""]
    return lines


def artifact(text: str, rows: Rows) -> str:
    """ARTIFACT.md with the claims of today."""
    told = Claims(rows)
    lines = misses(told)
    for title, section in told.sections:
        lines += [f"### {title}", "",
                  *(section_of_rows(told, section) if "row" in section[0] else section_of_checks(section))]
    return text[:text.index("\n### ") + 1] + "\n".join(lines).rstrip("\n") + "\n"


def write(rows: Rows) -> None:
    for page, made in ((kArtifact, artifact), (kMeasured, measured)):
        page.write_text(made(page.read_text(encoding="utf-8"), rows), encoding="utf-8")
