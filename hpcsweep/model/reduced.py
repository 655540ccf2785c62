"""A reduced model in plain values, as a job stores it, and its structure."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from hpcsweep.model.arguments import wrong
from hpcsweep.model.matrices import elements_of
from hpcsweep.model.reduction import Reduction
from hpcsweep.model.structure import Structure


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
