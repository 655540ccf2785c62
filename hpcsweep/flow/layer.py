r"""Motion while a floor is inside its contact layer: Gauss collocation of order 16.

The whole smooth equation (19) is integrated, with any number of floors in their layers. On a
step of length h the accelerations G_j at the `N_STAGES` Gauss nodes c_j satisfy

    V_j = v_0 + h sum_k A_jk G_k,      U_j = u_0 + h c_j v_0 + h^2 sum_k (A^2)_jk G_k,
    G_j = G(tau + c_j h, U_j, V_j)

(implicit Runge-Kutta of Gauss type, order 2 N_STAGES; Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, II.7), solved by fixed-point iteration from the polynomial of
the step before. The step has two limits.

- The sigmoid has poles at rho x = +-i pi (2 m + 1). If y = rho x moves by at most `REACH` times
  the distance d = sqrt(pi^2 + y^2) of the nearest one, the path stays inside a Bernstein ellipse
  about the step with parameter kappa, and Gauss quadrature converges as kappa^-16. This limit
  also keeps a floor that is still far away from stepping over its layer.
- The iteration contracts as h^2 |dG/du| / 2, so h <= `CONTRACTION` / sqrt(|dG/du|), and likewise
  for damping and forcing.

The last Legendre coefficient c_7 of G measures kappa; the error of the velocity, about
h c_7^2 / max|c_k|, must stay below the tolerance, or the step is halved.
"""

import math

import numpy as np

from hpcsweep.equations import contact_stiffness, switch
from hpcsweep.jit import jit
from hpcsweep.outcome import Outcome

N_STAGES = 8
REACH = 1.1
CONTRACTION = 0.6
MAX_ITERATIONS = 40
COMPLETE = int(Outcome.COMPLETE)
NON_FINITE = int(Outcome.NON_FINITE)
STEP_LIMIT = int(Outcome.STEP_LIMIT)
SOLVER_FAILED = int(Outcome.SOLVER_FAILED)


def _collocation():
    """Gauss nodes and weights on [0, 1], A, A^2, the Legendre transform, and extrapolation."""
    x, w = np.polynomial.legendre.leggauss(N_STAGES)
    legendre = np.polynomial.legendre.legvander(x, N_STAGES - 1)
    transform = (np.arange(N_STAGES)[:, None] + 0.5) * legendre.T * w
    integral = np.empty((N_STAGES, N_STAGES))
    for k in range(N_STAGES):
        unit = np.zeros(N_STAGES)
        unit[k] = 1.0
        antiderivative = np.polynomial.legendre.legint(unit, lbnd=-1)
        integral[:, k] = 0.5 * np.polynomial.legendre.legval(x, antiderivative)
    stages = integral @ transform
    return 0.5 * (x + 1.0), 0.5 * w, stages, stages @ stages, transform


NODES, WEIGHTS, STAGES, STAGES_SQUARED, LEGENDRE = _collocation()
POSITION_WEIGHTS = WEIGHTS @ STAGES
"""b^T A: u_1 = u_0 + h v_0 + h^2 sum_k (b^T A)_k G_k."""


@jit
def _acceleration(tau, u, v, amplitude, model, stage, out):
    """Evaluate G at one stage: `u`, `v`, `out` have shape (n, N_STAGES)."""
    n = u.shape[0]
    ground = amplitude * math.sin(model.omega * tau)
    for i in range(n):
        x = u[i, stage] - 1.0
        force = -ground - model.beta * switch(x, model.rho) * x
        for j in range(n):
            force -= model.damping[i, j] * v[j, stage]
        left = u[i - 1, stage] if i > 0 else 0.0
        force -= u[i, stage] - left
        if i < n - 1:
            force -= u[i, stage] - u[i + 1, stage]
        out[i, stage] = force


