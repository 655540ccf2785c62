"""Layout of the campaign file: dimensions, variables, attributes.

HDF5, readable as netCDF-4: named dimension scales, ``units`` and ``long_name``. All datasets are
contiguous and allocated when the file is made, so that a block of consecutive runs is one run of
bytes in each variable, at an offset known beforehand.

``commit`` is what is believed: 0, or the checksum of one block (see `hpcsweep.store.commit`). The
variables, their dimensions, and which runs belong to a block, are the study's
(`hpcsweep.studies.study`); of an amplitude sweep block b of the way up holds amplitudes b B to
(b + 1) B - 1, of the way down as many counted from the top, and rows are always in ascending
amplitude.

Versions
--------
Until release 1.0 a file belongs to the ``layout_version`` it was written with: another version is
refused with one line that names both, and the program that wrote the file. A change that a reader
would misread gets a new number; where the same job comes to mean other results, so does
`MEANING_VERSION` of `hpcsweep.job.fingerprint`.

A file may be packed (`hpcsweep.store.packing`): the same datasets, chunked and compressed, with the
same values, attributes and checksums. It is read like any other and written never again.
"""

import numpy as np

from hpcsweep.job import Job
from hpcsweep.model import description

LAYOUT_VERSION = 2
FORMAT = "hpcsweep campaign"


class StoreError(ValueError):
    """A file that cannot be used; the message is one line for the user."""


class DamagedError(StoreError):
    """A campaign file that has been damaged: cut short, or not what it says it is.

    Parameters
    ----------
    message : str
    repairable : bool
        Whether `run` may repair it; it may not where the checksums are lost.
    """

    def __init__(self, message: str, repairable: bool = True):
        super().__init__(message)
        self.repairable = repairable


class WriteError(RuntimeError):
    """A write that failed on one rank, on a full disk say; the message is one line for the user."""


class Layout:
    """What a job's file holds, and where; made once and handed to all that read or write it.

    Parameters
    ----------
    job : Job

    Attributes
    ----------
    study : Study
    name, text, fingerprint : str
        Of the job.
    variables : list of Variable
        Of the runs, in the order of the file.
    sizes : dict of str to int
        Size of every dimension.
    coordinates : dict of str to Coordinate
    given : list of (Variable, ndarray)
        Variables that are known beforehand.
    commit : Variable
    """

    def __init__(self, job: Job):
        self.job = job
        self.study = job.study
        self.name, self.text, self.fingerprint = job.name, job.text, job.fingerprint
        self.variables = job.study.variables
        self.sizes = job.study.dimensions
        self.coordinates = job.study.coordinates
        self.given = job.study.given
        self.commit = job.study.commit

    @property
    def datasets(self) -> list:
        """All variables but the coordinates, in the order of the file."""
        return [*(variable for variable, _ in self.given), *self.variables, self.commit]

    def shape(self, variable) -> tuple[int, ...]:
        """Return the shape of a variable."""
        return tuple(self.sizes[dim] for dim in variable.dims)

    def bytes_of(self, variable) -> int:
        """Return the bytes of a variable."""
        return int(np.prod(self.shape(variable), dtype=object)) * np.dtype(variable.dtype).itemsize

    @property
    def attributes(self) -> dict[str, object]:
        """Attributes by which a reader knows the job."""
        settings, structure = self.study.settings, self.study.structure
        told = {"structure": description.as_text(structure)} if structure.foreign else {}
        return {
            "format": FORMAT,
            "layout_version": LAYOUT_VERSION,
            "fingerprint": self.fingerprint,
            "name": self.name,
            "job": self.text,
            "solver": settings.solver,
            "rtol": settings.rtol,
            **told,
        }

    def file_size(self) -> int:
        """Return the bytes of the file, without its few kilobytes of metadata."""
        return sum(map(self.bytes_of, [*self.variables, self.commit]))
