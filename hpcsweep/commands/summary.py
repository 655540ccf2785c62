"""`hpcsweep summary`: the numbers of a whole study."""

import json
import math
from collections import Counter
from pathlib import Path

from hpcsweep.commands import Rows, table
from hpcsweep.commands.status import inferred_text
from hpcsweep.figures.options import whole_number
from hpcsweep.studies.run_names import count

SUMMARY = "summarise studies: cost, kinds of motion"
HELP = """\
Summarise studies: what they cost, how much work was spared, what shares of the runs are periodic,
chaotic, quasi-periodic or undecided, and which contact sets occur. Files may be larger than the
memory. To see the progress alone, `hpcsweep status` is quicker."""
MAX_ROWS = 16
"""Most orbit periods, and most contact sets, that are listed one by one."""


def configure(parser) -> None:
    """Add the options of the command."""
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="machine-readable")
    form.add_argument(
        "--markdown", action="store_true", help="a Markdown table with a column for each file"
    )
    parser.add_argument(
        "--transients",
        type=whole_number(1),
        metavar="N",
        help="continue N chaotic runs of each file, drawn at random, by 10,000 forcing periods, "
        "and say what share of chaos outlives them",
    )


def run(options) -> int:
    """Run the command."""
    from hpcsweep.campaign.summary import summarize

    found = [summarize(path) for path in options.files]
    if options.transients:
        from hpcsweep.checks.transients import outliving

        for summary in found:
            summary["transients"] = outliving(summary["file"], options.transients)
    if options.json:
        print(json.dumps(found, indent=1))
    elif options.markdown:
        print(_markdown(found))
    else:
        print("\n\n".join(_text(summary) for summary in found))
    return 0


def _text(summary: dict) -> str:
    rows = dict(_rows(summary, [summary]))
    return table(summary["file"], rows.items(), max(map(len, rows)) + 1)


def _markdown(summaries: list[dict]) -> str:
    columns = [dict(_rows(summary, summaries)) for summary in summaries]
    names = dict.fromkeys(name for rows in columns for name in rows)
    lines = [
        f"| | {' | '.join(summary['name'] for summary in summaries)} |",
        "|---" * (1 + len(summaries)) + "|",
        *(f"| {name} | {' | '.join(r.get(name, '–') for r in columns)} |" for name in names),
    ]
    return "\n".join(lines)


def _rows(summary: dict, together: list[dict]) -> Rows:
    """Yield name and value of every line of a table, for summaries shown together."""
    vary = [f"{key} {_values(values)}" for key, values in summary["vary"].items()]
    yield "structure", summary["structure"] + " (the first)" * bool(vary)
    if vary:
        yield "varied", "; ".join(vary)
    yield (
        f"{_noun(summary)}s",
        f"{summary['runs_done']} of {summary['runs_total']}{_grid(summary)}",
    )
    if "audit" in summary:
        share = _percent(summary["runs_inferred"] / summary["runs_total"])
        wrong = inferred_text(summary["runs_inferred"], summary["audit"])
        of = "all of these" if "basins" in summary else "runs"
        yield "inferred", f"{share} of the map, {wrong}; all shares below are of {of}"
    yield from _cost_rows(summary)
    kinds = {"measure": _record_rows, "branches": _branch_rows, "attractors": _attractor_rows}
    own = next((rows for key, rows in kinds.items() if key in summary), _history_rows)
    yield from own(summary)
    yield (
        "file",
        f"{summary['file_bytes'] / 1e9:.4g} GB, {summary['disk_bytes'] / 1e9:.4g} GB on disk",
    )
    if "measure" not in summary:
        yield from _motion_rows(summary, together)
    for name, most in summary["largest"].items():
        units = "" if most["units"] == "1" else f" {most['units']}"
        yield f"largest {name}", f"{most['value']:.4g}{units} ({most['of']}, {_where(most)})"
    yield "failures", _counts(summary["failures"])


def _where(most: dict) -> str:
    """Write where the largest value of a measure is."""
    if "record" in most:
        part = f"{most['part']}, " if most["part"] else ""
        return f"{part}{most['record']}, scale {most['scale']:.6g}"
    return f"A = {most['amplitude']:.6g}, Omega = {most['omega']:.6g}"


def _record_rows(summary: dict) -> Rows:
    yield "scaled by", summary["measure"]
    yield "below first contact", _share(summary["below_contact"])
    yield "of equal ratio", _share(summary["equal_ratio"])
    yield "with contact", _share(summary["with_contact"])
    if "collapsed" in summary:
        yield "collapsed", _share(summary["collapsed"])


def _motion_rows(summary: dict, together: list[dict]) -> Rows:
    """Write the shares of kinds of motion, periods and contact sets."""
    directions = summary.get("by_direction", {})
    for name, entry in summary["classes"].items():
        parts = [f"{d} {_percent(kinds[name]['share'])}" for d, kinds in directions.items()]
        each = f": {', '.join(parts)}" * (len(parts) > 1 and entry["runs"] > 0)
        yield name, _share(entry) + each
    if summary["classes"] and not summary["tells_chaos"]:
        yield "chaotic", "not told: the file holds neither motion nor lyapunov"
    if (later := summary.get("transients")) and later["share"] is not None:
        yield (
            "chaos that lasts",
            f"{_percent(later['share'])} of chaotic runs outlive {later['periods']} more periods "
            f"({later['outlive']} of {later['samples']} drawn, {later['undecided']} undecided; "
            f"95 %: {_percent(later['low'])} to {_percent(later['high'])})",
        )
        mean, low, high = (math.inf if x is None else x for x in later["lifetime"])
        yield "lifetime of chaos", f"{mean:.4g} periods (95 %: {low:.4g} to {high:.4g})"
    window = summary.get("window_test")
    if window and window["runs"]:
        yield (
            "window test",
            f"of {window['runs']} windows it claims {window['wrong']} wrong periods and misses "
            f"{window['missed']}",
        )
    for key, label in (("periods", "P{}"), ("contact_sets", "contact {}")):
        for name in _listed(key, together):
            entry = summary[key].get(name)
            yield label.format(name), _share(entry) if entry else "0"


