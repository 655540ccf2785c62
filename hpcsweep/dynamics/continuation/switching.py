r"""Switch to branches that leave another one: orbits of twice the period, and crossings.

At a doubling the tangent map of the chain X of p points, gone round twice, has the null vector
Phi = (phi_0, ..., phi_{p-1}, -phi_0, ..., -phi_{p-1}) with phi_{i+1} = M_i phi_i and M phi_0 =
-phi_0. The orbits of twice the period leave along it, at a distance eps with lambda = lambda_* + c
eps^2 + ...: they are found on the hyperplane across Phi at the distance eps. The doubling is
supercritical if they lie on the side where the orbits of period p are unstable, which is the sign
of c, that of the normal form's coefficient (Kuznetsov, Elements of Applied Bifurcation Theory,
4.5). At a branch point the null vector is of one round, with M phi_0 = phi_0.
"""

from dataclasses import replace

import numpy as np

from hpcsweep.dynamics.continuation.cycle import Curve, NotConvergedError, Solution
from hpcsweep.dynamics.continuation.events import Kind, Special, n_unstable, tests_of
from hpcsweep.dynamics.stability import TangentMaps

DISTANCES = (1e-3, 1e-4, 1e-5, 1e-6)
"""eps, in units of the state, as they are tried: at a large one the orbit of twice the period may
have doubled itself."""
APART = 0.1
"""Share of eps at which the orbit found is another one."""


def switch(curve: Curve, special: Special) -> tuple[Curve, Solution] | None:
    """Find an orbit on the branch that leaves at a doubling or a branch point.

    Parameters
    ----------
    curve : Curve
        Curve of the branch of the special point.
    special : Special

    Returns
    -------
    curve : Curve
        Of the branch that leaves.
    point : Solution
        None, instead of both, if there is none at any of `DISTANCES`.
    """
    doubles = special.kind is Kind.DOUBLING
    points, value = curve.split(special.at.y)
    vector = _null_vector(special.at.maps, -1.0 if doubles else 1.0)
    if doubles:
        points, vector = np.tile(points, (2, 1)), np.concatenate((vector, -vector))
    new = replace(curve, period=len(points))
    border = np.append(vector.ravel() / np.linalg.norm(vector), 0.0)
    start = new.join(points, value)
    sign = 1.0 if doubles else np.sign(tests_of(special.at).doubling)
    for distance in DISTANCES:
        eps = distance * np.sqrt(len(points))
        try:
            found = new.solve(start + eps * border, border)
        except NotConvergedError:
            continue
        is_apart = float((found.y - start) @ border) > (1.0 - APART) * eps
        if is_apart and tests_of(found).doubling * sign > 0:
            return new, found
    return None


def criticality(before: Solution, after: Solution, special: Special, leaving: Solution) -> int:
    """Return 1 for a supercritical doubling, -1 for a subcritical one, 0 if undetermined.

    Parameters
    ----------
    before, after : Solution
        Neighbours of the special point on its branch.
    special : Special
    leaving : Solution
        Of the branch that leaves.
    """
    unstable_after = n_unstable(after.multipliers) > n_unstable(before.multipliers)
    side = float(leaving.y[-1] - special.at.y[-1])
    way = float(after.y[-1] - before.y[-1])
    if side == 0.0 or way == 0.0:
        return 0
    return 1 if (side * way > 0) == unstable_after else -1


def _null_vector(maps: TangentMaps, multiplier: float) -> np.ndarray:
    """Return phi_i of the multiplier nearest to a real one, shape (p, N)."""
    values, vectors = np.linalg.eig(maps.product)
    chain = [vectors[:, np.argmin(np.abs(values - multiplier))].real]
    for matrix in maps.matrices[:-1]:
        chain.append(matrix @ chain[-1])
    return np.array(chain)
