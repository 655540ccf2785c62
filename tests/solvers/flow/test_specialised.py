"""Kernels specialised to a structure: when they are made, and that they change no result."""

from dataclasses import astuple

import numba
import numpy as np
import pytest
from tools import JOBS, PAPER, assert_same_datasets, hpcsweep, kernels_but, run_script

from hpcsweep.job import load_job
from hpcsweep.kernels.compile.places import Pattern
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap, specialised
from hpcsweep.studies import compilation
from hpcsweep.studies.compilation import worth_specialising
from hpcsweep.studies.sweep.runs import FrameRuns

if numba.config.DISABLE_JIT:
    pytest.skip("nothing is compiled", allow_module_level=True)


def everything(study, omega, amplitudes) -> list:
    """What the solver gives at one frequency, and a path with all decided."""
    structure = study.structure
    solver = FlowMap(structure, omega)
    found = []
    for amplitude in amplitudes:
        z = solver.advance(np.zeros(2 * structure.n_floors), amplitude, 30).state
        seen = solver.observe(z, amplitude, 30, modal_norm=True, growth=True)
        found += [z, *astuple(seen), *astuple(solver.grow(z, amplitude, 10))]
        found += astuple(solver.settle(z, amplitude, 60, 16, 1e-10, 1e-6, 1e-3))
        found += solver.monodromy(z, amplitude, 2)
    runs = FrameRuns(structure, omega, study.settings, solver)
    found += runs.follow(amplitudes, np.zeros(2 * structure.n_floors)).values()
    return [*found, solver.counts.copy(), solver.is_specialised]


@pytest.fixture
def nothing_fitted(monkeypatch):
    """Let solvers be made as if the cache had no specialised kernels, and could take none."""
    monkeypatch.setattr(specialised, "_kept_keys", frozenset)
    monkeypatch.setattr(specialised, "_loaded", set())
    specialised._kernels_for.cache_clear()
    yield
    specialised._kernels_for.cache_clear()


@pytest.mark.slow
def test_fitted_kernels_give_the_same_to_the_last_bit(nothing_fitted):
    """In one process with the others, with rows of relative displacements."""
    study = load_job(JOBS / "structures/pounding.toml").study
    *plain, was_fitted = everything(study, 0.3, (0.02, 0.05, 0.1))
    assert not was_fitted
    study.warm_up(n_ranks=0)
    *again, is_specialised = everything(study, 0.3, (0.02, 0.05, 0.1))
    assert is_specialised
    for one, other in zip(plain, again, strict=True):
        np.testing.assert_array_equal(one, other)
    solver = FlowMap(study.structure, 0.3)
    z = solver.advance(np.zeros(2 * study.structure.n_floors), 0.1, 30).state
    right = solver.points(z, 0.1, 30)[0]
    words = np.array(Pattern(solver._shared).words)
    solver._packed[: words.nbytes].view(np.int64)[words > 0] = 0
    # sizes and places of arrays are in the kernels: nobody reads them
    np.testing.assert_array_equal(solver.points(z, 0.1, 30)[0], right)


def test_a_structure_of_other_sizes_has_other_kernels():
    one, same, other = (
        specialised.needed_kernels(Structure(n, stiffness), specialised=True)
        for n, stiffness in ((2, 9.0), (2, 5.0), (3, 9.0))
    )
    assert one == same
    assert not {kernel for kernel in one if kernel.specialisation} & set(other)
    assert {kernel.name for kernel in one if kernel.specialisation is None} == {
        "hpcsweep.solvers.free.is_free",
        "hpcsweep.solvers.flow.step.step.lookup",
    }


def test_kernels_are_fitted_where_the_histories_of_a_rank_earn_it():
    study = load_job(PAPER / "bluecrystal.toml").study
    assert not worth_specialising(study, None)
    assert worth_specialising(study, 10)
    assert not worth_specialising(study, 11)
    assert not worth_specialising(load_job(PAPER / "figure6.toml").study, 1)
    searched = load_job(JOBS / "attractors/attractors-map.toml").study
    n_ranks = searched.n_runs * searched.starts // compilation.SPECIALISED_FROM
    assert n_ranks > 1
    assert worth_specialising(searched, n_ranks)
    assert not worth_specialising(searched, n_ranks + 1)


def test_only_one_solver_has_kernels_to_fit(tmp_path):
    text = (PAPER / "bluecrystal.toml").read_text().replace("figure2", str(PAPER / "figure2"))
    (tmp_path / "job.toml").write_text(f'{text}\n[solver]\nmethod = "bdf"\n')
    assert not worth_specialising(load_job(tmp_path / "job.toml").study, 1)


def test_warmup_refuses_what_is_no_job(tmp_path):
    job = tmp_path / "none.toml"
    done = hpcsweep(0, "warmup", JOBS / "ci.toml", job)
    assert done.returncode == 2
    assert str(job) in done.stderr
    assert done.stderr.count("\n") == 1


BUILDING = """
[structure]
[sweep]
omega = [0.2023, 0.445]
amplitude = {from = 0.01, to = 0.28, count = 10}
transient_cycles = 30
sampling_cycles = 20
[output]
block = 4
"""
"""Of the paper: slow impacts, grazing, chaos, two contacts at once."""
FITTING = """
import sys
from pathlib import Path
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.progress import say_line
from hpcsweep.job import load_job
from hpcsweep.parallel import mpi
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies import compilation

compilation.SPECIALISED_FROM = float(sys.argv[1])
job, out = load_job(sys.argv[2]), Path(sys.argv[3])
code = campaign.run(job, out, mpi.world(), say=say_line)
if code == 0 and mpi.world().rank == 0:
    solver = make_solver("flow", job.study.structure, 0.5, 1e-9)
    print("specialised" if solver.is_specialised else "for any")
sys.exit(code)
"""


@pytest.mark.mpi
@pytest.mark.slow
def test_a_large_study_fits_kernels_first_and_gives_the_same(tmp_path, monkeypatch):
    kernels_but(tmp_path / "cache")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    script, job = tmp_path / "run.py", tmp_path / "job.toml"
    script.write_text(FITTING)
    job.write_text(BUILDING)
    n_runs = load_job(job).study.n_runs
    outputs = [tmp_path / f"{k}.h5" for k in range(3)]
    said = []
    for least, output in zip((n_runs / 2 + 1, n_runs / 2, 1e9), outputs, strict=True):
        done = run_script(2, script, least, job, output)
        assert done.returncode == 0, done.stderr
        said.append(
            (done.stdout.split(), "specialised to the structure" in done.stdout + done.stderr)
        )
    (first, _), (second, compiled), (third, again) = said
    assert (first[-2:], second[-1], third[-1]) == (["for", "any"], "specialised", "specialised")
    assert compiled
    assert not again
    for output in outputs[1:]:
        assert_same_datasets(outputs[0], output)
