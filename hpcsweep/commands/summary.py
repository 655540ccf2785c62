"""`hpcsweep summary`: summarise studies: cost, kinds of motion.

Summarise studies: what they cost, how much work was spared, what shares of the runs are periodic,
chaotic, quasi-periodic or undecided, and which contact sets occur. Files may be larger than the
memory. To see the progress alone, `hpcsweep status` is quicker.
"""

import json
from collections import Counter
from typing import Any

from hpcsweep.commands import Rows, listing
from hpcsweep.commands.rows import by_clock, inferred_text, percent, rows_of, share
from hpcsweep.figures.options import file_name
from hpcsweep.studies.run_names import count, plural, written

MAX_ROWS = 16
"""Most orbit periods, and most contact sets, that are listed one by one."""


def configure(parser) -> None:
    """Add the options of the command."""
    parser.add_argument("files", type=file_name, nargs="+", metavar="FILE")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="machine-readable")
    form.add_argument("--markdown", action="store_true", help="a Markdown table, a column a file")


def run(options) -> int:
    """Run the command."""
    from hpcsweep.campaign.summary import summarize

    summaries = [summarize(path) for path in options.files]
    if options.json:
        print(json.dumps(summaries, indent=1))
    elif options.markdown:
        print(_markdown(summaries))
    else:
        print("\n\n".join(_text(summary) for summary in summaries))
    return 0


ROWS = """\
structure | {structure} | {first}
free | the structure {drifts}
varied | {varied}
{run_noun}s | {runs_done} of {runs_total} | {grid}
inferred | {share_inferred:percent} of the map, {inferred}; all shares below are of {of}
cost | {no_cost}
wall time | {cost[wall_seconds]:.4g} s{sessions} on {ranks}
core seconds | {cost[core_seconds]:.4g} s of processor time | , {by_clock:.4g} s by the clock
{run_noun}s per second | {cost[runs_per_second]:.4g}
{run_noun}s per core second | {cost[runs_per_core_second]:.4g}
scaled by | {measure}
linear | {below_contact:share}, nothing touches or slips
of equal ratio | {equal_ratio:share}
with contact | {with_contact:share}
collapsed | {collapsed:share}
strength lost | {strength_lost:share}, of some storey or slider
storeys | {elastic_storeys}
periods per run | {periods_per_run:.4g} integrated, of {periods_per_run_window}
rules: skip rule {key} | {value:share}
periods per {run_noun} | {periods_per_run:.4g} integrated, {periods_per_start:.4g} a start
numbers: points with {key:n attractor} | {value:share}
starts | {searched}
starts undecided | {starts_undecided:share}
starts failed | {starts_failed:share}
starts elsewhere | {starts_elsewhere:share}
attractors | {attractors}
basins: starts to {key}, {value[name]} | {value:share}
boundaries: basin entropy {key} | {value[entropy]:.4g}, on the boundary \
{value[boundary_entropy]:.4g}
told: uncertainty exponent {key} | {value}
parameter | {parameter}
branches | {branches}
sources: branches by {key} | {value:share}
points | {points}
points stable | {points_stable:share}
special_points: points of {key} | {value}
curves | {curves[curves]}, {curves[points]} points
special points on a curve | {curves[followed]:share}
meetings | {curves[meetings]:counts}
seeds | {seeds}, and {motions_not_periodic} motions not periodic
seeds on a branch | {seeds_covered:share}
missed: seed {key} on none | {value[line]}, {parameter} = {value[value]:.8g}, \
P{value[period]}: {value[reason]}
more seeds on none | {more_missed}
file | {file_bytes:size}, {disk_bytes:size} on disk
kinds: {key} | {value}
undecided: undecided {key} | {value}
shakedown: shakedown {key} | {value:share}
chaotic | {untold}
window test | of {tested[runs]} windows it claims {tested[wrong]} wrong periods and misses \
{tested[missed]}
listed_periods: P{key} | {value}
contacts | {named}
listed_contact_sets: contact {key} | {value}
most: largest {key} | {value[value]:.4g}{value[unit]} ({value[of]}, {value[where]})
failures | {failures:counts}
"""
"""What is told of a summary, of its values and those of `_values`; see `hpcsweep.commands.rows`."""


def _text(summary: dict) -> str:
    return listing(summary["file"], _rows(summary, [summary]))


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
    return rows_of(ROWS, summary | _values(summary, together))


