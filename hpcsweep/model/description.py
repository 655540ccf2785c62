"""Describe a structure in words, and in plain values for files read without their job."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hpcsweep.model.forcing import ONE_HARMONIC
from hpcsweep.model.structure import Structure

MAX_LISTED = 4
"""Most values listed individually."""
FAST = 1e3
"""Highest natural frequency of storeys, bearings and masses over the lowest, without a warning."""
SPRINGLESS = 10.0
"""Damping ratio zeta above which the spring hardly counts: speeds decay in 1 / (2 zeta omega), 4
zeta^2 times as fast as displacements."""
DASHPOT = ("damping", "tension")
"""What is told of a dashpot."""
MOTION = """\
M u'' + C u' + K u + sum_k d_k F_k - sum_j k_j b_j p_j = b G(tau). u, u': displacements and \
velocities of the coordinates relative to the base, in the order of the matrices. {forcing} \
Contact k: x = d_k . u - gap_k is the distance past its stop, and it pushes with F_k = \
stiffness_k S(x) x, S(x) = 1 / (1 + exp(-sharpness x)), with an infinite sharpness S = 1 where x > \
0 and else 0; with a damping c F_k = stiffness_k x + c x' where x > 0, which without tension is at \
least 0. Slider j of stiffness k_j, whose spring K holds: |k_j (b_j . u - p_j)| <= strength_j; p_j \
rests, and while the limit is reached follows b_j . u.{more}"""
DEGRADES = """\
 Of one with a backbone k_j p_j = k_j b_j . u - f_j, with its force f_j by the rules of Ibarra, \
Medina and Krawinkler (2005), see hpcsweep.Backbone."""
RIGID = """\
 Of an infinite stiffness_k x is at most 0: where it reaches 0, d_k . u' becomes -restitution \
times what it was, by an impulse along -d_k; while that is 0 a reaction along -d_k may hold it."""
HARMONIC = """\
G = A sum_h a_h sin(h Omega tau + phi_h), with (h, a_h, phi_h) of the harmonics, A = amplitude, \
Omega = omega; where b = -M r, r the influence, it is the acceleration of the base."""
RECORDED = """\
G is the acceleration of the base, b = -M r, r the influence: that of the record times its factor, \
linear between samples, 0 after the last."""
SIGNS = """\
u, G and the directions d_k, b_j are positive the same way; a stop lies where d_k . u = gap_k, and \
a contact that pushes does so against d_k. Stroboscopic points and final states are (u, u', p) at \
whole multiples of the forcing period 2 pi / Omega, h = 1, where phases are those of the \
harmonics; forces and accelerations are positive as their displacements. Contact sets have bit k - \
1 for the contact of number k."""
"""Equation of motion, its forcings and conventions in words, for files."""


def contacts_named(structure: Structure) -> str:
    """Name the contacts behind the numbers of contact sets; empty where they have no names."""
    named = structure.contact_names.items() if structure.names.contacts else ()
    return ", ".join(f"{number} is {name}" for number, name in named)


def motion(structure: Structure, forcing: str) -> str:
    """Return the equation of motion in words."""
    more = DEGRADES * any(slider.backbone is not None for slider in structure.sliders)
    return MOTION.format(forcing=forcing, more=more + RIGID * bool(structure.is_rigid.any()))


def describe(structure: Structure) -> dict:
    """Return all that the equations of `hpcsweep.model.matrices` need except A and Omega.

    The stiffness is that of a structure whose sliders stick.
    """
    limits = structure.drift_limits
    return {
        "n_floors": structure.n_floors,
        "mass": structure.mass_matrix.tolist(),
        "stiffness": structure.stiffness_matrix.tolist(),
        "damping": structure.damping_matrix.tolist(),
        "forcing": structure.forcing_vector.tolist(),
        "influence": structure.influence.tolist(),
        "harmonics": [list(harmonic) for harmonic in structure.harmonics],
        "sharpness": structure.sharpness,
        "contacts": [
            {
                "number": number,
                "direction": list(contact.direction),
                "gap": contact.gap,
                "stiffness": contact.stiffness,
                **({name: getattr(contact, name) for name in DASHPOT} if contact.damping else {}),
                **({} if contact.restitution is None else {"restitution": contact.restitution}),
            }
            for number, contact in zip(structure.contact_numbers, structure.contacts, strict=True)
        ],
        "drift": structure.drift_rows.tolist(),
        **({"sliders": [*map(_of_slider, structure.sliders)]} if structure.sliders else {}),
        **({} if structure.collapse_drift is None else {"collapse_drift": limits.tolist()}),
    }


def _of_slider(slider) -> dict:
    told = asdict(slider).items()
    return {key: value for key, value in told if value is not None or key == "name"}


def as_text(structure: Structure) -> str:
    """Return `describe` as JSON (an infinite sharpness as Infinity)."""
    return json.dumps(describe(structure))


