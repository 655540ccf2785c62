"""Inferred values of a refined map, and when they are valid.

The variables are those of `hpcsweep.studies.refine.growth`. They follow from the committed runs,
and are written when no run is left to do: all of them first, then, after they have reached the
disk, ``inferred``: a checksum for each frame, of the job's fingerprint, the frame's place, all its
bytes and the audit. A map is complete where all frames have one; then what has no checksum of its
own in ``commit`` is inferred. A kill before that leaves nothing that would be believed.
"""

import numpy as np

from hpcsweep.store.commit import Blocks, Campaign
from hpcsweep.store.layout import Layout
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.refine.audit import AUDIT, INFERRED, MAX_LOOKS, SOURCE, Look, last_look
from hpcsweep.studies.refinement import Source
from hpcsweep.studies.variable import Variable


class Inferred:
    """Reads the derived variables of a refined map, believing frames whose checksum holds.

    Parameters
    ----------
    blocks : Blocks
        Of its file.
    """

    def __init__(self, blocks: Blocks):
        self._blocks = blocks
        layout = blocks.layout
        self.variables = frame_variables(layout)
        self._n = layout.sizes[layout.study.run_dims[-1]]
        self._shape = tuple(layout.sizes[dim] for dim in layout.commit.dims[:-1])
        self.shapes = {v.name: layout.shape(v)[len(self._shape) :] for v in self.variables}
        self.places: list[Place] = list(np.ndindex(*self._shape))

    def audit(self) -> np.ndarray:
        """Read the looks of the audit, right or not."""
        return self._blocks.read_rows(AUDIT, (0,), MAX_LOOKS)

    def checksum(self, place: Place, rows: dict[str, np.ndarray], audit: np.ndarray) -> int:
        """Compute the checksum of a frame; never 0."""
        held = (np.asarray(rows[v.name], v.dtype) for v in self.variables)
        return self._blocks.checksum_of(place, *held, np.asarray(audit, "<f8"))

    def frame(self, place: Place, audit: np.ndarray | None = None) -> dict[str, np.ndarray] | None:
        """Read a frame, arrays without its axes; None if its checksum does not hold."""
        stored = int(self._blocks.read_rows(INFERRED, place, 1)[0])
        if not stored:
            return None
        read = self._blocks.read_rows
        rows = {name: read(name, (*place, 0), shape[0]) for name, shape in self.shapes.items()}
        audit = self.audit() if audit is None else audit
        return rows if stored == self.checksum(place, rows, audit) else None

    def labels(self, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Read the labels of the committed points of a frame.

        Returns
        -------
        points : ndarray of int, shape (k,)
            Flat indices among all points, ascending, of those whose own checksum holds.
        labels : ndarray of uint64, shape (k, m)
            See `hpcsweep.studies.refinement.Refinement.labels`.
        """
        blocks = self._blocks
        growth = blocks.layout.growth
        assert growth is not None
        first = int(np.ravel_multi_index((*place, 0), (*self._shape, self._n)))
        points, labels = [], []
        for at in np.flatnonzero(blocks.read_rows("commit", (*place, 0), self._n)).tolist():
            rows = blocks.believed(blocks.study.block((*place, at)))
            if rows is not None:
                points.append(first + at)
                labels.append(growth.refinement.labels(rows))
        labelled = np.concatenate(labels) if labels else np.zeros((0, 2), np.uint64)
        return np.array(points, int), labelled

    def agrees(self, place: Place, points: np.ndarray, audit: np.ndarray) -> bool:
        """Return whether a frame is complete, with these points of all as the computed ones."""
        rows = self.frame(place, audit)
        if rows is None:
            return False
        computed = np.flatnonzero(np.isin(rows[SOURCE], (Source.COMPUTED, Source.AUDIT)))
        return np.array_equal(computed, points % self._n)

    def unknown(self) -> list[Place]:
        """Return the frames without inferred values; none if the map is complete."""
        audit = self.audit()
        return [place for place in self.places if self.frame(place, audit) is None]

    def mask(self) -> np.ndarray | None:
        """Return which points are inferred, shape of the runs; None if the map is not complete."""
        audit = self.audit()
        frames = [self.frame(place, audit) for place in self.places]
        if any(rows is None for rows in frames):
            return None
        inferred = [rows[SOURCE] == Source.INFERRED for rows in frames if rows is not None]
        return np.array(inferred).reshape(*self._shape, self._n)

    def summary(self, mask: np.ndarray | None) -> dict:
        """Return the number of inferred points, those of `mask`, and the last look."""
        look = self.look()
        return {
            "runs_inferred": 0 if mask is None else int(mask.sum()),
            "audit": None if look is None else look._asdict(),
        }

    def look(self) -> Look | None:
        """Return the look of the audit that counts; None if the map is not complete."""
        audit = self.audit()
        return None if self.frame(self.places[-1], audit) is None else last_look(audit)


def is_complete(blocks: Blocks) -> bool:
    """Return whether a file holds all of its job: every block, or what is inferred from them."""
    if blocks.layout.derived:
        return not Inferred(blocks).unknown()
    return bool(blocks.have_checksum().all())


def frame_variables(layout: Layout) -> list[Variable]:
    """Return the derived variables that have values for each frame."""
    return [v for v in layout.derived if v.name not in (AUDIT, INFERRED)]


def write_inferred(campaign: Campaign, values: dict[str, np.ndarray]) -> None:
    """Write the derived variables of a map, and when they are on disk their checksums, by one rank.

    Parameters
    ----------
    campaign : Campaign
        All of whose runs are committed.
    values : dict of str to ndarray
        Of `hpcsweep.studies.refine.growth.MapGrowth.values`.
    """
    inferred = Inferred(campaign.blocks)
    frames = {
        v.name: values[v.name].astype(v.dtype).reshape(-1, *inferred.shapes[v.name])
        for v in inferred.variables
    }
    sums = []
    for k, place in enumerate(inferred.places):
        rows = {name: array[k] for name, array in frames.items()}
        sums.append((place, inferred.checksum(place, rows, values[AUDIT])))
        for name, row in rows.items():
            campaign.transport.write(name, (*place, 0), row)
    campaign.transport.write(AUDIT, (0,), values[AUDIT])
    campaign.flush()
    campaign.transport.sync()
    for place, checksum in sums:
        campaign.transport.write(INFERRED, place, np.array([checksum], "<u8"))
    campaign.transport.sync()
