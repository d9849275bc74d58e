"""MATLAB files (version 5 to 7): plain arrays, structures, Simulink's logs.

Their tags are gone through before scipy's reader sees them: it trusts the sizes in the file, and
a damaged one can make it crash. Layout after MathWorks' "MAT-File Format", version 5: elements of
a type, a byte count and the data, padded to eight bytes; arrays are elements that hold elements.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, NotThisFormatError, Table
from pendpipe.formats.words import role_of

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


_SLOWEST_HZ, _FASTEST_HZ = 1e-9, 1e12
"""What a rate or an interval may be."""
_RATES = ("fs", "samplerate", "sample_rate", "srate", "rate", "sampling_rate", "samplingrate")
_INTERVALS = ("dt", "ts", "tsample", "sampletime", "sample_time", "t_s", "deltat")


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the arrays of one length, with the names of the variables they are in.

    Of several lengths the one is taken that the array the user named has, else the
    longest that comes with a time.
    """
    if data[:8] == b"\x89HDF\r\n\x1a\n" or b"MATLAB 7.3" in data[:128]:
        raise InputError(
            place, "this is a MATLAB 7.3 file (HDF5)", "save it in MATLAB with save(..., '-v7')"
        )
    # Version 4 has no mark of its own, and is not written any more.
    if not data.startswith(b"MATLAB 5.0") and data[126:128] not in (b"IM", b"MI"):
        raise NotThisFormatError("the file does not begin with 'MATLAB 5.0'")
    arrays = dict(_numbers(_load(place, data)))
    columns = {name: values for name, values in arrays.items() if values.size > 3}
    if not columns:
        raise InputError(place, "there is no array of numbers in it", "save the time and the angle")
    length = _length(columns, options)
    chosen = {name: values for name, values in columns.items() if len(values) == length}
    notes = []
    left = [name for name in columns if name not in chosen]
    if left:
        notes.append(f"arrays of another length left out: {', '.join(left[:8])}")
    chosen = _one_clock(chosen)
    return Table(
        place=place,
        format="matlab-v5",
        columns=tuple(
            Column(name=name, unit="", values=values, number=number)
            for number, (name, values) in enumerate(chosen.items(), start=1)
        ),
        interval_s=_interval(arrays),
        notes=tuple(notes),
    )


def _load(place: Path, data: bytes) -> dict[str, Any]:
    import io
    import warnings

    remedy = "save it again in MATLAB with save(..., '-v7')"
    try:
        names = sound_variables(data)
    except DamagedError as fault:
        raise InputError(place, f"the MATLAB file can't be read: {fault}", remedy) from None
    from scipy.io import loadmat

    stream: Any = io.BytesIO(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded = loadmat(stream, squeeze_me=True, variable_names=names)
    except Exception as fault:  # scipy raises whatever its parser stumbles on
        raise InputError(
            place, f"the MATLAB file can't be read: {str(fault)[:200]}", remedy
        ) from None
    return {name: value for name, value in loaded.items() if not name.startswith("__")}


def _numbers(tree: Any, path: str = "", depth: int = 0) -> Iterator[tuple[str, FloatArray]]:
    """Walk through variables and structures; give every real array as columns with a name."""
    if depth > 12:
        return
    if isinstance(tree, dict):
        for name, value in tree.items():
            yield from _numbers(value, f"{path}.{name}" if path else name, depth + 1)
        return
    array = np.asarray(tree)
    if array.dtype.names:
        for number, record in enumerate(array.reshape(-1)[:64], start=1):
            fields = {name: record[name] for name in array.dtype.names}
            name = path if array.size == 1 else f"{path}({number})"
            # Simulink's "structure with time" names a signal in its label.
            label = fields.get("label")
            if isinstance(label, str) and label.strip() and "values" in fields:
                name, fields = label.strip(), {"values": fields["values"]}
            yield from _numbers(fields, name, depth + 1)
        return
    if array.dtype == object:
        if array.dtype == object and array.ndim == 0:
            yield from _numbers(array.item(), path, depth + 1)
            return
        for number, entry in enumerate(array.reshape(-1)[:64], start=1):
            name = path if array.size == 1 else f"{path}({number})"
            yield from _numbers(entry, name, depth + 1)
        return
    if array.dtype.kind not in "fiub" or array.ndim > 2 or not array.size:
        return
    # Simulink's "structure with time" keeps the readings in NAME.signals.values.
    path = path.removesuffix(".signals.values").removesuffix(".values").removesuffix(".Data")
    if array.ndim < 2:
        yield path, np.atleast_1d(array).astype(np.float64)
        return
    tall = array if array.shape[0] >= array.shape[1] else array.T
    if tall.shape[1] <= 64:
        for number in range(tall.shape[1]):
            yield f"{path}({number + 1})", np.ascontiguousarray(tall[:, number], dtype=np.float64)


def _last(name: str) -> str:
    """The last part of a dotted name, without a column's number."""
    return name.rsplit(".", 1)[-1].split("(")[0]


def _length(columns: dict[str, FloatArray], options: ReadOptions) -> int:
    for name, values in columns.items():
        if options.reading_column in (name, _last(name)) or options.channel == name:
            return len(values)
    timed = [len(values) for name, values in columns.items() if role_of(_last(name)) == "time"]
    paired = [n for n in timed if sum(len(values) == n for values in columns.values()) > 1]
    return max(paired or [len(values) for values in columns.values()])


def _one_clock(columns: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Keep one of several equal time columns, and put it first."""
    clocks: list[FloatArray] = []
    first: dict[str, FloatArray] = {}
    rest: dict[str, FloatArray] = {}
    for name, values in columns.items():
        if role_of(_last(name)) != "time":
            rest[name] = values
        elif not any(np.array_equal(values, clock) for clock in clocks):
            clocks.append(values)
            first[name] = values
    return first | rest


def _interval(arrays: dict[str, FloatArray]) -> float | None:
    for name, values in arrays.items():
        word = _last(name).lower()
        if values.size != 1 or not _SLOWEST_HZ < values[0] < _FASTEST_HZ:
            continue
        if word in _RATES:
            return float(1.0 / values[0])
        if word in _INTERVALS:
            return float(values[0])
    return None
