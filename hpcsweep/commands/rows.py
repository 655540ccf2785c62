"""Rows of tables, declared as templates of the values that commands are given.

A line declares a row: its name and its text, divided by a bar, and behind another bar what is added
to the text. A row is shown where the values of name and text are there and not None, and what is
added where its own are. ``MAPPING: `` before a name declares a row for each `key` and `value` of a
mapping. Templates are those of `str.format`, also with these formats: ``share`` of a number and its
share, ``percent``, ``counts`` of a mapping, ``size`` of bytes, ``run`` of a described one,
``n NOUN`` of a count.
"""

import string
from collections.abc import Callable, Mapping
from typing import Any

from hpcsweep.commands import Rows
from hpcsweep.studies.run_names import amount, count, run_name


def rows_of(declared: str, values: Mapping[str, Any]) -> Rows:
    """Yield name and text of the declared rows whose values are there."""
    for line in declared.splitlines():
        name, *texts = line.split(" | ")
        each, _, name = name.rpartition(": ")
        entries = (values.get(each) or {}).items() if each else [(None, None)]
        for key, value in entries:
            of_entry = {**values, "key": key, "value": value}
            filled, text, *more = (_filled(template, of_entry) for template in (name, *texts))
            if filled is not None and text is not None:
                yield filled, "".join([text, *filter(None, more)])


def _filled(template: str, values: Mapping[str, Any]) -> str | None:
    try:
        return _TEMPLATES.vformat(template, (), values)
    except KeyError:
        return None


class _Templates(string.Formatter):
    """`str.format` without None, and with the formats of `Row`."""

    def get_field(self, field_name, args, kwargs):
        try:
            field = super().get_field(field_name, args, kwargs)
        except TypeError:  # an entry of None
            raise KeyError(field_name) from None
        if field[0] is None:
            raise KeyError(field_name)
        return field

    def format_field(self, value, format_spec):
        if format_spec.startswith("n "):
            return count(value, format_spec[2:])
        formatter = FORMATS.get(format_spec)
        return formatter(value) if formatter else super().format_field(value, format_spec)


_TEMPLATES = _Templates()
BUSY = 1.1
"""Seconds by the clock over those of processor time, from which on both are told."""


def by_clock(cost: Mapping[str, float]) -> float | None:
    """Return the seconds by the clock where they are more than those of processor time."""
    clock = cost["clock_seconds"]
    return clock if clock > BUSY * cost["core_seconds"] else None


def percent(share: float | None) -> str:
    """Format a share."""
    return "–" if share is None else f"{100 * share:.3g} %"


def share(entry: Mapping) -> str:
    """Format a number of runs, and their share."""
    return f"{entry['runs']} ({percent(entry['share'])})"


def counts(numbers: Mapping[str, int]) -> str:
    """Format the counts that are not 0."""
    return ", ".join(f"{name} {n}" for name, n in numbers.items() if n) or "0"


FORMATS: dict[str, Callable[[Any], str]] = {
    "percent": percent,
    "share": share,
    "counts": counts,
    "run": run_name,
    "size": amount,
}


def inferred_text(count: int, audit: Mapping | None) -> str:
    """Write how many points of a refined map are inferred, and how many of these are wrong."""
    if audit is None:
        return "nothing yet: not complete"
    return (
        f"{count} points; of {audit['drawn']} drawn and computed {audit['wrong']} were wrong: "
        f"{100 * audit['low']:.2g} to {100 * audit['high']:.2g} % of them are (95 %)"
    )
