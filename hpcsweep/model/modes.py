"""Linear dynamics of the free structure: natural modes, responses, extrema of steady motions."""

import math

import numpy as np

SAMPLES = 64
"""Of a period of the highest harmonic, before an extremum is polished."""

CHAINS = 2**20
"""Entries of the matrices of chains that are solved at a time."""
RIGID = 1e-13
"""Stiffness of a motion that is 0, where the diagonal of K is scaled to 1: so that penalty springs,
which hold supports, count as little as units do."""


def power_of_two(value: float) -> float:
    """Round to a power of two: a unit that scales numbers without rounding."""
    return 2.0 ** round(math.log2(value))


def per_mass(mass: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve M x = right; exactly where M is diagonal."""
    if np.array_equal(mass, np.diag(np.diag(mass))):
        return (right.T / np.diag(mass)).T
    return np.linalg.solve(mass, right)


def scaled_stiffness(stiffness: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of K with its diagonal scaled to 1: `RIGID` and less is no spring."""
    diagonal = np.diag(stiffness)
    root = np.sqrt(np.where(diagonal > 0.0, diagonal, np.abs(diagonal).max() or 1.0))
    return np.linalg.eigvalsh(stiffness / np.outer(root, root))


def natural_modes(
    mass: np.ndarray, stiffness: np.ndarray, n_rigid: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Solve K phi = omega^2 M phi with Phi^T M Phi = 1.

    Parameters
    ----------
    mass, stiffness : ndarray, shape (n, n)
    n_rigid : int, optional
        Number of rigid motions, where it is known.

    Returns
    -------
    frequencies : ndarray, shape (n,)
        Ascending; exactly 0 of a rigid motion, which no spring opposes.
    shapes : ndarray, shape (n, n)
        One a column; the first entry that is not negligible is positive.
    """
    # reading results does not need scipy
    from scipy.linalg import eigh

    squares, shapes = eigh(stiffness, mass)
    for shape in shapes.T:
        first = np.argmax(np.abs(shape) > 1e-8 * np.abs(shape).max())
        if shape[first] < 0:
            shape *= -1.0
    if n_rigid is None:
        n_rigid = int(np.count_nonzero(scaled_stiffness(stiffness) <= RIGID))
    squares[:n_rigid] = 0.0
    return np.sqrt(squares), shapes


def longest_period(mass: np.ndarray, stiffness: np.ndarray) -> float:
    """Return the longest period of the modes that vibrate; inf where none does."""
    frequencies, _ = natural_modes(mass, stiffness)
    vibrating = frequencies[frequencies > 0.0]
    return 2.0 * math.pi / float(vibrating[0]) if vibrating.size else math.inf


def chain_periods(mass: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Return the longest natural periods of chains of storeys on the ground, shape (k,).

    A force on floor i moves floor j by the sum of 1 / k_e over the storeys e below both. That
    matrix F has the largest eigenvalue 1 / omega_1^2 of F M to full precision.

    Parameters
    ----------
    mass, stiffness : ndarray, shape (k, n)
        Of each floor and each storey, from the lowest on.
    """
    below = np.minimum(*np.indices((mass.shape[1],) * 2))
    squares = np.empty(len(mass))
    step = max(CHAINS // below.size, 1)
    for at in range(0, len(mass), step):
        batch = slice(at, at + step)
        root = np.sqrt(mass[batch])
        soft = np.cumsum(1.0 / stiffness[batch], axis=1)[:, below]
        squares[batch] = np.linalg.eigvalsh(root[:, :, None] * soft * root[:, None, :])[:, -1]
    return 2.0 * math.pi * np.sqrt(squares)


def damped_response(mass, damping, stiffness, forcing, w: float) -> np.ndarray:
    """Solve (K - w^2 M + i w C) U = b, shape (n,), of matrices that share no modes.

    Raises
    ------
    ZeroDivisionError
        If there is no solution: an undamped resonance.
    """
    try:
        return np.linalg.solve(stiffness - w * w * mass + 1j * w * damping, forcing)
    except np.linalg.LinAlgError:
        raise ZeroDivisionError(f"undamped resonance at omega = {w!r}: no steady state") from None


def trigonometric_maximum(orders: np.ndarray, amplitudes: np.ndarray) -> float:
    """Return the maximum of sum_h Im(a_h exp(i h theta)) over theta; |a| for one harmonic.

    Parameters
    ----------
    orders : ndarray, shape (H,)
        h, whole numbers.
    amplitudes : ndarray of complex, shape (H,)
        a_h.
    """
    if orders.size == 1:
        return float(np.abs(amplitudes[0]))
    n = int(SAMPLES * orders.max())
    theta = np.linspace(0.0, 2.0 * math.pi, n, endpoint=False)
    value = np.imag(amplitudes @ np.exp(1j * np.outer(orders, theta)))
    highest = value.max()
    # no extremum is further from the best of its neighbours than their distance
    near = np.flatnonzero((value >= np.roll(value, 1)) & (value >= np.roll(value, -1)))
    rate, bend = 1j * orders * amplitudes, -(orders**2) * amplitudes
    for at in theta[near[value[near] >= highest - 0.01 * np.abs(amplitudes).sum()]]:
        s = at
        for _ in range(6):
            turn = np.exp(1j * orders * s)
            slope, curve = np.imag(rate @ turn), np.imag(bend @ turn)
            if not curve < 0:
                break
            s = min(max(s - slope / curve, at - 2 * math.pi / n), at + 2 * math.pi / n)
        highest = max(highest, float(np.imag(amplitudes @ np.exp(1j * orders * s))))
    return float(highest)


def trigonometric_maxima(orders: np.ndarray, responses: np.ndarray, rows) -> np.ndarray:
    """Return `trigonometric_maximum` of row . u for each row, with responses (H, n) of u."""
    return np.array([trigonometric_maximum(orders, responses @ row) for row in rows])


def trigonometric_zeros(orders: np.ndarray, amplitudes: np.ndarray) -> list[float]:
    """Return the sign changes of sum_h Im(a_h exp(i h theta)) over a period of theta."""
    from scipy.optimize import brentq

    edges = np.linspace(0.0, 2.0 * math.pi, int(SAMPLES * orders.max()) + 1)

    def value(theta: float) -> float:
        return float(np.imag(amplitudes @ np.exp(1j * orders * theta)))

    values = np.imag(amplitudes @ np.exp(1j * np.outer(orders, edges)))
    return [
        brentq(value, edges[k], edges[k + 1], xtol=1e-14)
        for k in np.flatnonzero(values[:-1] * values[1:] < 0)
    ]
