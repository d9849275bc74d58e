"""MATLAB files (version 5 to 7): plain arrays, structures, Simulink's logs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.formats.matlab_check import DamagedError, sound_variables
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, NotThisFormatError, Table
from pendpipe.formats.words import role_of

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
