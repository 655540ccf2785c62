"""Job files: TOML in, a validated `Job` out. The only place that checks what a user wrote.

Every error is one line that names the file, the key, the value and the limit.
"""

import difflib
import hashlib
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from pathlib import Path

import numpy as np

from hpcsweep.job.tree import TreeError, resolve
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies.settings import METRICS, SKIP_RULES, SweepSettings

KEYS: dict[str, tuple[str, ...]] = {
    "": ("name", "structure", "sweep", "solver", "output"),
    "structure": ("n_floors", "stiffness_ratio", "sharpness", "damping_ratio"),
    "sweep": (
        "omega",
        "amplitude",
        "directions",
        "transient_cycles",
        "sampling_cycles",
        "max_orbit_period",
        "period_tolerance",
        "initial_state",
    ),
    "solver": ("method", "rtol", "skip"),
    "output": (*METRICS, "max_points", "block"),
}
RANGE_KEYS = ("from", "to", "count", "step")
MAX_VALUES = 10_000_000
"""Frames or amplitudes of one job."""
MAX_CYCLES = 10_000_000
DEFAULT_BLOCK = 50
MEANING_VERSION = 1
"""Part of the fingerprint; raised when the same job text comes to mean other results."""


class JobError(ValueError):
    """A job that cannot be run; the message is one line for the user."""


@dataclass(frozen=True, eq=False)
class Job:
    """A validated job.

    Attributes
    ----------
    name : str
        Default name of the results.
    text : str
        The TOML text.
    structure : Structure
    omega : ndarray, shape (n_frames,)
        Forcing frequency of each frame.
    amplitude : ndarray, shape (n_amplitudes,)
        Ascending.
    directions : tuple of str
        ``("up",)`` or ``("up", "down")``.
    initial_state : ndarray, shape (2n,)
        State from which each frame's up sweep starts.
    settings : SweepSettings
    block : int
        Amplitudes that are committed to the file together.
    """

    name: str
    text: str
    structure: Structure
    omega: np.ndarray
    amplitude: np.ndarray
    directions: tuple[str, ...]
    initial_state: np.ndarray
    settings: SweepSettings
    block: int

    @property
    def n_runs(self) -> int:
        """Runs of the whole job: directions x frames x amplitudes."""
        return len(self.directions) * self.omega.size * self.amplitude.size

    @property
    def fingerprint(self) -> str:
        """Hash of what the job means, whatever its text looks like and its name is.

        The fields that the first version knew are hashed in its order. Every other field of the
        structure, the settings and the job counts where it differs from its default, so that a new
        one changes the jobs that use it and leaves the files of all others theirs.
        """
        settings = self.settings
        meaning: list[object] = [
            MEANING_VERSION,
            self.structure.n_floors,
            self.structure.stiffness_ratio.hex(),
            self.structure.sharpness.hex(),
            [float(value).hex() for value in self.structure.damping_ratios],
            self.directions,
            settings.transient_cycles,
            settings.sampling_cycles,
            settings.max_orbit_period,
            settings.period_tolerance.hex(),
            settings.solver,
            settings.rtol.hex(),
            sorted(settings.skip),
            sorted(settings.metrics),
            self.block,
        ]
        if settings.stored_points < settings.sampling_cycles:
            meaning.append(("max_points", settings.stored_points))
        for part, first in ((self.structure, FIRST), (settings, FIRST), (self, FIRST)):
            for field in fields(part):
                value = getattr(part, field.name)
                if field.name not in first and not _is_default(field, value):
                    meaning.append((field.name, _canonical(value)))
        digest = hashlib.sha256(repr(meaning).encode())
        for array in (self.omega, self.amplitude, self.initial_state):
            digest.update(str(array.size).encode())
            digest.update(array.astype("<f8").tobytes())
        return digest.hexdigest()


FIRST = frozenset(
    {
        *("n_floors", "stiffness_ratio", "sharpness", "damping_ratio", "_ratios"),
        *("transient_cycles", "sampling_cycles", "max_orbit_period", "period_tolerance"),
        *("solver", "rtol", "skip", "metrics", "max_points"),
        *("name", "text", "structure", "omega", "amplitude", "directions", "initial_state"),
        *("settings", "block"),
    }
)
"""Fields whose part in the fingerprint is written out; a job's name and text have none."""


def _is_default(field: Field, value: object) -> bool:
    """Tell whether a field has its default; one without a default never has."""
    if field.default_factory is not MISSING:
        return bool(value == field.default_factory())
    return field.default is not MISSING and bool(value == field.default)


