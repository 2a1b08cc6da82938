"""Many arguments of a compiled function in one array of numbers: addresses and shapes of arrays, and numbers.

To pass an array from Python takes about 50 ns. Arguments that stay the same from step to step are put into a `Block`
once; a compiled function that is given its array takes them out at the cost of reading memory. Their names and types
are those that a class, a `typing.NamedTuple`, declares; see `type_names.declared_type`.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from ctypes import addressof, c_char
from functools import partial
from struct import Struct
from typing import Any, NamedTuple, cast
from weakref import WeakKeyDictionary

import numpy as np
from numba import typeof, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from mesa_swarm.kernels.type_names import Integers, declared_type, name_type

NUMBER = np.dtype(np.int64)
# To ask NumPy for the address of an array takes several times as long.
NO_BYTES = c_char * 0
pack_real, unpack_number = Struct("=d").pack, Struct("=q").unpack
# Of functions that can be called by their addresses: a block, a step, the first row and one past the last.
SIGNATURE = (types.int64[::1], types.int64, types.int64, types.int64)


# Arrays of numbers, each with what returns the values that it stands for.
Notes = list[tuple[np.ndarray, Callable[[], Any]]]
# Those that `note_blocks` is taking: none, or one after the other.
_open_notes: list[Notes] = []


@contextmanager
def note_blocks() -> Iterator[Notes]:
    """Note of all blocks that are made meanwhile their numbers, and what returns the values that these stand for.

    The values of rows of blocks are a tuple, see `stack_blocks`.

    Examples
    --------
    >>> with note_blocks() as notes:
    ...     block = Block(KernelCall(5, np.arange(2)))
    >>> [(numbers, values)] = notes
    >>> numbers is block.numbers, values().address
    (True, 5)
    """
    _open_notes.append([])
    try:
        yield _open_notes[-1]
    finally:
        _open_notes.pop()


def _note(numbers: np.ndarray, values: Callable[[], Any]) -> None:
    if _open_notes:
        _open_notes[-1].append((numbers, values))


class Block:
    """Arguments of a compiled function, as long as none of the arrays is replaced by another.

    Parameters
    ----------
    values : NamedTuple
        The arguments; arrays are kept as long as the block is.

    Attributes
    ----------
    numbers : int64 ndarray
        What the compiled function is given.

    Raises
    ------
    TypeError
        If they have other types than their class declares.

    Examples
    --------
    >>> from typing import NamedTuple
    >>> from mesa_swarm.kernels.type_names import Reals
    >>> class Table(NamedTuple):
    ...     values: Reals
    ...     share: float
    >>> Block(Table(np.zeros(3), 0.5)).numbers[1:].tolist()
    [3, 4602678819172646912]
    """

    __slots__ = ("_values", "numbers")

    def __init__(self, values: Any) -> None:
        check_types(values)
        self._values = values
        self.numbers = np.array(_numbers_of(values), NUMBER)
        _note(self.numbers, lambda: self._values)

    def replace(self, values: Any) -> None:
        """Take other values of the same types, in the same numbers, to which blocks may refer."""
        self._values, self.numbers[:] = values, _numbers_of(values)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how a copy is made: of copies of the arrays, so that it refers to these."""
        return Block, (self._values,)


def pack(values: Any) -> np.ndarray:
    """Return the numbers of a block of numbers, arrays in C order and tuples of these; the arrays have to be kept.

    For values whose types no class declares, which `unpack_as` takes out again.
    """
    numbers = np.array(_numbers_of(values), NUMBER)
    _note(numbers, lambda: values)
    return numbers


def stack_blocks(
    blocks: Sequence["Block | None"], width: int | None = None, more: Sequence[tuple[int, ...]] = ()
) -> np.ndarray:
    """Return the numbers of blocks of one class as rows, zeros for None, each followed by what `more` has for it.

    Parameters
    ----------
    blocks : sequence of Block or None
    width : int, optional
        How many numbers a row has; by default as many as the first block, and 0 without blocks.
    more : sequence of tuples of int, optional
        One for each block.

    Examples
    --------
    >>> stack_blocks([None], 3).tolist()
    [[0, 0, 0]]
    """
    if width is None:
        width = next((len(block.numbers) for block in blocks if block is not None), 0)
    rows = np.zeros((len(blocks), width), NUMBER)
    behind = more or [()] * len(blocks)
    for row, block, others in zip(rows, blocks, behind, strict=True):
        if block is not None:
            row[: len(block.numbers)], row[len(block.numbers) :] = block.numbers, others
    zeros = (0,) * width
    _note(
        rows,
        lambda: tuple(
            zeros if block is None else (block._values, others) for block, others in zip(blocks, behind, strict=True)
        ),
    )
    return rows


# Kinds of arguments that were compared with what their class declares: to ask Numba takes as long as all else.
CHECKED: set[Any] = set()


def check_types(values: Any) -> None:
    """Refuse arguments of other types than their class declares."""
    kind = _kind_of(values)
    if kind in CHECKED:
        return
    actual_type, declared_name = name_type(typeof(values)), name_type(declared_type(type(values)))
    if actual_type != declared_name:
        raise TypeError(f"a block got {actual_type}; expected {declared_name}")
    CHECKED.add(kind)


