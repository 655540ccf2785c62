"""Refined maps of labels that are known everywhere: cells, rounds, and what the audit promises."""

import numpy as np
import pytest
from together import together

from hpcsweep.dynamics.shares import share_interval
from hpcsweep.studies.refine.audit import ALPHA, draw, interval, n_allowed, n_drawn
from hpcsweep.studies.refine.cells import WRONG, Cells, Counts, Labels
from hpcsweep.studies.refine.growth import KnownCurve, crossed_boxes
from hpcsweep.studies.refine.rounds import RefinementRounds, n_least
from hpcsweep.studies.refinement import Refinement, Source


def bands(shape, seed) -> np.ndarray:
    """Wide fields of three labels, and thin tongues of a fourth that corners of cells miss."""
    rng = np.random.default_rng(seed)
    axes = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
    waves = sum(
        np.sin(sum(rng.uniform(3, 9) * axis for axis in axes) + rng.uniform(0, 6)) for _ in range(3)
    )
    labels = 1 + (waves > 0.4) + (waves > 1.2)
    for _ in range(4):
        labels[np.abs(axes[0] - rng.uniform() - 0.3 * axes[1]) < 0.004 * rng.uniform()] = 4
    return labels.ravel()


def walk(truth, shape, refinement, known=(), cost=1, crossed=None):
    """Walk all rounds; the labels, and the points of each round."""
    cost = np.broadcast_to(cost, truth.shape)
    labels, asked = Labels(truth.size), []
    rounds = RefinementRounds(shape, refinement, labels, crossed)

    def learn(points):
        told = np.stack([truth[points] == 0, truth[points], cost[points]], axis=1)
        labels.store(points, told.astype(np.uint64))

    learn(np.array(known, int))
    for points in rounds:
        asked.append(points)
        learn(points)
    return rounds, labels, asked


def inferred_and_wrong(truth, rounds, labels):
    level, code = rounds.inferred()
    inferred = np.flatnonzero(level)
    told = np.array([0] + [label[1] for label in labels.codes])[code[inferred]]
    return inferred, int((told != truth[inferred]).sum())


