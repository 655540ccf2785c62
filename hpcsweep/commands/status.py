"""`hpcsweep status`: report what of a results file is computed."""

import json
import sys
import time
from pathlib import Path

from hpcsweep.commands import USER_ERROR, CommandError, Rows, table
from hpcsweep.commands.outputs import PAGE, check_overwriting, writing
from hpcsweep.figures.options import file_name

SUMMARY = "show how far results files are, also while they run"
HELP = """\
Show how far results files are, also while campaigns write them. One file is shown in full; several
take one line each, and their checksums are not verified."""


def configure(parser) -> None:
    """Add the options of the command."""
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="machine-readable")
    form.add_argument(
        "--html",
        type=file_name,
        metavar="PAGE",
        help="write the lines as a page, and keep writing it until nothing runs; a browser that "
        "shows the page reloads it",
    )
    form.add_argument(
        "--job",
        action="store_true",
        help="print the job of the file as TOML; running it gives equal data",
    )


def run(options) -> int:
    """Run the command."""
    from hpcsweep.campaign.status import status
    from hpcsweep.store import job_of

    if options.html:
        return _keep_page(options.files, options.html)
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
    print(json.dumps(state, indent=1) if options.json else table(title, _rows(state)))
    return 0


def _overview(options) -> int:
    """Print the progress of several files, a line each."""
    from hpcsweep.campaign.overview import as_table, overview

    rows = [overview(path) for path in options.files]
    print(json.dumps(rows, indent=1) if options.json else as_table(rows))
    return USER_ERROR if any(row["state"] == "unreadable" for row in rows) else 0


def _keep_page(files: list[Path], page: Path) -> int:
    """Rewrite the page of several files as long as anything is running."""
    from hpcsweep.campaign.overview import REFRESH, as_page, finished, overview
    from hpcsweep.figures.explorer.page import write_page

    check_overwriting(page, PAGE)
    while True:
        rows = [overview(path) for path in files]
        with writing(page):
            write_page(as_page(rows), page)
        if finished(rows):
            return USER_ERROR if any(row["state"] == "unreadable" for row in rows) else 0
        time.sleep(REFRESH)


def _rows(state: dict) -> Rows:
    """Write a status as a person reads it."""
    from hpcsweep.studies.run_names import count, run_name

    done, total = state["runs_done"], state["runs_total"]
    run, frame = state["run_noun"], state["frame_noun"]
    frames = ""
    if frame != run:
        frames = f", {frame}s {state['frames_done']} of {state['frames_total']}"
    share = f"{100 * done / total:.1f} %"
    yield f"{run}s", f"{done} of {total} ({share}){frames}, solver {state['solver']}"
    if "audit" in state:
        yield "inferred", inferred_text(state["runs_inferred"], state["audit"])
    if rate := state["runs_per_core_second"]:
        left = state["core_seconds_remaining"]
        rest = "" if left is None else f", about {left:.3g} core seconds left"
        spent = f"{state['core_seconds']:.3g} core seconds"
        yield "cost", f"{spent}, {rate:.3g} {run}s per core second{rest}"
    yield from _rows_of_work(state)
    yield from _rows_of_motions(state)
    yield "failures", str(state["n_failed"])
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
        if session["write_bytes_per_second"]:
            yield (
                "  wrote",
                f"{session['written_bytes'] / 1e6:.4g} MB at "
                f"{session['write_bytes_per_second'] / 1e6:.3g} MB/s, "
                f"{100 * session['write_share']:.2g} % of the ranks' time",
            )


def inferred_text(count: int, audit: dict | None) -> str:
    """Write how many points of a refined map are inferred, and how many of these are wrong."""
    if audit is None:
        return "nothing yet: not complete"
    return (
        f"{count} points; of {audit['drawn']} drawn and computed {audit['wrong']} were wrong: "
        f"{100 * audit['low']:.2g} to {100 * audit['high']:.2g} % of them are (95 %)"
    )


def _rows_of_motions(state: dict) -> Rows:
    """Write the periods integrated, and the lines of only one kind of study."""
    if "runs_spared" in state:
        if state["periods_per_run"] is not None:
            spared = ", ".join(f"{name} {count}" for name, count in state["runs_spared"].items())
            yield (
                "periods",
                f"{state['periods_per_run']:.3g} integrated a run, of "
                f"{state['periods_per_run_window']}; runs spared: {spared}",
            )
        yield "no period found in", f"{state['no_period_found']} runs"
    if "runs_below_contact" in state:
        yield "linear", f"{state['runs_below_contact']} runs below first contact"
    if "starts" in state and state["periods_per_start"] is not None:
        if state.get("attractors_per_point") is not None:
            yield (
                "found",
                f"{state['attractors_per_point']:.3g} attractors a point, several in "
                f"{state['points_with_several']} points, at most {state['most_attractors']}",
            )
        yield (
            "starts",
            f"{state['starts']} of {state['periods_per_start']:.3g} periods; undecided "
            f"{state['starts_undecided']}, failed {state['starts_failed']}, to attractors that are "
            f"not in the file {state['starts_elsewhere']}",
        )


def _rows_of_work(state: dict) -> Rows:
    """Write rate, remaining time, cost by frame and the master's load."""
    from hpcsweep.studies.run_names import run_name

    if state["runs_per_second"] is not None:
        left = state["seconds_remaining"]
        yield (
            "rate",
            f"{state['runs_per_second']:.3g} {state['run_noun']}s/s by the clock, "
            f"{state['runs_per_second_recent']:.3g} in the last minute of the last session"
            + ("" if left is None else f"; about {left:.3g} s left on its ranks"),
        )
    if frames := state["frame_seconds"]:
        most, least = (
            f"{which} {frames[which]:.3g} s ({run_name(frames[f'{which}_at'])})"
            for which in ("costliest", "cheapest")
        )
        whole = f"{frames['frames']} timed whole"
        yield (
            f"{state['frame_noun']}s",
            f"{most}, median {frames['median']:.3g} s, {least}, of {whole}",
        )
    master = state["master"]
    if master and master["messages"]:
        yield (
            "master",
            f"{master['messages']} messages, {master['messages_per_second']:.3g}/s "
            f"of {master['messages_per_second_possible']:.3g}/s possible; "
            f"{master['tasks_moved']} tasks moved between ranks",
        )
    if state["peak_memory"]:
        first, largest = (size / 1e6 for size in state["peak_memory"])
        yield "memory", f"rank 0 {first:.0f} MB, largest rank {largest:.0f} MB"
    if not state["complete"] and state["last_heard"] is not None:
        yield "last heard of", f"{state['last_heard']:.0f} s ago"
