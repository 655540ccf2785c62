"""`hpcsweep status`: show how far results files are, also while they run.

Show how far results files are, also while campaigns write them. One file is shown in full; several
take one line each, and their checksums are not verified.
"""

import json
import sys
import time

from hpcsweep.commands import USER_ERROR, CommandError, Rows, listing
from hpcsweep.commands.rows import by_clock, inferred_text, rows_of
from hpcsweep.figures.options import file_name
from hpcsweep.studies.run_names import count, run_name


def configure(parser) -> None:
    """Add the options of the command."""
    parser.add_argument("files", type=file_name, nargs="+", metavar="FILE")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="machine-readable")
    form.add_argument(
        "--job",
        action="store_true",
        help="print the job of the file as TOML; running it gives equal data",
    )


def run(options) -> int:
    """Run the command."""
    from hpcsweep.campaign.status import status
    from hpcsweep.store import job_of

    if options.job:
        if len(options.files) > 1:
            raise CommandError("--job: goes with one file")
        sys.stdout.buffer.write(job_of(options.files[0]).text.encode())
        sys.stdout.flush()
        return 0
    if len(options.files) > 1:
        return _overview(options)
    state = status(options.files[0])
    title = f"{state['file']}: {'complete' if state['complete'] else 'not complete'}"
    print(json.dumps(state, indent=1) if options.json else listing(title, _rows(state)))
    return 0


def _overview(options) -> int:
    """Print the progress of several files, a line each."""
    from hpcsweep.campaign.status import as_table, overview

    rows = [overview(path) for path in options.files]
    print(json.dumps(rows, indent=1) if options.json else as_table(rows))
    return USER_ERROR if any(row["state"] == "unreadable" for row in rows) else 0


ROWS = """\
{run_noun}s | {runs_done} of {runs_total} ({done:.1f} %)\
 | , {frame}s {frames_done} of {frames_total}
solver | {solver}
inferred | {inferred}
cost | {core_seconds:.3g} core seconds, {runs_per_core_second:.3g} {run_noun}s per core second\
 | ; {by_clock:.3g} s by the clock | , about {core_seconds_remaining:.3g} core seconds left
rate | {runs_per_second:.3g} {run_noun}s/s by the clock in the last session\
 | ; about {seconds_remaining:.3g} s left on its ranks
master | {master[messages]} messages, {master[messages_per_second]:.3g}/s; \
{master[busy]:percent} of its time; {master[tasks_moved]} tasks moved between ranks
memory | rank 0 {memory[0]:.0f} MB, largest rank {memory[1]:.0f} MB
last heard of | {silent:.0f} s ago
periods | {periods_per_run:.3g} integrated a run, of {periods_per_run_window}; runs spared: {spared}
no period found | in {no_period_found} runs
linear | {runs_below_contact} runs, in which nothing touches or slips
found | {attractors_per_point:.3g} attractors a point, several in {points_with_several} points, \
at most {most_attractors}
starts | {starts} of {periods_per_start:.3g} periods; undecided {starts_undecided}, failed \
{starts_failed}, to attractors that are not in the file {starts_elsewhere}
branches | {n_branches}, on which {n_covered} of {n_seeds} motions of the files lie
failures | {n_failed}
"""
"""What is told of a state, of its values and those of `_rows`; see `hpcsweep.commands.rows`."""


def _rows(state: dict) -> Rows:
    """Write a status as a person reads it."""
    own_noun, spared = state["frame_noun"] != state["run_noun"], state.get("runs_spared", {})
    waits, master = not state["complete"], state["master"]
    derived = {
        "done": 100 * state["runs_done"] / state["runs_total"],
        "frame": state["frame_noun"] if own_noun else None,
        "spared": ", ".join(f"{name} {n}" for name, n in spared.items()),
        "master": master if master and master["messages"] else None,
        "memory": [size / 1e6 for size in state["peak_memory"] or ()] or None,
        "silent": state["last_heard"] if waits else None,
        "by_clock": by_clock(state),
    }
    if "audit" in state:
        derived["inferred"] = inferred_text(state["runs_inferred"], state["audit"])
    yield from rows_of(ROWS, state | derived)
    for failed in state["failures"]:
        yield f"  {run_name(failed)}:", failed["outcome"]
    if state["n_failed"] > len(state["failures"]):
        yield f"  and {state['n_failed'] - len(state['failures'])} more", ""
    for name, kind in state["remedies"].items():
        yield f"  {name} ({kind['runs']}):", kind["remedy"]
    for session in state["sessions"]:
        started = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(session["started"]))
        yield (
            "session",
            f"{started}, {count(session['ranks'], 'rank')} on {' '.join(session['hosts'])}, "
            f"{session['transport']}: {session['ended'] or 'running or killed'}",
        )
