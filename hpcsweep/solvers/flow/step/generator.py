"""The matrix M of the linear motion of one set, x' = M x (`propagators`), and its spectrum."""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.kernel_contacts import DRAG
from hpcsweep.solvers.flow.state.state import contact_bit, is_oblique
from hpcsweep.solvers.flow.step.constraint import constrain_generator


@kernel
def write_generator(key, model, scale, out):
    """Write M of the coordinates u into `out`, (2n + 2H + 1, padded), balanced.

    Displacements are measured in units of ``model.balance``, velocities in these times `scale`, and
    the forcing in units of `scale`.
    """
    n, unit = model.modal_transform.shape[0], model.balance
    loads = out.shape[0] - 1 - model.elements.stiffness.shape[0]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
    for i in range(n):
        out[i, n + i] = scale
        for j in range(n):
            ratio = unit[j] / unit[i]
            out[n + i, j] = -model.stiffness[i, j] * ratio / scale
            out[n + i, n + j] = -model.damping[i, j] * ratio
        for h in range(2 * n, loads, 2):
            out[n + i, h] = model.forcing[i] / unit[i]
    _add_contacts(key, model, scale, out)
    _add_elements(key, model, scale, out)
    constrain_generator(key, model, out)
    for h in range(model.harmonics.shape[0]):
        at = 2 * n + 2 * h
        out[at, at + 1] = model.harmonics[h, 0] * model.omega
        out[at + 1, at] = -model.harmonics[h, 0] * model.omega
    for k in range(model.ramp.shape[0]):
        at = 2 * n + 2 * (model.harmonics.shape[0] + k)
        out[at, at + 1] = 1.0


@inlined
def _add_contacts(key, model, scale, out):
    """Add the springs and dashpots of the closed contacts."""
    n, last = model.modal_transform.shape[0], out.shape[0] - 1
    contacts, unit = model.contacts, model.balance
    for k in range(contacts.row.shape[0]):
        if (key >> np.uint64(k)) & np.uint64(1):
            for i in range(n):
                push = contacts.beta[k] * contacts.kick[k, i] / (unit[i] * scale)
                if push != 0.0:
                    for j in range(n):
                        out[n + i, j] -= push * contacts.reach[k, j] * unit[j]
                    out[n + i, last] += push * contacts.gap[k]
                drag = contacts.edges[k, DRAG] * contacts.kick[k, i] / unit[i]
                if drag != 0.0:
                    for j in range(n):
                        out[n + i, n + j] -= drag * contacts.reach[k, j] * unit[j]


@inlined
def _add_elements(key, model, scale, out):
    """Add the loads of elements, and take the springs of those that slip away."""
    n = model.modal_transform.shape[0]
    elements, unit = model.elements, model.balance
    loads = out.shape[0] - 1 - elements.stiffness.shape[0]
    for j in range(elements.stiffness.shape[0]):
        slips = key & contact_bit(model.contacts.row.shape[0] + j) != np.uint64(0)
        for i in range(n):
            push = elements.stiffness[j] * elements.kick[j, i] / (unit[i] * scale)
            out[n + i, loads + j] += push
            if slips and push != 0.0:
                for k in range(n):
                    out[n + i, k] += push * elements.reach[j, k] * unit[k]


@kernel
def bound_of_set(key, model):
    """Bound the moduli of the eigenvalues of M.

    For an eigenvector with displacements q, q* M q = 1, lambda^2 + d lambda + k = 0 with d = q* C q
    and k = q* (K + contacts) q, dashpots in C. If the roots are complex |lambda|^2 = k, if not
    |lambda| <= d. Of K and C k and d are at most the largest eigenvalues, of contacts the largest
    sum of a row of sqrt(kappa_k kappa_l) |d_k M^-1 d_l| = sqrt(beta_k beta_l) share_kl, where
    share_kl^2 = (d_k . e_l) (d_l . e_k), 1 for k = l.
    """
    contacts, m = model.contacts, model.contacts.row.shape[0]
    hardest = strongest = 0.0
    for k in range(m):
        if key & contact_bit(k) == np.uint64(0):
            continue
        stiff = drag = 0.0
        for i in range(m):
            if key & contact_bit(i) != np.uint64(0) and (i == k or is_oblique(contacts)):
                share = 1.0 if i == k else contacts.oblique[k, i] * contacts.oblique[i, k]
                stiff += math.sqrt(share * contacts.beta[k] * contacts.beta[i])
                drag += math.sqrt(share * contacts.edges[k, DRAG] * contacts.edges[i, DRAG])
        hardest, strongest = max(hardest, stiff), max(strongest, drag)
    fastest = model.omega
    for h in range(model.harmonics.shape[0]):
        fastest = max(fastest, model.harmonics[h, 0] * model.omega)
    stiffest = math.sqrt(model.stiffness_bound + hardest)
    return max(stiffest, max(model.drag + strongest, fastest))
