"""Read sweeps and maps from results files."""

import math
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from claims.data import Map, is_chaotic
from claims.evidence import RESONANCE, Study, make_sweep
from hpcsweep.model.description import few
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Frames, StoreError

SAME_OMEGA = 5e-4
WITHOUT_VALUE = {"matrices": "structure.matrices", "harmonics": "forcing.harmonics"}
"""Keys of a job whose values are too long for a message."""
OPTIONAL = ("lyapunov", "modal_norm", "motion", "classification_cycles", "n_points")
FOREIGN = (
    *("matrices", "mass", "storey_stiffness", "gap", "gap_left", "rayleigh", "storey_damping"),
    *("stiffness_ratio", "harmonics", "restitution", "yield_force", "yield_drift", "p_delta"),
)
"""Parameters that the building of the paper leaves at their defaults."""
MIN_FRAMES = 10
"""Frames from which on a file is a map."""


def read_study(frames: Frames) -> Study | None:
    """Read the frame at the linear resonance of a file; None if it has none."""
    study = frames.study
    place = int(np.argmin(np.abs(study.omega - RESONANCE)))
    if abs(study.omega[place] - RESONANCE) > SAME_OMEGA:
        return None
    needed = ("orbit_period", "contact", "drift", "final_state", "outcome", "poincare")
    if study.omega.size >= MIN_FRAMES and any(name not in frames for name in needed):
        return None  # a map, kept small
    optional = [name for name in OPTIONAL if name in frames]
    arrays = frames.read(place, (*needed, *optional))
    omega = float(study.omega[place])
    sweep = make_sweep(omega, study.amplitude, study.directions, arrays, study.settings)
    return Study(study.structure, sweep, study.settings)


def read_map(frames: Frames) -> Map | None:
    """Read the upward sweeps of a file; None if it is not a map."""
    study = frames.study
    if study.omega.size < MIN_FRAMES:
        return None
    names = ["orbit_period", "contact", "drift", "outcome"]
    exponents = "lyapunov" in frames
    names += [name for name in ("lyapunov", "motion") if name in frames]
    rows: dict[str, list] = {name: [] for name in names}
    for place in range(study.omega.size):
        for name, values in frames.read(place, tuple(names)).items():
            rows[name].append(values[0])
    arrays = {name: np.stack(values) for name, values in rows.items()}
    valid = arrays["outcome"] == Outcome.COMPLETE
    period = arrays["orbit_period"].astype(int)
    window = study.settings.sampling_cycles * 2 * math.pi / study.omega[:, None]
    growth = arrays["lyapunov"] * window if exponents else np.full(valid.shape, np.nan)
    free = [study.structure.steady_drift(omega) * omega**2 for omega in study.omega]
    return Map(
        stiffness_ratio=study.structure.stiffness_ratio,
        omega=study.omega,
        period=period,
        contact=arrays["contact"].astype(int),
        chaotic=is_chaotic(period, growth, arrays.get("motion")) & valid,
        valid=valid,
        drift=arrays["drift"],
        free_drift=np.array(free),
        exponents=exponents,
    )


def foreign(structure: Structure) -> dict[str, Any]:
    """Return the parameters in which a structure differs from the paper's, by name.

    The paper's is uniform, with one stop a floor at gap 1, one stiffness ratio and one harmonic.
    """
    usual = {part.name: part.default for part in fields(structure)}
    if not isinstance(structure.stiffness_ratio, tuple):  # the paper varies it
        usual["stiffness_ratio"] = structure.stiffness_ratio
    return {name: value for name in FOREIGN if (value := getattr(structure, name)) != usual[name]}


def open_frames(path: Path) -> Frames:
    """Open a file to judge claims by.

    Raises
    ------
    StoreError
        If it is not a campaign file, or of another structure than the paper's.
    """
    frames = Frames(path)
    n = frames.study.structure.n_floors
    if n != 3:
        frames.close()
        raise StoreError(f"{path}: structure.n_floors = {n}: the claims are about 3 floors")
    for key, value in foreign(frames.study.structure).items():
        frames.close()
        name = WITHOUT_VALUE.get(key) or f"structure.{key} = {few(value)}"
        raise StoreError(f"{path}: {name}: the claims are about the building of the paper alone")
    return frames