def _noun(summary: dict) -> str:
    """Return the noun for a run of a study."""
    if "basins" in summary and "audit" in summary:
        return "start"
    for key, noun in (("basins", "row"), ("branches", "line"), ("attractors", "point")):
        if key in summary:
            return noun
    return "run"


def _grid(summary: dict) -> str:
    """Format the frames and amplitudes of the runs, or the point of a slice."""
    if "basins" in summary or "branches" in summary:
        return ""
    if "measure" in summary:
        return f" ({count(summary['records'], 'record')} x {count(summary['scales'], 'scale')})"
    frames = count(summary["frames"], "frame")
    amplitudes = count(summary["amplitudes"], "amplitude")
    return f" ({frames} x {amplitudes}, {' and '.join(summary['directions'])})"


def _history_rows(summary: dict) -> Rows:
    if summary["runs_done"]:
        window = summary["periods_per_run_window"]
        yield "periods per run", f"{summary['periods_per_run']:.4g} integrated, of {window}"
    for name, entry in summary["skip_rules"].items():
        if name != "none":
            yield f"skip rule {name}", _share(entry)


def _attractor_rows(summary: dict) -> Rows:
    if not summary["runs_done"]:
        return
    noun = _noun(summary)
    yield (
        f"periods per {noun}",
        f"{summary['periods_per_run']:.4g} integrated, {summary['periods_per_start']:.4g} a start",
    )
    for number, entry in summary["numbers"].items():
        yield f"points with {count(number, 'attractor')}", _share(entry)
    if noun != "start":
        yield "starts", str(summary["starts"])
    for name in ("undecided", "failed", "elsewhere"):
        yield f"starts {name}", _share(summary[f"starts_{name}"])
    yield "attractors", str(summary["attractors"])
    for number, entry in summary.get("basins", {}).items():
        yield f"starts to {number}, {entry['name']}", _share(entry)


def _branch_rows(summary: dict) -> Rows:
    yield "parameter", summary["parameter"]
    yield "branches", str(summary["branches"])
    for name, entry in summary["sources"].items():
        yield f"branches by {name}", _share(entry)
    yield "points", str(summary["points"])
    yield "points stable", _share(summary["points_stable"])
    for name, n in summary["special_points"].items():
        yield f"points of {name}", str(n)
    if told := summary.get("curves"):
        yield "curves", f"{told['curves']}, {told['points']} points"
        yield "special points on a curve", _share(told["followed"])
        yield "meetings", _counts(told["meetings"])
    unsteady = summary["motions_not_periodic"]
    yield "seeds", f"{summary['seeds']}, and {unsteady} motions not periodic"
    yield "seeds on a branch", _share(summary["seeds_covered"])
    missed = summary["seeds_missed"]
    for k, one in enumerate(missed[:MAX_ROWS], 1):
        place = f"{one['line']}, {summary['parameter']} = {one['value']:.8g}"
        yield f"seed {k} on none", f"{place}, P{one['period']}: {one['reason']}"
    if len(missed) > MAX_ROWS:
        yield "more seeds on none", str(len(missed) - MAX_ROWS)


def _cost_rows(summary: dict) -> Rows:
    cost, runs = summary["cost"], f"{_noun(summary)}s"
    if cost is None:
        yield "cost", "not known: no journal beside the file"
        return
    ranks = f"{' or '.join(map(str, cost['ranks']))} rank{'s' * (cost['ranks'] != [1])}"
    pieces = f" in {cost['sessions']} sessions" if cost["sessions"] > 1 else ""
    yield "wall time", f"{cost['wall_seconds']:.4g} s{pieces} on {ranks}"
    yield "core seconds", f"{cost['core_seconds']:.4g} s"
    for unit in ("second", "core_second"):
        if cost[f"runs_per_{unit}"] is not None:
            yield f"{runs} per {unit.replace('_', ' ')}", f"{cost[f'runs_per_{unit}']:.4g}"


def _listed(key: str, together: list[dict]) -> list:
    """Return the most frequent names of all summaries: periods in order, sets by frequency."""
    total: Counter = Counter()
    for summary in together:
        total.update({name: entry["runs"] for name, entry in summary[key].items()})
    chosen = [name for name, _ in total.most_common(MAX_ROWS)]
    return sorted(chosen) if key == "periods" else chosen


def _values(values: list) -> str:
    """Format the values of a key; only the ends of many."""
    words = [f"{one:.6g}" if isinstance(one, int | float) else one for one in values]
    if len(words) <= 3:
        return ", ".join(words)
    return f"{words[0]} to {words[-1]} ({len(words)} values)"


def _counts(numbers: dict[str, int]) -> str:
    """Format the counts that are not 0."""
    return ", ".join(f"{name} {n}" for name, n in numbers.items() if n) or "0"


def _share(entry: dict) -> str:
    return f"{entry['runs']} ({_percent(entry['share'])})"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.3g} %"
