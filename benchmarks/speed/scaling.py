"""Measure run time against the number of ranks and the number of floors."""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from hpcsweep.model.matrices import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.store import Journal
from speed import cpu_seconds

JOB = """
[sweep]
omega = {{from = 0.3, to = 0.8, count = {n_frames}}}
amplitude = {{from = 0.05, to = 0.3, count = 40}}

[solver]
skip = "none"
"""
"""Job of the scaling over ranks: its frames, which are what ranks share, all cost about the same,
and no rule makes it cheaper for a change of the rules."""
BUSY = 0.25
"""Load a core from other programs, above which the clock does not measure the scaling."""
LIMIT = 600
"""Seconds after which a campaign is given up."""


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def mpirun() -> str | None:
    """Return the launcher: ``$HPCSWEEP_MPIRUN``, else beside this Python, else on the path."""
    own = Path(sys.executable).parent / "mpirun"
    return os.environ.get("HPCSWEEP_MPIRUN") or (
        str(own) if own.exists() else shutil.which("mpirun")
    )


def rank_numbers(largest: int) -> list[int]:
    """Return 1, 2, 4, ... up to a number of ranks, and that number."""
    return sorted({2**k for k in range(largest.bit_length())} | {largest})


def ranks(
    numbers: list[int] | None = None,
    turns: int = 3,
    n_frames: int = 24,
    say: Callable = lambda text: None,
) -> dict:
    """Measure strong scaling: the same small job on more and more ranks of this machine.

    Parameters
    ----------
    numbers : list of int, optional
        Numbers of ranks, the first as the base; default: 1, 2, 4, ... up to all cores.
    turns : int
        Number of turns over all numbers; the least time of each is kept.
    n_frames : int
        Frames of the job, 40 runs each.

    Returns
    -------
    dict
        ``rows``: for each number of ranks ``seconds`` of the campaign without its start, their
        ``speedup`` and ``efficiency`` against the base, and ``command_seconds`` of the whole
        command; ``load``: processes that were already running. Or ``skipped``: why nothing was
        measured; or ``failed``: the message of a campaign.
    """
    launcher = mpirun()
    if launcher is None:
        return {"skipped": "no mpirun found (pip install 'hpcsweep[mpich]', or an MPI)"}
    numbers = numbers or rank_numbers(cores())
    load = os.getloadavg()[0]
    times: dict[int, list[tuple[float, float]]] = {number: [] for number in numbers}
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder) / "scaling.toml"
        job.write_text(JOB.format(n_frames=n_frames))
        for turn in range(turns):
            for number in numbers:
                say(f"{number} ranks, turn {turn + 1} of {turns}")
                output = Path(folder) / f"{number}-{turn}.h5"
                command = [launcher, "-n", str(number), sys.executable, "-m", "hpcsweep"]
                try:
                    times[number].append(_campaign([*command, "run", job, "-o", output], output))
                except subprocess.SubprocessError as error:
                    return {"failed": f"the campaign on {number} ranks failed: {reason(error)}"}
                output.unlink()
    base = min(seconds for seconds, _ in times[numbers[0]])
    rows = []
    for number in numbers:
        seconds = min(seconds for seconds, _ in times[number])
        speedup = base / seconds
        rows.append(
            {
                "ranks": number,
                "seconds": seconds,
                "speedup": speedup,
                "efficiency": speedup * numbers[0] / number,
                "command_seconds": min(whole for _, whole in times[number]),
            }
        )
    return {
        "runs": 40 * n_frames,
        "cores": cores(),
        "load": load,
        "turns": turns,
        "rows": rows,
    }


def _campaign(command: list, output: Path) -> tuple[float, float]:
    """Run a campaign; return its wall time (s) without and with its start."""
    whole = run_command(command)
    end = next(record for record in Journal(output).read()[::-1] if record["kind"] == "end")
    start = next(record for record in Journal(output).read() if record["kind"] == "start")
    return end["rank_seconds"] / start["ranks"], whole


