"""Split a job into parts that together have all its frames, and find the whole of a part."""

import re
from pathlib import Path
from typing import NamedTuple

from hpcsweep.job.job import Job, JobError
from hpcsweep.job.keys import every_key
from hpcsweep.job.reading import parse_job
from hpcsweep.job.tree import parse_toml, write

MAX_PARTS = 10_000
LINE = re.compile(r"^part = \[\d+, \d+\]\n", re.MULTILINE)
"""As `split` and `write` have it."""


def split(job: Job, n_parts: int, path: Path) -> dict[Path, str]:
    """Return the jobs of all parts by file name, in the folder of the whole.

    Raises
    ------
    JobError
        If the job cannot be cut in so many parts.
    """
    if not 2 <= n_parts <= MAX_PARTS:
        raise JobError(f"-n {n_parts}: must be from 2 to {MAX_PARTS}")
    if LINE.search(job.text):
        raise JobError(f"{path}: is a part already")
    named = (path.with_name(f"{path.stem}-{k + 1}of{n_parts}.toml") for k in range(n_parts))
    texts = {name: f"part = [{k}, {n_parts}]\n{job.text}" for k, name in enumerate(named, 1)}
    try:
        parse_job(next(iter(texts.values())), str(path), path.stem, path.parent)
    except JobError as error:
        if error.key == "part":
            error.key, error.value = f"-n {n_parts}", ""
            error.limit = f": {error.limit}"
        raise
    return texts


class Whole(NamedTuple):
    """The whole job of a part, with the number of the part and of all parts."""

    job: Job
    k: int
    n: int


def whole_of(text: str, source: str, name: str) -> Whole:
    """Return the whole job of a part, by its text; `source` is named in errors.

    Raises
    ------
    JobError
        If the text is not that of a part.
    """
    tree = parse_toml(text, source)
    if "part" not in tree:
        raise JobError(f"{source}: is of a whole job, of no part as hpcsweep split makes them")
    k, n = tree.pop("part")
    whole = LINE.sub("", text, count=1)
    if "part" in parse_toml(whole, source):
        whole = write(tree, every_key())
    return Whole(parse_job(whole, source, name.removesuffix(f"-{k}of{n}")), k, n)
