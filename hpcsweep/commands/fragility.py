"""`hpcsweep fragility`: tell capacities and fragility of responses to records.

Tell at which intensities the responses of a study of records reach a threshold: fractiles of the
records' capacities, interpolated between the stripes, and the lognormal fragility of largest
likelihood with its 95 % intervals. A motion that has collapsed reaches every threshold; --collapse
asks for collapse itself, of which a capacity is the middle between two stripes. Without contacts
and yielding, where responses are proportional to the intensity, the exact capacities. It says where
a median is an extrapolation beyond the stripes.
Drifts are ratios in percent where the job gives storey heights, else in its unit of length.
With --hazard, the annual frequencies of a site: how often it is reached, and its margin.

With --demands instead of a threshold: write drift ratios, peak and residual, floor accelerations
and the spectral acceleration of one building, a row a run, as the CSV table that Pelicun and PBE of
SimCenter read. PFA-0 is that of the ground, or of the slab on bearings. Of a structure that may
collapse, runs that do have no row: a file beside it, NAME.json, has them, and the collapse
fragility as Pelicun's configuration has it.

examples:
  hpcsweep fragility pair.h5 --threshold 1.0 --place A
  hpcsweep fragility pair.h5 --threshold 5.0 --response acceleration
  hpcsweep fragility frame.h5 --collapse --hazard site.csv --units g --dispersion 0.4
  hpcsweep fragility pair.h5 --demands demands.csv --place A
  hpcsweep fragility pair.h5 --demands demands.csv --place A --scale 4.0 8.0
  hpcsweep plot pair.h5 --kind fragility --threshold 1.0
"""

import contextlib
import json
import math

from hpcsweep.commands import CommandError, add_at, add_file, listing
from hpcsweep.commands.outputs import COLLAPSES, DEMANDS, check_overwriting, writing
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
    parser.add_argument(
        "--scale", type=positive, nargs="+", help="of the table, or the nearest (default: all)"
    )
    parser.add_argument(
        "--hazard",
        type=file_name,
        metavar="CSV",
        help="intensities, in the unit of those printed, and with what frequencies a year they are "
        "exceeded",
    )
    parser.add_argument(
        "--dispersion",
        type=positive,
        help="of all that records do not have, as models and construction, added in squares",
    )
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
    total = math.hypot(fitted.dispersion, options.dispersion or 0.0)
    if options.dispersion:
        sums |= {"total_dispersion": total, "added_dispersion": options.dispersion}
    if options.hazard:
        sums |= _risk(options.hazard, fitted.median, total)
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
        "caution": sums["caution"] or None,
        "beyond_curve": sums["beyond_curve"] if sums.get("beyond_curve", 0.0) > TOLD else None,
        "without": alone_words(study.structure),
    }
    if "alone" in sums:
        shown["free"] = _shown(sums["alone"]) + ", exact" * stripes.proportional
    print(listing(title, rows_of(ROWS, shown)))
    return 0


ROWS = """\
capacity | {fractiles} of {measure}; {never} records never reach it up to {highest:.4g}\
 | , {lost} unknown
{without} | {free}
crossings | {later_crossings} records fall below it again
fragility | median {median:.4g} ({median_interval[0]:.4g} to {median_interval[1]:.4g}), \
dispersion {dispersion:.4f} ({dispersion_interval[0]:.4f} to {dispersion_interval[1]:.4f})
total | dispersion {total_dispersion:.4f} with {added_dispersion:g} of all else
hazard | {annual_frequency:.3g} a year, {in_50_years:.3g} % in 50 years\
 | ; {beyond_curve:.2g} % of it beyond the ends of the curve
margin | the median is {margin:.3g} times the intensity of 2 % in 50 years, {rare:.4g}
caution | {caution}
"""
TOLD = 1.0
"""Percent of a frequency that are told to be beyond the curve."""
RARE = -math.log(0.98) / 50.0
"""Annual frequency of an intensity that is exceeded with 2 % in 50 years."""


