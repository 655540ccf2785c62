"""A reduced model in plain values, as a job stores it, and its structure."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

from hpcsweep.model.arguments import InputError, refused
from hpcsweep.model.matrices import Contact
from hpcsweep.model.reduction import Reduction
from hpcsweep.model.slider import Slider
from hpcsweep.model.springs import Spring
from hpcsweep.model.structure import Structure
from hpcsweep.model.vectors import each


def elements_of(name: str, tables: Iterable[Any]) -> list:
    """Make each contact, slider or spring that is a table; errors name its place, from 0."""
    kind: Any = {"contact": Contact, "slider": Slider, "spring": Spring}[name]
    keys = [parameter.name for parameter in fields(kind)]
    made = []
    for k, table in enumerate(tables):
        if isinstance(table, kind):
            made.append(table)
            continue
        place = f"{name}[{k}]"
        if not set(keys[:3]) <= set(table) <= set(keys):
            raise refused(place, f"of {', '.join(keys)}, the first three at least", dict(table))
        try:
            made.append(kind(**table))
        except InputError as error:
            raise error.within(place) from None
    return made


class Reduced(NamedTuple):
    """Matrices and rows of a structure; `Contact` and `Slider` have the laws of the elements."""

    names: list[str]
    mass: list[list[float]]
    stiffness: list[list[float]]
    influence: list[float]
    contacts: list[list[float]]
    """Direction of each ..."""
    sliders: list[list[float]]
    drift: list[list[float]]
    contact_names: list[str]
    drift_names: list[str]
    facts: Mapping[str, Any]
    """Those of `Reduction`."""
    damping: list[list[float]] | None = None

    def structure(
        self,
        contacts: Sequence[Any],
        sliders: Sequence[Any],
        damping_ratio: Any = None,
        origin: str = "",
        **others: Any,
    ) -> Structure:
        """Return the structure, from its contacts and sliders, or their tables."""
        if hasattr(damping_ratio, "__len__"):
            n = self.facts["modes"]
            vibrate = n - [*self.facts["frequencies"]].count(0.0)
            ratios = each("damping_ratio", damping_ratio, vibrate, "mode")
            damping_ratio = ratios + ratios[-1:] * (len(self.names) - n)
        is_given = damping_ratio is not None or others.get("rayleigh") is not None

        hits = elements_of("contact", contacts)
        slides = elements_of("slider", sliders)
        made = Structure.from_matrices(
            self.mass,
            self.stiffness,
            [replace(hit, direction=row) for hit, row in zip(hits, self.contacts, strict=True)],
            sliders=[
                replace(s, direction=row) for s, row in zip(slides, self.sliders, strict=True)
            ],
            damping_ratio=damping_ratio,
            damping=None if is_given else self.damping,
            influence=self.influence,
            drift=self.drift,
            **others,
        )
        facts: dict[str, Any] = dict(self.facts)
        facts |= {key: tuple(v) for key, v in facts.items() if isinstance(v, list)}
        matrices: Any = made.matrices
        return replace(
            made.named(self.names, self.contact_names, (), self.drift_names),
            matrices=replace(matrices, origin=origin),
            reduction=Reduction(**facts),
        )
