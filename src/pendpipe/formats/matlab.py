"""MATLAB files (version 4 to 7) as trees of arrays: plain ones, structures, Simulink's logs.

Read here and not by scipy, whose reader trusts the sizes in a file, so that a damaged one makes it
crash. Layout after MathWorks' "MAT-File Format", version 5: elements of a type, a byte count and
the data, padded to eight bytes; arrays are elements that hold elements.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from itertools import islice
from math import prod
from typing import Any, Final

import numpy as np

from pendpipe.arrays import AnyArray
from pendpipe.formats.table import NotThisFormatError

_STORED: Final = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8"} | {
    12: "i8",
    13: "u8",
    16: "u1",
    17: "u2",
    18: "u4",
}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _CHARACTERS = 1, 2, 4
_NUMERIC: Final = range(6, 16)
_COMPLEX: Final = 0x0800
_DEEPEST: Final = 32


class DamagedError(ValueError):
    """The file's tags contradict one another."""


def most_unpacked(size: int) -> int:
    """How many bytes a packed file of so many may hold; what holds more is no recording."""
    return max(256 << 20, 100 * size)


def is_matlab(data: bytes) -> bool:
    """Say whether a file is one of version 5 to 7 by its head; version 7.3 is HDF5."""
    head = data[:10] == b"MATLAB 5.0" or data[126:128] in (b"IM", b"MI")
    return head and b"MATLAB 7.3" not in data[:128]


def tree_of(data: bytes) -> dict[str, Any]:
    """Read the variables of a file of version 5 to 7.

    Raises
    ------
    DamagedError
        When a size or a type can't be true.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None:
        raise DamagedError("its header is damaged")
    most, tree = most_unpacked(len(data)), {}
    for kind, content in _elements(data, order, 128):
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            unpacked = unpacker.decompress(content, most)
            if not unpacker.eof:
                many = len(unpacked) >= most
                fault = f"are more than {most >> 20} MB" if many else "are cut short"
                raise DamagedError(f"its compressed data {fault}")
            most -= len(unpacked)
            kind, content = next(_elements(unpacked, order), (0, b""))
        name, value = _array(kind, content, order)
        tree[name] = value
    return tree


def _elements(data: bytes, order: str, at: int = 0) -> Iterator[tuple[int, bytes]]:
    """Give type and content of the elements that stand one after the other."""
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(order + "II", data, at)
        start, small = at + 8, kind >> 16
        if 0 < small <= 4:  # so few bytes stand in the tag itself
            start, kind, size = at + 4, kind & 0xFFFF, small
        if start + size > len(data):
            raise DamagedError(f"an element of {size} bytes does not fit at byte {at}")
        yield kind, data[start : start + size]
        at = start + size + (0 if kind == _COMPRESSED else -(start + size - at) % 8)


def _numbers(parts: Iterator[tuple[int, bytes]], order: str, *kinds: int) -> AnyArray:
    """Read the next element, which must be of one of these types."""
    kind, content = next(parts, (0, b""))
    if kind not in kinds:
        raise DamagedError(f"an element of type {kind} stands where {kinds} is due")
    return np.frombuffer(content, order + _STORED[kind])


def _array(kind: int, content: bytes, order: str, depth: int = 0) -> tuple[str, Any]:
    """Read an array: its name; numbers, text, or cells and structures as an array of objects.

    ``None`` stands for what holds no readings: complex numbers, functions, objects.
    """
    if kind != _MATRIX or depth > _DEEPEST:
        raise DamagedError(f"an element of type {kind} stands where an array is due")
    if not content:
        return "", None
    parts = _elements(content, order)
    flags, shape = _numbers(parts, order, 6), _numbers(parts, order, 5).tolist()
    name = _numbers(parts, order, 1, 2, 16).tobytes().decode("latin-1")
    if not len(flags) or min(shape, default=-1) < 0:
        raise DamagedError(f"an array has the size {shape}")
    group, count = int(flags[0]) & 0xFF, prod(shape)
    if group in _NUMERIC:
        values = _numbers(parts, order, *_STORED).reshape(shape, order="F")
        return name, None if flags[0] & _COMPLEX else np.squeeze(values)
    if group == _CHARACTERS:
        return name, "".join(map(chr, _numbers(parts, order, *_STORED).tolist()))
    if group not in (_CELL, _STRUCT):
        return name, None
    fields = [""]
    if group == _STRUCT:
        width = int(_numbers(parts, order, 5).sum())
        names = _numbers(parts, order, 1).tobytes().decode("latin-1")
        if width < 1 or len(names) % width:
            raise DamagedError("the names of a structure's fields are damaged")
        starts = range(0, len(names), width)
        fields = [names[at : at + width].partition("\0")[0] for at in starts]
    held = [_array(*each, order, depth + 1)[1] for each in islice(parts, count * len(fields))]
    if len(held) < count * len(fields):
        raise DamagedError(f"{len(held)} arrays stand where {count * len(fields)} are due")
    entries = np.empty(len(held) // max(len(fields), 1), dtype=object)
    for place in range(len(entries)):
        some = held[place * len(fields) : (place + 1) * len(fields)]
        entries[place] = some[0] if group == _CELL else dict(zip(fields, some, strict=True))
    return name, entries


def tree_of_version_4(data: bytes) -> dict[str, Any]:
    """Read the variables of a file of version 4.

    Each has five words (type, rows, columns, whether complex, length of the name), its name and
    its numbers. Type MOPT has the byte order in its thousands, 0 in its hundreds, the kind of
    number in its tens, and 0 for a full matrix in its ones.

    Raises
    ------
    NotThisFormatError
        When the file is none of that version.
    """
    tree, at = {}, 0
    while at < len(data):
        try:
            kind, rows, columns, is_complex, length = struct.unpack_from("<5I", data, at)
            name = re.fullmatch(rb"(\w{1,63})\0", data[at + 20 : at + 20 + length])
            stored = {0: "f8", 10: "f4", 20: "i4", 30: "i2", 40: "u2", 50: "u1"}[kind]
            count = rows * columns * (1 + is_complex)
            values = np.frombuffer(data, "<" + stored, count, at + 20 + length)
        except (struct.error, KeyError, ValueError):
            name = None
        if name is None or is_complex > 1:
            raise NotThisFormatError("the file does not begin with 'MATLAB 5.0'")
        if not is_complex:
            tree[name[1].decode()] = values.reshape(rows, columns, order="F")
        at += 20 + length + values.nbytes
    return tree
