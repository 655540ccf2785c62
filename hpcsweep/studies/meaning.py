"""What the fingerprint of a job over direction, frame and amplitude is made of."""

from typing import Any

COVERED = frozenset(
    {
        *("n_floors", "stiffness_ratio", "sharpness", "damping_ratio", "_ratios"),
        *("transient_cycles", "sampling_cycles", "max_orbit_period", "period_tolerance"),
        *("solver", "rtol", "skip", "metrics", "max_points"),
        *("structure", "omega", "amplitude", "directions", "initial_state", "settings"),
        "block_size",
    }
)
"""Fields that `listed_meaning` and the arrays of `RunGrid.meaning` write out."""


def listed_meaning(study) -> list[object]:
    """Return the values of the fields that the first version knew, in its order."""
    structure, settings = study.structure, study.settings
    ratio: Any = structure.stiffness_ratio
    listed: list[object] = [
        structure.n_floors,
        [value.hex() for value in ratio] if isinstance(ratio, tuple) else float(ratio).hex(),
        structure.sharpness.hex(),
        [value.hex() for value in structure._ratios],
        study.directions,
        settings.transient_cycles,
        settings.sampling_cycles,
        settings.max_orbit_period,
        settings.period_tolerance.hex(),
        settings.solver,
        settings.rtol.hex(),
        sorted(settings.skip),
        sorted(settings.metrics),
        study.block_size,
    ]
    if settings.stored_points < settings.sampling_cycles:
        listed.append(("max_points", settings.stored_points))
    return listed