def _risk(path, median: float, dispersion: float) -> dict:
    """Return how often a threshold is reached at the site of a hazard curve, and its margin."""
    from hpcsweep.earthquakes.hazard import annual_frequency, intensity_at, read_hazard

    try:
        curve = read_hazard(path)
    except (OSError, ValueError) as error:
        raise CommandError(f"--hazard {path}: {getattr(error, 'strerror', '') or error}") from None
    parts = annual_frequency(*curve, median, dispersion)
    total, rare = float(parts.sum()), intensity_at(*curve, RARE)
    known = {"margin": median / rare, "rare": rare} if math.isfinite(rare) else {}
    return known | {
        "annual_frequency": total,
        "in_50_years": -100.0 * math.expm1(-50.0 * total),
        "beyond_curve": 100.0 * float(parts[0] + parts[-1]) / total,
    }


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
    """Write the table of demands of a building at the scales nearest to some, or at all.

    Runs that have collapsed have no demands: they are in a file of their own, beside the fragility.
    """
    import numpy as np

    from hpcsweep.earthquakes.demands import write_demands
    from hpcsweep.figures.diagrams.responses import at_scale, scale_index
    from hpcsweep.studies.ground_motion.stripes import fallen, spectral_accelerations

    beside = options.demands.with_suffix(".json")
    check_overwriting(options.demands, DEMANDS)
    if "storey_height" not in results:
        raise CommandError(f"{options.file}: its job gives no storey_height: drift has no ratio")
    storeys, floors, slab = _places(results, study, options.place)
    g = study.gravity
    scales, _ = study.intensities(study.scale)
    chosen = sorted({scale_index(scales, each) for each in options.scale or scales})
    at = [at_scale(study, place) for place in chosen]
    where = at[0] if len(at) == 1 else f"{len(at)} stripes, {at[0]} to {at[-1]}"
    runs = results.isel(scale=chosen).transpose("scale", "record", ...)
    height, factor = results["storey_height"].values[storeys], runs["factor"].values
    accelerations = runs["floor_acceleration"].values / g
    period, spectral = spectral_accelerations(study)
    columns = {
        "drift_ratio": runs["storey_drift"].values[..., storeys] / height,
        "floor_acceleration": accelerations[..., floors],
        "ground_acceleration": factor * runs["pga"].values / g,
    }
    if slab:
        columns["ground_acceleration"] = accelerations[..., slab[0]]
    if "residual_drift" in runs:
        columns["residual_drift"] = np.abs(runs["residual_drift"].values[..., storeys]) / height
    stands = np.ones(factor.shape, bool)
    if "collapsed" in runs:
        check_overwriting(beside, COLLAPSES)
        stands = ~fallen(runs)
    if not stands.any():
        raise CommandError(f"{options.file}: all records collapse at {where}: none has demands")
    columns = {name: values[stands] for name, values in columns.items()}
    if not all(np.isfinite(column).all() for column in columns.values()):
        raise CommandError(f"{options.file}: holds no response of some records at {where}")
    names = [[one.name + f", {each}" * (len(at) > 1) for one in study.suite] for each in at]
    listed = np.array(names, object)
    notes = [f"PFA-0 is that of {results['floor'].values[i]}" for i in slab]
    if spectral is None:
        notes.append("no spectral acceleration, the records are not at hand")
    else:
        columns["spectral_acceleration"] = {period: (factor * spectral / g)[stands]}
    if "collapsed" in runs:
        fragility = _collapses(results, study, period, spectral)
        collapses = listed[~stands].tolist()
        notes.append(f"{len(collapses)} of {stands.size} runs collapse, see {beside.name}")
        with writing(beside):
            told = {"CollapseFragility": fragility, "unit": "mps2", "collapsed": collapses}
            beside.write_text(json.dumps(told, indent=1) + "\n")
    note, records = "; ".join(notes), listed[stands].tolist()
    write_demands(options.demands, **columns, unit="g", records=records, note=note)
    print(f"{options.demands}: {len(records)} runs at {where}" + f": {note}" * bool(note))
    return 0


def _places(results, study, place: str | None) -> tuple[list[int], list[int], list[int]]:
    """Return the places of a building's storeys, of its floors, and of what carries them."""
    from hpcsweep.model.isolation import SLAB
    from hpcsweep.model.unit_names import OF_SOIL, is_level
    from hpcsweep.studies.ground_motion.stripes import places_of

    buildings = study.structure.building_names
    if place not in buildings and (place or len(buildings) > 1):
        limit = f"a table is of one building, {', '.join(buildings)}"
        raise CommandError(f"--place {place or 'is missing'}: {limit}")
    storeys, floors = ([*map(str, results[dim].values)] for dim in ("storey", "floor"))
    own = place if len(buildings) > 1 else None
    bases = [f"{own or ''} {name}".strip() for name in (SLAB, OF_SOIL[0])]

    def of_building(names: list[str]) -> list[int]:
        chosen = places_of(names, own)
        return [i for i in chosen if not names[i].endswith(SLAB) and is_level(names[i])]

    slabs = [i for i, name in enumerate(floors) if name in bases]
    return of_building(storeys), of_building(floors), slabs


def _collapses(results, study, period: float, spectral) -> dict | None:
    """Return the fragility of collapse by the spectral acceleration, as Pelicun is told it.

    Its median is in m/s^2. None where records and stripes determine none.
    """
    from hpcsweep.earthquakes.fragility import capacity_fragility
    from hpcsweep.earthquakes.units import STANDARD_GRAVITY
    from hpcsweep.studies.ground_motion.stripes import COLLAPSE, capacities, stripes_of

    if spectral is None:
        return None
    reached = capacities(stripes_of(results, study, COLLAPSE), 1.0)
    unit = spectral / study.measures * (STANDARD_GRAVITY / study.gravity)
    lengths = {name: getattr(reached, name) * unit for name in ("scale", "below", "above")}
    try:
        fitted = capacity_fragility(reached._replace(**lengths), event=COLLAPSE)
    except ValueError:
        return None
    return {
        "DemandType": f"SA_{period:.4g}",
        "CapacityDistribution": "lognormal",
        "CapacityMedian": fitted.median,
        "Theta_1": fitted.dispersion,
    }
