"""A table of cases that one rule decides: one test."""

import functools
import inspect
from collections.abc import Callable, Iterable


def together(names: str, cases: Iterable) -> Callable:
    """Run a test of all cases, where ``pytest.mark.parametrize`` makes a test of each.

    Its fixtures are made once: a case leaves nothing there that another one finds. The first case
    that fails ends it, and is told.
    """
    keys = [name.strip() for name in names.split(",")]

    def decorate(test: Callable) -> Callable:
        signature = inspect.signature(test)

        @functools.wraps(test)
        def whole(**fixtures) -> None:
            number = -1
            for number, case in enumerate(cases):
                given = dict(zip(keys, case if len(keys) > 1 else (case,), strict=True))
                try:
                    test(**fixtures, **given)
                except BaseException as error:
                    error.add_note(f"case {number}: {given}")
                    raise
            assert number >= 0, "no case"

        left = [p for name, p in signature.parameters.items() if name not in keys]
        whole.__signature__ = signature.replace(parameters=left)  # type: ignore[attr-defined]
        return whole

    return decorate