def _kind_of(value: Any) -> Any:
    """Return what is the same for values of the same type to Numba."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num
    return (type(value), *map(_kind_of, value)) if isinstance(value, tuple) else type(value)


def _numbers_of(values: Any) -> list[int]:
    numbers: list[int] = []
    _put_numbers(values, numbers)
    return numbers


def _put_numbers(value: Any, numbers: list[int]) -> None:
    if isinstance(value, np.ndarray):
        # Quicker than the other way, but only for arrays that can be written to.
        quick = value.flags.writeable
        numbers.append(addressof(NO_BYTES.from_buffer(cast(Any, value))) if quick else value.ctypes.data)
        numbers += value.shape
    elif isinstance(value, tuple):
        for part in value:
            _put_numbers(part, numbers)
    elif isinstance(value, float):
        numbers += unpack_number(pack_real(value))
    elif value is not None:
        numbers.append(int(value))


@intrinsic
def unpack(typing_context: Any, block: Any, block_class: Any) -> Any:
    """Return the arguments in a block, as the class declares them, or None for None; for compiled functions."""
    if block is types.none:
        return types.none(block, block_class), lambda context, *_: context.get_dummy_value()
    result = declared_type(block_class.instance_class)
    return result(block, block_class), partial(_read_block, result)


def unpack_as(kind: Any) -> Any:
    """Return what takes a value of this type, such as a tuple, out of a block of `pack`; for compiled functions."""

    @intrinsic
    def take(typing_context: Any, block: Any) -> Any:
        return kind(block), partial(_read_block, kind)

    return take


def _read_block(kind: Any, context: Any, builder: Any, signature: Any, values: Any) -> Any:
    """Write the code that reads a value of this type from the beginning of a block."""
    array = context.make_array(signature.args[0])(context, builder, values[0])
    return _Reader(context, builder, array.data).take(kind)


@intrinsic
def borrow(typing_context: Any, value: Any) -> Any:
    """Return an array, or a tuple of these, without counting who refers to it; for compiled functions.

    For arguments of a function that is not part of its caller: they outlive the call, but Numba would count references
    to them in each loop that passes them on.
    """
    return value(value), lambda context, builder, signature, values: _drop_count(context, builder, value, *values)


def _drop_count(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.BaseTuple):
        parts = [builder.extract_value(value, k) for k in range(len(cast(Any, kind)))]
        kinds = list(cast(Any, kind))
        dropped = [_drop_count(context, builder, *pair) for pair in zip(kinds, parts, strict=True)]
        return context.make_tuple(builder, kind, dropped)
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()
    return value


class _Reader:
    """Writes the code that reads the numbers of a block one after the other."""

    def __init__(self, context: Any, builder: Any, first: Any) -> None:
        self.context, self.builder, self.first, self.place = context, builder, first, 0

    def take(self, kind: Any) -> Any:
        """Return the value of a type, made of the next numbers."""
        if isinstance(kind, types.BaseTuple):
            return self.context.make_tuple(self.builder, kind, [self.take(part) for part in cast(Any, kind)])
        if isinstance(kind, types.Array):
            return self._array(kind)
        if kind is types.none:
            return self.context.get_dummy_value()
        if isinstance(kind, types.Boolean):
            return self.builder.icmp_signed("!=", self._number(), self.context.get_constant(types.intp, 0))
        if isinstance(kind, types.Float):
            return self.builder.bitcast(self._number(), self.context.get_value_type(kind))
        return self._number()

    def _number(self) -> Any:
        place = self.context.get_constant(types.intp, self.place)
        self.place += 1
        return self.builder.load(self.builder.gep(self.first, [place]))

    def _array(self, kind: Any) -> Any:
        context, builder = self.context, self.builder
        array = context.make_array(kind)(context, builder)
        item = context.get_data_type(kind.dtype)
        address = builder.inttoptr(self._number(), item.as_pointer())
        shape = [self._number() for _ in range(kind.ndim)]
        size = context.get_constant(types.intp, context.get_abi_sizeof(item))
        strides = [size]
        for length in shape[:0:-1]:
            strides.insert(0, builder.mul(strides[0], length))
        populate_array(array, data=address, shape=shape, strides=strides, itemsize=size, meminfo=None)
        return array._getvalue()


class KernelCall(NamedTuple):
    """A call of a function of `SIGNATURE` by compiled functions: where its code is, and the numbers of its block."""

    address: int
    block: Integers


# How many numbers the block of one has.
CALL_NUMBERS = 3
# Of functions of `SIGNATURE`: code stays where it is.
ADDRESSES: WeakKeyDictionary[Any, int] = WeakKeyDictionary()


def code_address(function: Any) -> int:
    """Return where the code of a function of `SIGNATURE` is, which is compiled if it is not there."""
    address = ADDRESSES.get(function)
    if address is None:
        function.compile(SIGNATURE)
        result = function.overloads[SIGNATURE]
        address = ADDRESSES[function] = result.library.get_pointer_to_function(result.fndesc.llvm_func_name)
    return address


# A code larger than those of kernels, of one that has raised an error.
FAILED = np.int64(2**40)


def _write_call(context: Any, builder: Any, values: Any) -> tuple[Any, Any]:
    """Write the call of the function at an address, and return its status and code."""
    address, *arguments = values
    kind = context.call_conv.get_function_type(types.int64, SIGNATURE)
    function = builder.inttoptr(address, kind.as_pointer())
    return context.call_conv.call_function(builder, function, types.int64, SIGNATURE, arguments)


@intrinsic
def call_at(typing_context: Any, address: Any, block: Any, step: Any, first: Any, last: Any) -> Any:
    """Call the function at an address and return its code; for compiled functions."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        status, value = _write_call(context, builder, values)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return value

    return types.int64(types.int64, *SIGNATURE), code


@intrinsic
def try_call_at(typing_context: Any, address: Any, block: Any, step: Any, first: Any, last: Any) -> Any:
    """Call the function at an address and return its code, `FAILED` for an error; for compiled functions."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        status, value = _write_call(context, builder, values)
        return builder.select(status.is_error, context.get_constant(types.int64, int(FAILED)), value)

    return types.int64(types.int64, *SIGNATURE), code
