"""Finite element models: a clamped beam whose frequencies are known, and 100 random models."""

import math
import tracemalloc

import numpy as np
import pytest
from beams import beam
from scipy import sparse
from together import together

from hpcsweep import (
    Contact,
    Slider,
    Structure,
    response,
    stroboscopic_points,
    synthetic_records,
)
from hpcsweep.model import reduction, sparse_matrices
from hpcsweep.model.description import one_line, slow
from hpcsweep.model.finite_elements import FiniteElements
from hpcsweep.model.modes import per_mass

ROOTS = np.array([1.875104069, 4.694091133, 7.854757438, 10.995540735])
"""beta of cos(beta) cosh(beta) = -1: omega = beta^2 for a beam with E I = rho A = L = 1."""


def model(n: int = 30, lumped: bool = False) -> FiniteElements:
    names = [f"{i}.{what}" for i in range(1, n + 1) for what in ("UY", "RZ")]
    return FiniteElements(*beam(n, lumped), names=names)


def with_stop(reduce, n: int = 30, **more) -> Structure:
    """Return the beam with a stop at its tip, 100 times as stiff as the tip."""
    stop = Contact(direction=f"{n}.UY", gap=0.02, stiffness=300.0)
    return model(n).structure([stop], influence="UY", reduce=reduce, damping_ratio=0.02, **more)


@together("modes", [1, 6, 20])
def test_a_clamped_beam_has_its_frequencies_and_all_static_flexibility_of_its_tip(modes):
    found = with_stop({"modes": modes}, outputs=["15.UY"])
    exact = ROOTS[:modes] ** 2
    assert found.reduction.frequencies[: exact.size] == pytest.approx(exact, rel=3e-5)
    assert found.n_floors == modes + 2
    (d,) = found.directions
    assert d @ np.linalg.solve(found.stiffness_matrix, d) == pytest.approx(1 / 3, rel=1e-9)


def test_the_error_falls_as_modes_are_added_and_says_how_many_are_needed():
    errors = {k: with_stop({"modes": k}).reduction.error for k in (4, 9, 13)}
    assert errors == pytest.approx({4: 1.6e-3, 9: 2.6e-5, 13: 4.1e-6}, rel=0.1)
    assert with_stop({"error": 3e-5}).reduction.modes == 9
    assert with_stop({"up_to": ROOTS[3] ** 2 / (2 * math.pi) * 1.001}).reduction.modes == 4
    assert with_stop(None).reduction.error == 0.0


def test_motions_with_contact_are_those_of_the_full_model():
    full, few = with_stop(None, n=10), with_stop({"modes": 9}, n=10, outputs=["5.UY"])
    assert (full.n_floors, few.n_floors) == (20, 11)
    tips = []
    for structure, place in ((full, 18), (few, few.floor_names.index("10.UY"))):
        state = np.zeros(2 * structure.n_floors)
        tips.append(stroboscopic_points(structure, 0.5, 4.0, state, 12)[:, place])
    assert np.abs(tips[0]).max() > 0.02
    assert np.abs(tips[0] - tips[1]).max() < 1e-5 * np.abs(tips[0]).max()


def test_absolute_accelerations_are_those_of_the_rows_that_are_asked_for():
    found = with_stop({"modes": 3}, outputs=["1.UY", "15.UY", "20.RZ"])
    ground = -per_mass(found.mass_matrix, found.forcing_vector)
    assert found.shakes
    # of three modes alone 0.02 of the ground's acceleration would reach the first node
    assert ground[:4] == pytest.approx([1.0, 1.0, 0.0, 1.0], abs=1e-8)
    mass, r = beam()[0], np.tile([1.0, 0.0], 30)
    assert found.base_masses == pytest.approx([r @ mass @ r])
    assert found.names.floors[:4] == ("1.UY", "15.UY", "20.RZ", "30.UY")
    assert found.frequencies[-1] == pytest.approx(found.frequencies[-2])


