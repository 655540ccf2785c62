"""The measure of what plain periods would take: `bash benchmarks/run.sh least_time JOB.toml`."""

from dataclasses import replace

import least_time
import numpy as np
import pytest
from tools import JOBS

from hpcsweep.job import load_job
from hpcsweep.solvers.flow import FlowMap


@pytest.fixture(scope="module")
def study():
    whole = load_job(JOBS / "paper/bluecrystal.toml").study
    return replace(whole, amplitude=whole.amplitude[600::40])


def test_every_period_is_repeated_once(study, monkeypatch):
    repeated = []
    original = least_time.parts

    def kept(*call):
        found = original(*call)
        repeated.extend(found)
        return found

    monkeypatch.setattr(least_time, "parts", kept)
    solver, seconds = least_time.run_frame(study, 0.7063)
    assert sum(n for _, _, n in repeated) == sum(solver.periods.values()) > 1000
    assert {"follow_orbits", "observe", "grow"} <= set(solver.plain) <= set(solver.seconds)
    assert 0.0 < sum(solver.seconds.values()) <= seconds
    assert sum(solver.plain.values()) > 0.0


@pytest.mark.parametrize(
    ("name", "end"),
    [
        ("observe", lambda result: result.points[-1]),
        ("grow", lambda result: result.points[-1]),
        ("monodromy", lambda result: result[0]),
        ("points", lambda result: result[0][-1]),
    ],
)
def test_periods_are_repeated_from_where_a_call_began(study, name, end):
    solver, z = FlowMap(study.structure, 0.7063), np.full(6, 0.01)
    call = (z, 0.3, 7)
    result = getattr(solver, name)(*call)
    (part,) = least_time.parts(name, result, call)
    assert np.array_equal(solver.advance(*part).state, end(result))


def test_the_table_adds_up(study):
    small = replace(study, omega=np.array([0.5, 0.6]), amplitude=study.amplitude[::3])
    lines = least_time.measure(small, slice(None)).splitlines()
    *calls, total = (cells(line) for line in lines[2:-1])
    assert sum(seconds for _, seconds, _ in calls) == pytest.approx(total[1], abs=0.05)
    assert sum(plain for _, _, plain in calls) == pytest.approx(total[2], abs=0.05)
    assert lines[-1].startswith("plain periods alone: ")


def cells(line: str) -> list[float]:
    """Return the numbers of a row; 0 where there is none."""
    return [float(cell.strip().replace(",", "") or 0) for cell in line.split("|")[2:5]]
