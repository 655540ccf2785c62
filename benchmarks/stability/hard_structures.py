"""Hard structures of any kind for `stress`: by name, as arguments of `made`."""

import math
from collections.abc import Iterator

import numpy as np

from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure

CHAIN = [[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]]
TOP, FIRST = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
OBLIQUE = ((0.6, -0.3, 0.2), (-0.2, 0.9, 0.4), (0.5, 0.5, -0.7), (0.1, -0.8, 0.6))


def made(given: dict) -> Structure:
    """Return the structure of a case: a building, or with ``contacts`` one of matrices."""
    if "contacts" not in given:
        return Structure(**given)
    contacts = [Contact(*contact) for contact in given["contacts"]]
    return Structure.from_matrices(**{**given, "contacts": contacts})


def _three(rho: float, contacts: list, **more) -> dict:
    """Return three masses in a row, with contacts (direction, gap, stiffness)."""
    given = {"mass": [1.0, 2.0, 1.0], "stiffness": CHAIN, "contacts": contacts, "sharpness": rho}
    if "damping" not in more:
        given["damping_ratio"] = 0.05
    return {**given, **more}


def _turned(direction: tuple) -> tuple:
    return tuple(-one for one in direction)


def hard_structures(rho: float) -> Iterator[tuple[str, dict]]:
    """Return the structures whose contacts have a sharpness (of a gap of 1)."""
    yield from _decades(rho)
    yield from _contacts(rho)
    yield from _places(rho)
    for size in (1e2, 1e4):
        stiff = (size * np.array(CHAIN)).tolist()
        contacts = [(TOP, 0.3, 1000.0), (FIRST, 0.1, 1000.0)]
        yield f"damping matrix {size:g} K", _three(rho, contacts, damping=stiff)
        dashpot = np.diag((0.0, size, 0.0)).tolist()
        yield f"one dashpot of {size:g}", _three(rho, contacts, damping=dashpot)
    sixteen = tuple((k, 1.0 / k, 0.3 * k) for k in range(1, 17))
    yield "16 harmonics", {"sharpness": rho, "gap": 0.5, "harmonics": sixteen}
    orders = ((1, 1.0, 0.0), (37, 0.5, 1.0), (1000, 10.0, 0.2))
    yield "harmonics of orders 1, 37, 1000", {"sharpness": rho, "gap": 0.5, "harmonics": orders}


def _decades(rho):
    """Return structures with masses, storeys, contacts and units far from 1."""
    for half in (2, 4, 6):
        spread = (10.0 ** np.linspace(-half, half, 4)).tolist()
        name = f"from 1e-{half} to 1e{half}"
        chain = {"n_floors": 4, "sharpness": rho}
        yield f"masses {name}, upwards", {**chain, "mass": tuple(spread)}
        yield f"masses {name}, downwards", {**chain, "mass": tuple(spread[::-1])}
        yield f"storeys {name}", {**chain, "storey_stiffness": tuple(spread)}
        both = {"mass": tuple(spread), "storey_stiffness": tuple(spread)}
        yield f"both {name}", {**chain, **both}
    for length, rate in ((1e-6, 1e3), (1e4, 1e-3)):
        storeys = tuple((rate * rate * np.array((3.0, 2.0, 1.0))).tolist())
        building = {
            "mass": (1.0, 2.0, 3.0), "storey_stiffness": storeys, "sharpness": rho / length,
            "gap": length, "gap_left": 0.5 * length,
        }  # fmt: skip
        yield f"lengths {length:g}, frequencies {rate:g}", building
    unequal = [(TOP, 0.3, 1e8), ((0.0, 1.0, 0.0), 0.2, 1e2), (FIRST, 0.1, 1e-4)]
    yield "contacts from 1e-4 to 1e8", _three(rho, unequal)


def _contacts(rho):
    """Return structures with contacts in oblique directions."""
    oblique = [(d, 0.1 * k, 10.0 ** (1 + k % 3)) for k, d in enumerate(OBLIQUE)]
    yield "four oblique contacts", _three(rho, oblique)
    both = [*oblique, *((_turned(d), g, kappa) for d, g, kappa in oblique)]
    yield "four oblique contacts, both sides", _three(rho, both)
    near = [((1.0, 1e-9 * k, 0.0), 0.2, 500.0) for k in range(4)]
    yield "directions that are nearly parallel", _three(rho, near)
    for scale in (1e-8, 1e8):
        longer = tuple(scale * one for one in OBLIQUE[0])
        scaled = [(longer, 0.1 * scale, 500.0 / scale**2)]
        scaled.append((_turned(longer), 0.2 * scale, 500.0 / scale**2))
        yield f"directions of length {scale:g}", _three(rho / scale, scaled)


def _places(rho):
    """Return structures with coincident stops, stops in a row, at rest, and beyond it."""
    yield "gaps of 0 on both sides", {"gap": 0.0, "gap_left": 0.0, "sharpness": rho}
    some = {"gap": (1.0, math.inf, 0.0), "gap_left": (math.inf, math.inf, 0.0)}
    yield "gaps of 0 on both sides of one floor", {**some, "sharpness": rho}
    yield "negative gaps on both sides", {"gap": -0.3, "gap_left": -0.2, "sharpness": rho}
    for name, d in (("opposite", TOP), ("opposite oblique", OBLIQUE[0])):
        pair = [(d, 0.3, 1000.0), (_turned(d), -0.3, 400.0)]
        yield f"{name} contacts at one place", _three(rho, pair)
    places = [(tuple(s * one for one in TOP), 0.0, kappa) for s, kappa in
              ((1.39, 2.1), (-0.08, 12.2), (-0.64, 202.0), (-0.91, 1666.5))]  # fmt: skip
    yield "directions of four lengths at one place", _three(rho, places)
    yield "8 contacts at one place", _three(rho, [(TOP, 0.3, 200.0)] * 8)
    yield "64 contacts on a row", _three(rho, [(TOP, 0.01 * k, 10.0) for k in range(64)])
