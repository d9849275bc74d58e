"""MATLAB files (version 4 to 7): plain arrays, structures, Simulink's logs.

Their tags are gone through before scipy's reader sees them: it trusts the sizes in the file, and
a damaged one can make it crash. Layout after MathWorks' "MAT-File Format", version 5: elements of
a type, a byte count and the data, padded to eight bytes; arrays are elements that hold elements.
"""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, Final

from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import NotThisFormatError, Table
from pendpipe.formats.trees import table_of_tree

_SIZES: Final = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHARACTERS = 1, 2, 3, 4
_NUMERIC: Final = range(6, 16)
_COMPLEX: Final = 0x0800
_LARGEST: Final = 1 << 31


class DamagedError(ValueError):
    """The file's tags contradict one another."""


def most_unpacked(size: int) -> int:
    """How many bytes a packed file of so many may hold; what holds more is no recording."""
    return max(256 << 20, 100 * size)


@dataclass
class _Elements:
    """Elements one after the other in `data`, from `at` on."""

    data: bytes
    order: str
    at: int = 0

    def next(self) -> tuple[int, bytes]:
        """Return the next element's type and content."""
        if self.at + 8 > len(self.data):
            raise DamagedError(f"it ends within a tag at byte {self.at}")
        kind, size = struct.unpack_from(self.order + "II", self.data, self.at)
        if kind >> 16 and kind >> 16 <= 4:
            content = self.data[self.at + 4 : self.at + 4 + (kind >> 16)]
            self.at += 8
            return kind & 0xFFFF, content
        start, stop = self.at + 8, self.at + 8 + size
        if stop > len(self.data):
            raise DamagedError(f"an element of {size} bytes does not fit at byte {self.at}")
        self.at = stop if kind == _COMPRESSED else min(stop + -size % 8, len(self.data))
        return kind, self.data[start:stop]

    def plain(self, *kinds: int) -> bytes:
        """Return the next element's content, which must be of one of these types."""
        kind, content = self.next()
        if kind not in kinds or len(content) % _SIZES[kind]:
            raise DamagedError(f"an element of type {kind} stands where {kinds} is due")
        return content

    def more(self) -> bool:
        """Say whether anything is left but padding."""
        return self.at + 8 <= len(self.data)


def sound_variables(data: bytes) -> list[str]:
    """List the variables of numbers, cells and structures; raise if anything is damaged.

    Raises
    ------
    DamagedError
        When a size or a type can't be true.
    """
    if len(data) < 136 or data[126:128] not in (b"IM", b"MI"):
        raise DamagedError("its header is damaged")
    order = "<" if data[126:128] == b"IM" else ">"
    most = most_unpacked(len(data))
    elements = _Elements(data, order, 128)
    names = []
    while elements.more():
        kind, content = elements.next()
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            try:
                unpacked = unpacker.decompress(content, most)
            except zlib.error as fault:
                raise DamagedError(f"its compressed data are damaged ({fault})") from None
            if not unpacker.eof and len(unpacked) >= most:
                raise DamagedError(f"its compressed data are more than {most >> 20} MB")
            if not unpacker.eof:
                raise DamagedError("its compressed data are cut short")
            most -= len(unpacked)
            kind, content = _Elements(unpacked, order).next()
        if kind != _MATRIX:
            raise DamagedError(f"an element of type {kind} stands where a variable is due")
        name, known = _array(_Elements(content, order))
        if known:
            names.append(name)
    return names


def _array(parts: _Elements, depth: int = 0) -> tuple[str, bool]:
    """Go through one array; return its name, and whether all of it is of a known class."""
    if depth > 32:
        raise DamagedError("its structures are nested too deeply")
    if not parts.data:
        return "", True
    flags = parts.plain(6)
    shape = parts.plain(5)
    name = parts.plain(1, 2, 16).decode("latin-1")
    if len(flags) != 8 or len(shape) < 8:
        raise DamagedError("an array has no class or no size")
    word = struct.unpack_from(parts.order + "I", flags)[0]
    sizes = struct.unpack_from(f"{parts.order}{len(shape) // 4}i", shape)
    count = prod(sizes)
    if min(sizes) < 0 or count > _LARGEST:
        raise DamagedError(f"an array has the size {sizes}")
    return name, _content(parts, word & 0xFF, bool(word & _COMPLEX), count, depth)


