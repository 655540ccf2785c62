"""Foundations on soil and neighbours with gaps and bumpers of their own, against own equations."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from hpcsweep import Building, Soil, adjacent, response, synthetic_records
from hpcsweep.job import JobError, parse_job
from hpcsweep.model.plausibility import springs, told

SOIL = {"mass": 1.2e5, "inertia": 3e6, "sway_stiffness": 2e8, "rocking_stiffness": 5e9}
HOUSE = {"mass": [2e5, 1.5e5], "storey_stiffness": [1.5e8, 1e8], "storey_height": [3.5, 3.0]}
RECORD = synthetic_records(1, seed=2, duration=6.0)[0]


def test_the_period_of_an_oscillator_on_soil_is_longer_by_the_closed_form():
    # without masses of its own the soil is in series: T^2 / T_fixed^2 = 1 + k / k_s + k h^2 / k_r
    m, k, h = 3e5, 1.2e8, 9.0
    soil = SOIL | {"mass": 1e-4, "inertia": 1e-4}
    made = Building(mass=m, storey_stiffness=k, storey_height=h, soil=soil).structure
    ratio = made.longest_period / (2.0 * np.pi * np.sqrt(m / k))
    assert ratio**2 == pytest.approx(1.0 + k / 2e8 + k * h**2 / 5e9, rel=1e-9)


def test_weights_help_to_overturn_what_rocks():
    # a storey and a rotation in series lean by x, of which P-Delta takes W / h; the sway is behind
    m, k, h, weight = 3e5, 1.2e8, 9.0, 4e7
    soil = SOIL | {"mass": 1e-4, "inertia": 1e-4}
    house = {"mass": m, "storey_stiffness": k, "storey_height": h, "p_delta": True}
    made = Building(**house, weight=weight, soil=soil).structure
    leans = 1.0 / (1.0 / k + h**2 / 5e9) - weight / h
    along = 1.0 / (1.0 / leans + 1.0 / 2e8)
    assert made.longest_period == pytest.approx(2.0 * np.pi * np.sqrt(m / along), rel=1e-9)
    two = HOUSE | {"p_delta": True, "weight": [2e6, 1.5e6]}
    least = 3.5e6 * 3.5 + 1.5e6 * 3.0  # each storey's weight times its height
    with pytest.raises(ValueError, match=r"rocking_stiffness must be above 1\.675e\+07, or"):
        _ = Building(**two, soil=SOIL | {"rocking_stiffness": least}).structure
    struck = Building(**two, column={"share": 0.1, "mass": 1.0}, soil=SOIL)
    plain = Building(**two, soil=SOIL).structure
    assert struck.struck([2.0]).longest_period == pytest.approx(plain.longest_period, rel=1e-4)


def test_motions_on_soil_are_those_of_sway_rotation_and_drifts():
    dashpots = {"sway_damping": 4e6, "rocking_damping": 6e7}
    building = Building(**HOUSE, soil=Soil(**SOIL, **dashpots))
    fixed, heights = Building(**HOUSE).structure, np.array([3.5, 6.5])
    # u = (v, theta, d): kinetic energy of v + h theta + d, springs and dashpots along each
    floors = np.column_stack((np.ones(2), heights, np.eye(2)))
    mass = floors.T @ np.diag(HOUSE["mass"]) @ floors + np.diag([1.2e5, 3e6, 0.0, 0.0])
    ground = np.r_[HOUSE["mass"] @ floors] + np.array([1.2e5, 0.0, 0.0, 0.0])
    stiffness, damping = (np.zeros((4, 4)) for _ in range(2))
    stiffness[:2, :2], damping[:2, :2] = np.diag([2e8, 5e9]), np.diag([4e6, 6e7])
    stiffness[2:, 2:], damping[2:, 2:] = fixed.stiffness_matrix, fixed.damping_matrix
    system, dt = np.zeros((10, 10)), RECORD.dt
    system[:4, 4:8] = np.eye(4)
    system[4:8, :4] = -np.linalg.solve(mass, stiffness)
    system[4:8, 4:8] = -np.linalg.solve(mass, damping)
    system[4:8, 8] = -np.linalg.solve(mass, ground)
    system[8, 9] = 1.0
    tenth = expm(0.1 * dt * system)
    state, seen, a = np.zeros(10), [], RECORD.acceleration
    for first, second in pairwise(a):
        state[8:] = first, (second - first) / dt
        for _ in range(10):
            seen.append(state[:4])
            state = tenth @ state
    seen = np.array([*seen, state[:4]])
    found = response(building.structure, RECORD)
    u = seen[:, [0]] + seen[:, [1]] * heights + seen[:, 2:]
    assert found.final_state[2:4] == pytest.approx(u[-1], abs=1e-12 * np.abs(u).max())
    assert found.final_state[1] == pytest.approx(seen[-1, :2] @ [1.0, 6.5], rel=1e-9)
    drift = np.abs(seen[:, 2:] - np.column_stack((np.zeros(len(seen)), seen[:, 2]))).max(axis=0)
    assert found.drift == pytest.approx(drift, rel=1e-4)


def test_soil_that_yields_is_a_slider_and_bears_no_more():
    strength = {"sway_strength": 4e5, "rocking_strength": 3e6}
    building = Building(**HOUSE, yield_drift=0.01, soil=SOIL | strength)
    structure = building.structure
    assert structure.slider_names == ("1", "2", "foundation", "rocking")
    sway, rocking = structure.sliders[2:]
    assert (sway.strength, sway.spring) == (4e5, 2e8)
    assert (rocking.strength * 6.5, rocking.spring * 6.5**2) == pytest.approx((3e6, 5e9))
    strong = Building(**HOUSE, soil=SOIL).structure
    assert structure.stiffness_matrix == pytest.approx(strong.stiffness_matrix, rel=1e-12)
    weak, elastic = (response(s, RECORD, base_shear=True) for s in (structure, strong))
    assert weak.ductility[2:].min() > 1.0
    assert weak.base_shear[0] < 0.7 * elastic.base_shear[0]
    rows = structure.drift_rows
    assert springs(strong, strong.stiffness_matrix, rows) == pytest.approx(
        HOUSE["storey_stiffness"]
    )
    (line,) = told(strong, 9.81)
    assert line.startswith(f"weight {9.81 * 3.5e5:.4g}, theta at most ")
    assert f"period {Building(**HOUSE).structure.longest_period:.4g} on a fixed base" in line


def test_the_weight_that_is_told_is_the_one_given():
    given = Building(**HOUSE, p_delta=True, weight=[3e6, 2e6]).structure
    (line,) = told(given, 9.81)
    theta = max(5e6 / 3.5 / 1.5e8, 2e6 / 3.0 / 1e8)
    assert line.startswith(f"weight 5e+06, theta at most {theta:.3g}, period ")


def test_each_two_neighbours_have_their_own_gap_and_bumper():
    house = {"mass": 1e5, "storey_stiffness": 4e7, "storey_height": 3.0}
    three = [
        Building(**house, name=name, period=t)
        for name, t in zip("ABC", (0.3, 0.5, 0.8), strict=True)
    ]
    between = [
        {"gap": 0.01, "stiffness": 1e7, "bumper": [[0.005, 5e7], [0.01, 4e8]]},
        {"gap": 0.03, "stiffness": 3e8, "restitution": 0.6},
    ]
    made = adjacent(three, between=between)
    assert made.names.contacts == ("A1-B1", "A1-B1 0.005", "A1-B1 0.01", "B1-C1")
    closing = np.array([0.0, 0.004, 0.006, 0.02])
    force = sum(c.stiffness * np.maximum(closing + 0.01 - c.gap, 0.0) for c in made.contacts[:3])
    assert force == pytest.approx([0.0, 4e4, 5e4 + 5e4, 5e4 + 2.5e5 + 4e6])
    alike = adjacent(three, 0.03, 3e8, restitution=0.6)
    assert made.contacts[3] == alike.contacts[1]
    hit = response(made, RECORD, scale=3.0)
    assert hit.impacts[:3].min() > 0
    tables = "".join(
        "[[building]]\n" + "".join(f"{key} = {value!r}\n" for key, value in house.items())
        for _ in range(3)
    )
    tables += "[[pounding]]\ngap = 0.01\nstiffness = 1e7\nbumper = [[0.005, 5e7]]\n"
    text = '[study]\nkind = "records"\n' + tables + "[[pounding]]\ngap = 0.02\nstiffness = 1e8\n"
    text += "[records]\nsynthetic = {}\n[vary]\n"
    varied = parse_job(text + '"pounding[1].gap" = [0.02, 0.05]\n', "job", "job").study
    assert [axis.name for axis in varied.axes] == ["pounding_1_gap"]
    for given, said in (
        (text.replace("5e7]]", "5e6]]"), "pounding.bumper must ascend from 0 and from the"),
        (text.replace("[[pounding]]\ngap = 0.02\nstiffness = 1e8\n", ""), "is 1"),
        (text.replace("gap = 0.02\n", ""), "is missing"),
    ):
        with pytest.raises(JobError, match=said):
            parse_job(given.removesuffix("[vary]\n"), "job", "job")
