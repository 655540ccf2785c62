"""`hpcsweep schedule`: predict makespan and efficiency on numbers of ranks, and check it."""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from hpcsweep.commands import RAW, USER_ERROR, complain
from hpcsweep.figures.options import positive

HELP = """\
Predict the makespan of a job on numbers of ranks, from the costs measured in a results file (also
an unfinished one) or from a timed sample of a job file, with the rule the campaign itself follows.

With --replay, under mpirun, the ranks sleep for the same costs, scaled to about SECONDS, and the
makespan is compared with the predicted one; the messages per second of rank 0 are measured."""


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    schedule = commands.add_parser(
        "schedule",
        help="predict makespan and efficiency on numbers of ranks",
        description=HELP,
        formatter_class=RAW,
    )
    schedule.add_argument("source", type=Path, metavar="FILE.h5|JOB.toml")
    schedule.add_argument(
        "--ranks", type=_counts, metavar="N,N,...", help="numbers of ranks (default: 1 to 4096)"
    )
    schedule.add_argument(
        "--replay", type=positive, metavar="SECONDS", help="check against sleeping tasks"
    )
    schedule.add_argument("--json", action="store_true", help="machine-readable")
    schedule.set_defaults(function=_schedule)


def _counts(text: str) -> tuple[int, ...]:
    """Parse a list of numbers of ranks."""
    try:
        counts = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be whole numbers, is {text}") from None
    if min(counts) < 1 or max(counts) > 1_000_000:
        raise argparse.ArgumentTypeError(f"must be from 1 to 1000000, is {text}")
    return counts


def _schedule(options) -> int:
    from hpcsweep.parallel.mpi import world

    comm = world()
    known, problem = _costs(options.source) if comm.rank == 0 else (None, None)
    if comm.bcast(problem is not None):
        if problem is not None:
            complain(problem)
        return USER_ERROR
    checked = _replay(comm, known, options.replay) if options.replay else None
    if known is not None:
        job, forecast = known
        _show(options, job, forecast, checked)
    return 0


def _costs(source: Path) -> tuple:
    """Return (job, forecast) and None, or None and an error message."""
    from hpcsweep.campaign import forecast as estimate
    from hpcsweep.job import JobError, load_job
    from hpcsweep.store import StoreError
    from hpcsweep.store.reader import job_of

    try:
        if source.suffix == ".toml":
            job = load_job(source)
            return (job, estimate.sample(job)), None
        job = job_of(source)
        forecast = estimate.from_journal(job, source)
        if forecast is None:
            return None, f"{source}.journal: holds no costs; give the job file instead"
        return (job, forecast), None
    except (JobError, StoreError) as error:
        return None, str(error)


def _replay(comm, known, seconds: float) -> dict | None:
    """Sleep through the job's costs, scaled; compare with the simulation on rank 0."""
    from hpcsweep.campaign.forecast import MOST_BLOCKS, MOST_TASKS
    from hpcsweep.parallel import replay
    from hpcsweep.parallel.simulation import MESSAGE_SECONDS, simulate

    messages = replay.time_messages(comm)
    blocks = None
    if comm.rank == 0:
        blocks, _ = known[1].costs.blocks(MOST_BLOCKS, MOST_TASKS)
        bound = simulate(blocks, comm.size).bound
        blocks = [block * (seconds / bound) for block in blocks]
    makespan, traffic = replay.replay(comm, blocks)
    if blocks is None:
        return None  # the master compares
    each = 1 / messages.capacity if messages else MESSAGE_SECONDS
    predicted = simulate(blocks, comm.size, message_seconds=each, poll_seconds=replay.SLICE)
    return {
        "ranks": comm.size,
        "predicted": predicted.makespan,
        "measured": makespan,
        "bound": predicted.bound,
        "recalls_predicted": predicted.recalls,
        "recalls_measured": traffic.recalls,
        "messages": asdict(messages) if messages else None,
    }


def _show(options, job, forecast, checked) -> None:
    from hpcsweep.campaign import forecast as estimate
    from hpcsweep.parallel.simulation import ranks_that_help

    study, each = job.study, {}
    if checked and checked["messages"]:
        each["message_seconds"] = 1 / checked["messages"]["capacity"]
    predictions = estimate.predict(job, forecast, options.ranks or estimate.RANKS, **each)
    if options.json:
        totals = forecast.costs.totals()
        report = {
            "job": job.name,
            "runs": study.n_runs,
            "runs_timed": forecast.n_timed,
            "core_seconds": float(totals.sum()),
            "ranks_that_help": ranks_that_help(totals),
            "frame_seconds": totals.tolist(),
            "predictions": [asdict(prediction) for prediction in predictions],
            "replay": checked,
        }
        json.dump(report, sys.stdout, indent=1)
        print()
        return
    print(
        f"{job.name}: {study.n_tasks} {study.task_noun}s, "
        f"{forecast.run_seconds * study.n_runs:.4g} core seconds, from {forecast.n_timed} runs "
        f"timed, of {study.n_runs}"
    )
    print("\n".join(estimate.ranks_text(job, forecast, predictions)))
    if checked is None:
        return
    print(
        f"replay:     on {checked['ranks']} ranks {checked['measured']:.4g} s, predicted "
        f"{checked['predicted']:.4g} s (ratio {checked['measured'] / checked['predicted']:.3f}), "
        f"bound {checked['bound']:.4g} s; {checked['recalls_measured']} tasks moved, predicted "
        f"{checked['recalls_predicted']}"
    )
    if checked["messages"]:
        print(
            f"messages:   {checked['messages']['per_second']:.3g} a second came, the master could "
            f"handle {checked['messages']['capacity']:.3g} a second"
        )
