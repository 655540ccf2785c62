"""Grid of starts on a slice of the initial states at one point (A, Omega).

Two components of the state run over a grid; the others are those of `initial_state`. A component
may be a row d of displacements or velocities: a start is then the state nearest to the initial one
that has these two values.

Starts are classified by attractors that are found first, from a low-discrepancy sequence of starts
on the same slice (`hpcsweep.dynamics.basins`). Each process finds them itself: they depend only on
the job.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from hpcsweep.dynamics.starts import usual_reach
from hpcsweep.model.coordinates import coordinate_of
from hpcsweep.model.structure import Structure
from hpcsweep.studies.attractors import search
from hpcsweep.studies.attractors.variables import ORDINATE, ROW_OMEGA
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.keys import OMEGA, Key, Tables
from hpcsweep.studies.path_grid import FORCING
from hpcsweep.studies.refinement import REFINE
from hpcsweep.studies.variable import Coordinate, Variable
from hpcsweep.studies.variables import numbered, state_names

START = "slice"
SPAN = 200
"""Values of either component, from minus to plus the usual reach, unless a job gives them."""
COMPONENTS = Key(
    "components",
    "the two components of the state that span the slice, `u_1` .. `u_n`, `v_1` .. `v_n`, of "
    "buildings `u_A1` .., or of rows, `u_2-1`, `v_contact:1`",
    told='`["u_1", "v_1"]`',
)
HORIZONTAL, VERTICAL = (
    Key(
        name,
        f"values of the {number} component, ascending, two or more",
        told=f"{SPAN} over the range of `study.displacement` or `study.velocity`",
    )
    for name, number in (("horizontal", "first"), ("vertical", "second"))
)
MAX_VALUES = {"horizontal": 100_000, "vertical": 10_000_000}
MAX_STATE = 1e200
FEW = 6
"""Components of a kind that an error lists; of more it names the first and the last."""


@dataclass(frozen=True, eq=False)
class SliceGrid(RunGrid):
    """Starts on a slice, a frame for each row; see `RunGrid`, which holds a frequency a frame.

    Attributes
    ----------
    components : tuple of two int or str
        Components of the state along a row, and from row to row; words of rows of it.
    horizontal, vertical : ndarray
        Values of the components, ascending; one row for each value of `vertical`.
    starts, seed : int
        Starts on the slice from which the attractors are found, and the seed of their sequence.
    max_attractors : int
        Most attractors listed: those that most starts reach.
    max_cycles : int
        Forcing periods after which a motion is left undecided.
    """

    components: tuple[int | str, int | str]
    horizontal: np.ndarray
    vertical: np.ndarray
    starts: int = search.STARTS.default
    seed: int = search.SEED.default
    max_attractors: int = search.MAX_ATTRACTORS.default
    max_cycles: int = search.MAX_CYCLES.default

    kind: ClassVar[str] = "basins"
    summary: ClassVar[str] = (
        "at one frequency and amplitude, to which attractor each start of a slice goes"
    )
    words: ClassVar[dict[str, str]] = {START: "each start on its own"}
    direction_name: ClassVar[str] = "where starts lie"
    keys: ClassVar[Tables] = {
        "study": (COMPONENTS, HORIZONTAL, VERTICAL, *search.SEARCH, REFINE),
        "sweep": OMEGA,
    }
    carried: ClassVar[tuple[str, ...]] = ()
    content: ClassVar[str] = "basins"
    point_dim: ClassVar[str] = "column"

    @property
    def starting_range(self) -> dict[str, tuple[int, float, float]]:  # type: ignore[override]
        """Component and range of the slice."""
        spans = zip(self.names(), self.components, (self.horizontal, self.vertical), strict=True)
        return {
            f"{name}, {values.size} values": (
                _unit(k, self.structure),
                float(values[0]),
                float(values[-1]),
            )
            for name, k, values in spans
        }

    @property
    def starting_states(self) -> np.ndarray:
        """A state at least as far out as any of the slice."""
        corners = np.meshgrid(self.horizontal[[0, -1]], self.vertical[[0, -1]])
        farthest = np.abs(self.at(*corners)).max(axis=(0, 1))
        return np.where(self.across.any(axis=0), farthest, self.initial_state)[None]

    @cached_property
    def across(self) -> np.ndarray:
        """Rows of the two components over the state, shape (2, 2n + L)."""
        n, rows = self.structure.n_floors, np.zeros((2, self.initial_state.size))
        for row, component in zip(rows, self.components, strict=True):
            if isinstance(component, int):
                row[component] = 1.0
                continue
            first = n * (component[0] == "v")
            row[first : first + n] = coordinate_of(self.structure, component[2:]).row
        return rows

    def two_places(self) -> list[int]:
        """Return a component of the state for each of the two, two different ones."""
        first, second = np.abs(self.across)
        second[first.argmax()] = -1.0
        return [int(first.argmax()), int(second.argmax())]

    def at(self, horizontal, vertical) -> np.ndarray:
        """Return the starts at values of both components, shape (..., 2n + L)."""
        values, rows = np.stack(np.broadcast_arrays(horizontal, vertical), axis=-1), self.across
        away = (values - rows @ self.initial_state) @ np.linalg.solve(rows @ rows.T, rows)
        states = self.initial_state + away
        for place, component in enumerate(self.components):
            if isinstance(component, int):
                states[..., component] = values[..., place]  # without its rounding
        return states

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""
        coordinates = super().coordinates | {
            "row": numbered(self.vertical.size, "row of starts"),
            "attractor": numbered(self.max_attractors, "attractor, by falling share"),
            "column": Coordinate(
                self.horizontal, ORDINATE.units, "first component of a row's starts"
            ),
        }
        del coordinates["omega"]
        return coordinates

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Variables that are known in advance, with their values."""
        return [(ROW_OMEGA, self.omega), (ORDINATE, self.vertical)]

    def names(self) -> tuple[str, str]:
        """Names of the components of the slice."""
        names = state_names(self.structure)
        first, second = (k if isinstance(k, str) else names[k] for k in self.components)
        return first, second


