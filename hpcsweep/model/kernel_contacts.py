"""Contacts in the kernels' form: rows, signs, gaps, laws, what each pushes; see `kernel_model`."""

from typing import NamedTuple

import numpy as np

from hpcsweep.model.modes import per_mass
from hpcsweep.model.rigid import bounces
from hpcsweep.model.structure import Structure

DRAG, LETS_GO, SPRING, DASHPOT = range(4, 8)
"""Columns of `Contacts.edges`: damping that the distance x of a contact feels, x'' = ... - beta x -
drag x'; 1 where a dashpot never pulls; and the force, SPRING x + DASHPOT x', in its unit
(`LinearDynamics.force_per_length`)."""


class Contacts(NamedTuple):
    """The m contacts in the kernels' form."""

    row: np.ndarray
    """(m,) int: x = sign y[row] - gap."""
    places: np.ndarray
    """(m, 2) unsigned: row and R + row, of y and y' in a state; such an index is not checked."""
    edges: np.ndarray
    """(m, 8): sign, y at the edge of the layer before the stop and beyond it, gap: the data of the
    search for the next contact; then `DRAG`, `LETS_GO`, `SPRING`, `DASHPOT`. One cache line."""
    sign: np.ndarray
    """(m,): 1 or -1."""
    gap: np.ndarray
    beta: np.ndarray
    """(m,): stiffness of the contact that its distance feels."""
    first: np.ndarray
    """(m + 1,) int: first entries of e_k in `push_row` and `push`."""
    push_row: np.ndarray
    push: np.ndarray
    """The entries of e_k that are not 0."""
    solo: np.ndarray
    """(R,) int: the contact that refers to a row and pushes nothing else; -1 if there is none."""
    others: np.ndarray
    """(any,) int: the contacts that are not in `solo`."""
    reach: np.ndarray
    """(m, n): d_k."""
    kick: np.ndarray
    """(m, R): e_k ..."""
    damped: np.ndarray
    """... D e_k, D = M^-1 C ..."""
    bent: np.ndarray
    """... and -M^-1 K e_k + D^2 e_k, that of free flight."""
    gain: np.ndarray
    """(m,): bound of the effect of a unit of x on a coordinate, for the errors of passages."""
    oblique: np.ndarray
    """(m, m): d_k . e_l for k != l, 0 where contact l does not push contact k; no rows if none
    pushes another."""
    bounce: np.ndarray
    """(m,): e of rigid contacts, -1 of others; nothing if none is rigid, see `rigid`."""


def kernel_contacts(
    structure: Structure, places, extra: np.ndarray, matrices, layer: float, n_bases: int
) -> Contacts:
    """Return the contacts, from their rows and signs and all rows beyond n, first those of bases.

    The reaction of a base is what structure and ground exert on each other: contacts do not push
    its row.
    """
    mass, softness, reach = structure.mass_matrix, structure.contact_softness, structure.directions
    stiffness, damping = matrices
    kick = per_mass(mass, reach.T).T / softness[:, None]
    damped = kick @ damping.T
    pushed = wide(kick, extra)
    pushed[:, len(mass) : len(mass) + n_bases] = 0.0
    entries = [np.flatnonzero(e) for e in pushed]
    first = np.cumsum([0, *(entry.size for entry in entries)]).astype(np.int64)
    push_row = np.concatenate([np.zeros(0, np.int64), *entries]).astype(np.int64)
    row = np.array([row for row, _ in places], np.int64)
    sign = np.array([sign for _, sign in places], float)
    gap = structure.gaps / structure.length_unit
    solo, others = _shares(row, entries, pushed.shape[1])
    oblique = reach @ kick.T
    oblique[np.abs(oblique) < 1e-14] = 0.0
    np.fill_diagonal(oblique, 0.0)
    flexibility = np.diag(per_mass(mass, np.eye(len(mass))))
    beta = structure.contact_stiffness * softness / structure.frequency_unit**2
    drag = structure.contact_damping * softness / structure.frequency_unit
    tension = np.array([contact.tension for contact in structure.contacts], bool)
    return Contacts(
        row=row,
        places=np.stack((row, row + pushed.shape[1]), 1).astype(np.uint64),
        edges=np.column_stack(
            (
                *(sign, sign * (gap - layer), sign * (gap + layer), gap),
                *(drag, (drag > 0.0) & ~tension),
                _law(beta, drag),
            )
        ),
        sign=sign,
        gap=gap,
        beta=beta,
        first=first,
        push_row=push_row,
        push=np.concatenate([np.zeros(0), *(e[i] for e, i in zip(pushed, entries, strict=True))]),
        solo=solo,
        others=others,
        reach=reach,
        kick=pushed,
        damped=wide(damped, extra),
        bent=wide(_bent(stiffness, damping, kick, damped), extra),
        gain=np.sqrt(np.maximum(flexibility.max() / softness, 1.0)),
        oblique=oblique if oblique.any() else oblique[:0],
        bounce=bounces(structure.contacts),
    )


def _law(beta: np.ndarray, drag: np.ndarray) -> np.ndarray:
    """Return beta and drag of each contact over beta, or over drag where there is no spring."""
    found = np.stack((beta, drag), 1)
    unit = np.where(beta != 0.0, np.abs(beta), np.where(drag > 0.0, drag, 1.0))
    return found / unit[:, None]


def _shares(row: np.ndarray, pushed: list[np.ndarray], n_rows: int) -> tuple[np.ndarray, ...]:
    """Return which contacts push only their row and are alone on it, and which do not."""
    solo = np.full(n_rows, -1, np.int64)
    others = []
    for k, (own, rows) in enumerate(zip(row, pushed, strict=True)):
        if rows.tolist() == [own] and solo[own] < 0:
            solo[own] = k
        else:
            others.append(k)
    return solo, np.array(others, np.int64)


def _bent(stiffness, damping, kick, damped) -> np.ndarray:
    """Return -K e + D (D e) of each contact, summed in the order of the columns."""
    found = -(kick @ stiffness.T)
    for j in range(len(damping)):
        found = found + damping[:, j] * damped[:, j, None]
    return found


def wide(vectors: np.ndarray, extra: np.ndarray) -> np.ndarray:
    """Extend vectors (..., n) by the rows beyond n to (..., R)."""
    return np.concatenate((vectors, vectors @ extra.T), axis=-1)
