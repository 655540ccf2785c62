"""Read the forcing of a job: harmonics, or samples of a period."""

import math

import numpy as np

from hpcsweep.job.values import Values
from hpcsweep.model.forcing import MAX_HARMONICS, MEAN_PHASE, ONE_HARMONIC, Terms, fourier_series

HARMONIC = ("order", "amplitude", "phase")
N_HARMONICS = 8
"""Of samples, besides the mean, if a job does not say."""
MAX_SAMPLES = 100_000


def read_forcing(values: Values) -> Terms:
    """Read the table ``forcing``: harmonics, or samples with their number of harmonics."""
    table = dict(values.table("forcing"))
    kept = table.pop("n_harmonics", None)
    if kept is not None and "samples" not in table:
        raise values.error("forcing.n_harmonics", kept, "goes with samples")
    if len(table) > 1:
        first, second = list(table)[:2]
        raise values.error(f"forcing.{second}", table[second], f"does not go with {first}")
    if "samples" in table:
        return _series(values, table["samples"])[0]
    return _harmonics(values, table["harmonics"]) if "harmonics" in table else ONE_HARMONIC


def _harmonics(values: Values, listed) -> Terms:
    """Read a sum of harmonics; order 0 is the mean and has no phase."""
    if not isinstance(listed, list) or not listed:
        limit = "must be a list of {order = 1, amplitude = 1.0, phase = 0.0}"
        raise values.error("forcing.harmonics", listed, limit)
    terms = []
    for harmonic in listed:
        values.check_table("forcing.harmonics", harmonic, HARMONIC, ("order",))
        order, phase = harmonic["order"], harmonic.get("phase", 0.0)
        if order == 0 and not isinstance(order, bool):
            if "phase" in harmonic:
                raise values.error("forcing.harmonics.phase", phase, "does not go with order 0")
            phase = MEAN_PHASE
        terms.append((order, harmonic.get("amplitude", 1.0), phase))
    return tuple(terms)


def _series(values: Values, content) -> tuple[Terms, float]:
    """Read samples of a period as a Fourier series."""
    listed = content if isinstance(content, list) else []
    samples = np.array([values.number("forcing.samples", value) for value in listed])
    if not 3 <= samples.size <= MAX_SAMPLES or not 0 < np.ptp(samples) < math.inf:
        limit = f"must be a list of 3 to {MAX_SAMPLES} numbers, finite and not all equal"
        raise values.error("forcing.samples", content, limit)
    kept = values.get("forcing.n_harmonics", N_HARMONICS)
    kept = values.whole("forcing.n_harmonics", kept, 1, MAX_HARMONICS - 1)
    return fourier_series(samples, kept)


def forcing_notes(values: Values) -> tuple[str, ...]:
    """Return notes on the forcing: how well a Fourier series fits its samples."""
    if not values.has("forcing.samples"):
        return ()
    terms, error = _series(values, values.get("forcing.samples"))
    orders = ", ".join(str(order) for order, _, _ in terms)
    return (f"forcing.samples: harmonics {orders} meet them to {100 * error:.2g} % of the largest",)