def read_slice(values, common: dict[str, Any]) -> dict[str, Any]:
    """Read the point, the slice and the limits of a job.

    Parameters
    ----------
    values : hpcsweep.job.values.Values
    common : dict
        Fields of every study, see `RunGrid.read`.

    Returns
    -------
    dict
        Fields of the study.
    """
    structure, settings = common["structure"], common["settings"]
    limits = search.read_limits(values, "basins")
    point = {name: values.forcing(name) for name in FORCING}
    for name, numbers in point.items():
        if numbers.size != 1:
            asked, limit = values.get(f"sweep.{name}"), "must be one number: basins of one point"
            raise values.error(f"sweep.{name}", asked, limit)
    if "lyapunov_spectrum" in settings.metrics:
        limit = "must be false: spectra are of sweeps, points and attractors"
        raise values.error("output.lyapunov_spectrum", True, limit)
    if settings.rows:
        limit = "must be empty: rows are of sweeps, points and attractors"
        raise values.error("output.rows", [*settings.rows], limit)
    metrics = frozenset(settings.metrics) | {"lyapunov"}
    components = _components(values, structure)
    reach = np.append(usual_reach(structure), [structure.length_unit] * len(structure.sliders))
    horizontal, vertical = (
        _span(values, f"study.{name}", float(reach[_unit(component, structure)]), most)
        for name, component, most in zip(MAX_VALUES, components, MAX_VALUES.values(), strict=True)
    )
    return {
        **common,
        **limits,
        "settings": replace(settings, metrics=metrics, classify_cycles=None),
        "omega": np.full(vertical.size, point["omega"][0]),
        "amplitude": point["amplitude"],
        "directions": (START,),
        "components": components,
        "horizontal": horizontal,
        "vertical": vertical,
    }


def _unit(component: int | str, structure: Structure) -> int:
    """Return a component of the state that has the unit of one."""
    return component if isinstance(component, int) else structure.n_floors * (component[0] == "v")


def _components(values, structure: Structure) -> tuple[int | str, int | str]:
    """Read the two components of the slice."""
    names, n = state_names(structure), structure.n_floors
    pair = values.get("study.components", [names[0], names[n]])
    are_two = isinstance(pair, list) and len(pair) == 2 and pair[0] != pair[1]
    first, second = (_component(structure, names, k) for k in (pair if are_two else (None, None)))
    if first is None or second is None:
        groups = filter(None, (names[:n], names[n : 2 * n], names[2 * n :]))
        listed = (", ".join(x) if len(x) <= FEW else f"{x[0]} .. {x[-1]}" for x in groups)
        raise values.error("study.components", pair, f"must be two of {', '.join(listed)}")
    return first, second


def _component(structure: Structure, names: list[str], name) -> int | str | None:
    """Return a component, or the word of a row; None if there is none."""
    if name in names or not isinstance(name, str) or name[:2] not in ("u_", "v_"):
        return names.index(name) if name in names else None
    try:
        row = coordinate_of(structure, name[2:]).row
    except ValueError:
        return None
    return name if np.count_nonzero(row) > 1 or ":" in name else None


def _span(values, key: str, reach: float, most: int) -> np.ndarray:
    """Read the values of a component, ascending, two or more."""
    if not values.has(key):
        return np.linspace(-reach, reach, SPAN)
    numbers = values.numbers(key, values.get(key), True, most)
    if numbers.size < 2 or not np.abs(numbers).max() <= MAX_STATE:
        limit = f"must have two values or more, at most {MAX_STATE:g}"
        raise values.error(key, values.get(key), limit)
    return numbers
