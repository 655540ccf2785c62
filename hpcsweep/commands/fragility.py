"""`hpcsweep fragility`: capacities and fragility of a study of records; tables for loss tools."""

import contextlib
import json
import math
from pathlib import Path

from hpcsweep.commands import RAW, CommandError, add_at
from hpcsweep.commands.outputs import DEMANDS, check_overwriting
from hpcsweep.figures.options import file_name

HELP = """\
Tell at which intensities the responses of a study of records reach a threshold: fractiles of the
records' capacities, and the lognormal fragility of largest likelihood with its 95 % intervals.
Drifts are ratios in percent where the job gives storey heights, else in its unit of length.

With --demands instead of a threshold: write peak drift ratios and floor accelerations of one
building at one intensity as the CSV table that Pelicun and PBE of SimCenter read."""
EXAMPLES = """\
examples:
  hpcsweep fragility pair.h5 --threshold 1.0 --place A
  hpcsweep fragility pair.h5 --threshold 5.0 --response acceleration
  hpcsweep fragility pair.h5 --demands demands.csv --place A --scale 4.0
  hpcsweep plot pair.h5 --kind fragility --threshold 1.0"""


def add_to(commands) -> None:
    """Add the command to the parser's commands."""
    parser = commands.add_parser(
        "fragility",
        help="tell capacities and fragility of responses to records",
        description=HELP,
        epilog=EXAMPLES,
        formatter_class=RAW,
    )
    parser.add_argument("file", type=Path, metavar="FILE")
    wanted = parser.add_mutually_exclusive_group(required=True)
    wanted.add_argument("--threshold", type=float, help="response that is a failure")
    wanted.add_argument("--demands", type=file_name, metavar="CSV", help="table to be written")
    parser.add_argument(
        "--response",
        default="drift",
        choices=("drift", "displacement", "acceleration", "force", "impacts"),
        help="of which the threshold is (default: %(default)s)",
    )
    parser.add_argument(
        "--place", metavar="NAME", help="storey, floor, contact or building (default: the largest)"
    )
    parser.add_argument("--scale", type=float, help="intensity of the table; the nearest there is")
    parser.add_argument("--json", action="store_true", help="machine-readable")
    add_at(parser)
    parser.set_defaults(function=_fragility)


def _fragility(options) -> int:
    from hpcsweep.store import Frames

    with contextlib.closing(Frames(options.file, "responses", options.at)) as frames:
        results, study = frames.gather([*frames]), frames.study
    if options.demands:
        return _demands(options, results, study)
    if not math.isfinite(options.threshold):
        raise CommandError(f"--threshold {options.threshold:g}: must be finite")
    return _threshold(options, results, study)


def _threshold(options, results, study) -> int:
    """Print capacities and fragility."""
    import numpy as np

    from hpcsweep.campaign.stripes import fit, stripes_of
    from hpcsweep.earthquakes.stripes import PARTS, capacity, fractiles

    stripes = stripes_of(results, study, options.response, options.place)
    reached = capacity(stripes.intensity, stripes.values, options.threshold)
    parts = fractiles(reached.scale, PARTS).tolist()
    sums = {
        "response": stripes.label,
        "measure": stripes.measure,
        "threshold": options.threshold,
        "records": len(stripes.records),
        "capacity": dict(zip(map(str, PARTS), parts, strict=True)),
        "never": int(np.isinf(reached.scale).sum()),
        "later_crossings": int((reached.later_crossings > 0).sum()),
    }
    found = fit(stripes, options.threshold)
    sums |= {
        "median": found.median,
        "median_interval": list(found.median_interval),
        "dispersion": found.dispersion,
        "dispersion_interval": list(found.dispersion_interval),
    }
    if options.json:
        finite = {k: v if np.isfinite(v) else None for k, v in sums["capacity"].items()}
        print(json.dumps({**sums, "capacity": finite}, indent=1))
        return 0
    capacities = ", ".join(f"{100 * p:g} % {v:.4g}" for p, v in zip(PARTS, parts, strict=True))
    low, high = sums["median_interval"]
    least, most = sums["dispersion_interval"]
    print(
        f"{stripes.label}: threshold {options.threshold:g}, {sums['records']} records\n"
        f"  capacity    {capacities} of {stripes.measure}; {sums['never']} records never reach it\n"
        f"  crossings   {sums['later_crossings']} records fall below it again\n"
        f"  fragility   median {found.median:.4g} ({low:.4g} to {high:.4g}), dispersion "
        f"{found.dispersion:.4f} ({least:.4f} to {most:.4f})"
    )
    return 0


def _demands(options, results, study) -> int:
    """Write the table of demands of a building at the scale nearest to one."""
    import numpy as np

    from hpcsweep.campaign.stripes import places_of
    from hpcsweep.earthquakes.demands import write_demands

    check_overwriting(options.demands, DEMANDS)
    if "storey_height" not in results:
        raise CommandError(f"{options.file}: its job gives no storey_height: drift has no ratio")
    scales = results["scale"].values
    if options.scale is None and scales.size > 1:
        raise CommandError(f"--scale is missing: one of {scales[0]:g} to {scales[-1]:g}")
    at = int(np.argmin(np.abs(scales - (options.scale or scales[0]))))
    one = results.isel(scale=at)
    storeys, floors = (
        places_of([str(name) for name in results[dim].values], options.place)
        for dim in ("storey", "floor")
    )
    height = results["storey_height"].values[storeys]
    g = study.gravity
    columns = (
        one["storey_drift"].values[:, storeys] / height,
        one["floor_acceleration"].values[:, floors] / g,
        one["pga"].values * one["factor"].values / g,
    )
    if not all(np.isfinite(column).all() for column in columns):
        raise CommandError(f"{options.file}: holds no response of some records at {scales[at]:g}")
    write_demands(options.demands, *columns, unit="g")
    print(f"{options.demands}: {one.sizes['record']} records at {scales[at]:g}")
    return 0
