"""Read and validate job files."""

from hpcsweep.job.job import Job, JobError
from hpcsweep.job.reading import load_job, parse_job, part_of

__all__ = ["Job", "JobError", "load_job", "parse_job", "part_of"]