def in_words(structure: Structure) -> list[tuple[str, str]]:
    """Describe the parameters of a structure: (symbol, value); with an empty symbol in words.

    The symbols are those of the equations: n, beta, m, k, g (gap), g_L (on the left), rho, e
    (restitution), c (dashpots), zeta.
    """
    words = [("n", str(structure.n_floors))]
    if structure.matrices is not None:
        count = len(structure.contacts)
        words.append(("", f"{count} contact{'' if count == 1 else 's'}, matrices"))
        if structure.reduction is not None and structure.reduction.error:
            words.append(("", f"reduced with an error of {structure.reduction.error:.2g}"))
    else:
        parameters: Sequence[tuple[str, Any, Any]] = (
            ("beta", structure.stiffness_ratio, None),
            ("m", structure.mass, None),
            ("k", structure.storey_stiffness, None),
            ("g", structure.gap, 1.0),
            ("g_L", structure.gap_left, math.inf),
        )
        words += [(symbol, few(value)) for symbol, value, usual in parameters if value != usual]
    if count := structure.n_rigid:
        words.append(("", f"{count} motion{'' if count == 1 else 's'} without spring"))
    words.append(("rho", f"{structure.sharpness:g}"))
    if structure.p_delta:
        words.append(("", "P-Delta"))
    if structure.restitution is not None:
        words.append(("e", few(structure.restitution)))
    elif np.any(structure.contact_damping):
        words.append(("c", few(structure.contact_damping.tolist())))
    if any(contact.damping and contact.tension for contact in structure.contacts):
        words.append(("", "dashpots pull"))
    if structure.matrices is not None and structure.matrices.damping is not None:
        words.append(("", "damping matrix"))
    if structure.sliders:
        count = len(structure.sliders)
        words.append(("", f"{count} slider{'' if count == 1 else 's'}"))
    elif structure.rayleigh is not None:
        words.append(("", "Rayleigh damping " + few(structure.rayleigh_factors)))
    else:
        ratios = structure.damping_ratios[structure.n_rigid : modes_kept(structure)].tolist()
        if 0.0 <= max(ratios, default=-1.0) <= SPRINGLESS:
            words.append(("zeta", few([float(f"{ratio:.4g}") for ratio in ratios])))
    if structure.storey_dashpots.any():
        words.append(("", "dashpots of storeys"))
    if structure.harmonics != ONE_HARMONIC:
        orders = ", ".join(str(order) for order, _, _ in structure.harmonics)
        words.append(("", f"harmonic{'s' if len(structure.harmonics) > 1 else ''} {orders}"))
    return words


def one_line(structure: Structure) -> str:
    """Describe the parameters of a structure on one line."""
    return ", ".join(f"{name} = {value}" if name else value for name, value in in_words(structure))


def few(value: float | Sequence[float]) -> str:
    """Format a number, or several: up to four individually, more by their range."""
    numbers = value if isinstance(value, Sequence) else (value,)
    if len(set(numbers)) == 1:
        return f"{numbers[0]:g}"
    if len(numbers) <= MAX_LISTED:
        return "(" + ", ".join(f"{x:g}" for x in numbers) + ")"
    finite = [x for x in numbers if math.isfinite(x)]
    ends = f"{min(finite):g} to {max(finite):g}" if min(finite) < max(finite) else f"{finite[0]:g}"
    return ends + (" or inf" if len(finite) < len(numbers) else "")


def modes_kept(structure: Structure) -> int:
    """Return how many modes are those of the structure, or of the model that it is reduced from."""
    return structure.n_floors if structure.reduction is None else structure.reduction.modes


def slow(structure) -> Iterator[str]:
    """Yield one line if a mode oscillates or decays so fast that runs take long."""
    first = structure.n_rigid
    ratios = structure.damping_ratios[first : modes_kept(structure)]
    frequencies = structure.frequencies[first : first + ratios.size]
    if not ratios.size:
        return
    rates = frequencies
    if not rates[-1] > FAST * rates[0] > 0:
        rates = frequencies * np.maximum(1.0, 2.0 * ratios)
    fastest = int(rates.argmax())
    if not rates[fastest] > FAST * frequencies[0] > 0:
        return
    place = structure.floor_names[int(np.abs(structure.modes[:, first + fastest]).argmax())]
    why, hint = "is", "is its mass right, are the springs beside it?"
    if rates[fastest] > frequencies[fastest]:
        why, hint = "decays", f"its damping ratio is {ratios[fastest]:.3g}"
    if structure.reduction is not None:
        hint = "structure.model.reduce with fewer modes leaves it out"
    yield (
        f"mode {first + fastest + 1} {why} {rates[fastest] / frequencies[0]:.2g} times as fast as "
        f"the first{' that vibrates' * bool(first)}, a motion of {place}: runs take long; {hint}"
    )
