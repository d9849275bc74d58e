"""MATLAB: versions 5 to 7, and 4; version 7.3 is HDF5.

scipy reads them. Of versions 5 to 7 it trusts the sizes in a file, so that a damaged one makes it
crash: it is called apart, when what is packed has been counted.
"""

import io
import struct
import zlib
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.arrays import AnyArray
from pendpipe.formats.apart import called_apart
from pendpipe.formats.plugin import Dialect
from pendpipe.formats.table import (
    NotThisFormatError,
    ReadOptions,
    Table,
    damaged_if,
    most_unpacked,
)
from pendpipe.formats.trees import MOST, table_of_tree

_HEAD: Final = 128
"""Bytes before the first element: a text, version and byte order."""
_COMPRESSED: Final = 15
"""The type of an element that is packed."""
_LAST_TYPE_4: Final = 51
"""Of version 4: an array of bytes that is a text."""


def _read(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the variables of a file of version 5 to 7.

    Raises
    ------
    ValueError
        When a size or a type can't be true.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[126:_HEAD], "")
    damaged_if(not order, "its header is damaged")
    most, at = most_unpacked(len(data)), _HEAD
    while at + 8 <= len(data):
        kind, size = struct.unpack(f"{order}2I", data[at : at + 8])
        at += 8 + size
        damaged_if(at > len(data), f"an element of {size} bytes is cut short")
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            most -= len(unpacker.decompress(data[at - size : at], most))
            damaged_if(
                most <= 0, f"its compressed data are more than {most_unpacked(len(data)) >> 20} MB"
            )
            damaged_if(not unpacker.eof, "its compressed data are cut short")
    return table_of_tree(place, called_apart(arrays_of, data), "matlab-v5", options)


def arrays_of(data: bytes) -> dict[str, Any]:
    """Return the variables by their names, structures as dictionaries."""
    from scipy.io import loadmat

    variables: dict[str, Any] = loadmat(io.BytesIO(data))  # type: ignore[arg-type]
    return {name: _unfolded(held) for name, held in variables.items() if name[:2] != "__"}


def _unfolded(array: AnyArray) -> Any:
    """Give a text as one; cells and structures as an array of objects, these as dictionaries."""
    names = array.dtype.names or ()
    if "Opaque" in type(array).__name__:  # an object of a class
        return None
    if not (names or array.dtype == object):
        return str(array.item()) if array.dtype.kind == "U" and array.size == 1 else array
    entries = np.empty(array.size, dtype=object)
    for place, each in enumerate(array.reshape(-1, order="F")):
        held = {name: _unfolded(np.asanyarray(each[name])) for name in names}
        entries[place] = held or _unfolded(np.asanyarray(each))
    return entries


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
    try:
        tree = arrays_of(data)
    except Exception as fault:
        # scipy's message may hold a name of a damaged file: any bytes, of any length.
        raise NotThisFormatError(f"it is no file of MATLAB 4 ({str(fault)[:60]!a})") from None
    return table_of_tree(place, tree, "matlab-v4", options)


MATLAB = Dialect(
    "file of arrays",
    lambda head: (
        (head[:10] == b"MATLAB 5.0" or head[126:_HEAD] in (b"IM", b"MI"))
        and b"MATLAB 7.3" not in head[:_HEAD]
    ),
    _read,
)
MATLAB_4 = Dialect("file of arrays", _is_version_4, _read_version_4)