@together("shape", [(70, 53), (12, 30, 17), (2, 90), (33, 33)])
def test_points_that_are_inferred_lie_in_cells_that_agree_or_may_be_left(shape):
    truth = bands(shape, 1)
    rounds, labels, asked = walk(truth, shape, Refinement(3, wrong=0.05))
    inferred, wrong = inferred_and_wrong(truth, rounds, labels)
    assert np.array_equal(inferred, np.flatnonzero(rounds.source == Source.UNKNOWN))
    assert inferred.size + sum(map(len, asked)) == truth.size
    assert np.unique(np.concatenate(asked)).size == truth.size - inferred.size
    assert wrong <= rounds.looks[-1].high * inferred.size
    level = rounds.inferred()[0].reshape(shape)
    assert (level < 0).sum() <= n_allowed(0.05, 1, truth.size) / WRONG
    told = np.where(level != 0, -1, truth.reshape(shape))
    for point in map(tuple, np.argwhere(level)[::7]):
        size = 2 ** abs(int(level[point]))
        box = tuple(
            slice(k // size * size, min(k // size * size + size, n - 1) + 1)
            if k < n - 1
            else slice((n - 2) // size * size, n)
            for k, n in zip(point, shape, strict=True)
        )
        seen = told[box]
        assert (np.unique(seen[seen >= 0]).size == 1) == (level[point] > 0)
        assert all(told[corner] >= 0 for corner in _corners(box))


def _corners(box):
    return [
        tuple(b.start if end else b.stop - 1 for b, end in zip(box, at, strict=True))
        for at in np.ndindex(*(2,) * len(box))
    ]


def test_of_one_label_corners_and_centres_and_a_draw_are_computed():
    truth = np.ones(65 * 33, int)
    rounds, _, asked = walk(truth, (65, 33), Refinement(4, wrong=0.1))
    assert [len(points) for points in asked] == [5 * 3 + 4 * 2, n_drawn(0.1, 1, truth.size)]
    (look,) = rounds.looks
    assert (look.wrong, look.low) == (0, 0.0)
    high = share_interval(0, look.drawn, 1 - ALPHA / 2)[1] * look.inferred / look.left
    assert look.high == pytest.approx(high)


def test_the_costliest_cells_are_left_and_inferred_from_the_nearest_points():
    """A quarter of the map is speckled: costly speckles are left, cheap ones cut."""
    shape, rng = (200, 240), np.random.default_rng(4)
    truth = np.ones(shape, int)
    truth[100:, 120:] = rng.integers(1, 4, (100, 120))
    cost = np.where(np.arange(240) < 180, 10, 1000) * np.ones((200, 1), int)
    rounds, labels, _ = walk(truth.ravel(), shape, Refinement(4, wrong=0.02), (), cost.ravel())
    inferred, wrong = inferred_and_wrong(truth.ravel(), rounds, labels)
    left = rounds.inferred()[0].reshape(shape) < 0
    assert left[101:, 181:].mean() > 0.05
    assert not left[:, :179].any()
    assert 0.2 * wrong < WRONG * left.sum() < 5 * wrong
    assert wrong <= rounds.looks[-1].high * inferred.size < 0.02 * inferred.size


def test_of_equally_near_points_the_first_axis_counts_first():
    cells, labels = Cells((3, 3), 1), Labels(9)
    labels.store(np.array([0, 2, 4, 6, 8]), np.array([[0, k, 1] for k in (1, 2, 3, 4, 5)], "u8"))
    cells.learn(cells.corners_and_centres(), labels)
    assert cells.cut(allowed=WRONG * 4).size == 0
    level, code = cells.inferred()
    assert level.tolist() == [0, -1, 0, -1, 0, -1, 0, -1, 0]
    assert code[[1, 3, 5, 7]].tolist() == [3, 1, 2, 3]
    assert cells.cut().tolist() == list(range(9))


def test_a_failed_run_agrees_with_nothing():
    truth = np.ones((33, 33), int)
    truth[16, 16] = 0
    rounds, _, _ = walk(truth.ravel(), (33, 33), Refinement(4, wrong=0.5))
    level = rounds.inferred()[0].reshape(33, 33)
    assert not level[15:18, 15:18].any()
    assert level[3, 5] == 3


def test_who_knows_more_walks_the_same_rounds():
    shape, refinement = (64, 50), Refinement(3, wrong=0.02)
    truth = bands(shape, 2)
    rounds, _, asked = walk(truth, shape, refinement)
    known = np.random.default_rng(0).permutation(truth.size)[:900]
    again, _, same = walk(truth, shape, refinement, known)
    assert len(same) == len(asked)
    assert all(map(np.array_equal, same, asked))
    assert again.looks == rounds.looks
    assert np.array_equal(again.source, rounds.source)


def test_a_draw_depends_on_seed_and_look_and_is_even():
    points = np.arange(100, 4100)
    first = draw(points, 400, 0, 1)
    assert np.array_equal(first, draw(points, 400, 0, 1))
    assert np.unique(first).size == 400
    assert np.array_equal(draw(points, 4000, 5, 2), points)
    others = [draw(points, 400, seed, look) for seed, look in ((1, 1), (0, 2), (0, 3))]
    for other in others:
        assert 15 < np.intersect1d(first, other).size < 75  # 40 +- 6 of two independent draws
    counts = np.histogram(np.concatenate([draw(points, 400, s, 1) for s in range(50)]), 10)[0]
    assert np.all(np.abs(counts - 2000) < 250)


def test_the_interval_counts_what_was_found_and_what_changed():
    plain = share_interval(3, 500, 1 - ALPHA / 2)
    low, high = interval(1, 10_000, 500, 3, 0, 0, 10_000)
    assert (low, high) == pytest.approx(plain)
    low, high = interval(1, 10_000, 500, 3, 20, 5, 9_000)
    assert high == pytest.approx((plain[1] * 10_000 - 20 + 5) / 9_000)
    assert low == 0.0
    # 40 of 500 are wrong: at least n times the lower end, less what was found and what changed
    low, _ = interval(1, 10_000, 500, 40, 20, 5, 9_000)
    assert low == pytest.approx((share_interval(40, 500, 1 - ALPHA / 2)[0] * 10_000 - 25) / 9_000)
    assert low > 0
    assert interval(1, 500, 500, 3, 3, 0, 0) == (0.0, 0.0)


@pytest.mark.slow
def test_the_interval_holds_the_share_of_wrong_points():
    """Of 100 maps and seeds 95 % must; each allows 0.5 % of wrong points."""
    shape, held = (150, 120), 0
    for seed in range(100):
        truth = bands(shape, seed)
        rounds, labels, _ = walk(truth, shape, Refinement(4, wrong=0.005, seed=seed))
        inferred, wrong = inferred_and_wrong(truth, rounds, labels)
        look = rounds.looks[-1]
        assert look.high < 0.005
        held += look.low <= wrong / max(inferred.size, 1) <= look.high
    assert held >= 95


def tongue(shape) -> tuple[np.ndarray, list[KnownCurve]]:
    """One field with a tongue of a twelfth of a step of the coarsest cells, and its borders."""
    x, y = np.linspace(0, 1, shape[-2]), np.linspace(0, 1, shape[-1])
    left = 0.31 + 0.3 * y
    inside = (x[:, None] > left - 0.004) & (x[:, None] < left + 0.004)
    borders = [np.stack((left + half, y), axis=1)[[0, -1]] for half in (-0.004, 0.004)]
    return np.where(inside, 2, 1), [KnownCurve((1,) * (len(shape) - 2), one) for one in borders]


@together("shape", [(161, 97), (3, 161, 97)])
def test_a_thin_tongue_is_missed_without_its_curve_and_found_with_it(shape):
    plane, borders = tongue(shape)
    truth = np.ones(shape, int)
    truth[(..., slice(None), slice(None)) if len(shape) == 2 else 1] = plane
    truth = truth.ravel()
    axes = [np.linspace(0, 1, n) for n in shape[-2:]]
    crossed = crossed_boxes(shape, axes, borders)
    refinement = Refinement(4, wrong=0.05)
    missed, found = (walk(truth, shape, refinement, crossed=one) for one in (None, crossed))
    n_tongue = int((truth == 2).sum())
    assert n_tongue > 90
    # the audit's draws apart, not one of the coarse cells sees it
    assert (truth[missed[0].source != Source.UNKNOWN] == 2).sum() < 0.1 * n_tongue
    _, wrong = inferred_and_wrong(truth, *found[:2])
    assert wrong == 0
    assert not found[0].inferred()[1][truth == 2].any()
    assert (found[0].source != Source.UNKNOWN).mean() < 0.3
    # what is known before, in any order, changes nothing
    again = walk(truth, shape, refinement, known=np.flatnonzero(truth == 2)[::-3], crossed=crossed)
    assert np.array_equal(again[0].source, found[0].source)
    assert all(map(np.array_equal, again[2], found[2]))
    assert n_least(shape, refinement, crossed) > n_least(shape, refinement)


def test_boxes_on_both_sides_of_a_curve_along_a_line_of_the_grid():
    axes = [np.array([0.0, 1.0, 2.0, 4.0]), np.array([0.0, 1.0, 2.0])]
    along = crossed_boxes((4, 3), axes, [KnownCurve((), np.array([[1.0, 0.1], [1.0, 0.9]]))])
    assert np.argwhere(along).tolist() == [[0, 0], [1, 0]]
    point = crossed_boxes((4, 3), axes, [KnownCurve((), np.array([[3.0, 2.0]]))])
    assert np.argwhere(point).tolist() == [[2, 1]]
    beyond = crossed_boxes((4, 3), axes, [KnownCurve((), np.array([[-9.0, 0.5], [9.0, 0.5]]))])
    assert np.argwhere(beyond).tolist() == [[0, 0], [1, 0], [2, 0]]
    assert not crossed_boxes(
        (4, 3), axes, [KnownCurve((), np.array([[4.5, 0.0], [9.0, 2.0]]))]
    ).any()
    slices = crossed_boxes((4, 4, 3), axes, [KnownCurve((2,), np.array([[0.5, 1.5], [3.0, 1.6]]))])
    assert np.argwhere(slices).tolist() == [[k, i, 1] for k in (1, 2) for i in (0, 1, 2)]


@together("seed", range(4))
def test_the_boxes_of_a_polyline_are_those_that_many_points_on_it_lie_in(seed):
    rng = np.random.default_rng(seed)
    axes = [np.sort(rng.uniform(0, 1, n)) for n in (23, 41)]
    line = np.cumsum(rng.normal(0, 0.15, (30, 2)), axis=0) + 0.5
    crossed = crossed_boxes((23, 41), axes, [KnownCurve((), line)])
    t = np.linspace(0, 29, 400_001)
    dense = np.stack([np.interp(t, np.arange(30), line[:, k]) for k in (0, 1)], axis=1)
    seen = np.zeros_like(crossed)
    at = [np.searchsorted(axis, dense[:, k]) - 1 for k, axis in enumerate(axes)]
    inside = (at[0] >= 0) & (at[0] < 22) & (at[1] >= 0) & (at[1] < 40)
    seen[at[0][inside], at[1][inside]] = True
    assert seen.sum() > 40
    # corners that are cut by less than the distance of the points may be missed by these
    assert not (seen & ~crossed).any()
    assert (crossed & ~seen).sum() <= 2
    counts = Counts(crossed)
    begin = rng.integers(0, (10, 20), (50, 2))
    end = begin + rng.integers(1, (12, 20), (50, 2))
    for low, high, count in zip(begin, end, counts.between(begin, end).tolist(), strict=True):
        assert count == crossed[low[0] : high[0], low[1] : high[1]].sum()
