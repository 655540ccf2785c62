"""`hpcsweep fragility`: tell capacities and fragility of responses to records.

Tell at which intensities the responses of a study of records reach a threshold: fractiles of the
records' capacities, interpolated between the stripes, and the lognormal fragility of largest
likelihood with its 95 % intervals. A motion that has collapsed reaches every threshold; --collapse
asks for collapse itself, of which a capacity is the middle between two stripes. Without contacts
and yielding, where responses are proportional to the intensity, the exact capacities. It says where
a median is an extrapolation beyond the stripes.
Drifts are ratios in percent where the job gives storey heights, else in its unit of length.

With --demands instead of a threshold: write peak drift ratios and floor accelerations of one
building at one intensity as the CSV table that Pelicun and PBE of SimCenter read. PFA-0 is that of
the ground, or of the slab on bearings. Records that collapse have no row; the first cell names
them, and what the table does not have.

examples:
  hpcsweep fragility pair.h5 --threshold 1.0 --place A
  hpcsweep fragility pair.h5 --threshold 5.0 --response acceleration
  hpcsweep fragility frame.h5 --collapse
  hpcsweep fragility pair.h5 --demands demands.csv --place A --scale 4.0
  hpcsweep plot pair.h5 --kind fragility --threshold 1.0
"""

import contextlib
import json

from hpcsweep.commands import CommandError, add_at, add_file, listing
from hpcsweep.commands.outputs import DEMANDS, check_overwriting
from hpcsweep.commands.rows import rows_of
from hpcsweep.figures.options import UNITS, file_name, positive


def configure(parser) -> None:
    """Add the options of the command."""
    from hpcsweep.figures.diagrams import responses

    add_file(parser)
    wanted = parser.add_mutually_exclusive_group(required=True)
    responses.THRESHOLD.add(wanted)
    responses.COLLAPSES.add(wanted)
    wanted.add_argument("--demands", type=file_name, metavar="CSV", help="table to be written")
    for option in (responses.RESPONSE, responses.PLACE, UNITS):
        option.add(parser)
    parser.add_argument("--scale", type=positive, help="intensity of the table, or the nearest")
    parser.add_argument("--json", action="store_true", help="machine-readable")
    add_at(parser)


def run(options) -> int:
    """Run the command."""
    from hpcsweep.store import Frames
    from hpcsweep.studies.ground_motion.records import Records
    from hpcsweep.studies.study import as_kind

    with contextlib.closing(Frames(options.file, "responses", options.at)) as frames:
        results, study = frames.gather([*frames]), as_kind(frames.study, Records)
    if options.demands:
        return _demands(options, results, study)
    return _threshold(options, results, study)


def _threshold(options, results, study) -> int:
    """Print capacities and fragility."""
    from hpcsweep.studies.ground_motion.describe import alone_words
    from hpcsweep.studies.ground_motion.stripes import COLLAPSE, capacities, fit, stripes_of

    options.response = options.response or "drift"
    if options.collapse:
        options.response, options.threshold = COLLAPSE, 1.0
    stripes = stripes_of(results, study, options.response, options.place, options.units)
    reached = capacities(stripes, options.threshold)
    fitted = fit(stripes, options.threshold)
    sums = {
        "response": stripes.label,
        "measure": stripes.measure,
        "threshold": options.threshold,
        "records": len(stripes.records),
        "highest": float(stripes.intensity[-1]),
        **_counted(reached),
        "later_crossings": int((reached.later_crossings > 0).sum()),
        "median": fitted.median,
        "median_interval": list(fitted.median_interval),
        "dispersion": fitted.dispersion,
        "dispersion_interval": list(fitted.dispersion_interval),
        "caution": fitted.caution,
    }
    if stripes.alone is not None and stripes.alone is not stripes.values:
        sums["alone"] = _counted(capacities(stripes, options.threshold, alone=True))
    if options.json:
        finite = json.loads(json.dumps(sums), parse_constant=lambda name: None)
        print(json.dumps(finite, indent=1))
        return 0
    threshold = "" if options.collapse else f"threshold {options.threshold:g}, "
    title = f"{stripes.label}: {threshold}{sums['records']} records"
    shown = sums | {
        "fractiles": _shown(sums),
        "lost": sums["unknown"] or None,
        "free": _shown(sums["alone"]) if "alone" in sums else None,
        "caution": sums["caution"] or None,
        "without": alone_words(study.structure),
    }
    print(listing(title, rows_of(ROWS, shown)))
    return 0


