"""MATLAB: versions 5 to 7, and 4; version 7.3 is HDF5.

Versions 5 to 7 are read here and not by scipy, whose reader trusts the sizes in a file, so that a
damaged one makes it crash. Layout after MathWorks' "MAT-File Format", version 5: elements of a
type, a byte count and the data, padded to eight bytes; arrays are elements that hold elements.
"""

import io
import struct
import zlib
from collections.abc import Iterator
from itertools import islice
from math import prod
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.arrays import AnyArray
from pendpipe.formats.plugin import Dialect
from pendpipe.formats.table import (
    NotThisFormatError,
    ReadOptions,
    Table,
    damaged_if,
    most_unpacked,
)
from pendpipe.formats.trees import MOST, table_of_tree

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
_LAST_TYPE_4: Final = 51
"""Of version 4: an array of bytes that is a text."""


def _read(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the variables of a file of version 5 to 7.

    Raises
    ------
    ValueError
        When a size or a type can't be true.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128], "")
    damaged_if(not order, "its header is damaged")
    most, tree = most_unpacked(len(data)), {}
    for kind, content in _elements(data, order, 128):
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            unpacked = unpacker.decompress(content, most)
            many = len(unpacked) >= most
            fault = f"are more than {most >> 20} MB" if many else "are cut short"
            damaged_if(not unpacker.eof, f"its compressed data {fault}")
            most -= len(unpacked)
            kind, content = next(_elements(unpacked, order), (0, b""))
        name, value = _array(kind, content, order)
        tree[name] = value
    return table_of_tree(place, tree, "matlab-v5", options)


def _elements(data: bytes, order: str, at: int = 0) -> Iterator[tuple[int, bytes]]:
    """Give type and content of the elements that stand one after the other."""
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(order + "II", data, at)
        start, small = at + 8, kind >> 16
        if 0 < small <= 4:  # so few bytes stand in the tag itself
            start, kind, size = at + 4, kind & 0xFFFF, small
        damaged_if(
            start + size > len(data), f"an element of {size} bytes does not fit at byte {at}"
        )
        yield kind, data[start : start + size]
        at = start + size + (0 if kind == _COMPRESSED else -(start + size - at) % 8)


def _element(parts: Iterator[tuple[int, bytes]], order: str, *kinds: int) -> AnyArray:
    """Read the next element, which must be of one of these types."""
    kind, content = next(parts, (0, b""))
    damaged_if(kind not in kinds, f"an element of type {kind} stands where {kinds} is due")
    return np.frombuffer(content, order + _STORED[kind])


def _array(kind: int, content: bytes, order: str, depth: int = 0) -> tuple[str, Any]:
    """Read an array: its name; numbers, text, or cells and structures as an array of objects.

    ``None`` stands for what holds no readings: complex numbers, functions, objects.
    """
    damaged_if(
        kind != _MATRIX or depth > _DEEPEST,
        f"an element of type {kind} stands where an array is due",
    )
    if not content:
        return "", None
    parts = _elements(content, order)
    flags, shape = _element(parts, order, 6), _element(parts, order, 5).tolist()
    name = _element(parts, order, 1, 2, 16).tobytes().decode("latin-1")
    damaged_if(not len(flags) or min(shape, default=-1) < 0, f"an array has the size {shape}")
    group, count = int(flags[0]) & 0xFF, prod(shape)
    if group in _NUMERIC:
        values = _element(parts, order, *_STORED).reshape(shape, order="F")
        return name, None if flags[0] & _COMPLEX else np.squeeze(values)
    if group == _CHARACTERS:
        return name, "".join(map(chr, _element(parts, order, *_STORED).tolist()))
    if group not in (_CELL, _STRUCT):
        return name, None
    fields = [""]
    if group == _STRUCT:
        width = int(_element(parts, order, 5).sum())
        names = _element(parts, order, 1).tobytes().decode("latin-1")
        damaged_if(width < 1 or len(names) % width, "the names of a structure's fields are damaged")
        fields = [names[at : at + width].partition("\0")[0] for at in range(0, len(names), width)]
    held = [_array(*each, order, depth + 1)[1] for each in islice(parts, count * len(fields))]
    due = count * len(fields)
    damaged_if(len(held) < due, f"{len(held)} arrays stand where {due} are due")
    entries = np.empty(len(held) // max(len(fields), 1), dtype=object)
    for place in range(len(entries)):
        some = held[place * len(fields) : (place + 1) * len(fields)]
        entries[place] = some[0] if group == _CELL else dict(zip(fields, some, strict=True))
    return name, entries


def _is_version_4(head: bytes) -> bool:
    """Say whether a file begins as one of version 4: type, size, whether complex, a name."""
    words = struct.unpack("<5i", head[:20].ljust(20, b"\xff"))
    limits = ((0, _LAST_TYPE_4), (0, MOST), (0, MOST), (0, 1), (1, 64))
    return all(low <= word <= high for word, (low, high) in zip(words, limits, strict=True))


def _read_version_4(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the variables of a file of version 4, which scipy reads without compiled code.

    Raises
    ------
    NotThisFormatError
        When the file is none of that version.
    """
    from scipy.io import loadmat

    try:
        tree = dict(loadmat(io.BytesIO(data)))  # type: ignore[arg-type]
    except Exception as fault:
        # scipy's message may hold a name of a damaged file: any bytes, of any length.
        raise NotThisFormatError(f"it is no file of MATLAB 4 ({str(fault)[:60]!a})") from None
    return table_of_tree(place, tree, "matlab-v4", options)


MATLAB = Dialect(
    "file of arrays",
    lambda head: (
        (head[:10] == b"MATLAB 5.0" or head[126:128] in (b"IM", b"MI"))
        and b"MATLAB 7.3" not in head[:128]
    ),
    _read,
)
MATLAB_4 = Dialect("file of arrays", _is_version_4, _read_version_4)
