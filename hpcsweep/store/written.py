"""Layout of a file of an earlier version: what is in it is as the file itself says.

Names, types, units, coordinates and the meaning of codes are read, and so are the order of the
results under a checksum and the fingerprint that seeds it. The job gives the blocks and the sizes
of a run's dimensions, and this version what it knows of a variable besides: limits and labels.
"""

from copy import copy
from dataclasses import replace

import h5py
import numpy as np

from hpcsweep.job import Job
from hpcsweep.store.contents import CHECKSUM, NOTES, notes_of, scales_of
from hpcsweep.store.layout import Layout
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.variable import Coordinate, Variable


class WrittenLayout(Layout):
    """See `Layout`.

    Parameters
    ----------
    job : Job
        As this version reads it.
    file : h5py.File
    """

    is_own = False

    def __init__(self, job: Job, file: h5py.File):
        super().__init__(job)
        self._attributes = {key: value for key, value in file.attrs.items() if key != CHECKSUM}
        self.fingerprint = str(self._attributes["fingerprint"])
        known = {variable.name: variable for variable in self.datasets}
        self._notes, data = {name: notes_of(each) for name, each in file.items()}, dict(file)
        scales = {name for name, each in data.items() if each.is_scale}

        def held(name: str) -> Variable:
            said = {note: str(self._notes[name][note]) for note in NOTES[:2]}
            said["dtype"] = data[name].dtype.str
            dims = tuple((axis or [name])[0] for axis in scales_of(data[name]))
            usual = known.get(name) or Variable(name, (), "", "", "")
            return replace(usual, dims=dims, **said)

        def listed(key: str) -> list[Variable]:
            return [held(name) for name in str(self._attributes.get(key, "")).split()]

        self.variables, self.derived = listed("variables"), listed("derived")
        self.coordinates = {}
        for name in scales:
            values = data[name].asstr() if data[name].dtype == object else data[name]
            scale = held(name)
            self.coordinates[name] = Coordinate(values[...], scale.units, scale.long_name)
        self.sizes = {name: data[name].shape[0] for name in scales} | {
            dim: job.study.dimensions[dim] for dim in (*job.study.run_dims, "block")
        }
        others = {*file} - scales - {v.name for v in (*self.stored, *self.structures)}
        self.given = [(held(name), data[name][...]) for name in sorted(others)]

    @property
    def attributes(self) -> dict[str, object]:
        """Attributes of the file."""
        return self._attributes

    def notes(self, variable: Variable) -> dict[str, object]:
        """Return the attributes of a variable."""
        return self._notes[variable.name]

    def of(self, job: Job, place: Place) -> "Layout":
        """Return the layout of a part of the job, without the axes of the varied keys."""
        axes = [axis.name for axis in self.study.axes]

        def inner(variable: Variable) -> Variable:
            return replace(variable, dims=tuple(dim for dim in variable.dims if dim not in axes))

        part = copy(self)
        part.job, part.study, part.growth = job, job.study, job.growth
        part.commit, part.structures = job.study.commit, []
        part.variables, part.derived = [*map(inner, self.variables)], [*map(inner, self.derived)]
        part.coordinates = {name: c for name, c in self.coordinates.items() if name not in axes}
        at = dict(zip(axes, place, strict=True))
        part.given = [
            (inner(v), np.asarray(values[tuple(at.get(dim, slice(None)) for dim in v.dims)]))
            for v, values in self.given
            if {*v.dims} - {*axes}
        ]
        return part
