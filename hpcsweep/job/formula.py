"""Formulas that tie one parameter of a job to others: ``0.7 * omega**2``."""

import ast
import math
from collections.abc import Callable, Collection

MAX_LETTERS = 200
"""Of a formula: its brackets cannot be nested too deeply."""
FUNCTIONS = ("sqrt", "exp", "log", "sin", "cos", "tan")
KNOWN = {name: getattr(math, name) for name in (*FUNCTIONS, "pi")}
ARITHMETIC = (
    *(ast.BinOp, ast.UnaryOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd),
)
FORM = f"must be of numbers, names, + - * / **, brackets, pi and {', '.join(FUNCTIONS)}"


def formula(text: str, names: Collection[str]) -> tuple[Callable[..., float], str]:
    """Return a function of keywords with the value of a formula and its text.

    The value is infinite where it overflows, NaN where there is none; the text is the same however
    the formula is written.

    Parameters
    ----------
    text : str
    names : collection of str
        What it may be of, beside `KNOWN`.

    Raises
    ------
    ValueError
        If it is no formula of these; the message is the limit that it breaks.
    """
    if len(text) > MAX_LETTERS:
        raise ValueError(f"must have {MAX_LETTERS} letters at most")
    try:
        tree = ast.parse(text.strip(), mode="eval")
        one_way = ast.unparse(tree)
        for node in ast.walk(tree.body):
            _check(node, names)
        code = compile(tree, "formula", "eval")
    except (SyntaxError, RecursionError, MemoryError, OverflowError):
        raise ValueError(FORM) from None

    def value(**given: float) -> float:
        try:
            result = eval(code, {"__builtins__": {}, **KNOWN}, given)
        except OverflowError:
            return math.inf
        except (ArithmeticError, ValueError, TypeError):
            return math.nan
        return result if isinstance(result, float) else math.nan  # neither complex nor a function

    return value, one_way


def _check(node: ast.AST, names: Collection[str]) -> None:
    """Refuse all but arithmetic of known names; make numbers real."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        assert isinstance(node.value, int | float)
        node.value = float(node.value)
    elif isinstance(node, ast.Name):
        if node.id not in names and node.id not in KNOWN:
            raise ValueError(f"knows no {node.id!r}, only {', '.join(names)}; {FORM}")
    elif isinstance(node, ast.Call):
        is_function = isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS
        if not is_function or len(node.args) != 1 or node.keywords:
            raise ValueError(FORM)
    elif not isinstance(node, (*ARITHMETIC, ast.Load)):
        raise ValueError(FORM)