def test_accelerations_and_base_shear_under_a_record_are_those_of_the_full_model():
    record = synthetic_records(1, seed=1, duration=5.0)[0]
    wanted = ["1.UY", "5.UY", "10.UY"]
    given = {"influence": "UY", "damping_ratio": 0.02, "outputs": wanted}
    full, few = (model(10).structure(reduce=one, **given) for one in (None, {"modes": 6}))
    found = [response(one, record, base_shear=True) for one in (full, few)]
    places = [[one.floor_names.index(name) for name in wanted] for one in (full, few)]
    whole, own = (r.floor_acceleration[at] for r, at in zip(found, places, strict=True))
    assert own == pytest.approx(whole, rel=0.02)
    assert found[1].base_shear == pytest.approx(found[0].base_shear, rel=2e-3)
    assert few.building_names == ("building",)


def test_coordinates_without_mass_are_condensed():
    lumped = model(20, lumped=True)
    whole = lumped.structure(outputs=["20.UY"], influence="UY")
    assert whole.reduction.massless == whole.n_floors == 20
    few = lumped.structure(outputs=["20.UY"], influence="UY", reduce={"modes": 5})
    assert whole.frequencies[:5] == pytest.approx(few.frequencies[:5], rel=1e-9)
    assert whole.frequencies[0] == pytest.approx(ROOTS[0] ** 2, rel=2e-3)


def test_shares_of_the_mass_are_those_of_a_clamped_beam():
    shares = with_stop({"modes": 3}).reduction.shares
    assert shares == pytest.approx((0.6131, 0.1883, 0.0647), rel=0.03)  # Blevins; a finite mesh


def test_sliders_and_pairs_keep_their_springs_out_of_the_elastic_stiffness():
    slider = Slider(direction={"30.UY": 1.0, "29.UY": -1.0}, stiffness=50.0, strength=0.1)
    found = model().structure(
        [], [slider], influence="UY", outputs=[["30.UY", "20.UY"], "30.UY"], reduce={"modes": 8}
    )
    force = np.array(found.drift_rows[0])
    _, stiffness = beam()
    row = np.zeros(60)
    row[[58, 38]] = 1.0, -1.0
    # along the slider itself, whose flexibility is exact with and without its spring
    b = found.slider_directions[0]
    full = np.zeros(60)
    full[[58, 56]] = 1.0, -1.0
    assert b @ np.linalg.solve(found.elastic_stiffness, b) == pytest.approx(
        full @ np.linalg.solve(stiffness, full), rel=1e-6
    )
    assert force @ np.linalg.solve(found.elastic_stiffness, b) == pytest.approx(
        row @ np.linalg.solve(stiffness, full), rel=1e-6
    )
    assert found.storey_names == ("30.UY-20.UY",)


def test_contacts_on_two_sides_are_one_coordinate():
    stops = [Contact(direction=d, gap=0.02, stiffness=300.0) for d in ("30.UY", "-30.UY")]
    found = model().structure(stops, influence="UY", reduce={"modes": 5})
    assert found.n_floors == 6
    assert np.array_equal(found.directions, [[1, 0, 0, 0, 0, 0], [-1, 0, 0, 0, 0, 0]])
    assert found.names.contacts == ("30.UY", "-30.UY")


def random_model(seed: int) -> tuple:
    """Return a model of 300 masses, two rows, stiffnesses of contacts and a number of modes."""
    rng = np.random.default_rng(seed)
    n, width = 300, int(rng.integers(1, 6))
    stiffness = np.zeros((n, n))
    for i in range(n):
        for j in range(max(0, i - width), i):
            if rng.random() < 0.7 or j == i - 1:
                row = np.eye(n)[i] - np.eye(n)[j]
                stiffness += 10.0 ** rng.uniform(2, 4) * np.outer(row, row)
    stiffness[0, 0] += 1e3
    rows = np.eye(n)[rng.choice(n, 2, replace=False)]
    found = FiniteElements(10.0 ** rng.uniform(-1, 1, n), stiffness)
    return found, rows, 10.0 ** rng.uniform(1, 5, 2), int(rng.integers(3, 25))


