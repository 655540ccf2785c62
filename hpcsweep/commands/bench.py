"""`hpcsweep bench`: measure run time against error."""

import json
import sys
from pathlib import Path

from hpcsweep.commands import USER_ERROR, complain


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    bench = commands.add_parser(
        "bench",
        help="measure run time against error, for our solvers and their peers",
        description="Measure run time against error on several regimes, for our solvers, scipy's "
        "and, where installed (extra 'bench'), numbalsoda and CVODE; the ratio of bdf to flow "
        "over a job's first frame; and flow against the number of floors.",
    )
    bench.add_argument(
        "job", type=Path, nargs="?", metavar="JOB.toml", help="job of the ratio (default: Figure 3)"
    )
    bench.add_argument("--ratio", action="store_true", help="only the ratio of bdf to flow")
    bench.add_argument("--json", action="store_true", help="machine-readable")
    bench.add_argument(
        "--plot", type=Path, metavar="PNG", help="also draw the work-precision figure"
    )
    bench.add_argument(
        "--tolerance",
        type=Path,
        metavar="PNG",
        help="only measure error against the tolerance asked for, of both solvers, and draw it",
    )
    bench.set_defaults(function=_bench)


def _tolerance(options) -> int:
    from hpcsweep import tolerance
    from hpcsweep.figures import tolerance as figure
    from hpcsweep.figures.style import PlotError

    rows = tolerance.measure(say=lambda text: print(f"  {text}", file=sys.stderr))
    if options.json:
        print(json.dumps(tolerance.as_json(rows), indent=1))
    else:
        print(tolerance.as_text(rows))
    try:
        figure.draw(rows, options.tolerance)
    except PlotError as error:
        complain(str(error))
        return USER_ERROR
    return 0


def _bench(options) -> int:
    if options.tolerance:
        return _tolerance(options)
    from hpcsweep import bench
    from hpcsweep.job import JobError, load_job, parse_job

    try:
        job = load_job(options.job) if options.job else parse_job(bench.FIGURE_3, "", "figure3")
    except JobError as error:
        complain(str(error))
        return USER_ERROR
    rows, by_floors = [], []
    if not options.ratio:
        rows = bench.work_precision(say=lambda text: print(f"  {text}", file=sys.stderr))
        by_floors = bench.floors()
    ratio = bench.sweep_ratio(job)
    if options.plot and rows:
        from hpcsweep.figures import work_precision

        work_precision.draw(rows, options.plot)
    if options.json:
        print(json.dumps(bench.as_json(rows, ratio, by_floors), indent=1))
    else:
        print(bench.as_text(rows, ratio, by_floors))
    return 0