def _content(parts: _Elements, kind: int, is_complex: bool, count: int, depth: int) -> bool:
    """Go through an array's content by its class; ``False`` for a class left alone."""
    if kind in _NUMERIC:
        for _ in range(2 if is_complex else 1):
            stored, content = parts.next()
            if stored not in _SIZES or len(content) != count * _SIZES[stored]:
                raise DamagedError(f"an array of {count} numbers holds {len(content)} bytes")
        return True
    if kind == _CHARACTERS:
        stored, content = parts.next()
        if stored not in _SIZES or len(content) > 4 * count:
            raise DamagedError(f"a text of {count} letters holds {len(content)} bytes")
        return stored != 16 or len(content) == count
    fields = 1
    if kind == _OBJECT:
        parts.plain(1)
    if kind in (_STRUCT, _OBJECT):
        length = parts.plain(5)
        names = parts.plain(1)
        width = struct.unpack(parts.order + "i", length)[0] if len(length) == 4 else 0
        if width < 1 or len(names) % width:
            raise DamagedError("the names of a structure's fields are damaged")
        fields = len(names) // width
    elif kind != _CELL:
        return False
    known = True
    for _ in range(count * fields):
        stored, content = parts.next()
        if stored != _MATRIX:
            raise DamagedError(f"an element of type {stored} stands where an array is due")
        known &= _array(_Elements(content, parts.order), depth + 1)[1]
    return known and kind != _OBJECT


def _version_4(data: bytes) -> list[str] | None:
    """List the variables of a file of version 4; ``None`` where it is none.

    Each has five words (type, rows, columns, whether complex, length of the name), its name and
    its numbers. Type MOPT has the byte order in its thousands, 0 in its hundreds, the kind of
    number in its tens, and 0 for a full matrix in its ones.
    """
    names, at = [], 0
    while at + 20 <= len(data):
        kind, rows, columns, is_complex, length = struct.unpack_from("<5I", data, at)
        if kind not in (0, 10, 20, 30, 40, 50) or is_complex > 1 or not 1 < length < 64:
            return None
        name = data[at + 20 : at + 20 + length]
        if not name[:-1].isalnum() and not name[:-1].replace(b"_", b"").isalnum():
            return None
        size = rows * columns * (1 + is_complex) * (8, 4, 4, 2, 2, 1)[kind // 10]
        names.append(name[:-1].decode("latin-1"))
        at += 20 + length + size
    return names if names and at == len(data) else None


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the arrays of one length, with the names of the variables they are in.

    Raises
    ------
    NotThisFormatError
        When the file is none of MATLAB's, or of version 7.3 (which is HDF5).
    InputError
        When it holds no numbers.
    Exception
        Whatever scipy's parser raises that stumbles on a damaged file.
    """
    form, names = "matlab-v5", None
    if not data.startswith(b"MATLAB 5.0") and data[126:128] not in (b"IM", b"MI"):
        form, names = "matlab-v4", _version_4(data)
        if names is None:
            raise NotThisFormatError("the file does not begin with 'MATLAB 5.0'")
    if b"MATLAB 7.3" in data[:128]:
        raise NotThisFormatError("version 7.3 is HDF5")
    names = names or sound_variables(data)
    from scipy.io import loadmat

    stream: Any = io.BytesIO(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        loaded = loadmat(stream, squeeze_me=True, variable_names=names)
    tree = {name: value for name, value in loaded.items() if not name.startswith("__")}
    return table_of_tree(place, tree, form, options)