def _canonical(value: object) -> object:
    """Write a value so that equal ones are written equally, to the last bit.

    Raises
    ------
    TypeError
        If it is of a kind that has no such form: a field must not be left out silently.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, np.ndarray):
        return [str(value.dtype), value.shape, [_canonical(v) for v in value.ravel().tolist()]]
    if isinstance(value, frozenset | set):
        return sorted(value)
    if isinstance(value, tuple | list):
        return [_canonical(item) for item in value]
    if isinstance(value, Mapping):
        return sorted((key, _canonical(item)) for key, item in value.items())
    if is_dataclass(value):
        return [(f.name, _canonical(getattr(value, f.name))) for f in fields(value)]
    raise TypeError(f"a {type(value).__name__} has no place in a job's fingerprint")


def load_job(path: str | Path, settings: Sequence[str] = ()) -> Job:
    """Read and validate a job file.

    Parameters
    ----------
    path : str or Path
        The file; what it extends is read too.
    settings : sequence of str
        ``TABLE.KEY=VALUE`` each, the value in TOML: replace what the files give.

    Raises
    ------
    JobError
        If a file cannot be read or all together is not a valid job.
    """
    path = Path(path)
    try:
        text, source = resolve(path, settings, KEYS)
    except TreeError as error:
        raise JobError(str(error)) from None
    return parse_job(text, source, path.stem)


def parse_job(text: str, source: str, default_name: str) -> Job:
    """Validate the text of a job; `source` is named in errors.

    Raises
    ------
    JobError
        If it is not a valid job.
    """
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise JobError(f"{source}: not valid TOML: {error}") from None
    return _Reader(source, tree).job(text, default_name)


class _Reader:
    """Reads one job tree; `source` and the key are named in every error."""

    def __init__(self, source: str, tree: Mapping):
        self._source = source
        self._tree = tree
        self._check_keys("", tree)
        for table in KEYS[""][1:]:
            if not isinstance(tree.get(table, {}), Mapping):
                raise self._error(table, tree[table], "must be a table")
            self._check_keys(table, tree.get(table, {}))

    def job(self, text: str, default_name: str) -> Job:
        structure = self._structure()
        amplitude = self._values("sweep.amplitude", ascending=True)
        if amplitude[0] < 0:
            raise self._error("sweep.amplitude", amplitude[0], "must be at least 0")
        omega = self._values("sweep.omega", ascending=False)
        if np.any(omega <= 0):
            raise self._error("sweep.omega", omega[omega <= 0][0], "must be greater than 0")
        settings = self._settings()
        return Job(
            name=self._name(default_name),
            text=text,
            structure=structure,
            omega=omega,
            amplitude=amplitude,
            directions=self._directions(),
            initial_state=self._initial_state(structure.n_floors),
            settings=settings,
            block=self._whole("output.block", DEFAULT_BLOCK, 1, MAX_VALUES),
        )

    def _error(self, key: str, value: object, limit: str) -> JobError:
        shown = repr(float(value)) if isinstance(value, np.floating) else repr(value)
        if len(shown) > 60:
            shown = shown[:57] + "..."
        return JobError(f"{self._source}: {key} = {shown}: {limit}")

    def _check_keys(self, table: str, tree: Mapping, known: Sequence[str] | None = None) -> None:
        known = KEYS[table] if known is None else known
        for key in tree:
            if key in known:
                continue
            full = f"{table}.{key}" if table else key
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.4)
            hint = f"; did you mean {near[0]!r}?" if near else f"; known are {', '.join(known)}"
            elsewhere = [other for other in KEYS if other and other != table and key in KEYS[other]]
            if elsewhere:
                hint = f"; it belongs in [{elsewhere[0]}]"
            raise JobError(f"{self._source}: unknown key {full!r}{hint}")

    def _get(self, key: str, default: object = None) -> object:
        table, name = key.split(".")
        value = self._tree.get(table, {}).get(name, default)
        if value is None:
            raise JobError(f"{self._source}: {key} is missing")
        return value

    def _number(self, key: str, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
            raise self._error(key, value, "must be a number")
        return float(value)

    def _whole(self, key: str, default: int, least: int, most: int) -> int:
        value = self._get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise self._error(key, value, f"must be a whole number from {least} to {most}")
        return value

    def _name(self, default: str) -> str:
        name = self._tree.get("name", default)
        if not isinstance(name, str) or not name or "/" in name or name != name.strip():
            raise self._error("name", name, "must be a file name without folder")
        return name

    def _structure(self) -> Structure:
        given = dict(self._tree.get("structure", {}))
        for key, value in given.items():
            if isinstance(value, list):
                given[key] = tuple(value)
        try:
            return Structure(**given)
        except ValueError as error:
            raise JobError(f"{self._source}: structure.{error}") from None

    def _values(self, key: str, ascending: bool) -> np.ndarray:
        """Read a number, a list of numbers, or a range table."""
        given = self._get(key)
        if isinstance(given, Mapping):
            return self._range(key, given)
        listed = given if isinstance(given, list) else [given]
        if not listed:
            raise self._error(key, given, "must not be empty")
        values = np.array([self._number(key, value) for value in listed])
        if not np.all(np.isfinite(values)):
            raise self._error(key, given, "must be finite")
        if ascending and np.any(np.diff(values) <= 0):
            place = int(np.argmax(np.diff(values) <= 0))
            raise self._error(
                key,
                given,
                f"must ascend, but {values[place]!r} is followed by {values[place + 1]!r}",
            )
        if np.unique(values).size != values.size:
            raise self._error(key, given, "must not hold a value twice")
        return values

    def _range(self, key: str, given: Mapping) -> np.ndarray:
        self._check_keys(key, given, RANGE_KEYS)
        ends = []
        for end in ("from", "to"):
            if end not in given:
                raise JobError(f"{self._source}: {key}.{end} is missing")
            value = self._number(f"{key}.{end}", given[end])
            if not math.isfinite(value):
                raise self._error(f"{key}.{end}", value, "must be finite")
            ends.append(value)
        low, high = ends
        if not low < high:
            raise self._error(f"{key}.from", low, f"must be less than to = {high!r}")
        if ("count" in given) == ("step" in given):
            raise JobError(f"{self._source}: {key} needs either count or step beside from and to")
        if "count" in given:
            count = given["count"]
            if isinstance(count, bool) or not isinstance(count, int):
                raise self._error(f"{key}.count", count, "must be a whole number")
            if not 2 <= count <= MAX_VALUES:
                raise self._error(f"{key}.count", count, f"must be from 2 to {MAX_VALUES}")
            return np.linspace(low, high, count)
        step = self._number(f"{key}.step", given["step"])
        if not (0 < step <= high - low and (high - low) / step < MAX_VALUES):
            raise self._error(
                f"{key}.step",
                step,
                f"must be greater than 0, at most to - from = {high - low:g}, and give at most "
                f"{MAX_VALUES} values",
            )
        n_steps = math.floor((high - low) / step * (1 + 1e-12) + 1e-9)
        return low + step * np.arange(n_steps + 1)

    def _directions(self) -> tuple[str, ...]:
        given = self._get("sweep.directions", ["up", "down"])
        if given not in (["up"], ["up", "down"]):
            raise self._error("sweep.directions", given, 'must be ["up"] or ["up", "down"]')
        return tuple(given)

    def _initial_state(self, n: int) -> np.ndarray:
        given = self._get("sweep.initial_state", "rest")
        if given == "rest":
            return np.zeros(2 * n)
        if not isinstance(given, list) or len(given) != 2 * n:
            raise self._error(
                "sweep.initial_state", given, f'must be "rest" or a list of 2 n = {2 * n} numbers'
            )
        state = np.array([self._number("sweep.initial_state", value) for value in given])
        if not np.all(np.isfinite(state)):
            raise self._error("sweep.initial_state", given, "must be finite")
        return state

    def _settings(self) -> SweepSettings:
        default = SweepSettings()
        sampling = self._whole("sweep.sampling_cycles", default.sampling_cycles, 1, MAX_CYCLES)
        longest = max(sampling // 2, 1)
        tolerance = self._number(
            "sweep.period_tolerance", self._get("sweep.period_tolerance", default.period_tolerance)
        )
        if not 0 < tolerance < 1:
            raise self._error("sweep.period_tolerance", tolerance, "must lie between 0 and 1")
        method = self._get("solver.method", default.solver)
        if method not in SOLVERS:
            raise self._error("solver.method", method, f"must be one of {', '.join(SOLVERS)}")
        rtol = self._number(
            "solver.rtol", self._get("solver.rtol", 1e-6 if method == "bdf" else default.rtol)
        )
        if not 1e-13 <= rtol <= 1e-2:
            raise self._error("solver.rtol", rtol, "must be from 1e-13 to 1e-2")
        longest = self._whole(
            "sweep.max_orbit_period", min(default.max_orbit_period, longest), 1, longest
        )
        return SweepSettings(
            transient_cycles=self._whole(
                "sweep.transient_cycles", default.transient_cycles, 0, MAX_CYCLES
            ),
            sampling_cycles=sampling,
            max_orbit_period=longest,
            period_tolerance=tolerance,
            solver=method,
            rtol=rtol,
            skip=self._skip(),
            metrics=self._metrics(default),
            max_points=self._max_points(sampling, longest),
        )

    def _max_points(self, sampling: int, longest: int) -> int | None:
        given = self._get("output.max_points", sampling)
        least = min(2 * longest, sampling)
        if isinstance(given, bool) or not isinstance(given, int) or given < least:
            limit = f"must be a whole number of at least 2 max_orbit_period = {least}"
            raise self._error("output.max_points", given, limit)
        return given if given < sampling else None

    def _skip(self) -> frozenset[str]:
        given = self._get("solver.skip", "all")
        if given == "all":
            return frozenset(SKIP_RULES)
        if given == "none":
            return frozenset()
        if not isinstance(given, list) or not all(name in SKIP_RULES for name in given):
            raise self._error(
                "solver.skip",
                given,
                f'must be "all", "none" or a list of {", ".join(SKIP_RULES)}',
            )
        return frozenset(given)

    def _metrics(self, default: SweepSettings) -> frozenset[str]:
        wanted = set()
        for name in METRICS:
            value = self._get(f"output.{name}", name in default.metrics)
            if not isinstance(value, bool):
                raise self._error(f"output.{name}", value, "must be true or false")
            if value:
                wanted.add(name)
        return frozenset(wanted)
