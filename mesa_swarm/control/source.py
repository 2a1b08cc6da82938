"""What a function is and uses: its source in normal form, and names in its code, found without running it."""

import dis
import inspect
import io
import random
import sys
import textwrap
import tokenize
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from operator import itemgetter
from types import CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

GENERATORS = (np.random.Generator, np.random.RandomState, np.random.BitGenerator, random.Random)
GALLERY = "mesa_swarm.models."
# Packages whose functions and constants are as they are.
COMPUTING = ("numpy", "numba", "scipy", "shapely", "mesa", "mesa_swarm")
# Deepest nesting of values that count.
DEEPEST = 6
# Instead of a value that is neither a number nor a text nor holds such.
NOTHING = "\0nothing"
# The file of code that was compiled from a text.
UNNAMED = "<string>"
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
    if function.__code__.co_filename == UNNAMED:  # Python 3.13 has the source of `python -c` under the same name
        return ""
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
                yield tokenize.OP, _text_between(rows, begin, token.end)
        elif not depth and token.type not in SKIPPED:
            yield token.type, token.string


def _text_between(rows: list[str], begin: tuple[int, int], end: tuple[int, int]) -> str:
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
    is_generator = isinstance(value, GENERATORS) or isinstance(getattr(value, "__self__", None), GENERATORS)
    return is_generator or home == "random" or home.startswith("numpy.random")


def functions_used(function: FunctionType) -> list[FunctionType]:
    """Return a function and the functions in reach by the names that it uses, compiled ones as they were written."""
    functions = [function]
    for part in functions:
        values = (getattr(value, "py_func", value) for _, value in values_used(part))
        functions += [value for value in values if isinstance(value, FunctionType) and value not in functions]
    return functions


