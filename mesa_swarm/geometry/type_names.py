"""Types of arguments of compiled functions in words: the same in every process, and read back."""

import re
from typing import Any, cast

from numba import types


def in_words(kind: Any) -> str:
    """Return a type in words that do not depend on Numba's version, nor on addresses.

    Examples
    --------
    >>> in_words(types.Tuple((types.Array(types.float64, 2, "C"), types.none)))
    '(float64[2C] none)'
    """
    if isinstance(kind, types.Array):
        return f"{kind.dtype}[{kind.ndim}{kind.layout}{'' if kind.mutable else 'r'}]"
    if isinstance(kind, types.BaseTuple):
        return f"({' '.join(in_words(part) for part in cast(Any, kind))})"
    return re.sub(r" at 0x[0-9a-f]+", "", str(kind))


def types_in_words(words: str) -> tuple[Any, ...]:
    """Return the types that these words name: arrays, numbers and tuples of these.

    Raises
    ------
    LookupError
        If there is another type.

    Examples
    --------
    >>> types_in_words("float64[2C] (int64 none)")
    (Array(float64, 2, 'C', False, aligned=True), Tuple((int64, none)))
    """
    open_tuples: list[list[Any]] = [[]]
    for token in re.findall(r"[()]|[^\s()]+", words):
        if token == "(":
            open_tuples.append([])
        elif token == ")":
            parts = open_tuples.pop()
            open_tuples[-1].append(types.BaseTuple.from_types(tuple(parts)))
        else:
            open_tuples[-1].append(_type_in_word(token))
    return tuple(open_tuples[0])


def _type_in_word(token: str) -> Any:
    if found := re.fullmatch(r"(\w+)\[(\d+)([ACF])(r?)\]", token):
        name, dimensions, layout, read_only = found.groups()
        return types.Array(vars(types)[name], int(dimensions), cast(Any, layout), readonly=bool(read_only))
    found_type = vars(types)[token]
    if not isinstance(found_type, types.Type):
        raise LookupError(f"{token!r} is not the name of a type")
    return found_type
