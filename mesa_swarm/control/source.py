"""What a function is and uses: its source in normal form, and names in its code, found without running it."""

import dis
import inspect
import io
import random
import textwrap
import tokenize
from collections.abc import Iterator
from functools import cache
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

GENERATORS = (np.random.Generator, np.random.RandomState, np.random.BitGenerator, random.Random)
# Tokens that are layout; what they separate is separated by their numbers.
LAYOUT = {tokenize.NEWLINE: ";", tokenize.INDENT: "{", tokenize.DEDENT: "}"}
SKIPPED = (tokenize.COMMENT, tokenize.NL, tokenize.ENCODING, tokenize.ENDMARKER)
# From Python 3.12 on a formatted string is several tokens.
BEGIN, END = (getattr(tokenize, f"FSTRING_{name}", None) for name in ("START", "END"))


@cache
def normal_source(function: FunctionType) -> str:
    """Return the source of a function without comments, decorators, docstrings and layout, an empty text if unknown.

    The same for every version of Python, other than bytecode and what `ast.unparse` returns.

    Examples
    --------
    >>> def ahead(me):
    ...     '''Drive on.'''
    ...     return me.max_speed, me.max_speed  # both wheels
    >>> normal_source(ahead)
    'def ahead ( me ) : ; { return me . max_speed , me . max_speed ; }'
    """
    try:
        text = textwrap.dedent(inspect.getsource(function))
        lines = list(_logical_lines(text))
    except (OSError, TypeError, SyntaxError, tokenize.TokenError):  # of a function that was typed in or generated
        return ""
    first = next((place for place, line in enumerate(lines) if line[0] != "@"), 0)
    return " ".join(part for line in lines[first:] for part in line)


def _logical_lines(text: str) -> Iterator[list[str]]:
    """Yield the words of each statement, the layout that ends it included, but no statement that is a text alone."""
    line: list[str] = []
    is_text = True
    for kind, word in _words(text):
        line.append(LAYOUT.get(kind, word))
        is_text = is_text and kind in (tokenize.STRING, tokenize.NEWLINE)
        if kind in LAYOUT:
            if not is_text or kind != tokenize.NEWLINE:
                yield line
            line, is_text = [], True


def _words(text: str) -> Iterator[tuple[int, str]]:
    """Yield kind and text of each token that counts, a formatted string as one of them."""
    rows, depth, begin = text.splitlines(keepends=True), 0, (0, 0)
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == BEGIN:
            begin, depth = (begin if depth else token.start), depth + 1
        elif token.type == END:
            depth -= 1
            if not depth:
                yield tokenize.OP, _between(rows, begin, token.end)
        elif not depth and token.type not in SKIPPED:
            yield token.type, token.string


def _between(rows: list[str], begin: tuple[int, int], end: tuple[int, int]) -> str:
    """Return the text between two places, given as row from 1 and column from 0."""
    if begin[0] == end[0]:
        return rows[begin[0] - 1][begin[1] : end[1]]
    inner = rows[begin[0] : end[0] - 1]
    return "".join([rows[begin[0] - 1][begin[1] :], *inner, rows[end[0] - 1][: end[1]]])


def uses_attribute(function: FunctionType, name: str) -> bool:
    """Return whether a function, or one that it calls by name, reads an attribute of this name."""
    return any(name in operands(part, "LOAD_ATTR", "LOAD_METHOD") for part in functions_used(function))


def own_randomness(function: FunctionType) -> str | None:
    """Return the name of a source of random numbers that the function uses, or None."""
    for part in functions_used(function):
        attributes = operands(part, "LOAD_ATTR", "LOAD_METHOD", "IMPORT_FROM")
        for name, value in values_used(part):
            if value is np and "random" in attributes:
                return f"{name}.random"
            if _is_random(value):
                return name
        for name in operands(part, "IMPORT_NAME"):
            if name in ("random", "numpy.random") or (name == "numpy" and "random" in attributes):
                return name
    return None


def _is_random(value: Any) -> bool:
    if isinstance(value, ModuleType):
        return value.__name__ in ("random", "numpy.random")
    home = str(getattr(value, "__module__", ""))
    made = isinstance(value, GENERATORS) or isinstance(getattr(value, "__self__", None), GENERATORS)
    return made or home == "random" or home.startswith("numpy.random")


def functions_used(function: FunctionType) -> list[FunctionType]:
    """Return a function and the functions in reach by the names that it uses, compiled ones as they were written."""
    found = [function]
    for part in found:
        called = (getattr(value, "py_func", value) for _, value in values_used(part))
        found += [value for value in called if isinstance(value, FunctionType) and value not in found]
    return found


def values_used(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Yield the global and enclosing names that a function uses, with what they stand for now."""
    names = operands(function, "LOAD_GLOBAL", "LOAD_NAME")
    yield from ((name, function.__globals__[name]) for name in sorted(names) if name in function.__globals__)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:  # not yet assigned
            continue


def operands(function: FunctionType, *operations: str) -> set[str]:
    """Return the names on which the function's code, and code nested in it, does one of these operations."""
    codes = [function.__code__]
    for code in codes:
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    steps = (step for code in codes for step in dis.get_instructions(code))
    return {step.argval for step in steps if step.opname in operations}