@jit
def step_limit(z, a, model, tau_left):
    """Choose the length of a step from state z and accelerations a; see the module."""
    n = a.shape[0]
    h = tau_left
    stiffness = 4.0
    hardest = 0.0
    for i in range(n):
        x = z[i] - 1.0
        v = abs(z[n + i])
        if model.rho > 0.0:
            y = model.rho * x
            reach = REACH * math.sqrt(math.pi**2 + y * y) / model.rho
            root = math.sqrt(v * v + 2.0 * abs(a[i]) * reach)
            if root > 0.0:
                h = min(h, 2.0 * reach / (v + root))
            nearest = x + reach
        else:
            nearest = 0.0
        hardest = max(
            hardest,
            contact_stiffness(min(nearest, 2.4 / max(model.rho, 1e-300)), model.beta, model.rho),
        )
    h = min(h, CONTRACTION / math.sqrt(stiffness + max(hardest, 0.0)))
    drag = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(model.damping[i, j])
        drag = max(drag, row)
    if drag > 0.0:
        h = min(h, 0.4 / drag)
    return min(h, 1.0 / model.omega)


@jit
def collocate(tau, h, z, amplitude, model, u, v, g, fresh):
    """Solve the collocation equations of one step.

    Parameters
    ----------
    tau, h : float
        Start and length of the step.
    z : ndarray, shape (2n,)
        State at `tau`; not changed.
    u, v, g : ndarray, shape (n, N_STAGES)
        Stage values; `g` holds the first guess on entry (any finite values) and the solution on
        return.
    fresh : ndarray, shape (n, N_STAGES)
        Room.

    Returns
    -------
    bool
        Whether the iteration converged to rounding.
    """
    n = g.shape[0]
    previous = math.inf
    for _ in range(MAX_ITERATIONS):
        for i in range(n):
            for j in range(N_STAGES):
                du = 0.0
                dv = 0.0
                for k in range(N_STAGES):
                    du += STAGES_SQUARED[j, k] * g[i, k]
                    dv += STAGES[j, k] * g[i, k]
                u[i, j] = z[i] + h * (NODES[j] * z[n + i] + h * du)
                v[i, j] = z[n + i] + h * dv
        change = 0.0
        size = 0.0
        for j in range(N_STAGES):
            _acceleration(tau + NODES[j] * h, u, v, amplitude, model, j, fresh)
        for i in range(n):
            for j in range(N_STAGES):
                change = max(change, abs(fresh[i, j] - g[i, j]))
                size = max(size, abs(fresh[i, j]))
                g[i, j] = fresh[i, j]
        if not size < math.inf:
            return False
        speed = 0.0
        for i in range(n):
            speed = max(speed, abs(z[n + i]))
        rounding = 4e-16 * (size + speed / h)
        if change <= rounding:
            return True
        if change >= previous and change <= 100.0 * rounding:
            return True
        if change > 4.0 * previous and previous < math.inf and change > 1e3 * rounding:
            return False
        previous = change
    return False


@jit
def quadrature_error(h, g):
    """Estimate the velocity error of a step from the Legendre coefficients of G."""
    worst = 0.0
    for i in range(g.shape[0]):
        largest = 0.0
        last = 0.0
        for k in range(N_STAGES):
            coefficient = 0.0
            for j in range(N_STAGES):
                coefficient += LEGENDRE[k, j] * g[i, j]
            largest = max(largest, abs(coefficient))
            if k >= N_STAGES - 2:
                last = max(last, abs(coefficient))
        if largest > 0.0:
            worst = max(worst, h * last * last / largest)
    return worst


@jit
def finish(h, z, g, out):
    """Write the state at the end of the step into `out`, shape (2n,)."""
    n = g.shape[0]
    for i in range(n):
        du = 0.0
        dv = 0.0
        for k in range(N_STAGES):
            du += POSITION_WEIGHTS[k] * g[i, k]
            dv += WEIGHTS[k] * g[i, k]
        out[i] = z[i] + h * (z[n + i] + h * du)
        out[n + i] = z[n + i] + h * dv


@jit
def accelerations(tau, z, amplitude, model, out):
    """Evaluate u'' at one state into `out`, shape (n,)."""
    n = out.shape[0]
    ground = amplitude * math.sin(model.omega * tau)
    for i in range(n):
        x = z[i] - 1.0
        force = -ground - model.beta * switch(x, model.rho) * x
        for j in range(n):
            force -= model.stiffness[i, j] * z[j] + model.damping[i, j] * z[n + j]
        out[i] = force


@jit
def inside_layer(z, half_width):
    """Tell whether any floor is within its contact layer (never, if that has no width)."""
    for i in range(z.shape[0] // 2):
        if abs(z[i] - 1.0) < half_width:
            return True
    return False
