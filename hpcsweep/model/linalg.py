"""scipy.linalg, loaded without parts of numpy that nobody asks for.

scipy takes every name that numpy has, and so makes it load f2py, its tests and more, on every rank.
While scipy is loaded, names that numpy has not loaded yet stand for modules that are loaded when
something of them is asked.
"""

import contextlib
import importlib
import types
from collections.abc import Iterator

import numpy as np


class _Later(types.ModuleType):
    """A module that is loaded when something of it is asked."""

    def __getattr__(self, name: str) -> object:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(importlib.import_module(self.__name__), name)


@contextlib.contextmanager
def _sparing_numpy() -> Iterator[None]:
    """Let names stand for what numpy has not loaded; take back those that nobody asked for."""
    missing = [name for name in np.__all__ if name not in vars(np)]
    for name in missing:
        setattr(np, name, _Later(f"numpy.{name}"))
    try:
        yield
    finally:
        for name in missing:
            if isinstance(vars(np).get(name), _Later):
                delattr(np, name)


with _sparing_numpy():
    from scipy.linalg import eigh, expm

__all__ = ["eigh", "expm"]
