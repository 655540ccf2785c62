"""The line that tells on a terminal how much is done."""

import sys

import pytest

from hpcsweep.parallel import counted


@pytest.mark.parametrize(
    ("is_terminal", "clock", "told"),
    [
        (True, [0.0, 0.1, 0.6, 0.6, 0.7], "record 1 of 3\r             \r"),
        (True, [0.0, 0.1, 0.2], ""),
        (False, [0.0, 0.6, 1.2], ""),
    ],
)
def test_on_a_terminal_what_is_slow_says_how_much_is_done(
    monkeypatch, capsys, is_terminal, clock, told
):
    times = iter([*clock, *clock[-1:] * 9])
    monkeypatch.setattr(counted.time, "monotonic", lambda: next(times))
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal)
    assert [*counted.counted(iter("abc"), 3, "record")] == ["a", "b", "c"]
    assert capsys.readouterr().err == told