def values_used(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Yield the global and enclosing names that a function uses, with what they stand for now."""
    names = operands(function, "LOAD_GLOBAL", "LOAD_NAME")
    yield from ((name, function.__globals__[name]) for name in sorted(names) if name in function.__globals__)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:  # not yet assigned
            continue


def attributes_used(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Yield dotted names that a function reads of modules, classes and plain objects, with what they stand for now.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> gains = SimpleNamespace(turn=0.5)
    >>> def turning(me):
    ...     return -gains.turn, gains.turn
    >>> list(attributes_used(FunctionType(turning.__code__, {"gains": gains})))
    [('gains.turn', 0.5), ('gains.turn', 0.5)]
    """
    values = dict(values_used(function))
    for code in _codes(function):
        path, value = "", None
        for step in dis.get_instructions(code):
            if step.opname in ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_DEREF"):
                path, value = (step.argval, values[step.argval]) if step.argval in values else ("", None)
            elif (
                path and step.opname in ("LOAD_ATTR", "LOAD_METHOD") and step.argval in (held := _attributes_of(value))
            ):
                path, value = f"{path}.{step.argval}", held[step.argval]
                yield path, value
            else:
                path = ""


def _attributes_of(owner: Any) -> dict[str, Any]:
    """Return the attributes of a module, a class or a plain object; none of other packages, which are constant."""
    if isinstance(owner, type):
        return {name: value for base in reversed(owner.__mro__) for name, value in vars(base).items()}
    if isinstance(owner, ModuleType) and is_python_or_numeric(owner.__name__):
        return {}
    return dict(getattr(owner, "__dict__", {}))


def is_python_or_numeric(module: str) -> bool:
    """Return whether a module belongs to Python, or to a package that computes."""
    package = module.partition(".")[0]
    is_python = package in sys.stdlib_module_names and package != "__main__"
    return (is_python or package in COMPUTING) and not module.startswith(GALLERY)


@dataclass(frozen=True, slots=True)
class Read:
    """What a function and those that it calls read besides their arguments, as it was: sources, and values by name."""

    sources: tuple[str, ...]
    values: tuple[tuple[str, Any], ...]


def what_is_read(function: FunctionType) -> Read:
    """Return what a function, and the functions in its reach outside this package, read besides arguments.

    Examples
    --------
    >>> def ahead(me):
    ...     return gain * me.max_speed, 1.0
    >>> what_is_read(FunctionType(ahead.__code__, {"gain": 0.5})).values
    (('gain', 0.5),)
    """
    parts, values = [function], []
    for part in parts:
        if part is not function:
            values += [(f"{part.__name__}.{name}", freeze(value)) for name, value in _defaults_of(part)]
        # By name: the order of operations is not the same for every version of Python.
        attributes = sorted(dict(attributes_used(part)).items(), key=itemgetter(0))
        for name, value in (*values_used(part), *attributes):
            functions = _functions_in(value)
            others = [function for function in functions if not is_python_or_numeric(function.__module__ or "")]
            parts += [function for function in others if function not in parts]
            if not functions and (plain := freeze(value)) is not NOTHING:
                values.append((name, plain))
    return Read(tuple(normal_source(part) or part.__qualname__ for part in parts), tuple(dict.fromkeys(values)))


def _defaults_of(function: FunctionType) -> list[tuple[str, Any]]:
    code, defaults = function.__code__, function.__defaults__ or ()
    names = code.co_varnames[: code.co_argcount]
    by_place = zip(names[len(names) - len(defaults) :], defaults, strict=True)
    return [*by_place, *sorted((function.__kwdefaults__ or {}).items())]


def _functions_in(value: Any) -> list[FunctionType]:
    """Return a function, as it was written if it is compiled, or those in a list of functions."""
    items = value if isinstance(value, (list, tuple)) else [value]
    functions = [getattr(item, "py_func", item) for item in items]
    return [function for function in functions if isinstance(function, FunctionType)]


def freeze(value: Any, depth: int = 0) -> Any:
    """Return numbers, texts, arrays and what holds such as a value that does not change and has a hash.

    Of anything else `NOTHING`.
    """
    if value is None or type(value) in (bool, int, float, str, bytes, complex):
        return value
    if isinstance(value, np.generic):
        number = freeze(value.item(), depth)
        return number if value.dtype.kind == "b" or value.dtype.itemsize == 8 else (value.dtype.str, number)
    if isinstance(value, np.ndarray):
        return (value.shape, value.dtype.str, value.tobytes()) if value.dtype.kind in "biufcSU" else NOTHING
    if isinstance(value, (SimpleNamespace, dict)) or (is_dataclass(value) and not isinstance(value, type)):
        pairs = value.items() if isinstance(value, dict) else _fields_of(value)
        items: Iterable = sorted(pairs, key=lambda pair: repr(pair[0]))
    elif isinstance(value, (set, frozenset)):
        items = sorted(value, key=repr)
    elif isinstance(value, (list, tuple)):
        items = value
    else:
        return NOTHING
    if depth > DEEPEST:
        return NOTHING
    inner = tuple(freeze(item, depth + 1) for item in items)
    return NOTHING if inner and all(item is NOTHING for item in inner) else inner


def _fields_of(value: Any) -> list[tuple[str, Any]]:
    if isinstance(value, SimpleNamespace):
        return list(vars(value).items())
    return [(field.name, getattr(value, field.name)) for field in fields(value)]


def _codes(function: FunctionType) -> list[CodeType]:
    """Return the code of a function, and code nested in it."""
    codes = [function.__code__]
    for code in codes:
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return codes


def operations(function: FunctionType) -> set[str]:
    """Return the names of the operations in a function's code, and code nested in it."""
    return {step.opname for code in _codes(function) for step in dis.get_instructions(code)}


def operands(function: FunctionType, *operations: str) -> set[str]:
    """Return the names on which the function's code, and code nested in it, does one of these operations."""
    steps = (step for code in _codes(function) for step in dis.get_instructions(code))
    return {step.argval for step in steps if step.opname in operations}
