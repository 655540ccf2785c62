"""Layout of the campaign file: dimensions, variables, attributes.

HDF5, readable as netCDF-4: named dimension scales, ``units`` and ``long_name``. All datasets are
contiguous and allocated when the file is made, so that a block of consecutive amplitudes of one
frame and direction is one run of bytes in each variable, at an offset known beforehand.

``commit(direction, frame, block)`` is what is believed: 0, or the checksum of one block (see
`hpcsweep.store.commit`). Block b of the up sweep holds amplitudes b B to (b + 1) B - 1, of the
down sweep it holds as many counted from the top; rows are always in ascending amplitude.

Versions
--------
``layout_version`` is 1. What a version-1 file means is fixed: every later program opens, lists,
validates and draws it (``tests/data/layout1.h5`` is kept for that), even if it writes another
layout. A change that a reader of today would misread gets a new number, and a reader for each old
number stays. Two things outside this module are part of version 1, because every file holds them:
the job's text, which must go on being accepted by `hpcsweep.job`, and its fingerprint, which is the seed
of all checksums; where `job.MEANING_VERSION` is raised, the formula of the old number stays for
old files. Files of a newer version are refused with both numbers.

A file may be packed (`hpcsweep.store.packing`): the same datasets, chunked and compressed, with the
same values, attributes and checksums. It is read like any other and written never again.
"""

from dataclasses import dataclass

import numpy as np

from hpcsweep.job import Job

LAYOUT_VERSION = 1
FORMAT = "hpcsweep campaign"
SPEED = "gaps omega_0"


class StoreError(ValueError):
    """A file that cannot be used; the message is one line for the user."""


class DamagedError(StoreError):
    """A campaign file that has been damaged: cut short, or not what it says it is."""


class WriteError(RuntimeError):
    """A write that failed on one rank, on a full disk say; the message is one line for the user."""


@dataclass(frozen=True)
class Variable:
    """One variable of a run, or one coordinate.

    Attributes
    ----------
    name : str
    dims : tuple of str
    dtype : str
    units, long_name : str
    """

    name: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str


RUN = ("direction", "frame", "amplitude")

RUN_VARIABLES = (
    Variable("poincare", (*RUN, "point", "state"), "<f8", "gaps; " + SPEED, "stroboscopic points"),
    Variable("n_points", RUN, "<i4", "1", "number of stroboscopic points stored"),
    Variable("orbit_period", RUN, "<i4", "forcing periods", "orbit period, 0 if none was found"),
    Variable("contact", RUN, "<u8", "1", "contact set, bit i - 1 for floor i"),
    Variable("drift", RUN, "<f8", "A / Omega^2", "normalised peak interstorey drift"),
    Variable("modal_norm", (*RUN, "mode"), "<f8", "1", "mean modal norm free of contact"),
    Variable("lyapunov", RUN, "<f8", "omega_0", "largest Lyapunov exponent"),
    Variable(
        "final_state", (*RUN, "state"), "<f8", "gaps; " + SPEED, "state after the last period"
    ),
    Variable("cycles", RUN, "<i4", "forcing periods", "forcing periods integrated"),
    Variable(
        "outcome",
        RUN,
        "<i1",
        "1",
        "outcome: 1 complete, 2 non-finite, 3 step limit, 4 solver failed",
    ),
    Variable(
        "shortcut", RUN, "<i1", "1", "rule that spared periods: 1 linear, 2 converged, 3 newton"
    ),
)
ALWAYS = ("orbit_period", "final_state", "cycles", "outcome", "shortcut")
OMEGA = Variable("omega", ("frame",), "<f8", "omega_0", "forcing frequency Omega")
COMMIT = Variable("commit", ("direction", "frame", "block"), "<u8", "1", "checksum of a block")


def run_variables(job: Job) -> list[Variable]:
    """List the variables a job's file holds for each run, in the file's order."""
    wanted = set(ALWAYS) | set(job.settings.metrics)
    if "poincare" in wanted:
        wanted.add("n_points")
    return [variable for variable in RUN_VARIABLES if variable.name in wanted]


def n_blocks(n_amplitudes: int, block: int) -> int:
    """Count the blocks of one sweep."""
    return -(-n_amplitudes // block)


def dimensions(job: Job) -> dict[str, int]:
    """Give the size of every dimension of a job's file."""
    n = job.structure.n_floors
    return {
        "direction": len(job.directions),
        "frame": job.omega.size,
        "amplitude": job.amplitude.size,
        "point": job.settings.stored_points,
        "state": 2 * n,
        "mode": n,
        "block": n_blocks(job.amplitude.size, job.block),
    }


def coordinates(job: Job) -> dict[str, tuple[np.ndarray, str, str]]:
    """Give values, units and long name of every dimension's coordinate."""
    n = job.structure.n_floors
    size = dimensions(job)
    states = [f"{letter}_{i}" for letter in "uv" for i in range(1, n + 1)]
    return {
        "direction": (np.array(job.directions, object), "1", "direction of the amplitude sweep"),
        "frame": (np.arange(size["frame"], dtype="<i4"), "1", "frame"),
        "amplitude": (job.amplitude.astype("<f8"), "gaps omega_0^2", "forcing amplitude A"),
        "point": (np.arange(size["point"], dtype="<i4"), "1", "stroboscopic point"),
        "state": (np.array(states, object), "1", "state component"),
        "mode": (np.arange(1, n + 1, dtype="<i4"), "1", "mode of the free structure"),
        "block": (np.arange(size["block"], dtype="<i4"), "1", "block of amplitudes"),
    }


def block_rows(direction: int, block: int, n_amplitudes: int, size: int) -> tuple[int, int]:
    """Return the first and the last-plus-one amplitude index of a block."""
    if direction == 0:
        return block * size, min((block + 1) * size, n_amplitudes)
    return max(n_amplitudes - (block + 1) * size, 0), n_amplitudes - block * size
