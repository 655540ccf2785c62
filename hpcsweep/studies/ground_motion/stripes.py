"""The stripes of a file of responses to records: one response of each record at each scale.

A response is the largest of some places: of all storeys, say, of those of one building, or of one.
Drifts are ratios of the storeys' heights where the job gives these. A response is infinite where
the motion has collapsed, whatever its peak until then.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hpcsweep.earthquakes.spectrum import spectrum
from hpcsweep.earthquakes.stripes import Capacity, capacity, linear_capacity
from hpcsweep.earthquakes.units import seconds_in
from hpcsweep.model.reduction import physical
from hpcsweep.model.unit_names import unit_of
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.ground_motion.keys import own_period
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.variables import BESIDE
from hpcsweep.studies.quantities import QUANTITIES
from hpcsweep.studies.variables import percent_of_height

if TYPE_CHECKING:
    from hpcsweep.earthquakes.fragility import Fragility

RESPONSES = {
    "drift": QUANTITIES["storey_drift"],
    "displacement": QUANTITIES["displacement"],
    "acceleration": QUANTITIES["floor_acceleration"],
    "force": QUANTITIES["contact_force"],
    "impacts": QUANTITIES["impacts"],
    "ductility": QUANTITIES["ductility"],
    "residual_drift": QUANTITIES["residual_drift"],
    "base_shear": QUANTITIES["base_shear"],
}
"""Variables of the file by the names of responses."""
LACKS = {
    "storey_drift": "storeys",
    "floor": "floors",
    "stop": "contacts",
    "slider": "storeys that yield, or sliders",
    "storey": "storeys that yield",
    "building": "output.base_shear",
}
"""What a structure without a variable, or one along a dimension, lacks."""
COLLAPSE = "collapse"
"""A response that is 0, or infinite."""


class StripesError(ValueError):
    """What a file of responses does not have or bound; the message is one line for the user."""


class Stripes(NamedTuple):
    """One response of each record at each scale."""

    intensity: np.ndarray
    """Scales, shape (s,)."""
    measure: str
    """Measure of the scales, and its unit."""
    values: np.ndarray
    """Responses, shape (records, s); NaN where they are not known."""
    alone: np.ndarray | None
    """The same without contacts, or of one that has none without yielding, where it is known."""
    proportional: bool
    """Whether that is so to the intensity."""
    label: str
    """Label of the response, with its unit."""
    unit: str
    """Of the response; empty for numbers."""
    records: tuple[str, ...]


class Responses(NamedTuple):
    """One response of each record at each scale, at each of its places."""

    values: np.ndarray
    """Shape (records, s, places): NaN where they are not known, inf of a motion that collapses."""
    alone: np.ndarray | None
    proportional: bool
    label: str
    unit: str
    """As of `Stripes`, from `alone` on, the label without its unit."""
    dim: str
    """Dimension of the places: ``storey``, ``floor``, ``stop``, ``slider``, ``building``."""
    names: tuple[str, ...]


def responses_of(results, study: Records, response: str = "drift") -> Responses:
    """Return a response at each of its places.

    Parameters
    ----------
    results : xarray.Dataset
        Of one part of a study of records.
    study : Records
        That part.
    response : str
        One of `RESPONSES`, or `COLLAPSE`.

    Raises
    ------
    StripesError
        If the file has no such response.
    """
    if response == COLLAPSE:
        name, label, quantity, lacks = "collapsed", COLLAPSE, "1", "collapse_drift"
    elif response in RESPONSES:
        variable = RESPONSES[response]
        name, label, quantity = variable.name, variable.label, variable.units
        lacks = LACKS.get(name) or LACKS[variable.dims[-1]]
    else:
        raise StripesError(f"response {response!r}: must be one of {', '.join(RESPONSES)}")
    structure = study.structure
    if name not in results:
        raise StripesError(f"the results hold no {name}: the structure has no {lacks}")
    array = results[name]
    if response == COLLAPSE:
        array = array.expand_dims(structure=["all"], axis=-1)
    dim = str(array.dims[-1])
    factor, unit = np.ones(1), unit_of(structure, quantity)
    percent = percent_of_height(results)
    if dim == "storey" and percent is not None:
        factor, unit = percent, "%"
        label += " ratio"
    values = np.abs(array.values * factor).astype(float)
    values[results["outcome"].values != Outcome.COMPLETE] = np.nan
    if "collapsed" in results:
        values[fallen(results)] = np.inf
    free = values if LINEAR.of(structure) and not structure.contacts else None
    for beside in {f"{name}_{kind}" for kind in BESIDE} & {*results}:
        free = np.where(
            falls_alone(results)[..., None], np.inf, abs(results[beside].values * factor)
        )
    if response == COLLAPSE and "collapse_time_alone" in results:
        free = np.where(falls_alone(results), np.inf, 0.0)[..., None]
    proportional = LINEAR.of(structure) or not structure.contacts
    names = tuple(str(place) for place in array[dim].values)
    unit = "" if unit == "1" else unit
    return Responses(values, free, proportional, label, unit, dim, names)


def fallen(results) -> np.ndarray:
    """Return which motions have collapsed, or leave nothing that stands, shape of the runs.

    Nothing stands at the end of a whole motion that has no residual drift.
    """
    stands = results["collapsed"].values == 0
    if "strength_lost" in results:
        complete = results["outcome"].values == Outcome.COMPLETE
        stands &= ~(complete & results["residual_drift"].isnull().any("storey").values)
    return ~stands


def falls_alone(results) -> np.ndarray:
    """Return whether motions without contacts collapse, shape (records, s) or ()."""
    return np.isfinite(np.asarray(results.get("collapse_time_alone", np.nan)))


def stripes_of(
    results,
    study: Records,
    response: str = "drift",
    place: str | None = None,
    units: str | None = None,
    known: Responses | None = None,
) -> Stripes:
    """Return the stripes of a response.

    Parameters
    ----------
    results, study, response
        As of `responses_of`.
    place : str, optional
        A storey, floor or contact by its name, or a building, whose storeys or floors are its name
        with a number. Default: all.
    units : str, optional
        ``g`` of intensities and responses that are accelerations; default: the structure's.
    known : Responses, optional
        Those of `responses_of`, if they are.

    Raises
    ------
    StripesError
        If the file has no such response, no such place, or intensities that are not in g.
    """
    responses = known or responses_of(results, study, response)
    chosen = places_of([*responses.names], place)
    in_g = units == "g" and getattr(RESPONSES.get(response), "units", "") == "acceleration"
    if units == "g" and not in_g and study.measure.quantity != "acceleration":
        raise StripesError(f"--units g: the intensities are of {study.measure}, no acceleration")
    of = study.gravity if in_g else 1.0
    values, alone = responses.values[..., chosen].max(axis=-1) / of, responses.alone
    if alone is responses.values:
        alone = values
    elif alone is not None:
        alone = alone[..., chosen].max(axis=-1) / of
    unit = "g" if in_g else responses.unit
    return Stripes(
        intensity=study.intensities(results["scale"].values, units)[0],
        measure=intensity_label(study, units),
        values=values,
        alone=alone,
        proportional=responses.proportional,
        label=responses.label + f" of {place}" * (place is not None) + _label(unit or "1"),
        unit=unit,
        records=tuple(str(record) for record in results["record"].values),
    )


def spectral_accelerations(study: Records) -> tuple[float, np.ndarray | None]:
    """Return a period in seconds, and Sa of each record as it is; None if they are not at hand.

    The period is that of the scales if they are of Sa, else the longest of the structure.
    """
    measure, period = study.measure, own_period(study.structure, study.measure)
    second = float(seconds_in(study.structure.unit_names.time or "s") or 1)
    if measure.by == "sa":
        (named,) = measure.periods
        return second * (named if isinstance(named, float) else period), study.measures
    try:
        records = [study.record(i) for i in range(len(study.suite))]
        found = [spectrum(record, [period]).acceleration[0] for record in records]
    except ValueError:
        return second * period, None
    return second * period, np.array(found)


def intensity_label(study: Records, units: str | None = None) -> str:
    """Write the measure of the scales, with its unit or in g."""
    named = study.measure.named(study.structure.unit_names.time)
    return named + _label(study.intensities(study.scale, units)[1])


def capacities(stripes: Stripes, threshold: float, alone: bool = False) -> Capacity:
    """Return the capacities of the records, exact where responses are proportional.

    Parameters
    ----------
    stripes : Stripes
    threshold : float
    alone : bool
        Without contacts: `stripes.alone`, which must be known.

    Raises
    ------
    StripesError
        If the threshold is not above 0.
    """
    if not 0 < threshold < np.inf:
        raise StripesError(f"threshold must be finite and above 0, is {threshold:g}")
    values = np.asarray(stripes.alone if alone else stripes.values)
    if stripes.proportional and (alone or stripes.alone is stripes.values):
        return linear_capacity(stripes.intensity[-1], values[:, -1], threshold)
    return capacity(stripes.intensity, values, threshold)


def fit(stripes: Stripes, threshold: float) -> "Fragility":
    """Fit the fragility of a threshold to the capacities of the records.

    Raises
    ------
    StripesError
        If they determine no curve: see `hpcsweep.capacity_fragility`.
    """
    from hpcsweep.earthquakes.fragility import REACHED, capacity_fragility  # loads scipy

    capacity = capacities(stripes, threshold)
    if stripes.label.startswith(COLLAPSE):
        option, event, largest = "--collapse", COLLAPSE, ""
    else:
        most = stripes.values[np.isfinite(stripes.values)].max(initial=0.0)
        largest = f", whose largest response is {most:.4g} {stripes.unit}".rstrip()
        option, event = f"--threshold {threshold:g}", REACHED
    try:
        return capacity_fragility(capacity, event=event)
    except ValueError as error:
        raise StripesError(f"{option}: {error}{largest}") from None


def _label(unit: str) -> str:
    """Return a unit as it stands behind a label; nothing for numbers."""
    return "" if unit == "1" else f"  [{unit.replace('^2', '²')}]"


def places_of(names: list[str], place: str | None) -> list[int]:
    """Return the places of a name, or of a building's names; without one no amounts of modes."""
    if place is None:
        return physical(names)
    if place in names:
        return [names.index(place)]
    numbered = [
        i for i, name in enumerate(names) if name.startswith(place) and name[len(place) :].isdigit()
    ]
    if not numbered:
        raise StripesError(f"--place {place}: must be one of {', '.join(names)}, or a building")
    return numbered
