"""All arrays that a model's kernels read and write, in one image of memory with addresses of its own.

Kernels find their arrays through blocks, arrays of numbers that hold addresses (`kernels.block`). An image is a copy of
all that a block leads to, in which addresses are those that the arrays have there, functions are places in a table, and
streams of random numbers are four words of their state.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from ctypes import string_at
from typing import Any, NamedTuple, cast

import numpy as np
from numba.core import event

from mesa_swarm.base.errors import ExportError
from mesa_swarm.kernels.block import Block, note_blocks
from mesa_swarm.kernels.crew import CrewArrays
from mesa_swarm.kernels.draws import Stream, Words, stream_of

NUMBER_BYTES, ALIGNMENT = 8, 16
STREAM_BYTES = 32
WORD = 2**64
# Names of the functions that draw, as `cross_compile` has them.
DRAWS = {Stream: "draw_number", Words: "draw_word"}
# Blocks of what pages do not have: threads, whose words are of the whole process.
LEFT_OUT = (CrewArrays,)
# Addresses are larger than any number of rows and smaller than any float that is not tiny.
LEAST_ADDRESS, LARGEST_ADDRESS = 2**32, 2**47


class CleanMemory(event.Listener):
    """Lets ``np.empty`` and ``np.empty_like`` return zeros, but not while Numba compiles, which asks what they are."""

    def __init__(self) -> None:
        self._module, self._before, self._depth = cast(Any, np), (np.empty, np.empty_like), 0

    def begin(self) -> None:
        """Return zeros from now on."""
        self._module.empty, self._module.empty_like = np.zeros, np.zeros_like

    def end(self) -> None:
        """Return what was returned before."""
        self._module.empty, self._module.empty_like = self._before

    def on_start(self, event: Any) -> None:
        """Let what is compiled see NumPy as it is."""
        self._depth += 1
        self.end()

    def on_end(self, event: Any) -> None:
        """Return zeros again, when all is compiled."""
        self._depth -= 1
        if self._depth == 0:
            self.begin()


@contextmanager
def clean_memory() -> Iterator[None]:
    """Let ``np.empty`` and ``np.empty_like`` return zeros meanwhile.

    What lies in scratch by chance would be part of an image. Nothing may depend on it, so that other threads may go on.
    """
    clean = CleanMemory()
    with event.install_listener("numba:compile", clean):
        clean.begin()
        try:
            yield
        finally:
            clean.end()


class Functions:
    """The functions of a page, and the places that they have in its table.

    Attributes
    ----------
    places : dict of str or function to int
        Of functions that draw by their names.
    """

    FIRST = 1

    def __init__(self, places: dict[Any, int] | None = None) -> None:
        self.places: dict[Any, int] = dict(places or {})

    def copy(self) -> "Functions":
        """Return others with the same functions, to be filled without changing these."""
        return Functions(self.places)

    def place_of(self, function: Any) -> int:
        """Return the place of a function, always the same one."""
        return self.places.setdefault(function, self.FIRST + len(self.places))


class Span(NamedTuple):
    """A range of this process's memory, and where it is in the image."""

    begin: int
    end: int
    address: int