MOST_NAMES = 20
"""Records that have collapsed which a table of demands names."""
ROWS = """\
capacity | {fractiles} of {measure}; {never} records never reach it up to {highest:.4g}\
 | , {lost} unknown
{without} | {free}, exact
crossings | {later_crossings} records fall below it again
fragility | median {median:.4g} ({median_interval[0]:.4g} to {median_interval[1]:.4g}), \
dispersion {dispersion:.4f} ({dispersion_interval[0]:.4f} to {dispersion_interval[1]:.4f})
caution | {caution}
"""


def _counted(reached) -> dict:
    """Count fractiles of capacities, and the records that have none."""
    import numpy as np

    from hpcsweep.earthquakes.stripes import PARTS, fractiles

    parts = fractiles(reached.scale, PARTS).tolist()
    return {
        "capacity": dict(zip(map(str, PARTS), parts, strict=True)),
        "never": int(np.isinf(reached.scale).sum()),
        "unknown": int(np.isnan(reached.scale).sum()),
    }


def _shown(counted: dict) -> str:
    """Write fractiles of capacities."""
    parts = counted["capacity"].items()
    return ", ".join(f"{100 * float(part):g} % {value:.4g}" for part, value in parts)


def _demands(options, results, study) -> int:
    """Write the table of demands of a building at the scale nearest to one.

    The lowest acceleration is that of the ground, or of the slab on bearings. Records that have
    collapsed have no demands; the corner of the table names them, and what it does not tell.
    """
    import numpy as np

    from hpcsweep.earthquakes.demands import write_demands
    from hpcsweep.model.buildings import COLUMN
    from hpcsweep.model.isolation import SLAB
    from hpcsweep.studies.ground_motion.stripes import places_of

    check_overwriting(options.demands, DEMANDS)
    if "storey_height" not in results:
        raise CommandError(f"{options.file}: its job gives no storey_height: drift has no ratio")
    scales, place = results["scale"].values, options.place
    if options.scale is None and scales.size > 1:
        raise CommandError(f"--scale is missing: one of {scales[0]:g} to {scales[-1]:g}")
    buildings = study.structure.building_names
    if place not in buildings and (place or len(buildings) > 1):
        limit = f"a table is of one building, {', '.join(buildings)}"
        raise CommandError(f"--place {place or 'is missing'}: {limit}")
    at = int(np.argmin(np.abs(scales - (options.scale or scales[0]))))
    runs = results.isel(scale=at)
    every = [*map(str, results["floor"].values)]

    def of_building(names: list[str]) -> list[int]:
        chosen = places_of(names, place if len(buildings) > 1 else None)
        return [i for i in chosen if not names[i].endswith(SLAB) and COLUMN not in names[i]]

    storeys, floors = of_building([*map(str, results["storey"].values)]), of_building(every)
    g, where = study.gravity, f"{study.measure} = {scales[at]:.4g}"
    slab = f"{place if len(buildings) > 1 else ''} {SLAB}".strip()
    ground = runs["pga"].values * runs["factor"].values
    if slab in every:
        ground = runs["floor_acceleration"].values[:, every.index(slab)]
    names = np.array([record.name for record in study.suite], object)
    stands = runs["collapsed"].values == 0 if "collapsed" in runs else np.ones(names.size, bool)
    if not stands.any():
        raise CommandError(f"{options.file}: all records collapse at {where}: none has demands")
    columns = (
        runs["storey_drift"].values[stands][:, storeys] / results["storey_height"].values[storeys],
        runs["floor_acceleration"].values[stands][:, floors] / g,
        ground[stands] / g,
    )
    if not all(np.isfinite(column).all() for column in columns):
        raise CommandError(f"{options.file}: holds no response of some records at {scales[at]:g}")
    fallen = names[~stands].tolist()
    listed = ", ".join(fallen[:MOST_NAMES]) + ", ..." * (len(fallen) > MOST_NAMES)
    collapse = f"{len(fallen)} of {names.size} records collapse and are not here: {listed}"
    notes = (
        f"PFA-0 is that of the slab {slab}" * (slab in every),
        "no residual drifts (RID)" * ("residual_drift" in results),
        collapse * bool(fallen),
    )
    note, records = "; ".join(filter(None, notes)), names[stands].tolist()
    write_demands(options.demands, *columns, unit="g", records=records, note=note)
    remark = f": {note}" * bool(note)
    print(f"{options.demands}: {len(records)} records at {where}{remark}")
    return 0
