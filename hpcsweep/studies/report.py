"""What users are told of studies over frequency and amplitude before anything is computed."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hpcsweep.earthquakes.units import seconds_in
from hpcsweep.model.description import few
from hpcsweep.model.plausibility import implausible
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import known_unit, unit_of
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.studies.study import Lines, Study


class Driven(NamedTuple):
    """What is driven at a place: its frequency or the parameter of a path, and what is there."""

    name: str
    value: float
    structure: Structure
    omega: float
    amplitude: float


FAR = 3.0
"""Least ratio of every frequency to every natural one that counts as far from resonance."""
WIDE = 0.05
"""Least amplitude step, over the smallest grazing amplitude, that disturbs a sweep."""
MAX_FRAMES = 200
"""Frames whose amplitudes and grazing are examined."""


def starting_range(study: Study) -> list[str]:
    """Return a line for each component, or group of equal ones, with the range of the starts.

    Parameters
    ----------
    study : Study
        Of one that varies keys the part at the first values counts.

    Returns
    -------
    list of str
        Empty for a study without a box or slice of starts.
    """
    part = study.part((0,) * len(study.axes))
    n = part.structure.n_floors
    return [
        f"{name} from {low:.6g} to {high:.6g}"
        + known_unit(part.structure, "length" if index < n else "velocity")
        for name, (index, low, high) in part.starting_range.items()
    ]


def ranges(
    structure: Structure, omega: np.ndarray, amplitude: np.ndarray, path: Sequence[Driven] = ()
) -> Lines:
    """Tell the ranges of frequency and amplitude, and of first contact, along a path if any."""
    unit = known_unit(structure, "acceleration")
    named = structure.unit_names.time
    cycles = unit_of(structure, "cycles") if named else "cycles per unit of time"
    turns = f"{_range(omega / (2 * np.pi))} {cycles}"
    yield "frequency", f"{_range(omega)}{known_unit(structure, 'frequency')} = {turns}"
    yield "amplitude", f"{_range(amplitude)}{unit}"
    places = path or [Driven("Omega", each, structure, each, 0.0) for each in _some(omega)]
    grazes = np.array([each.structure.grazing_amplitude(each.omega) for each in places])
    if not np.isfinite(grazes).any():
        free = "not known: where what has no spring stands without contact is its history"
        yield "grazing", free if np.isnan(grazes).any() else "there is no contact"
        return
    least, most = int(grazes.argmin()), int(np.where(np.isfinite(grazes), grazes, 0).argmax())
    text = " to ".join(
        f"{grazes[k]:.6g}{unit} ({places[k].name} = {places[k].value:.6g})"
        for k in dict.fromkeys((least, most))
    )
    motion = "free motion" if LINEAR.of(structure) else "motion without slip"
    text = f"the {motion} first touches at A = {text}"
    if path:
        touched = np.array([each.amplitude for each in path]) >= grazes
        there = [path[k].value for k in np.flatnonzero(touched).tolist()]
        where = (
            f"from {path[0].name} = {min(there):.6g} to {max(there):.6g}" if there else "nowhere"
        )
        text += f"; along the path it touches {where}"
    yield "grazing", text


def doubts(
    structure: Structure, omega: np.ndarray, amplitude: np.ndarray, continues: bool
) -> Iterator[str]:
    """Return one line for each thing that looks like a mistake in what drives the structure.

    Parameters
    ----------
    structure : Structure
    omega, amplitude : ndarray
        Ascending.
    continues : bool
        Whether runs start from the end of the one at the amplitude before.
    """
    yield from implausible(structure, seconds_in(structure.unit_names.time))
    natural = np.fmax(structure.frequencies, np.finfo(float).tiny)
    orders = np.array([order for order, _, _ in structure.forcing.terms if order])
    ratio = np.abs(np.log(np.outer(orders, omega).ravel()[:, None] / natural))
    if not structure.n_rigid and ratio.min() > np.log(FAR):
        yield (
            f"every frequency ({few(tuple(np.unique(omega).tolist()))}) is more than {FAR:g} "
            f"times off every natural one (the lowest {natural[0]:.6g})"
        )
    least = min(structure.grazing_amplitude(each) for each in _some(omega))
    if amplitude.size > 1 and continues and 0 < least < np.inf:
        step = float(np.diff(amplitude).max())
        if step > WIDE * least and amplitude.max() > least:
            yield (
                f"an amplitude step of {step:.4g} is {step / least:.2g} of the smallest "
                f"grazing amplitude {least:.4g}: the transient after a step touches where the "
                "steady motion does not"
            )


def _range(values: np.ndarray) -> str:
    """Format the lowest and the highest of some values, or the only one."""
    return " to ".join(dict.fromkeys(f"{value:.6g}" for value in (values.min(), values.max())))


def _some(omega: np.ndarray) -> list[float]:
    """Return frequencies, each once; of many `MAX_FRAMES`."""
    omegas = np.unique(omega)
    last = omegas.size - 1
    return omegas[np.linspace(0, last, min(omegas.size, MAX_FRAMES)).astype(int)].tolist()
