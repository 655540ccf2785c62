"""Count over the rows of a study of basins, for its summary."""

from collections import Counter

from hpcsweep.studies.attractors.tally import Found, SearchTally, attractors_in
from hpcsweep.studies.tally import share


class BasinTally(SearchTally):
    """Tally of rows of starts: all list the same attractors, whose shares are of all starts."""

    def __init__(self, study):
        super().__init__(study)
        self.attractors: dict[str, Found] = {}
        self.hits: Counter[str] = Counter()

    def add(self, frame, study) -> None:
        """Count a row, an xarray.Dataset, of a study or of a part of it."""
        self.add_starts(frame, study, study.horizontal.size)
        part = frame.attrs["part"]
        for number, hits, kind in zip(*attractors_in(frame), strict=True):
            name = f"{part}, {number}" if part else str(number)
            self.attractors[name] = kind
            self.hits[name] += hits

    def told(self) -> dict:
        """Return the counts: numbers, strings, lists and dicts."""
        basins = {
            name: {"name": kind.named(self._labels), **share(self.hits[name], self.starts)}
            for name, kind in self.attractors.items()
        }
        return self.told_of(Counter(), Counter(self.attractors.values())) | {"basins": basins}
