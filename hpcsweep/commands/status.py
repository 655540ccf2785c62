"""`hpcsweep status`: report what of a results file is computed."""

import json
import sys
import time
from pathlib import Path

from hpcsweep.commands import USER_ERROR, CommandError
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
    if options.json:
        print(json.dumps(state, indent=1))
        return 0
    print(_describe(state))
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


def _describe(state: dict) -> str:
    """Write a status as a person reads it."""
    from hpcsweep.studies.run_names import count, run_name

    done, total = state["runs_done"], state["runs_total"]
    run, frame = state["run_noun"], state["frame_noun"]
    frames = ""
    if frame != run:
        frames = f", {frame}s {state['frames_done']} of {state['frames_total']}"
    lines = [
        f"{state['file']}: {'complete' if state['complete'] else 'not complete'}",
        f"  {f'{run}s':9} {done} of {total} ({100 * done / total:.1f} %){frames}, solver "
        f"{state['solver']}",
    ]
    if "audit" in state:
        lines.append(f"  inferred  {inferred_text(state['runs_inferred'], state['audit'])}")
    if state["runs_per_core_second"]:
        left = state["core_seconds_remaining"]
        lines.append(
            f"  cost      {state['core_seconds']:.3g} core seconds, "
            f"{state['runs_per_core_second']:.3g} {run}s per core second"
            + ("" if left is None else f", about {left:.3g} core seconds left")
        )
    lines += _describe_work(state)
    lines += _describe_motions(state)
    lines.append(f"  failures  {state['n_failed']}")
    lines += [f"    {run_name(f)}: {f['outcome']}" for f in state["failures"]]
    if state["n_failed"] > len(state["failures"]):
        lines.append(f"    and {state['n_failed'] - len(state['failures'])} more")
    lines += [
        f"    {name} ({kind['runs']}): {kind['remedy']}" for name, kind in state["remedies"].items()
    ]
    for session in state["sessions"]:
        started = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(session["started"]))
        lines.append(
            f"  session   {started}, {count(session['ranks'], 'rank')} on "
            f"{' '.join(session['hosts'])}, {session['transport']}: "
            f"{session['ended'] or 'running or killed'}"
        )
        if session["write_bytes_per_second"]:
            lines.append(
                f"    wrote   {session['written_bytes'] / 1e6:.4g} MB at "
                f"{session['write_bytes_per_second'] / 1e6:.3g} MB/s, "
                f"{100 * session['write_share']:.2g} % of the ranks' time"
            )
    return "\n".join(lines)


def inferred_text(count: int, audit: dict | None) -> str:
    """Write how many points of a refined map are inferred, and how many of these are wrong."""
    if audit is None:
        return "nothing yet: not complete"
    return (
        f"{count} points; of {audit['drawn']} drawn and computed {audit['wrong']} were wrong: "
        f"{100 * audit['low']:.2g} to {100 * audit['high']:.2g} % of them are (95 %)"
    )


def _describe_motions(state: dict) -> list[str]:
    """Return the periods integrated, and the lines of only one kind of study."""
    lines = []
    if "runs_spared" in state:
        if state["periods_per_run"] is not None:
            spared = ", ".join(f"{name} {count}" for name, count in state["runs_spared"].items())
            lines.append(
                f"  periods   {state['periods_per_run']:.3g} integrated a run, of "
                f"{state['periods_per_run_window']}; runs spared: {spared}"
            )
        lines.append(f"  no period found in {state['no_period_found']} runs")
    if "runs_below_contact" in state:
        lines.append(f"  linear    {state['runs_below_contact']} runs below first contact")
    if "starts" in state and state["periods_per_start"] is not None:
        if state.get("attractors_per_point") is not None:
            lines.append(
                f"  found     {state['attractors_per_point']:.3g} attractors a point, several in "
                f"{state['points_with_several']} points, at most {state['most_attractors']}"
            )
        lines.append(
            f"  starts    {state['starts']} of {state['periods_per_start']:.3g} periods; undecided "
            f"{state['starts_undecided']}, failed {state['starts_failed']}, to attractors that are "
            f"not in the file {state['starts_elsewhere']}"
        )
    return lines


def _frame(frames: dict, which: str) -> str:
    """Format the cost of a frame, and its name."""
    from hpcsweep.studies.run_names import run_name

    return f"{frames[which]:.3g} s ({run_name(frames[f'{which}_at'])})"


def _describe_work(state: dict) -> list[str]:
    """Return rate, remaining time, cost by frame and the master's load."""
    lines = []
    if state["runs_per_second"] is not None:
        line = (
            f"  rate      {state['runs_per_second']:.3g} {state['run_noun']}s/s by the clock, "
            f"{state['runs_per_second_recent']:.3g} in the last minute of the last session"
        )
        if state["seconds_remaining"] is not None:
            line += f"; about {state['seconds_remaining']:.3g} s left on its ranks"
        lines.append(line)
    frames = state["frame_seconds"]
    if frames:
        lines.append(
            f"  {state['frame_noun'] + 's':9} costliest {_frame(frames, 'costliest')}, median "
            f"{frames['median']:.3g} s, cheapest {_frame(frames, 'cheapest')}, of "
            f"{frames['frames']} timed whole"
        )
    master = state["master"]
    if master and master["messages"]:
        lines.append(
            f"  master    {master['messages']} messages, {master['messages_per_second']:.3g}/s "
            f"of {master['messages_per_second_possible']:.3g}/s possible; "
            f"{master['tasks_moved']} tasks moved between ranks"
        )
    if state["peak_memory"]:
        first, largest = (size / 1e6 for size in state["peak_memory"])
        lines.append(f"  memory    rank 0 {first:.0f} MB, largest rank {largest:.0f} MB")
    if not state["complete"] and state["last_heard"] is not None:
        lines.append(f"  last heard of {state['last_heard']:.0f} s ago")
    return lines
