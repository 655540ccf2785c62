"""A results file is understood without the program: its equation, its job, its units."""

import contextlib
import json
import tomllib

import h5py
import numpy as np
import pytest
import tools
from scipy.integrate import solve_ivp
from together import together
from tools import JOBS, SMALL, VARY

from hpcsweep import load_job, meanings, open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.job import JobError, parse_job
from hpcsweep.job.resolved import resolved
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import Frames, Layout

DASHPOT = """
[structure]
damping_ratio = 0.03
[structure.matrices]
mass = [[2.0, 0.3], [0.3, 1.0]]
stiffness = [[3.0, -1.0], [-1.0, 1.0]]
[[structure.contact]]
direction = [-1, 1]
gap = 0.2
stiffness = 40.0
damping = 1.5
[[structure.contact]]
direction = [-1, 0]
gap = 0.3
stiffness = 30.0
[forcing]
harmonics = [{order = 1, amplitude = 1.0, phase = 0.4}, {order = 3, amplitude = 0.3}]
[sweep]
omega = 0.9
amplitude = [0.25, 0.3]
transient_cycles = 60
sampling_cycles = 20
"""


def computed(text: str, tmp_path):
    path = tmp_path / "made.h5"
    assert campaign.run(parse_job(text, "made", "made"), path, Serial()) == 0
    return path


def one_period(told: dict, amplitude: float, omega: float, z: np.ndarray) -> np.ndarray:
    """Integrate the attribute `equation` with the numbers of `structure`, by scipy alone."""
    mass, damping, stiffness = (np.array(told[k]) for k in ("mass", "damping", "stiffness"))
    n, rho = told["n_floors"], told["sharpness"]

    def motion(tau, z):
        u, v = z[:n], z[n:]
        waves = (a * np.sin(h * omega * tau + phi) for h, a, phi in told["harmonics"])
        force = np.array(told["forcing"]) * amplitude * sum(waves)
        force -= damping @ v + stiffness @ u
        for one in told["contacts"]:
            d = np.array(one["direction"])
            x, w = d @ u - one["gap"], d @ v
            switch = float(x > 0) if rho == np.inf else 0.5 * (1.0 + np.tanh(0.5 * rho * x))
            push = one["stiffness"] * x
            if c := one.get("damping", 0.0):
                push += c * w
                push = push if one["tension"] else max(push, 0.0)
            force -= d * switch * push
        return np.concatenate((v, np.linalg.solve(mass, force)))

    done = solve_ivp(motion, (0.0, 2 * np.pi / omega), z, "DOP853", rtol=1e-12, atol=1e-13)
    return done.y[:, -1]


@pytest.mark.slow
@pytest.mark.parametrize("text", [SMALL + VARY, DASHPOT], ids=["vary", "dashpot"])
def test_a_stored_point_follows_from_the_file_alone(text, tmp_path):
    with h5py.File(computed(text, tmp_path)) as file:
        structures = file.get("structures")
        contact, period = file["contact"][...], file["orbit_period"][...]
        chosen = [*map(tuple, np.argwhere((contact > 0) & (period > 0)))]
        assert len(chosen) > 1
        for place in (chosen[0], chosen[-1]):
            outer = place[:-3]
            text = structures[outer] if structures else file.attrs["structure"]
            points = file["poincare"][place][: period[place]]
            amplitude, omega = file["amplitude"][place[-1]], file["omega"][place[-2]]
            found = one_period(json.loads(text), amplitude, omega, points[0])
            np.testing.assert_allclose(found, points[1 % len(points)], rtol=0, atol=1e-8)
        assert "sum_k d_k F_k" in file.attrs["equation"]


KINDS = ("SMALL", "GRID", "REFINED", "ATTRACTORS", "BASINS", "RECORDS")


@together("kind", [*KINDS, "VARY"])
def test_the_resolved_job_is_the_job_with_every_default(kind):
    text = SMALL + VARY if kind == "VARY" else getattr(tools, kind)
    job = parse_job(text, kind, kind)
    whole = resolved(job)
    again = parse_job(whole, "resolved", "other")
    assert (again.fingerprint, again.name) == (job.fingerprint, kind)
    assert resolved(again) == whole
    assert "rtol = 1e-09" in whole
    assert "p_delta = false" in whole  # of a structure, or of each building
    assert ("transient_cycles" in whole) == (kind != "RECORDS")


@together("name", ["structures/pounding", "structures/two-masses", "paper/figure6"])
def test_shipped_jobs_are_resolved_too(name):
    job = load_job(JOBS / f"{name}.toml")
    assert parse_job(resolved(job), "resolved", "x").fingerprint == job.fingerprint


