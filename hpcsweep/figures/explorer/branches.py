"""Branches in the explorer: beneath the orbit diagrams, each point with all that is known of it."""

from collections.abc import Callable, Sequence

import numpy as np

from hpcsweep.figures import palette, style
from hpcsweep.figures.overlay import Drawn


def pack_branches(
    frames: Sequence[Sequence[Drawn]], structure, room: int, add: Callable[..., None]
) -> list[list[dict]]:
    """Add the arrays of branches to a page, and describe the branches of each frame.

    All points stand one after the other: of the arrays over steps `branch_value`,
    `branch_forcing`, `branch_stable`, `branch_contact` and `branch_multiplier` a branch takes
    `count` from `step`, of `branch_point` period x count states from `state`. Numbers are float32,
    bit for bit.

    Parameters
    ----------
    frames : sequence of sequence of Drawn
        Branches of each frame.
    structure : Structure
    room : int
        Letters of a contact set's name.
    add : callable
        Take the name of an array, its numbers and notes on it.
    """
    every = [branch for frame in frames for branch in frame]
    if not every:
        return []

    def joined(name: str, axis: int = 0) -> np.ndarray:
        return np.concatenate([getattr(branch, name) for branch in every], axis=axis)

    sets, contact = np.unique(joined("contact"), return_inverse=True)
    mu, stable = joined("multipliers"), joined("stable").astype(np.uint8)
    value, forcing = joined("value"), joined("forcing", 1)
    states = np.concatenate([branch.points.reshape(-1, mu.shape[1]) for branch in every])
    for name, numbers in (
        ("branch_value", value),
        ("branch_forcing", forcing),
        ("branch_point", states.T),
        ("branch_multiplier", np.concatenate((mu.real, mu.imag), axis=1).T),
    ):
        add(name, np.ascontiguousarray(numbers, "<f4").view("<u4"), float32=True)
    add("branch_stable", stable)
    names = with_members(sets.tolist(), structure, room)
    add("branch_contact", contact.astype(np.uint16), names=names)
    described: list[list[dict]] = []
    step = state = 0
    for frame in frames:
        described.append([])
        for branch in frame:
            count = branch.value.size
            colour = palette.period_colour(branch.period)
            described[-1].append(
                {"number": branch.number, "period": branch.period, "colour": colour}
                | {"count": count, "step": step, "state": state}
            )
            step, state = step + count, state + count * branch.period
    return described


def with_members(contacts: Sequence[int], structure, room: int) -> list[str]:
    """Return `style.set_names`, followed by the contacts of each that have names of their own."""
    named = structure.contact_names.items() if structure.names.contacts else ()
    members = (
        ", ".join(name for number, name in named if contact >> (number - 1) & 1)
        for contact in contacts
    )
    names = style.set_names(contacts, structure.contact_labels, room)
    return [
        f"{name}: {words}" if words else name for name, words in zip(names, members, strict=True)
    ]