def _values(summary: dict, together: list[dict]) -> dict[str, Any]:
    """Return what rows show besides the values of a summary; None where it is not shown."""
    vary = [f"{key} {_ends(values)}" for key, values in summary["vary"].items()]
    classes = summary.get("classes", {})
    sizes = [count(n, dim) for dim, n in summary["dimensions"].items() if n > 1]
    missed, window = summary.get("seeds_missed", []), summary.get("window_test")
    values: dict[str, Any] = {
        "first": " (the first)" if vary else None,
        "varied": "; ".join(vary) or None,
        "elastic_storeys": summary.get("elastic") or None,
        "grid": f" ({' x '.join(sizes)})" if len(sizes) > 1 else None,
        "of": "all of these" if "basins" in summary else "runs",
        "no_cost": None if summary["cost"] else "not known: no journal beside the file",
        "rules": {k: entry for k, entry in summary.get("skip_rules", {}).items() if k != "none"},
        "searched": None if summary["run_noun"] == "start" else summary.get("starts"),
        "missed": dict(enumerate(missed[:MAX_ROWS], 1)),
        "more_missed": len(missed) - MAX_ROWS if len(missed) > MAX_ROWS else None,
        "told": {
            name: f"{mean:.4g} (95 %: {low:.4g} to {high:.4g})"
            if low > 0.0
            else "not known: these starts are too few"
            for name, entry in summary.get("boundaries", {}).items()
            for mean, low, high in [entry["exponent"]] * bool(entry["exponent"])
        },
        "kinds": {n: share(entry) + _by_direction(summary, n) for n, entry in classes.items()},
        "named": (summary.get("contact_sets") and summary["contacts_named"]) or None,
        "tested": window if window and window["runs"] else None,
        "most": {name: most | _placed(most) for name, most in summary["largest"].items()},
    }
    if classes and not summary["tells_chaos"]:
        values["untold"] = "not told: the file holds neither motion nor lyapunov"
    if "audit" in summary:
        values["share_inferred"] = summary["runs_inferred"] / summary["runs_total"]
        values["inferred"] = inferred_text(summary["runs_inferred"], summary["audit"])
    if cost := summary["cost"]:
        values["by_clock"] = by_clock(cost)
        ranks, sessions = cost["ranks"], cost["sessions"]
        values["ranks"] = f"{' or '.join(map(str, ranks))} {plural('rank', sum(ranks))}"
        values["sessions"] = f" in {sessions} sessions" if sessions > 1 else ""
    for key in ("periods", "contact_sets"):
        shares = summary.get(key, {})
        names = _listed(key, together)
        values[f"listed_{key}"] = {n: share(shares[n]) if n in shares else "0" for n in names}
    return values


def _by_direction(summary: dict, name: str) -> str:
    """Write the shares of a class of motions of each direction, where there are several."""
    directions = summary.get("by_direction", {})
    parts = [f"{d} {percent(kinds[name]['share'])}" for d, kinds in directions.items()]
    is_shown = len(parts) > 1 and summary["classes"][name]["runs"] > 0
    return f": {', '.join(parts)}" if is_shown else ""


def _placed(most: dict) -> dict[str, str]:
    """Write the unit of the largest value of a measure, and where it is."""
    units = most["units"], most.get("scale_unit", "1")
    unit, of_scale = ("" if each == "1" else f" {each}" for each in units)
    where = "A = {amplitude:.6g}, Omega = {omega:.6g}"
    if "record" in most:
        where = "{part}, " * bool(most["part"]) + "{record}, scale {scale:.6g}" + of_scale
    return {"unit": unit, "where": where.format_map(most)}


def _listed(key: str, together: list[dict]) -> list:
    """Return the most frequent names of all summaries: periods in order, sets by frequency."""
    total: Counter = Counter()
    for summary in together:
        total.update({name: entry["runs"] for name, entry in summary.get(key, {}).items()})
    chosen = [name for name, _ in total.most_common(MAX_ROWS)]
    return sorted(chosen) if key == "periods" else chosen


def _ends(values: list) -> str:
    """Format the values of a key; only the ends of many."""
    words = [*map(written, values)]
    if len(words) <= 3:
        return ", ".join(words)
    return f"{words[0]} to {words[-1]} ({len(words)} values)"
