r"""Judge tables of thousands of rows without making the structure of each part.

A limit of one key is an interval. Where keys have no limits in common, the parts with the least and
the largest value of each tell of all whether they are valid. Two limits are common to all keys of
masses and stiffnesses: the ratios of eigenvalues, and of springs. A key that varies by the factor
r changes M or K by r^2 at most, so a structure is far enough from these limits if it keeps them by
the product of all r^2.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hpcsweep.job.keys import bare
from hpcsweep.job.structures import MAX_DAMPING
from hpcsweep.model.isolation import Isolation, springs
from hpcsweep.model.modes import chain_periods
from hpcsweep.model.structure import MAX_STIFFNESS
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import Axis, as_kind
from hpcsweep.studies.variable import Variable

OF_STOREYS = {"mass", "storey_stiffness", "stiffness_ratio", "damping_ratio"}
OF_STOREYS |= {"yield_drift", "yield_force"}
OF_BEARINGS = {"period", "slab_mass", "stiffness", "radius", "strength", "friction"}
ALONE = {
    "structure": OF_STOREYS,
    "building": OF_STOREYS | OF_BEARINGS,
    "pounding": {"gap", "stiffness", "restitution", "damping"},
}
"""Names of keys whose limits, for numbers above 0, depend on no other key, by their tables."""
LIMITING = {"storey_damping", "p_delta", "collapse_drift", "matrices", "model"}
LIMITING |= {"initial_stiffness", "column", "along", "points"}
"""Names of keys that the limits of others depend on."""
OTHERS = {"column", "model", "matrices"}
"""Keys of structures that are not storeys alone, on the ground or on bearings."""
TABLES = ("study", "structure", "building", "pounding", "sweep")
KINDS = ("records", "points", "amplitude_sweep")
"""Kinds of study that ask nothing further of the numbers of a structure."""
EXTENT = 1e6
"""Largest ratio of masses, and of stiffnesses, whose periods are known to nine digits."""


@dataclass(frozen=True)
class Table:
    """The parts of a job as columns: the values of each varied key.

    Attributes
    ----------
    tree : mapping
        The job of the first part.
    axes : tuple of Axis
    """

    tree: Mapping
    axes: tuple[Axis, ...]

    @cached_property
    def _names(self) -> set[str]:
        """Names of all keys but those of records."""
        return {*_names({key: self.tree.get(key) for key in TABLES})}

    @cached_property
    def _numbers(self) -> list[dict[str, np.ndarray]]:
        """Values of the keys of each axis that are numbers above 0, or lists of them: (n, any)."""
        return [
            {key.key: n for key in axis.keys if (n := _positive(key.given)) is not None}
            for axis in self.axes
        ]

    def telling(self, base: RunGrid) -> list[Place]:
        """Return the places of parts by whose validity all are valid; none: check all.

        Base is the first part.
        """
        columns = {key: values for axis in self._numbers for key, values in axis.items()}
        keys = [column.key for column in columns_of(self.axes)]
        is_separate = all(key in columns and _is_alone(key) for key in keys)
        if base.kind not in KINDS or not is_separate or LIMITING & self._names:
            return []
        if not _keeps_far(base, columns):
            return []
        first = (0,) * len(self.axes)
        extreme = {first}
        for i, axis in enumerate(self._numbers):
            for values in axis.values():
                ends = {*values.argmin(axis=0).tolist(), *values.argmax(axis=0).tolist()}
                extreme |= {(*first[:i], at, *first[i + 1 :]) for at in ends}
        return sorted(extreme)

    def by_part(self, base: RunGrid) -> dict[str, tuple[Variable, np.ndarray]] | None:
        """Return the variables known beforehand in which parts differ; None: parts must be made."""
        if any("storey_height" in column.key for column in columns_of(self.axes)):
            return None
        if base.kind != "records":
            return {}
        from hpcsweep.studies.ground_motion.keys import ISOLATED_PERIOD, RecordGrid, nearest
        from hpcsweep.studies.ground_motion.variables import FACTOR

        study = as_kind(base, RecordGrid)
        stored = self.tree["records"]["found"]
        if not (own := study.measure.own_period) or not isinstance(stored, Mapping):
            return {}
        periods = None if own == ISOLATED_PERIOD else self.longest_periods(study.gravity)
        if periods is None:
            return None
        try:
            at = nearest(stored["periods"], periods)
            measures = {r["name"]: np.array(r["measure"], float)[at] for r in stored["records"]}
        except (TypeError, ValueError, IndexError):
            return None
        at_periods = np.stack([measures[facts.name] for facts in study.suite], axis=-1)
        shape = [len(axis.values) for axis in self.axes]
        factors = (study.scale / at_periods[..., None]).reshape(*shape, *study.factor.shape)
        differ = not np.array_equal(factors, np.broadcast_to(study.factor, factors.shape))
        along = FACTOR.along(tuple(axis.name for axis in self.axes))
        return {FACTOR.name: (along, factors)} if differ else {}

    def longest_periods(self, gravity: float) -> np.ndarray | None:
        """Return the longest natural period of each part, flat.

        Masses, stiffnesses and periods tell it of storeys on the ground or on bearings; else, or
        where there may be a mistake, it is None: structures have to be made.
        """
        varied = {column.key for column in columns_of(self.axes)}
        if OTHERS & self._names or "structure.n_floors" in varied:
            return None
        tables = {f"building[{k}]": table for k, table in enumerate(self.tree.get("building", []))}
        tables = tables or {"structure": self.tree.get("structure", {})}
        try:
            periods = [self._periods_of(*building, gravity) for building in tables.items()]
            return np.max(periods, axis=0)
        except (KeyError, ValueError):
            return None

    def _periods_of(self, name: str, table: Mapping, gravity: float) -> np.ndarray:
        """Return the longest period of a building in each part.

        Raises
        ------
        KeyError, ValueError
            If it is not known of numbers of ordinary sizes.
        """
        bearings = table.get("isolation")
        if "soil" in table:
            raise ValueError
        if "period" in table:
            period = self._values(f"{name}.period", table["period"], 1)
            if bearings is None:
                return period[:, 0]
        n = table.get("n_floors", np.size(table.get("mass", 1.0)))
        keys = "mass", "storey_stiffness"
        mass, stiffness = (self._values(f"{name}.{k}", table.get(k, 1.0), n) for k in keys)
        if "period" in table:
            stiffness *= (chain_periods(mass, stiffness)[:, None] / period) ** 2
        if bearings is not None:
            of = {k: self._values(f"{name}.isolation.{k}", v, 1)[:, 0] for k, v in bearings.items()}
            for end in (np.min, np.max):  # which are in the limits if all are
                Isolation(**{k: float(end(values)) for k, values in of.items()}, gravity=gravity)
            mass = np.column_stack((of["slab_mass"], mass))
            stuck = springs(of | {"gravity": gravity}, mass.sum(axis=1))[1]
            stiffness = np.column_stack((np.broadcast_to(stuck, len(mass)), stiffness))
        return chain_periods(mass, stiffness)

    def _values(self, key: str, first: Any, n: int) -> np.ndarray:
        """Return the n values of a key in each part, (parts, n), from those of the first.

        Raises
        ------
        KeyError, ValueError
        """
        shape = [len(axis.values) for axis in self.axes]
        values = np.empty((math.prod(shape), n))
        values[:] = first
        for axis, numbers, at in zip(
            self.axes, self._numbers, np.indices(shape).reshape(len(shape), -1), strict=True
        ):
            for column in axis.keys:
                owner, _, place = column.key.rstrip("]").partition(f"{key}[")
                if column.key == key:
                    values[:] = numbers[key][at]
                elif not owner and place:
                    values[:, int(place)] = numbers[column.key][at, 0]
        if not values.max() <= EXTENT * values.min():
            raise ValueError
        return values


def columns_of(axes: Iterable[Axis]) -> list[Axis]:
    """Return the varied keys of axes, those of rows one by one."""
    return [column for axis in axes for column in axis.keys]


def _is_alone(key: str) -> bool:
    """Return whether the limits of a key depend on no other."""
    return bare(key) in ALONE.get(re.split(r"\W", key, maxsplit=1)[0], ())


def _keeps_far(base: RunGrid, columns: Mapping[str, np.ndarray]) -> bool:
    """Return whether no part comes near a limit that several keys have in common."""
    from hpcsweep.model.equilibrium import pressed  # imports scipy, which status does without

    structure = base.structure
    springs = structure.slider_stiffness.tolist()
    if springs and (pressed(structure).any() or not base.starts_at_rest):
        return False  # whose states at rest are limited by strengths over stiffnesses
    with np.errstate(all="ignore"):
        ratios = [(column.max(axis=0) / column.min(axis=0)).max() for column in columns.values()]
        room = float(np.prod(ratios)) ** 2
    trace = float(np.trace(structure.elastic_stiffness))
    stiffer = max(springs, default=0.0) / (trace if trace > 0.0 else min(springs, default=1.0))
    spread = max(map(np.linalg.cond, (structure.mass_matrix, structure.stiffness_matrix)))
    damping = float(structure.damping_ratios.max())
    return room * max(spread, stiffer) <= MAX_STIFFNESS and room * damping <= MAX_DAMPING


def _names(table: Any) -> Iterator[str]:
    """Iterate over the names of all keys in tables."""
    for key, value in table.items() if isinstance(table, Mapping) else ():
        yield key
        for item in value if isinstance(value, list) else (value,):
            yield from _names(item)


def _positive(values: tuple[Any, ...]) -> np.ndarray | None:
    """Return values as numbers, shape (n, any), if all are numbers above 0, or lists of as many."""
    lists = [value if isinstance(value, list) else [value] for value in values]
    forms = {type(value) is list and len(value) for value in values}
    kinds = {type(entry) for entries in lists for entry in entries}
    if len(forms) > 1 or not kinds <= {int, float}:
        return None
    numbers = np.array(lists, float)
    return numbers if numbers.size and np.all((numbers > 0.0) & np.isfinite(numbers)) else None