@pytest.mark.parametrize(
    "seeds", [range(3), pytest.param(range(3, 40), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_the_estimated_error_is_the_true_one_within_a_factor_of_three(seeds, monkeypatch):
    monkeypatch.setattr(sparse_matrices, "SMALL", 10)
    for seed in seeds:
        found, rows, kappa, k = random_model(seed)
        given = found.mass, found.stiffness, rows, found.mass @ np.ones(300)
        wanted = {"modes": k}
        some = reduction.find_modes(*given, reduction.most_modes(wanted, 60))
        whole = reduction.find_modes(*given, 300)
        assert whole.is_whole > some.is_whole
        _, estimate = reduction.choose(some, wanted, 60, rows, kappa)
        exact = reduction.error_of(whole, k, rows, kappa, reduction.basis_of(whole, 300))
        assert exact / 3 < estimate < 3 * exact, seed


def test_a_damping_matrix_is_projected_as_the_others():
    mass, stiffness = beam(20)
    found = FiniteElements(mass, stiffness, 0.2 * mass + 1e-4 * stiffness)
    row = np.eye(40)[20].tolist()
    stop = Contact(direction=row, gap=0.1, stiffness=10.0)
    few = found.structure([stop], reduce={"modes": 5}, outputs=[row, 39], influence=[1, 0] * 20)
    omega = np.array(few.reduction.frequencies)
    assert few.damping_ratios[:5] == pytest.approx(0.1 / omega + 0.5e-4 * omega, rel=1e-9)
    assert few.names.floors[:2] == ("21", "39")
    for k in (2, 3, 5):  # the missing mass has the frequency of mode k, and a damping of its own
        alone = found.structure([], reduce={"modes": k}, outputs=[39], influence=[1, 0] * 20)
        ratios = (0.1 / omega + 0.5e-4 * omega)[:k]
        assert alone.damping_ratios[:k] == pytest.approx(ratios, rel=1e-6)
        assert alone.damping_ratios[k] > 2 * ratios[-1]
    bare = found.structure([stop], reduce={"modes": 5}, influence=[1, 0] * 20, damping_ratio=0.03)
    assert bare.damping_ratios == pytest.approx(0.03)


@together(
    "damping, kept, said",
    [
        (0.0, None, "mode 40 is 6.8e+03 times as fast as the first"),
        (1e-2, 10, "mode 10 decays 2.3e+03 times as fast as the first"),
        (1e-5, 10, ""),
    ],
)
def test_a_model_that_takes_long_is_told_with_what_to_do(damping, kept, said):
    mass, stiffness = beam(20)
    reduce = None if kept is None else {"modes": kept}
    found = FiniteElements(mass, stiffness, damping * stiffness if damping else None)
    structure = found.structure(outputs=[39], influence=[1, 0] * 20, reduce=reduce)
    lines = list(slow(structure))
    assert len(lines) == bool(said)
    assert all(line.startswith(said) for line in lines)
    assert all("structure.model.reduce with fewer modes leaves it out" in line for line in lines)
    ratios = structure.damping_ratios[: structure.reduction.modes]
    assert not damping or f"zeta = {ratios[0]:.4g} to {ratios[-1]:.4g}" in one_line(structure)


def test_a_free_body_on_a_slider_is_a_structure():
    free = FiniteElements([1.0, 2.0], [[5.0, -5.0], [-5.0, 5.0]])
    slider = Slider(direction="1", stiffness=4.0, strength=1.0)
    exact = Structure.from_matrices(
        [1.0, 2.0],
        free.stiffness.toarray(),
        [],
        sliders=[Slider(direction=(1.0, 0.0), stiffness=4.0, strength=1.0)],
    )
    for reduce in (None, {"modes": 2}):
        found = free.structure((), [slider], reduce=reduce)
        assert found.frequencies == pytest.approx(exact.frequencies, rel=1e-12)


FREE_ENDS = np.array([0.0, 0.0, 4.730040745, 7.853204624, 10.995607838]) ** 2
"""beta^2 of cos(beta) cosh(beta) = 1, behind the two rigid modes."""


def between_stops(n: int, reduce, **more) -> Structure:
    """Return a beam with free ends, each between two stops."""
    names = [f"{i}.{what}" for i in range(1, n + 2) for what in ("UY", "RZ")]
    found = FiniteElements(*map(sparse.csr_array, beam(n, free=True)), names=names)
    ends = ("1.UY", 0.01), ("-1.UY", 0.02), (f"{n + 1}.UY", 0.03), (f"-{n + 1}.UY", 0.015)
    stops = [Contact(direction=way, gap=gap, stiffness=60.0) for way, gap in ends]
    return found.structure(stops, influence="UY", reduce=reduce, **more)


@together("n, modes", [(30, None), (30, 5), (30, 9), (260, 5)])
def test_a_beam_with_free_ends_keeps_its_rigid_modes(n, modes):
    ratios = [0.02] + [0.03] * ((modes or 62) - 3)
    found = between_stops(n, modes and {"modes": modes}, damping_ratio=ratios)
    assert (found.n_rigid, found.reduction.frequencies[:2]) == (2, (0.0, 0.0))
    assert found.frequencies[:5] == pytest.approx(FREE_ENDS, rel=1e-4)
    assert found.damping_ratios[:4].tolist() == [0.0, 0.0, 0.02, 0.03]
    # turned about the middle, M = 1 and 1 / 12
    shapes = found.directions[[0, 2]] @ found.modes[:, :2]
    assert shapes @ shapes.T == pytest.approx(np.array([[4.0, -2.0], [-2.0, 4.0]]), rel=1e-8)


def test_a_reduced_free_beam_moves_as_the_whole_one():
    whole, errors = between_stops(12, None, damping_ratio=0.02), []
    start = np.zeros(2 * whole.n_floors)
    exact = stroboscopic_points(whole, 2.0, 6.0, start, n_periods=3) @ np.eye(52)[:, [0, 24]]
    for modes in (3, 6, 12):
        found = between_stops(12, {"modes": modes}, damping_ratio=0.02)
        points = stroboscopic_points(found, 2.0, 6.0, np.zeros(2 * found.n_floors), n_periods=3)
        rows = found.directions[[0, 2]]
        moved = points[:, : found.n_floors] @ rows.T
        errors.append(np.abs(moved - exact).max() / np.abs(exact).max())
        assert errors[-1] < 30.0 * found.reduction.error
    assert errors[2] < 0.1 * errors[0]


def test_one_triangle_and_a_vector_of_masses_will_do():
    _, stiffness = beam(3)
    found = FiniteElements(np.ones(6), sparse.csc_array(np.triu(stiffness)))
    assert np.array_equal(found.stiffness.toarray(), stiffness)
    assert np.array_equal(found.mass.toarray(), np.eye(6))
    column = FiniteElements(sparse.csc_array(np.ones((6, 1))), stiffness)
    assert np.array_equal(column.mass.toarray(), np.eye(6))
    assert found.names == ("1", "2", "3", "4", "5", "6")


def of(mass=(1.0, 1.0, 1.0), stiffness=None, **more) -> FiniteElements:
    chain = 2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
    return FiniteElements(mass, chain if stiffness is None else stiffness, **more)


FREE = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
WRONG = [
    (lambda: of(mass=np.ones(2)), "mass has 2 rows, stiffness has 3"),
    (lambda: of(mass=np.diag([1.0, -1.0, 1.0])), "its diagonal is -1 at coordinate 2"),
    (lambda: of(mass=[[1, 2, 0], [2, 1, 0], [0, 0, 1]]), "mass must be positive definite, it has"),
    (lambda: of(stiffness=-np.eye(3)), "stiffness must not be negative, it has 3 negative eigen"),
    (lambda: of(stiffness=[[1, 2, 0], [1, 9, 0], [0, 0, 1]]), r"\(1, 2\) is 2, \(2, 1\) is 1"),
    (lambda: of(stiffness=np.ones((3, 2))), r"stiffness must be a square matrix, is 3 x 2"),
    (lambda: of(stiffness=np.full((3, 3), math.nan)), "stiffness must be finite, holds nan"),
    (lambda: of(mass=[[1, 1, 0], [1, 1, 0], [0, 0, 1]]), "mass must be positive .* 0 or less"),
    (lambda: of(stiffness=np.eye(3) * (1 + 1j)), "stiffness must be a matrix of real numbers"),
    (lambda: of().structure(outputs="1"), "outputs must be a list of coordinates, is '1'"),
    (lambda: of(stiffness="K"), "stiffness must be a matrix of real numbers, is 'K'"),
    (lambda: of(names=["a", "b"]), "names must be 3, one per coordinate, are 2"),
    (lambda: of(names=["a", "b", "a"]), "names must differ, 'a' is given twice"),
    (
        lambda: of(stiffness=FREE).structure(outputs=[1]),
        "leaves 1 motion free, which no contact holds: fix some coord",
    ),
    (lambda: of().structure(), "outputs are missing"),
    (lambda: of().structure(outputs=["7"]), "outputs must be one of the 3 coordinates .*, is '7'"),
    (lambda: of().structure(outputs=[[1.0, 2.0]]), "outputs must have 3 entries, has 2"),
    (lambda: of().structure(outputs=["1"], fixed=["1"]), "outputs names '1', which is fixed"),
    (lambda: of().structure(outputs=["1"], influence="UX"), "influence must be the direction of"),
    (lambda: of().structure(outputs=["1"], influence=[0, 0, 0]), "influence must not be 0 of all"),
    (lambda: of().structure(outputs=["1"], reduce={"modes": 9}), "reduce.modes .* 1 to 3, is 9"),
    (lambda: of().structure(outputs=["1"], reduce={"error": 0}), "reduce.error must be finite and"),
    (lambda: of().structure(outputs=["1"], reduce={"up_to": 9}), r"first frequency, 0.12\d*, to"),
    (lambda: of().structure(outputs=["1"], reduce={"n": 9}), "must be one of modes, error, up_to"),
    (
        lambda: of().structure(outputs=[1, 2], reduce={"modes": 1}),
        "1 mode cannot distinguish these 2 outputs: give",
    ),
    (lambda: of().structure(outputs=["1", 1]), "outputs must not hold a coordinate twice, as 1"),
    (
        lambda: model().structure(outputs=["1.UY"]),
        r"influence must be the .* \(RZ, UY\).*, is None",
    ),
    (lambda: of((1.0,) * 513, np.eye(513)).structure(outputs=[1]), "reduce is missing: .* has 513"),
    (lambda: with_stop({"error": 1e-18}, n=40), "reduce.error must be at least .*, is 1e-18"),
    (lambda: with_stop({"modes": 4}, fixed=["30.UY"]), r"contact\[0\].direction names '30.UY'"),
    (
        lambda: model(lumped=True).structure([Contact("30.RZ", 1, 1)], influence="UY"),
        "reduce is missing: a contact or slider acts on coordinates without mass",
    ),
    (
        lambda: of().structure([Contact("1", 1, 1)], damping_ratio=[0.1], reduce={"modes": 2}),
        "damping_ratio must have 2 numbers, one per mode, has 1",
    ),
    (
        lambda: of().structure([{"direction": 1, "gap": 0.0, "stiffness": 1.0, "force": 1.0}]),
        r"^contact\[0\] must be of direction, gap, stiffness, damping, tension, restitution, the f",
    ),
    (
        lambda: of().structure(sliders=[{"direction": 1, "stiffness": 1.0}]),
        r"^slider\[0\] must be of direction, stiffness, strength, name, kinetic, returns, back",
    ),
    (lambda: Contact({"a": 0.0}, 1, 1), "must not be 0: such a contact can never be reached"),
    (
        lambda: Structure.from_matrices([1], [[1]], [Contact("1", 1, 1)]),
        r"contact\[0\].direction must be 1 numbers: it names coordinates",
    ),
]


@together("make, said", WRONG)
def test_a_wrong_model_is_refused_in_one_line(make, said):
    with pytest.raises(ValueError, match=said) as caught:
        make()
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.slow
def test_a_large_model_is_reduced_without_a_dense_matrix():
    """A membrane, whose frequencies are known; n x n numbers would take 33 MB."""
    side, n = 45, 45**2
    chain = sparse.diags_array(
        [-np.ones(side - 1), np.full(side, 2.0), -np.ones(side - 1)], offsets=[-1, 0, 1]
    )
    eye = sparse.eye_array(side)
    stiffness = 1e6 * sparse.csr_array(sparse.kron(eye, chain) + sparse.kron(chain, eye))
    middle = str(n // 2 + 1)
    tracemalloc.start()
    stop = Contact(middle, 1e-3, 1e5)
    found = FiniteElements(np.full(n, 2.0), stiffness).structure(
        [stop], [Slider("7", 1e3, 1.0)], outputs=[middle], damping_ratio=0.01, reduce={"modes": 3}
    )
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e7
    assert 1e5 < found.reduction.memory < 2e7
    lowest = 4e6 * np.sin(np.pi / 2 / (side + 1)) ** 2
    assert found.reduction.frequencies[0] == pytest.approx(math.sqrt(lowest), rel=1e-4)


def test_units_that_do_not_fit_are_told():
    assert not [*of().problems]
    assert "the first period is 8209" in next(of(mass=np.full(3, 1e6)).problems)
    assert not [*of(stiffness=FREE).problems]
