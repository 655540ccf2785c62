"""Rows of tables are declared once, and shown as far as their values are there."""

from hpcsweep.commands import listing
from hpcsweep.commands.rows import rows_of
from hpcsweep.studies.run_names import amount

DECLARED = """\
{noun}s | {done:n run} of {all} | , {left:.2f} s left
master | {master[messages]} messages
sources: by {key} | {value:share}
outcomes | {outcomes:counts}
at | {place:run}
"""


def test_a_row_is_shown_where_its_values_are_there_and_what_is_added_where_that_is():
    values = {"noun": "point", "done": 1, "all": 3, "left": None, "master": None}
    assert [*rows_of(DECLARED, values)] == [("points", "1 run of 3")]
    values |= {"left": 1.234, "master": {"messages": 7}}
    told = dict(rows_of(DECLARED, values))
    assert told == {"points": "1 run of 3, 1.23 s left", "master": "7 messages"}


def test_mappings_have_a_row_for_each_entry_and_formats_of_their_own():
    sources = {"seed": {"runs": 1, "share": 0.25}, "search": {"runs": 0, "share": None}}
    place = {"omega": 0.5, "amplitude": 0.1, "direction": "up"}
    values = {"sources": sources, "outcomes": {"STEP_LIMIT": 0, "NON_FINITE": 2}, "place": place}
    assert [*rows_of(DECLARED, values)] == [
        ("by seed", "1 (25 %)"),
        ("by search", "0 (–)"),
        ("outcomes", "NON_FINITE 2"),
        ("at", "Omega = 0.5, A = 0.1, up"),
    ]
    sizes = [amount(n) for n in (12, 76680, 1e6, 10.25e9)]
    assert sizes == ["12 bytes", "76.68 kB", "1 MB", "10.25 GB"]


def test_a_long_name_has_a_line_of_its_own():
    rows = [("a", "1"), ("four", "2"), ("a name " * 6, "3")]
    told = listing("title", rows).splitlines()
    assert told == ["title", "  a     1", "  four  2", f"  {'a name ' * 6}", "        3"]
