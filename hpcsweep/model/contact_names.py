"""Numbers and names of contacts: bits of a contact set, labels in figures, names in files.

Names of floors besides.
"""

from functools import cached_property

from hpcsweep.model.system import System
from hpcsweep.model.unit_names import Names


class ContactNames(System):
    """Names of the contacts and floors of a structure."""

    names: Names

    @property
    def floor_names(self) -> tuple[str, ...]:
        """Name of each floor: as given, e.g. A3, or its number."""
        return self.names.floors or tuple(map(str, range(1, self.n_floors + 1)))

    def contact_bits(self, key: int) -> int:
        """Return the contact set as in files, bit k - 1 for contact number k, from a key."""
        if self.contact_numbers == tuple(range(1, len(self.contact_numbers) + 1)):
            return key
        return sum(1 << (k - 1) for i, k in enumerate(self.contact_numbers) if key >> i & 1)

    @cached_property
    def contact_labels(self) -> tuple[str, ...]:
        """Label of every contact number, e.g. 2 or 2L (left); '' where there is no such contact."""
        own = {k: self._label(k) for k in self.contact_numbers}
        return tuple(own.get(k, "") for k in range(1, max(own, default=0) + 1))

    def _label(self, number: int) -> str:
        left = self.matrices is None and number > self.n_floors
        return f"{number - self.n_floors}L" if left else str(number)

    @property
    def contact_names(self) -> dict[int, str]:
        """Name of each of `all_contact_numbers`: as given, e.g. A3-B3, or its label."""
        names = self.names.contacts or tuple(map(self._label, self.all_contact_numbers))
        return dict(zip(self.all_contact_numbers, names, strict=True))
