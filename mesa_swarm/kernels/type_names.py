"""Types of arguments of compiled functions in words: the same in every process, and read back."""

import re
from importlib import import_module
from types import NoneType
from typing import Annotated, Any, cast, get_args, get_origin, get_type_hints

import numpy as np
from numba import types

# Arrays in C order, as the fields of a named tuple of arrays declare them.
Reals = Annotated[np.ndarray, "float64[1C]"]
RealRows = Annotated[np.ndarray, "float64[2C]"]
RealTables = Annotated[np.ndarray, "float64[3C]"]
Singles = Annotated[np.ndarray, "float32[1C]"]
SingleRows = Annotated[np.ndarray, "float32[2C]"]
Integers = Annotated[np.ndarray, "int64[1C]"]
IntegerRows = Annotated[np.ndarray, "int64[2C]"]
IntegerTables = Annotated[np.ndarray, "int64[3C]"]
Shorts = Annotated[np.ndarray, "int32[1C]"]
ShortRows = Annotated[np.ndarray, "int32[2C]"]
Unsigned = Annotated[np.ndarray, "uint64[1C]"]
Bytes = Annotated[np.ndarray, "uint8[1C]"]
ByteRows = Annotated[np.ndarray, "uint8[2C]"]
Codes = Annotated[np.ndarray, "int8[1C]"]
CodeRows = Annotated[np.ndarray, "int8[2C]"]
Flags = Annotated[np.ndarray, "bool[1C]"]
FlagRows = Annotated[np.ndarray, "bool[2C]"]
NUMBERS = {float: types.float64, int: types.int64, bool: types.boolean}


def name_type(kind: Any) -> str:
    """Return a type in words that do not depend on Numba's version, nor on addresses.

    Examples
    --------
    >>> name_type(types.Tuple((types.Array(types.float64, 2, "C"), types.none)))
    '(float64[2C] none)'
    """
    if isinstance(kind, types.Array):
        return f"{kind.dtype}[{kind.ndim}{kind.layout}{'' if kind.mutable else 'r'}]"
    if isinstance(kind, types.BaseTuple):
        tuple_class = getattr(kind, "instance_class", None)
        name = "" if tuple_class is None else f"{tuple_class.__module__}.{tuple_class.__qualname__}"
        return f"{name}({' '.join(name_type(part) for part in cast(Any, kind))})"
    return re.sub(r" at 0x[0-9a-f]+", "", str(kind))


def types_in_words(words: str) -> tuple[Any, ...]:
    """Return the types that these words name: arrays, numbers, and tuples and named tuples of these.

    Raises
    ------
    LookupError
        If there is another type.

    Examples
    --------
    >>> types_in_words("float64[2C] (int64 none)")
    (Array(float64, 2, 'C', False, aligned=True), Tuple((int64, none)))
    """
    open_tuples: list[tuple[Any, list[Any]]] = [(None, [])]
    for token in re.findall(r"[\w.]*\(|\)|[^\s()]+", words):
        if token.endswith("("):
            open_tuples.append((_class_named(token[:-1]), []))
        elif token == ")":
            tuple_class, parts = open_tuples.pop()
            open_tuples[-1][1].append(types.BaseTuple.from_types(tuple(parts), tuple_class))
        else:
            open_tuples[-1][1].append(_type_in_word(token))
    return tuple(open_tuples[0][1])


def declared_type(annotation: Any) -> Any:
    """Return the type that an annotation of a named tuple declares.

    It is float, int, bool, one of the arrays above, or a tuple or a named tuple of these. What may be None as well is
    None: a block does not hold it.

    Examples
    --------
    >>> name_type(declared_type(tuple[int, Reals]))
    '(int64 float64[1C])'
    """
    if get_origin(annotation) is Annotated:
        return _type_in_word(annotation.__metadata__[0])
    if NoneType in get_args(annotation):
        return types.none
    if annotation in NUMBERS:
        return NUMBERS[annotation]
    if get_origin(annotation) is tuple:
        return types.Tuple(tuple(map(declared_type, get_args(annotation))))
    fields = get_type_hints(annotation, include_extras=True).values()
    return types.BaseTuple.from_types(tuple(map(declared_type, fields)), annotation)


def _class_named(name: str) -> Any:
    module, _, attribute = name.rpartition(".")
    return getattr(import_module(module), attribute) if name else None


def _type_in_word(token: str) -> Any:
    if match := re.fullmatch(r"(\w+)\[(\d+)([ACF])(r?)\]", token):
        name, dimensions, layout, read_only = match.groups()
        return types.Array(vars(types)[name], int(dimensions), cast(Any, layout), readonly=bool(read_only))
    found_type = vars(types)[token]
    if not isinstance(found_type, types.Type):
        raise LookupError(f"{token!r} is not the name of a type")
    return found_type
