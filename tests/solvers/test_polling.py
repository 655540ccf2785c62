"""How motions are cut into pieces of bounded time."""

import itertools

import pytest

from hpcsweep.solvers import polling as pieces
from hpcsweep.solvers.polling import GROWTH, PIECE_SECONDS, POLL_PERIODS, Polling


class Clock:
    def __init__(self):
        self.now = 0.0

    def perf_counter(self):
        return self.now


@pytest.mark.parametrize("period_seconds", [1e-6, 1e-3, 2.0])
def test_pieces_grow_to_what_fits_into_their_time(period_seconds, monkeypatch):
    clock = Clock()
    monkeypatch.setattr(pieces, "time", clock)
    cutter, polls, sizes, end = Polling(), [], [], 0
    for first, last in cutter.cut(10_000, lambda: polls.append(1)):
        assert first == end
        end = last
        sizes.append(last - first)
        clock.now += (last - first) * period_seconds
    assert end == 10_000
    assert len(polls) == len(sizes)
    assert sizes[0] == 1
    assert all(after <= GROWTH * before for before, after in itertools.pairwise(sizes))
    assert max(sizes) <= max(1, min(POLL_PERIODS, PIECE_SECONDS / period_seconds * (1 + 1e-9)))
    # what one motion took is known when the next begins
    begun = next(cutter.cut(10_000))
    assert begun[0] == 0
    fitting = max(1, min(POLL_PERIODS, PIECE_SECONDS / period_seconds))
    assert begun[1] == pytest.approx(fitting, abs=1)


def test_pieces_shrink_when_periods_become_slow(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(pieces, "time", clock)
    cutter = Polling()
    for first, last in cutter.cut(20_000):
        clock.now += (last - first) * 1e-6
    sizes = []
    for first, last in cutter.cut(20_000):
        sizes.append(last - first)
        clock.now += (last - first) * 1e-4
    assert sizes[0] == POLL_PERIODS
    assert sizes[1] == pytest.approx(PIECE_SECONDS / 1e-4, abs=1)


def test_without_periods_there_is_one_poll_and_no_piece():
    polls = []
    assert list(Polling().cut(0, lambda: polls.append(1))) == []
    assert polls == [1]
