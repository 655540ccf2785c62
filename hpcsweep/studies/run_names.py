"""Name runs in messages, by what distinguishes them within their study."""

from collections.abc import Mapping
from typing import Any

SYMBOLS = {"omega": "Omega", "amplitude": "A", "direction": ""}


def count(number: int, noun: str) -> str:
    """Format a count."""
    return f"{number} {plural(noun, number)}"


def plural(noun: str, number: int = 2) -> str:
    """Return a noun as it follows a number."""
    return noun if number == 1 else f"{noun}es" if noun.endswith("s") else f"{noun}s"


def written(value: object) -> str:
    """Write the value of a key: whole numbers in full, others with six digits."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def amount(n_bytes: float) -> str:
    """Write a number of bytes in the unit that suits it."""
    for unit, of in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if n_bytes >= of:
            return f"{n_bytes / of:.4g} {unit}"
    return f"{n_bytes:.4g} bytes"


def run_name(described: Mapping[str, Any]) -> str:
    """Format the name of a run, from `Study.describe` or a part of it, on one line."""
    last = [name for name in SYMBOLS if name in described]
    others = [name for name in described if name not in (*SYMBOLS, "outcome")]
    shown = []
    for name in (*others, *last):
        value = written(described[name])
        shown.append(value if name == "direction" else f"{SYMBOLS.get(name, name)} = {value}")
    return ", ".join(shown)
