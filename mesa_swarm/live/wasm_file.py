"""An object file of LLVM as a WebAssembly module that browsers load: with exports, and without what linkers need.

Of the format (WebAssembly core specification 2.0, chapter 5; the linking conventions of its tools for symbols) only
what LLVM writes here is read. All addresses of functions and data are in place already, since there is one object only.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

MAGIC = b"\0asm\1\0\0\0"
CUSTOM, IMPORT, EXPORT, CONSTANTS = 0, 2, 7, 11
# Kinds of imports, of symbols and of parts of the section "linking".
FUNCTION, TABLE, MEMORY, GLOBAL, TAG = range(5)
SYMBOLS = 8
CONSTANTS_SYMBOL, SECTION_SYMBOL = 1, 3
UNDEFINED, NAMED = 0x10, 0x40
HAS_MAXIMUM = 1
CONSTANT, END = 0x41, 0x0B
VERSION = 2


class ModuleImport(NamedTuple):
    """What a module imports: its kind, and its name."""

    kind: int
    name: str


class SectionReader:
    """Reads numbers and names of a section."""

    def __init__(self, content: bytes, at: int = 0) -> None:
        self.content, self.at = content, at

    @property
    def is_over(self) -> bool:
        """Whether nothing is left."""
        return self.at >= len(self.content)

    def byte(self) -> int:
        """Return the next byte."""
        self.at += 1
        return self.content[self.at - 1]

    def number(self) -> int:
        """Return the next number without sign, of 7 bits a byte (LEB128)."""
        result = shift = 0
        while True:
            byte = self.byte()
            result |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return result

    def signed(self) -> int:
        """Return the next number with a sign."""
        begin = self.at
        number = self.number()
        bits = 7 * (self.at - begin)
        return number - (1 << bits) if number >> (bits - 1) else number

    def bytes(self, count: int) -> bytes:
        """Return this number of bytes."""
        self.at += count
        return self.content[self.at - count : self.at]

    def name(self) -> str:
        """Return the next name."""
        return self.bytes(self.number()).decode()


def encode(number: int) -> bytes:
    r"""Return a number without sign as 7 bits a byte.

    Examples
    --------
    >>> encode(300)
    b'\xac\x02'
    """
    content = bytearray()
    while number > 0x7F:
        content.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*content, number])


def sections_of(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the kind and the content of each section."""
    reader = SectionReader(content, len(MAGIC))
    while not reader.is_over:
        kind = reader.byte()
        yield kind, reader.bytes(reader.number())


def functions_of(content: bytes) -> dict[str, int]:
    """Return the number of each function that an object file defines, by its name."""
    for kind, section in sections_of(content):
        reader = SectionReader(section)
        if kind == CUSTOM and reader.name() == "linking" and reader.number() == VERSION:
            return dict(_list_symbols(reader))
    return {}


def _list_symbols(reader: SectionReader) -> Iterator[tuple[str, int]]:
    while not reader.is_over:
        kind = reader.byte()
        part = SectionReader(reader.bytes(reader.number()))
        if kind == SYMBOLS:
            for _ in range(part.number()):
                yield from _read_symbol(part)


def _read_symbol(reader: SectionReader) -> Iterator[tuple[str, int]]:
    kind, flags = reader.byte(), reader.number()
    if kind == CONSTANTS_SYMBOL:
        reader.name()
        for _ in range(0 if flags & UNDEFINED else 3):
            reader.number()
        return
    number = reader.number()
    if kind == SECTION_SYMBOL or (flags & UNDEFINED and not flags & NAMED):
        return
    name = reader.name()
    if kind == FUNCTION and not flags & UNDEFINED:
        yield name, number


def imports_of(content: bytes) -> list[ModuleImport]:
    """Return what a module imports."""
    for kind, section in sections_of(content):
        if kind == IMPORT:
            reader = SectionReader(section)
            return [_read_import(reader) for _ in range(reader.number())]
    return []


def _read_import(reader: SectionReader) -> ModuleImport:
    reader.name()
    name, kind = reader.name(), reader.byte()
    if kind in (TABLE, GLOBAL, TAG):
        reader.byte()
    if kind == GLOBAL:
        reader.byte()
    elif kind in (FUNCTION, TAG):
        reader.number()
    else:
        _skip_limits(reader)
    return ModuleImport(kind, name)


def _skip_limits(reader: SectionReader) -> None:
    flags = reader.number()
    reader.number()
    if flags & HAS_MAXIMUM:
        reader.number()


def end_of_data(content: bytes) -> int:
    """Return the address behind the constants of a module."""
    end = 0
    for kind, section in sections_of(content):
        if kind != CONSTANTS:
            continue
        reader = SectionReader(section)
        for _ in range(reader.number()):
            reader.number()
            if reader.byte() != CONSTANT:
                raise ValueError("a piece of data has no constant address")
            address = reader.signed()
            if reader.byte() != END:
                raise ValueError("a piece of data has no constant address")
            end = max(end, address + len(reader.bytes(reader.number())))
    return end


def with_exports(content: bytes, exports: Mapping[str, str]) -> bytes:
    """Return the module that an object file is, which exports functions by other names than they have in it.

    Parameters
    ----------
    content : bytes
    exports : mapping of str to str
        Names of functions in the object file, by the names that they get.

    Raises
    ------
    KeyError
        If one of them is not defined there.
    """
    numbers = functions_of(content)
    body = encode(len(exports)) + b"".join(
        _with_length(name.encode()) + bytes([FUNCTION]) + encode(numbers[inner]) for name, inner in exports.items()
    )
    kept = [(kind, section) for kind, section in sections_of(content) if kind != CUSTOM]
    # The exports stand behind types, imports, functions, tables, memories, tags and globals.
    place = next((k for k, (kind, _) in enumerate(kept) if EXPORT < kind <= CONSTANTS + 1), len(kept))
    kept.insert(place, (EXPORT, body))
    return MAGIC + b"".join(bytes([kind]) + _with_length(section) for kind, section in kept)


def _with_length(content: bytes) -> bytes:
    return encode(len(content)) + content
