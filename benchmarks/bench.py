"""Speed against error, ratios to peers, scaling, start-up, and the skip rules, each in turn."""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
import json
import sys
from pathlib import Path

from speed import PARTS

from hpcsweep.figures.options import whole_number

DESCRIPTION = """\
Measure speed and error. Whatever is compared is timed in turn, within one run:

  work-precision  run time against error, for our solvers, scipy's and, where installed, CVODE
                  (extra 'bench') and numbalsoda (built from source), in several regimes
  ratio           flow against scipy's BDF and DOP853 and a compiled DOP853 on attractors of a
                  building and of two that pound, and against bdf over the first frame of JOB
  profile         runs on frames of JOB (default: eight frames of jobs/paper/bluecrystal.toml): CPU
                  time by part of the solver, with counts of periods, steps and passages
  floors          flow against the number of floors
  ranks           strong scaling of a small job over the cores of this machine (needs mpirun)
  startup         seconds of a tiny job, cold and warm
  skips           the rules that spare periods, against the window procedure on random points of
                  Figure 6; every difference is followed up"""
POINTS = 500
"""Random points of the skip rules where no number is given."""


def _parts(text: str) -> list[str]:
    parts = [part for part in text.split(",") if part]
    wrong = [part for part in parts if part not in PARTS]
    if wrong or not parts:
        name = wrong[0] if wrong else text
        raise argparse.ArgumentTypeError(f"'{name}' is none of {', '.join(PARTS)}")
    return parts


def build_parser() -> argparse.ArgumentParser:
    """Build the parser of the options."""
    bench = argparse.ArgumentParser(
        prog="bench",
        description=DESCRIPTION,
        epilog="exit codes: 0 done, 1 a skip rule made a difference that is left unexplained,\n"
        "or a program that was to be timed failed, 2 a mistake in what was asked",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    bench.add_argument(
        "job", type=Path, nargs="?", metavar="JOB.toml", help="job of the ratio and the profile"
    )
    bench.add_argument(
        "--only", type=_parts, metavar="PART[,PART...]", help="only these of the parts above"
    )
    bench.add_argument("--ratio", action="store_true", help="the same as --only ratio")
    bench.add_argument(
        "--skips",
        type=whole_number(1),
        metavar="N",
        help=f"only the skip rules, on N random points (whole bench: {POINTS})",
    )
    bench.add_argument(
        "--seed", type=int, default=0, metavar="K", help="of the random points (default: 0)"
    )
    bench.add_argument(
        "--processes",
        type=whole_number(1),
        metavar="N",
        help="for the random points (default: all cores)",
    )
    bench.add_argument("--json", action="store_true", help="machine-readable")
    bench.add_argument(
        "--plot", type=Path, metavar="PNG", help="also draw the work-precision figure"
    )
    bench.add_argument(
        "--tolerance",
        type=Path,
        metavar="PNG",
        help="only measure error against the tolerance requested, of both solvers, and draw it",
    )
    return bench


def _tolerance(options) -> int:
    import tolerance
    import tolerance_figure as figure

    rows = tolerance.measure(say=lambda text: print(f"  {text}", file=sys.stderr))
    if options.json:
        print(json.dumps(tolerance.as_json(rows), indent=1))
    else:
        print(tolerance.as_text(rows))
    figure.draw(rows, options.tolerance)
    return 0


def _requested(options) -> list[str]:
    """Return the parts to measure, in order."""
    parts = set(options.only or [])
    if options.ratio:
        parts.add("ratio")
    if options.skips:
        parts.add("skips")
    return [part for part in PARTS if part in parts or not parts]


def main(arguments: list[str] | None = None) -> int:
    """Measure what is asked; return the exit code."""
    parser = build_parser()
    options = parser.parse_args(arguments)
    if options.tolerance:
        return _tolerance(options)
    parts = _requested(options)
    if options.plot and "work-precision" not in parts:
        parser.error("--plot: draws work-precision, which is not among the parts that are measured")
    if options.seed < 0:
        parser.error(f"--seed {options.seed}: must not be negative")
    from speed import ratios

    from hpcsweep.job import JobError, load_job, parse_job

    try:
        job = load_job(options.job) if options.job else parse_job(ratios.FIGURE_3, "", "figure3")
    except JobError as error:
        parser.error(str(error))
    results, failed = {}, False
    for part in parts:
        result, text, well = MEASURE[part](options, job)
        results[part.replace("-", "_")] = result
        failed |= not well
        if not options.json:
            print(text + "\n", flush=True)
    if options.json:
        print(json.dumps(results, indent=1))
    return 1 if failed else 0


def _say(text: str) -> None:
    print(f"  {text}", file=sys.stderr, flush=True)


def _work_precision(options, _job):
    from speed import work_precision

    from hpcsweep.figures.style import PlotError

    rows = work_precision.work_precision(say=_say)
    drawn = True
    if options.plot:
        from speed import figure

        try:
            figure.draw(rows, options.plot)
        except (PlotError, OSError) as error:
            print(f"{options.plot}: {error}", file=sys.stderr)
            drawn = False
    return work_precision.as_json(rows), work_precision.as_text(rows), drawn


def _ratio(_options, job):
    from speed import ratios

    motions, sweep = ratios.motion_ratios(), ratios.sweep_ratio(job)
    return ratios.as_json(motions, sweep), ratios.as_text(motions, sweep), True


def _profile(options, job):
    from speed import profile

    rows = profile.profile(job if options.job else None)
    return profile.as_json(rows), profile.as_text(rows), True


def _floors(_options, _job):
    from speed import scaling

    rows = scaling.floors()
    return rows, scaling.floors_as_text(rows), True


def _ranks(_options, _job):
    from speed import scaling

    result = scaling.ranks(say=_say)
    return result, scaling.ranks_as_text(result), "failed" not in result


def _startup(_options, _job):
    from speed import startup

    result = startup.startup(say=_say)
    return result, startup.as_text(result), "failed" not in result


def _skips(options, _job):
    from speed import scaling, skips

    result = skips.compare(
        options.skips or POINTS, options.seed, options.processes or scaling.cores(), say=_say
    )
    return result, skips.as_text(result), not result["unexplained"]


MEASURE = {
    "work-precision": _work_precision,
    "ratio": _ratio,
    "profile": _profile,
    "floors": _floors,
    "ranks": _ranks,
    "startup": _startup,
    "skips": _skips,
}
"""For each part a function of the options and the job: (plain result, text, whether it is well)."""

if __name__ == "__main__":
    sys.exit(main())
