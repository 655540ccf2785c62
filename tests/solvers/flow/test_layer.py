"""Steps in the layer of a contact: their length, error and forces."""

import math

import numba
import numpy as np
import pytest

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd.vectors import LANES, load, store
from hpcsweep.model.contact import layer_half_width, less_contact_forces
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.layer import scheme, visit
from hpcsweep.solvers.flow.state.state import accelerations
from hpcsweep.solvers.flow.step import forcing
from hpcsweep.solvers.flow.step.step import layer_segment

compiled_only = pytest.mark.skipif(
    bool(numba.config.DISABLE_JIT), reason="many periods: too long as plain Python"
)

OMEGA = 0.445
PERIOD = 2 * math.pi / OMEGA


@pytest.mark.slow
@compiled_only
def test_error_of_a_layer_step_is_measured():
    """Against six parts of the step, at random places, speeds and lengths."""
    rng = np.random.default_rng(5)
    ratios, n_seen = [], 0
    for _ in range(400):
        n, rho, beta = int(rng.integers(1, 4)), 10 ** rng.uniform(2, 5), 10 ** rng.uniform(1, 5)
        flow = FlowMap(Structure(n, beta, rho, 0.05), OMEGA)
        model, work = flow._shared.model, flow._shared.work.step.layer
        z = np.concatenate((rng.uniform(-0.5, 0.9, n), rng.uniform(-0.3, 0.3, n)))
        z[n - 1] = 1 + rng.uniform(-25, 10) / rho
        z[2 * n - 1] = 10 ** rng.uniform(-4, 0) * rng.choice([-1, 1])
        tau = rng.uniform(0, PERIOD)
        a = np.zeros(n)
        pairs = np.zeros(2)
        forcing.forcing_at(tau, 0.3, model, pairs, 0)
        accelerations(pairs[0], z, model, a)
        length, stiffness = visit.step_limit(z, a, model, visit.longest_step(model))
        ends, measured = [], math.inf
        for parts in (1, 6):
            h, end = length / parts, z.copy()
            for part in range(parts):
                start = end.copy()
                begun = tau + part * h
                forcing.forcing_at(begun, 0.3, model, pairs, 0)
                accelerations(pairs[0], start, model, a)
                step = layer_segment(begun, h)
                if scheme.collocate(step, start, a, 0.3, pairs, stiffness, model, work):
                    scheme.finish(h, start, work.g, end)
                    if parts == 1:
                        measured = scheme.quadrature_error(h, z, model, work)
                else:
                    end[:] = np.nan
            ends.append(end)
        off = np.abs(ends[0] - ends[1]).max()
        if measured <= 1e-12:
            assert off <= 10 * measured + 1e-13
            n_seen += 1
        if 1e-13 < off < 1e-9:
            ratios.append(measured / off)
    assert n_seen > 200
    assert len(ratios) > 30
    assert np.median(ratios) < 10


def test_contact_forces_in_lanes_are_those_of_the_equations():
    @kernel
    def forces(u, beta, rho, out):
        for k in range(0, out.size, LANES):
            store(out, k, less_contact_forces(load(out, k), load(u, k) - 1.0, beta, rho))

    y = np.concatenate((np.linspace(-45, 45, 2001), [-1e4, -700.1, -699.9, 0.0, 700.1, 1e4, 1e12]))
    for rho in (0.0, 3.0, 1e4):
        u = 1 + y / max(rho, 1.0)
        x = u.astype(np.longdouble) - 1
        weight = np.where(x < 0, np.exp(np.minimum(rho * x, 0)), 1) / (1 + np.exp(-rho * abs(x)))
        out = np.ones(u.size)
        forces(u, 2.0, rho, out)
        exact = 2 * weight * x
        assert np.all(abs(1 - out - exact) <= 4e-16 * (1 + abs(exact) * (1 + abs(rho * x))))
    out = np.zeros(LANES)
    forces(np.full(LANES, np.nan), 1.0, 1e4, out)
    assert np.all(np.isnan(out))


def test_layer_width_leaves_out_only_a_negligible_force():
    for beta, rho in [(1000.0, 1e4), (1e5, 1e2), (1e7, 1e8), (1.0, 1e6)]:
        y = rho * layer_half_width(beta, rho)
        assert beta / rho * y / (1 + math.exp(y)) < 2e-13
    assert layer_half_width(1000.0, math.inf) == 0
    assert layer_half_width(1000.0, 0.0) == math.inf


class Cautious(Structure):
    """The same chain with a larger bound of K."""

    @property
    def stiffness_bound(self):
        return 6.0


@pytest.mark.parametrize("sharpness", [1e4, 50.0])
def test_bound_of_the_stiffness_is_the_one_that_the_structure_tells(sharpness):
    z = np.repeat([0.9, 0.4], 3)
    plain, cautious = (FlowMap(kind(3, 1000.0, sharpness), OMEGA) for kind in (Structure, Cautious))
    exact, _ = plain.points(z, 0.06, 1)
    found, _ = cautious.points(z, 0.06, 1)
    assert np.abs(found - exact).max() < 1e-11
    a = np.zeros(3)
    z[2] = 1.0 - 1.0 / sharpness
    limits = [visit.step_limit(z, a, flow._shared.model, 1.0) for flow in (plain, cautious)]
    assert limits[1][1] == pytest.approx(limits[0][1] + 2.0)
    assert limits[1][0] <= limits[0][0]
