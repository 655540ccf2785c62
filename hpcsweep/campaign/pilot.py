"""What rank 0 knows of the frames' costs: from the journal, a pilot, the blocks done."""

from pathlib import Path

from hpcsweep.campaign import costs
from hpcsweep.campaign.costs import FrameCosts
from hpcsweep.job import Job
from hpcsweep.parallel import farm
from hpcsweep.store import Journal

BLOCK_COST = ("frame", "direction", "block", "runs", "seconds")
PILOT_COST = ("frame", "amplitude", "runs", "seconds")
"""Keys of the journal's records of costs."""


class KnownCosts:
    """Costs of the unfinished frames; made on every rank, held on rank 0.

    Nothing is kept on one rank or for one frame: there is nothing to decide.

    Parameters
    ----------
    comm : hpcsweep.parallel.mpi.Serial or hpcsweep.parallel.mpi.Ranks
    job : Job
    output : Path
        Whose journal is read.
    todo : list of int
        Unfinished frames.
    done_blocks : list of (frame, direction, block, runs)
        What is done of them.
    sweep_block : callable or None
        What computes in place of `amplitude_sweep.sweep_block`; there is no pilot then.
    """

    def __init__(self, comm, job: Job, output: Path, todo, done_blocks, sweep_block):
        self._comm, self._job = comm, job
        self._wanted = comm.bcast(comm.size > 1 and len(todo) > 1)
        self._pilot = self._wanted and sweep_block is None
        if comm.rank != 0 or not self._wanted:
            return
        self.frames = FrameCosts(job)
        for record in Journal(output).read():
            if record["kind"] == "block":
                self.frames.measured(*(record[key] for key in BLOCK_COST))
            elif record["kind"] == "pilot":
                self.frames.sampled(*(record[key] for key in PILOT_COST))
        for block in done_blocks:
            self.frames.done(*block)

    def sample(self, journal: Journal, flag: farm.StopFlag) -> bool:
        """Time a pilot on all ranks, if it is needed; tell whether to go on (collective)."""
        count = 0
        if self._comm.rank == 0 and self._pilot:
            count = costs.n_samples(self._job)
            if self.frames.n_known() >= count * costs.PILOT_TIMED:
                count = 0
        count = self._comm.bcast(count)

        def compute(index, poll, report) -> None:
            place = costs.sample_place(self._job, index)
            runs, seconds = costs.time_sample(self._job, *place, poll)
            report((*place, runs, round(seconds, 6)))

        def on_report(_rank, value) -> None:
            self.frames.sampled(*value)
            journal.note("pilot", **dict(zip(PILOT_COST, value, strict=True)))

        return count == 0 or farm.run(self._comm, range(count), compute, flag, on_report)

    def block_done(self, frame, direction, block, runs, seconds) -> None:
        """Learn from a block."""
        if self._wanted:
            self.frames.measured(frame, direction, block, runs, seconds)
            self.frames.done(frame, direction, block, runs)

    def left(self, frame: int) -> float:
        """Estimate the cost (s) of what is left of a frame; 0 where it does not matter."""
        return self.frames.left(frame) if self._wanted else 0.0