def run_command(command: list, **environment: str) -> float:
    """Run a command and return its wall time (s).

    Raises
    ------
    subprocess.SubprocessError
        If it fails, or takes longer than `LIMIT`.
    """
    open_mpi = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    begun = time.perf_counter()
    subprocess.run(
        list(map(str, command)),
        env={**os.environ, **open_mpi, **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=True,
    )
    return time.perf_counter() - begun


def reason(error: subprocess.SubprocessError) -> str:
    """Return the last line of a failed command's output."""
    said = getattr(error, "stderr", None) or ""
    lines = (said if isinstance(said, str) else said.decode(errors="replace")).strip().splitlines()
    return lines[-1] if lines else str(error)


FLOORS = ((3, 3), (10, 10), (20, 20), (20, 10), (30, 30), (40, 40), (40, 10), (64, 64), (64, 10))
"""Floors, and how many of them are beside stops."""
FIRST = 30
"""Periods from rest."""


def building(n: int, n_stops: int) -> Structure:
    """Return a building of n floors, some of which are beside stops, the top first."""
    whole = Structure(n_floors=n)
    if n_stops == n:
        return whole
    rows = np.unique(np.linspace(n / n_stops - 1, n - 1, n_stops).round().astype(int))
    stops = [Contact(tuple(np.eye(n)[row]), 1.0, whole.stiffness_ratio) for row in rows]
    matrices = whole.mass_matrix, whole.stiffness_matrix
    more = {"damping": whole.damping_matrix, "sharpness": whole.sharpness}
    return Structure.from_matrices(*matrices, stops, **more)


def floors(numbers=FLOORS, repeats: int = 3, n_periods: int = 30) -> list[dict]:
    """Measure `flow` against the number of floors, at each structure's first resonance."""
    found = []
    for n, n_stops in numbers:
        structure = building(n, n_stops)
        omega = float(structure.frequencies[0])
        amplitude = 3.0 * structure.grazing_amplitude(omega)
        FlowMap(structure, omega).advance(np.zeros(2 * n), amplitude, 1)  # loads the kernels
        flow = FlowMap(structure, omega)
        first = 1e6 * cpu_seconds(partial(flow.advance, np.zeros(2 * n), amplitude, FIRST)) / FIRST
        state = flow.advance(np.zeros(2 * n), amplitude, 50).state
        once = partial(flow.advance, state, amplitude, n_periods)
        times = [1e6 * cpu_seconds(once) / n_periods for _ in range(repeats)]
        before = flow.counts.copy()
        flow.advance(state, amplitude, 1)
        steps = flow.counts - before
        tangent = partial(flow.monodromy, state, amplitude, 1)
        found.append(
            {
                "n_floors": n,
                "n_stops": n_stops,
                "linear_steps": int(steps[0]),
                "layer_steps": int(steps[2]),
                "microseconds_per_period": float(np.median(times)),
                "in_the_first": first,
                "tangent_map": 1e6 * min(cpu_seconds(tangent) for _ in range(repeats)),
            }
        )
    return found


def ranks_as_text(result: dict) -> str:
    """Format the scaling over ranks as a table, or why there is none."""
    for kind in ("skipped", "failed"):
        if kind in result:
            return f"ranks: not measured: {result[kind]}"
    lines = [
        f"strong scaling, {result['runs']} runs without skip rules, {result['cores']} cores, least "
        f"of {result['turns']} turns by the clock:",
        "  ranks   campaign s   speed-up   efficiency   whole command s",
    ]
    lines += [
        f"  {row['ranks']:5d}{row['seconds']:13.3g}{row['speedup']:11.3g}{row['efficiency']:13.1%}"
        f"{row['command_seconds']:18.3g}"
        for row in result["rows"]
    ]
    if result["load"] > BUSY * result["cores"]:
        lines.append(
            f"  other programs were running (load {result['load']:.2g} before the start): these "
            "times say little about the scaling"
        )
    return "\n".join(lines)


def floors_as_text(rows: list[dict]) -> str:
    """Format the scaling over floors as a table."""
    lines = [
        "flow against the number of floors (first resonance, 3 x grazing amplitude):",
        f"  floors  stops  linear  layer  us a period  in the first {FIRST}  tangent map, us",
    ]
    lines += [
        "  {n_floors:6d}{n_stops:7d}{linear_steps:8d}{layer_steps:7d}"
        "{microseconds_per_period:13.4g}{in_the_first:17.4g}{tangent_map:17.4g}".format(**row)
        for row in rows
    ]
    return "\n".join(lines)
