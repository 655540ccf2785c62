"""Rows of tables as declarations: templates of the values that commands are given."""

import string
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from hpcsweep.commands import Rows
from hpcsweep.studies.run_names import count, run_name


class Row(NamedTuple):
    """A row, shown where the values of its name and of its first piece are there and not None.

    Templates are those of `str.format`; of a format, too: ``share`` of a number and its share,
    ``percent``, ``counts`` of a mapping, ``run`` of a described one, and ``n NOUN`` of a count.

    Attributes
    ----------
    name, text : str
        Templates.
    more : str
        Template of what is added to the text where its own values are there.
    each : str
        Name of a mapping, of which there is a row for each `key` and `value`.
    """

    name: str
    text: str
    more: str = ""
    each: str = ""


def rows_of(declared: Iterable[Row], values: Mapping[str, Any]) -> Rows:
    """Yield name and text of the declared rows whose values are there."""
    for row in declared:
        entries = (values.get(row.each) or {}).items() if row.each else [(None, None)]
        for key, value in entries:
            own = {**values, "key": key, "value": value}
            name, text, more = (_filled(each, own) for each in row[:3])
            if name is not None and text is not None:
                yield name, text + (more or "")


def _filled(template: str, values: Mapping[str, Any]) -> str | None:
    try:
        return _TEMPLATES.vformat(template, (), values)
    except KeyError:
        return None


class _Templates(string.Formatter):
    """`str.format` without None, and with the formats of `Row`."""

    def get_field(self, field_name, args, kwargs):
        try:
            found = super().get_field(field_name, args, kwargs)
        except TypeError:  # an entry of None
            raise KeyError(field_name) from None
        if found[0] is None:
            raise KeyError(field_name)
        return found

    def format_field(self, value, format_spec):
        if format_spec.startswith("n "):
            return count(value, format_spec[2:])
        known = FORMATS.get(format_spec)
        return known(value) if known else super().format_field(value, format_spec)


_TEMPLATES = _Templates()


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
}


def inferred_text(count: int, audit: Mapping | None) -> str:
    """Write how many points of a refined map are inferred, and how many of these are wrong."""
    if audit is None:
        return "nothing yet: not complete"
    return (
        f"{count} points; of {audit['drawn']} drawn and computed {audit['wrong']} were wrong: "
        f"{100 * audit['low']:.2g} to {100 * audit['high']:.2g} % of them are (95 %)"
    )
