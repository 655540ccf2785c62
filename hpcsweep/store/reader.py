"""Open the results for people: an xarray.Dataset, and the state of a campaign."""

from pathlib import Path

import numpy as np

from hpcsweep.job import Job, JobError, parse_job
from hpcsweep.solvers.outcome import Outcome, Shortcut
from hpcsweep.store.commit import Blocks, check_file, path_blocks
from hpcsweep.store.journal import Journal
from hpcsweep.store.layout import DamagedError
from hpcsweep.store.offsets import open_for_reading

MISSING = {"n_points": 0, "orbit_period": 0, "contact": 0, "cycles": 0, "outcome": 0, "shortcut": 0}
"""What stands where nothing is committed; NaN in the other variables."""


OUTCOMES = {int(outcome): outcome.name for outcome in Outcome}


def job_of(path: str | Path) -> Job:
    """Give the job a campaign file was made for.

    Raises
    ------
    StoreError
        If the file is not a campaign file. A `DamagedError` if its job is not the one it says.
    """
    path = Path(path)
    attributes = check_file(path)
    try:
        job = parse_job(attributes["job"], f"{path} (job)", attributes["name"])
    except (KeyError, JobError) as error:
        raise DamagedError(f"{path}: its job cannot be read: {error}") from None
    if job.fingerprint != attributes.get("fingerprint"):
        raise DamagedError(f"{path}: its job and its fingerprint do not agree")
    return job


def open_results(path: str | Path):
    """Read a campaign file, believing only what is committed and whose checksum holds.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    xarray.Dataset
        Variables and dimensions as in the file. Runs without valid commit have outcome 0
        (``Outcome.NOT_COMPUTED``), zero counts and NaN elsewhere. The attributes are those of the
        file.

    Raises
    ------
    StoreError
        If the file is not a campaign file.
    """
    import xarray

    path = Path(path)
    job = job_of(path)
    arrays, attributes = {}, {}
    with open_for_reading(path) as file:
        for name, data in file.items():
            try:
                values = data[...]
            except OSError:
                raise DamagedError(f"{path}: variable {name} cannot be unpacked") from None
            if values.dtype == object:
                values = np.array(data.asstr()[...], dtype=str)
            dims = (
                tuple(dim[0].name.lstrip("/") for dim in data.dims)
                if not data.is_scale
                else (name,)
            )
            notes = {key: data.attrs[key] for key in ("units", "long_name")}
            arrays[name] = (dims, values, notes)
        attributes = dict(file.attrs)
    mask = _valid_runs(path, job)
    for name, (dims, values, _notes) in arrays.items():
        if dims[:3] == ("direction", "frame", "amplitude"):
            values[~mask] = MISSING.get(name, np.nan)
    return xarray.Dataset(arrays, attrs=attributes)


def _valid_runs(path: Path, job: Job) -> np.ndarray:
    """Tell for each (direction, frame, amplitude) whether it belongs to a valid block."""
    mask = np.zeros((len(job.directions), job.omega.size, job.amplitude.size), bool)
    blocks = Blocks(path, job)
    try:
        for frame in range(job.omega.size):
            for (direction, block), good in blocks.valid(frame).items():
                if good:
                    low, high = blocks.rows(direction, block)
                    mask[direction, frame, low:high] = True
    finally:
        blocks.close()
    return mask


def status(path: str | Path) -> dict:
    """Describe a campaign file, live or not, without disturbing its writers.

    Returns
    -------
    dict
        Plain numbers, strings and lists: what is done, outcomes, sessions, failures.
    """
    path = Path(path)
    job = job_of(path)
    attributes = check_file(path)
    with open_for_reading(path) as file:
        commit = file["commit"][...]
        outcome = file["outcome"][...]
        cycles = file["cycles"][...]
        period = file["orbit_period"][...]
        shortcut = file["shortcut"][...]
    done = np.zeros(outcome.shape, bool)
    blocks = Blocks(path, job)
    for direction, block in path_blocks(job):
        low, high = blocks.rows(direction, block)
        done[direction, :, low:high] = (commit[direction, :, block] != 0)[:, None]
    blocks.close()
    failed = np.argwhere(done & (outcome != Outcome.COMPLETE))
    records = Journal(path).read()
    costs = [r for r in records if r["kind"] == "block"]
    seconds = sum(r["seconds"] for r in costs)
    runs_timed = sum(r["runs"] for r in costs)
    n_done = int(done.sum())
    plain = job.settings.transient_cycles + job.settings.sampling_cycles
    return {
        "file": str(path),
        "name": job.name,
        "solver": job.settings.solver,
        "version": str(attributes.get("hpcsweep_version", "")),
        "runs_done": n_done,
        "runs_total": job.n_runs,
        "frames_done": int(done.all(axis=(0, 2)).sum()),
        "frames_total": int(job.omega.size),
        "complete": n_done == job.n_runs,
        "core_seconds": seconds,
        "runs_per_core_second": runs_timed / seconds if seconds else None,
        "core_seconds_remaining": (
            (job.n_runs - n_done) * seconds / runs_timed if runs_timed else None
        ),
        "periods_per_run": float(cycles[done].mean()) if n_done else None,
        "periods_per_run_plain": plain,
        "runs_spared": {
            rule.name.lower(): int((done & (shortcut == rule)).sum())
            for rule in Shortcut
            if rule is not Shortcut.NONE
        },
        "no_period_found": int((done & (period == 0) & (outcome == Outcome.COMPLETE)).sum()),
        "n_failed": len(failed),
        "failures": [
            {
                "direction": job.directions[d],
                "omega": float(job.omega[f]),
                "amplitude": float(job.amplitude[a]),
                "outcome": OUTCOMES.get(int(outcome[d, f, a]), "damaged; see validate"),
            }
            for d, f, a in failed[:20]
        ],
        "sessions": _sessions(records),
    }


def _sessions(records: list[dict]) -> list[dict]:
    """Pair every start with the end that follows it; a killed session has none."""
    sessions = []
    for record in records:
        if record["kind"] == "start":
            sessions.append(
                {
                    "started": record["time"],
                    "ranks": record["ranks"],
                    "hosts": record["hosts"],
                    "transport": record.get("transport"),
                    "ended": None,
                    "written_bytes": None,
                    "write_bytes_per_second": None,
                    "write_share": None,
                }
            )
        elif record["kind"] == "end" and sessions:
            last = sessions[-1]
            last["ended"] = record["reason"]
            written, seconds = record.get("written_bytes"), record.get("write_seconds")
            if written:
                last["written_bytes"] = written
                last["write_bytes_per_second"] = written / seconds if seconds else None
                last["write_share"] = seconds / record["rank_seconds"]
    return sessions