class Image:
    """What is reached from some blocks, as bytes.

    Parameters
    ----------
    roots : sequence of Block
    notes : list
        What `note_blocks` has noted while these blocks, and those that they lead to, were made.
    addresses : mapping of int to function
        The functions that blocks refer to, by the addresses of their code.
    streams : iterable of Generator
        Those that blocks may draw from.
    functions : Functions
        Takes what is found.
    base : int
        The address of the first byte.

    Attributes
    ----------
    content : bytes

    Raises
    ------
    ExportError
        If a block refers to something that was not noted.
    """

    def __init__(
        self,
        roots: Sequence[Block],
        notes: Sequence[tuple[np.ndarray, Callable[[], Any]]],
        addresses: dict[int, Any],
        streams: Iterable[np.random.Generator],
        functions: Functions,
        base: int,
    ) -> None:
        self._notes = {numbers.ctypes.data: (numbers, values) for numbers, values in notes if numbers.size}
        self._addresses, self._functions, self.base = addresses, functions, base
        self._streams = {stream_of(stream).state: stream for stream in streams}
        self._extents: dict[tuple[int, int], None] = {}
        self._noted: dict[int, tuple[np.ndarray, Any]] = {}
        self._plain: list[np.ndarray] = []
        self._drawn: dict[int, int] = {}
        for root in roots:
            self._visit(root.numbers)
        self._spans, end = self._place(base)
        for number, state in enumerate(self._drawn):
            self._drawn[state] = end + STREAM_BYTES * number
        self._begins = [span.begin for span in self._spans]
        self.end = end + STREAM_BYTES * len(self._drawn)
        self.content = self._write()

    def address_of(self, array: np.ndarray) -> int | None:
        """Return where an array is in the image, None if no block leads to it."""
        try:
            return self._moved(array.ctypes.data) if array.size else self.base
        except KeyError:
            return None

    def places_of(self, block: Block) -> Iterator[tuple[int, int]]:
        """Iterate over where in the content a block's arrays and the states of its streams are, with their lengths."""
        for value in block._values:
            if isinstance(value, (Stream, Words)):
                yield self._drawn[value.state] - self.base, STREAM_BYTES
            elif isinstance(value, np.ndarray) and value.size:
                yield self._moved(value.ctypes.data) - self.base, value.nbytes

    def has_whole(self, array: np.ndarray) -> bool:
        """Return whether a block leads to the whole of an array, not only to rows of it."""
        address = array.ctypes.data
        return array.size > 0 and (address, address + array.nbytes) in self._extents

    def takes(self, prefix: str) -> bool:
        """Return whether a block has an argument whose name begins so."""
        blocks = (values for _, values in self._noted.values())
        return any(name.startswith(prefix) for block in blocks for name in getattr(block, "_fields", ()))

    @property
    def layout(self) -> list[tuple[int, int]]:
        """Address and length of each range, in the order of the image."""
        return sorted((span.address, span.end - span.begin) for span in self._spans)

    def written_anew(self) -> bytes:
        """Return the content with what the arrays hold now."""
        return self._write()

    # ---- what is there

    def _visit(self, value: Any) -> None:
        if isinstance(value, np.ndarray):
            self._visit_array(value)
        elif isinstance(value, (Stream, Words)):
            self._visit_stream(value)
        elif isinstance(value, tuple):
            for part in value:
                self._visit(part)
        elif type(value) is int and value in self._addresses:
            self._functions.place_of(self._addresses[value])

    def _visit_array(self, array: np.ndarray) -> None:
        if not array.size:
            return
        address = array.ctypes.data
        noted = self._notes.get(address)
        self._extents[address, address + array.nbytes] = None
        if noted is None or noted[0].size != array.size:
            self._plain.append(array)
        elif address not in self._noted:
            values = noted[1]()
            self._noted[address] = noted[0], values
            if not isinstance(values, LEFT_OUT):
                self._visit(values)

    def _visit_stream(self, stream: Any) -> None:
        if stream.state:
            if stream.state not in self._streams:
                raise ExportError("a stream of random numbers is not one of the model's own")
            self._functions.place_of(DRAWS[type(stream)])
            self._drawn[stream.state] = 0

    def _place(self, base: int) -> tuple[list[Span], int]:
        """Return the ranges of memory, those that overlap as one, in ascending order, and the end of the image.

        In the image they are in the order in which they were found: the same for models that are made alike.
        """
        found = {extent: place for place, extent in enumerate(self._extents)}
        merged: list[list[int]] = []
        for begin, end in sorted(found):
            place = found[begin, end]
            if merged and begin < merged[-1][1]:
                last = merged[-1]
                last[1], last[2] = max(last[1], end), min(last[2], place)
            else:
                merged.append([begin, end, place])
        at, spans = base, []
        for begin, end, _ in sorted(merged, key=lambda span: span[2]):
            spans.append(Span(begin, end, at))
            at = -(-(at + end - begin) // ALIGNMENT) * ALIGNMENT
        return sorted(spans), at

    # ---- what it holds

    def _moved(self, address: int) -> int:
        """Return where an address is in the image."""
        place = bisect_right(self._begins, address) - 1
        if place < 0 or address >= self._spans[place].end:
            raise KeyError(address)
        return self._spans[place].address + address - self._spans[place].begin

    def _write(self) -> bytes:
        memory = bytearray(self.end - self.base)
        for begin, end, address in self._spans:
            memory[address - self.base : address - self.base + end - begin] = string_at(begin, end - begin)
        for array in self._plain:
            self._check_plain(array)
        for numbers, values in self._noted.values():
            found = [0] * numbers.size if isinstance(values, LEFT_OUT) else list(self._numbers(values))
            self._put(memory, self._moved(numbers.ctypes.data), np.array(found, np.int64))
        for state, address in self._drawn.items():
            self._put(memory, address, _words_of(self._streams[state]))
        return bytes(memory)

    def _put(self, memory: bytearray, address: int, array: np.ndarray) -> None:
        memory[address - self.base : address - self.base + array.nbytes] = array.tobytes()

    def _numbers(self, value: Any) -> Iterator[int]:
        """Yield what `Block` makes of values, with the addresses of the image."""
        if isinstance(value, (Stream, Words)):
            yield self._functions.place_of(DRAWS[type(value)]) if value.state else 0
            yield self._drawn[value.state] if value.state else 0
        elif isinstance(value, tuple):
            for part in value:
                yield from self._numbers(part)
        elif isinstance(value, np.ndarray):
            yield self._moved(value.ctypes.data) if value.size else self.base
            yield from value.shape
        elif isinstance(value, float):
            yield int(np.float64(value).view(np.int64))
        elif value is not None:
            number = int(value)
            yield self._functions.place_of(self._addresses[number]) if number in self._addresses else number

    def _check_plain(self, array: np.ndarray) -> None:
        """Refuse addresses in an array that is not noted: they would lead nowhere."""
        if array.dtype != np.int64:
            return
        values = np.unique(array[(array >= LEAST_ADDRESS) & (array < LARGEST_ADDRESS)]).tolist()
        for value in values:
            place = bisect_right(self._begins, value) - 1
            if value in self._addresses or (place >= 0 and value < self._spans[place].end):
                raise ExportError("an array holds addresses that are not known, so that a page would read elsewhere")


def _words_of(stream: np.random.Generator) -> np.ndarray:
    """Return the state of a stream: high and low word, then those of its increment."""
    state: Any = stream.bit_generator.state
    if state["bit_generator"] != "PCG64":
        raise ExportError(f"a stream of random numbers is a {state['bit_generator']}; expected PCG64")
    numbers = state["state"]["state"], state["state"]["inc"]
    return np.array([half for number in numbers for half in divmod(number, WORD)], np.uint64)


__all__ = ["Functions", "Image", "clean_memory", "note_blocks"]
