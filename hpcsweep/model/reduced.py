"""A reduced model in plain values, as a job stores it, and its structure."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, fields, replace
from typing import Any, NamedTuple

from hpcsweep.model.arguments import InputError, wrong
from hpcsweep.model.matrices import Contact, Slider
from hpcsweep.model.reduction import Reduction
from hpcsweep.model.structure import Structure


def elements_of(name: str, tables: Iterable[Mapping[str, Any]]) -> list:
    """Make each "contact", or "slider", of a table; errors name it with its place, from 0."""
    kind: Any = {"contact": Contact, "slider": Slider}[name]
    defaults = {parameter.name: parameter.default for parameter in fields(kind)}
    made = []
    for k, table in enumerate(tables):
        place = f"{name}[{k}]"
        if unknown := [key for key in table if key not in defaults]:
            raise wrong(f"{place}.{unknown[0]}", f"is unknown, known are {', '.join(defaults)}")
        for key, default in defaults.items():
            if default is MISSING and key not in table:
                raise wrong(f"{place}.{key}", "is missing")
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
        contacts: Sequence[Mapping[str, Any]],
        sliders: Sequence[Mapping[str, Any]],
        damping_ratio: Any = None,
        origin: str = "",
        **others: Any,
    ) -> Structure:
        """Return the structure, from tables of its contacts and sliders."""
        if hasattr(damping_ratio, "__len__"):
            n, ratios = self.facts["modes"], tuple(damping_ratio)
            if len(ratios) != n:
                limit = f"one number or one per mode: {n} are needed, {len(ratios)} are given"
                raise wrong("damping_ratio", f"must be {limit}")
            damping_ratio = ratios + ratios[-1:] * (len(self.names) - n)
        is_given = damping_ratio is not None or others.get("rayleigh") is not None

        def elements(name: str, tables: Sequence[Mapping[str, Any]], rows: list) -> list:
            pairs = zip(tables, rows, strict=True)
            return elements_of(name, [{**table, "direction": row} for table, row in pairs])

        made = Structure.from_matrices(
            self.mass,
            self.stiffness,
            elements("contact", contacts, self.contacts),
            sliders=elements("slider", sliders, self.sliders),
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