def test_defaults_that_depend_on_a_varied_key_are_not_settled_by_its_first_value():
    job = parse_job(tools.ATTRACTORS + "[vary]\nstructure.gap = [0.5, 1.0]\n", "x", "x")
    boxes = [job.study.part((k,)).box for k in (0, 1)]
    assert boxes[0][1] != boxes[1][1]
    whole = resolved(job)
    assert "\nvelocity" not in whole
    assert "confidence = 0.95" in whole


def test_what_a_job_tells_of_its_results_is_in_the_file_and_not_in_the_fingerprint(tmp_path):
    about = 'title = "Two floors"\ninstitution = "ETH"\nlicense = "CC-BY-4.0"\n'
    results = open_results(computed(about + SMALL, tmp_path))
    assert {k: results.attrs[k] for k in ("title", "institution", "license")} == {
        "title": "Two floors",
        "institution": "ETH",
        "license": "CC-BY-4.0",
    }
    assert results.attrs["Conventions"].startswith("CF-")
    assert results.attrs["created"] in results.attrs["history"]
    plain = parse_job(SMALL, "x", "x")
    assert plain.fingerprint == results.attrs["fingerprint"]
    with pytest.raises(JobError, match=r"title = 3: must be a text of one line"):
        parse_job(f"title = 3\n{SMALL}", "x", "x")


@together(
    "vary, axis, velocity",
    [
        ("structure.gap = [[1.0, 1.0], [0.5, 1.0]]", {"gap": "length"}, "length omega_0"),
        ("structure.gap = [[1.0, 1.0]]", {"gap": "gaps"}, "gaps omega_0"),
        ("structure.mass = [1.0, 2.0]", {"mass": "mass"}, "length/time"),
        (
            "structure.p_delta = [false, true]\nstructure.storey_height = 5.0\n"
            "structure.weight = [0.1, 0.2]",
            {"p_delta": "1", "storey_height": "length", "weight": "mass length/time^2"},
            "length/time",
        ),
        ("structure.storey_damping = [0.1, 0.2]", {"storey_damping": "k/omega_0"}, "gaps omega_0"),
    ],
)
def test_units_are_those_of_all_values_of_a_varied_key(vary, axis, velocity, tmp_path):
    layout = Layout(parse_job(f"{SMALL}\n[vary]\n{vary}\n", "x", "x"))
    units = {name: layout.coordinates[name].units for name in axis}
    (state,) = (v.units for v in layout.variables if v.name == "final_state")
    assert (units, state.split("; ")[1]) == (axis, velocity)


def test_units_of_a_varied_key_have_the_names_that_the_job_gives():
    named = DASHPOT + '[units]\nlength = "m"\nmass = "kg"\ntime = "s"\n[vary]\n'
    keys = {"gap": ([0.2, 0.3], "m"), "stiffness": ([30, 40], "N/m"), "damping": ([1, 2], "N s/m")}
    for key, (values, unit) in keys.items():
        job = parse_job(f'{named}"structure.contact[0].{key}" = {values}\n', "x", "x")
        assert Layout(job).coordinates[f"contact_0_{key}"].units == unit


def test_every_code_of_every_study_has_words(tmp_path):
    results = open_results(computed(tools.BASINS, tmp_path))
    assert {"attractor 1"} <= set(meanings(results.label).values.ravel().tolist())
    coded = [v for v in results.data_vars.values() if v.dtype == np.int8]
    assert {v.name for v in coded} >= {"label", "motion", "outcome"}
    for one in coded:
        assert "flag_meanings" in one.attrs, one.name


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["SMALL", "RECORDS", "BASINS"])
def test_a_frame_has_the_names_dimensions_and_words_of_the_whole(kind, tmp_path):
    """As docs/extending.md says of what a figure is given."""
    path = computed(getattr(tools, kind), tmp_path)
    whole = open_results(path)
    with contextlib.closing(Frames(path, None)) as frames:
        found, (axis,) = frames.dataset(1), frames.study.run_dims[-2:-1]
    assert set(whole.data_vars) - set(found.data_vars) == {"commit"}
    right = whole.isel({axis: [1]}).drop_vars("commit")
    for name, one in found.variables.items():
        assert (one.dims, one.dtype) == (right[name].dims, right[name].dtype), name
        assert {k: str(v) for k, v in one.attrs.items()} == {
            k: str(v) for k, v in right[name].attrs.items()
        }
        np.testing.assert_array_equal(one, right[name])


def test_each_harmonic_has_all_its_values():
    given = "[{order = 0, amplitude = 0.1}, {order = 1}]"
    job = parse_job(f"{SMALL}\n[forcing]\nharmonics = {given}\n", "x", "x")
    whole = parse_job(resolved(job), "x", "x")
    terms = [{"order": 0, "amplitude": 0.1}, {"order": 1, "amplitude": 1.0, "phase": 0.0}]
    assert tomllib.loads(resolved(job))["forcing"]["harmonics"] == terms
    assert whole.fingerprint == job.fingerprint
