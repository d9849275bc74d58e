"""Files of named arrays: HDF5 (and MATLAB 7.3), NumPy, JSON, TDMS, sound."""

import importlib
import io
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import refuse_if
from pendpipe.formats.apart import called_apart
from pendpipe.formats.clock import column_of_clock_times
from pendpipe.formats.grammar import MOST_COLUMNS
from pendpipe.formats.header import interval_of
from pendpipe.formats.lists import SETTINGS, WAVEFORM
from pendpipe.formats.table import (
    FEWEST_ROWS,
    Column,
    NotThisFormatError,
    ReadOptions,
    Table,
    damaged_if,
    refuse_unpacked,
    swing_of,
    zip_archive,
)
from pendpipe.formats.text import table_of_text
from pendpipe.formats.words import role_of, split_header

MOST: Final = 1 << 27
"""Numbers that an array may hold."""
_LARGEST_JSON: Final = 48 << 20
_MOST_CELLS: Final = 1_500_000
"""Of records with texts: half a gigabyte."""
_DEEPEST, _WIDEST = 12, 64
"""Structures in one another; columns of a matrix, and entries of a list of structures."""
_OUTSIDE: Final = "data sets of other files belong to it: copy them into it (h5repack)"
_MOST_LISTS: Final = 2_000_000
"""Lists and records of a JSON document: each takes a hundred bytes or more."""
_AUDIO_HZ: Final = 4000.0
"""Rate from which on a file of sound may hold a tone that the swing modulates."""
_STRETCH_S: Final = 5e-3
_MOST_SOUND: Final = 1 << 25
"""Samples of a sound, twelve minutes at 44.1 kHz: three copies of them take 0.8 GB."""


def table_of_tree(
    place: Path, tree: Any, form: str, options: ReadOptions, units: Mapping[str, str] | None = None
) -> Table:
    """Make a table of the arrays of one length, with the names of what they are in.

    Of several lengths the one is taken that the array the user named has, else the longest
    that comes with a time.

    Parameters
    ----------
    tree
        Arrays in dictionaries, lists, and NumPy's records and arrays of objects.
    form
        The name that ``inspect`` prints.
    units
        What the file says of an array's unit, by the array's name.
    """
    arrays = dict(_numbers(tree))
    columns = {name: values for name, values in arrays.items() if values.size >= FEWEST_ROWS}
    damaged_if(len(columns) > MOST_COLUMNS, f"it holds more than {MOST_COLUMNS} arrays")
    refuse_if(
        not columns,
        place,
        "there is no array of numbers in it: " + SETTINGS.partition(" ")[2],
        f"{WAVEFORM}, or save the time and the angle",
    )
    length = _length(columns, options)
    left = [name for name, values in columns.items() if len(values) != length]
    chosen = _one_clock({name: values for name, values in columns.items() if name not in left})
    return Table(
        place=place,
        format=form,
        columns=tuple(
            Column(name, (units or {}).get(name) or split_header(_last(name))[1], values, number)
            for number, (name, values) in enumerate(chosen.items(), start=1)
        ),
        interval_s=_interval(arrays),
        notes=(f"arrays of another length left out: {', '.join(left[:8])}",) if left else (),
    )


def _numbers(tree: Any, path: str = "", depth: int = 0) -> Iterator[tuple[str, FloatArray]]:
    """Walk through dictionaries, lists and structures; give every real array as columns."""
    if depth > _DEEPEST or tree is None:
        return
    if isinstance(tree, dict) and _is_list(tree):
        tree = list(tree.values())
    tree = _array_of_list(tree) if isinstance(tree, list) else tree
    label = tree.get("label") if isinstance(tree, dict) and "values" in tree else None
    if isinstance(label, str) and label.strip():
        # Simulink's "structure with time" names a signal in its label.
        path, tree = label.strip(), {"values": tree["values"]}
    array: Any = np.asarray(tree)
    kind = array.dtype.kind
    array = array.astype(f"{kind}8[ns]").astype(float) / 1e9 if kind in "mM" else array
    records = {name: array[name] for name in array.dtype.names or ()}
    named = tree if isinstance(tree, dict) else records
    inside = {f"{path}.{name}" if path else str(name): value for name, value in named.items()}
    if array.dtype == object and not isinstance(tree, dict):
        entries = enumerate(array.reshape(-1)[:_WIDEST], start=1)
        inside = {path if array.size == 1 else f"{path}({n})": entry for n, entry in entries}
    for name, value in inside.items():
        yield from _numbers(value, name, depth + 1)
    if inside or array.dtype.kind not in "fiub" or array.ndim > 2 or not array.size:
        return
    # Simulink's "structure with time" keeps the readings in NAME.signals.values.
    path = path.removesuffix(".signals.values").removesuffix(".values").removesuffix(".Data")
    flat = np.atleast_1d(np.squeeze(array)).astype(np.float64)
    tall = flat.T if flat.ndim > 1 and flat.shape[0] < flat.shape[1] else flat
    if tall.ndim < 2:
        yield path, tall
    elif tall.shape[1] <= _WIDEST:
        for number, column in enumerate(tall.T, start=1):
            yield f"{path}({number})", np.ascontiguousarray(column)


def _is_list(tree: dict[Any, Any]) -> bool:
    """Say whether keys only number the entries, as pandas', or name records of numbers."""
    records = [each.values() for each in tree.values() if isinstance(each, dict)]
    simple = all(isinstance(cell, int | float | str) for record in records for cell in record)
    named = len(records) == len(tree) >= FEWEST_ROWS and simple and len({*map(len, records)}) == 1
    return named or (len(tree) > 0 and all(str(key).isdigit() for key in tree))


def _array_of_list(entries: list[Any]) -> Any:
    """Turn JSON's list of records, of numbers with gaps, or of times of day into arrays."""
    if entries and all(isinstance(entry, dict) for entry in entries):
        entries = _unfolded(entries)
        return {name: [entry.get(name) for entry in entries] for name in entries[0]}
    try:
        return np.array([np.nan if entry is None else entry for entry in entries], dtype=np.float64)
    except (ValueError, TypeError):
        strings = all(isinstance(entry, str) for entry in entries)
        clock = column_of_clock_times(entries) if strings else None
        return np.array([*entries, None], dtype=object)[:-1] if clock is None else clock


def _unfolded(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Give records that hold lists of records (blocks of a sensor), one row per sample."""
    held = [
        k for k, v in records[0].items() if isinstance(v, list) and v and isinstance(v[0], dict)
    ]
    rows = [
        {name: value for name, value in record.items() if name not in held}
        | {f"{k}.{j}": w for k, v in one.items() if isinstance(v, dict) for j, w in v.items()}
        for record in records
        for one in (
            dict(zip(held, values, strict=True))
            for values in zip(*(record.get(k) or [] for k in held), strict=False)
        )
    ]
    return rows if len(rows) > len(records) else records


def _last(name: str) -> str:
    """The last part of a dotted name, without a column's number."""
    return name.rsplit(".", 1)[-1].split("(")[0]


def _length(columns: dict[str, FloatArray], options: ReadOptions) -> int:
    lengths = {name: len(values) for name, values in columns.items()}
    asked = (options.columns[1], options.channel)
    wanted = [n for name, n in lengths.items() if name in asked or _last(name) == asked[0]]
    timed = [n for name, n in lengths.items() if role_of(_last(name)) == "time"]
    paired = [n for n in timed if list(lengths.values()).count(n) > 1]
    return wanted[0] if wanted else max(paired or lengths.values())


def _one_clock(columns: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Keep one of several equal time columns, and put it first."""
    named = {name: values for name, values in columns.items() if role_of(_last(name)) == "time"}
    before = ([*named.values()][:number] for number in range(len(named)))
    again = (
        any(np.array_equal(a, b) for b in some)
        for a, some in zip(named.values(), before, strict=True)
    )
    clocks = {name: named[name] for name, twice in zip(named, again, strict=True) if not twice}
    return clocks | {name: values for name, values in columns.items() if name not in named}


def _interval(arrays: dict[str, FloatArray]) -> float | None:
    """Find a single number that is named as a header would name a rate or an interval."""
    single = ((_last(name), v.item()) for name, v in arrays.items() if v.size == 1)
    full = ((re.sub(r"(?i)^s?(?=rate$|freq)", "sample ", name), value) for name, value in single)
    lines = [f"{re.sub('(?i)^t_?s(ample)?$', 'ts', name)}: {value!r}" for name, value in full]
    return interval_of(lines)


def read_hdf5(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the data sets of all groups, with the units among their attributes.

    What lies outside of the file is refused before it is opened: it could be any file of the
    reader's, or a pipe. A damaged file may keep the library for good, which is called apart.
    """
    importlib.import_module("h5py")  # where it is not installed, that is said
    tree, units = called_apart(hdf5_tree, data)
    return table_of_tree(place, tree, "hdf5", options, units)


def hdf5_tree(data: bytes) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the data sets and attributes by their paths, and the units of the data sets."""
    import h5py

    tree: dict[str, Any] = {}
    units: dict[str, str] = {}

    whole = 0

    def gather(name: str, node: Any) -> None:
        nonlocal whole
        if not isinstance(node, h5py.Dataset):
            links = [node.get(each, getlink=True) for each in node]
            damaged_if(any(isinstance(each, h5py.ExternalLink) for each in links), _OUTSIDE)
            return
        damaged_if(len(units) > MOST_COLUMNS, f"it holds more than {MOST_COLUMNS} arrays")
        # To ask a virtual data set for its size opens the files that it is made of.
        damaged_if(node.is_virtual or node.external, _OUTSIDE)
        if name.startswith("#") or node.size > MOST:
            return
        if node.dtype.kind in "fiub" or node.dtype.names:
            path = name.replace("/", ".")
            whole += node.size * max(node.dtype.itemsize, 8)
            refuse_unpacked(whole, len(data))
            tree[path] = node[()]
            unit = node.attrs.get("units", node.attrs.get("unit", ""))
            tree.update({f"{path}.{key}": value for key, value in node.attrs.items()})
            units[path] = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)

    with h5py.File(io.BytesIO(data), "r") as file:
        tree.update(file.attrs)
        gather("", file)
        file.visititems(gather)
    return tree, units


def read_numpy(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read an array, or several by their names."""
    if data.startswith(b"PK"):
        zip_archive(data).close()
    loaded = np.load(io.BytesIO(data), allow_pickle=False)
    tree = dict(loaded) if hasattr(loaded, "files") else loaded
    return table_of_tree(place, tree, "numpy", options)


def read_json(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read a document, or one record a line."""
    refuse_if(
        len(data) > _LARGEST_JSON,
        place,
        f"the JSON holds more than {_LARGEST_JSON >> 20} MB",
        "export CSV",
    )
    refuse_if(
        data.count(b"[") + data.count(b"{") > _MOST_LISTS,
        place,
        f"the JSON holds more than {_MOST_LISTS} lists and records",
        "export CSV",
    )
    text = data.decode("utf-8-sig", errors="replace")
    try:
        tree = json.loads(text)
    except ValueError:
        try:
            tree = [json.loads(line) for line in text.splitlines() if line.strip()]
        except (ValueError, RecursionError):
            raise NotThisFormatError("it is no JSON") from None
    if isinstance(tree, list) and tree and all(isinstance(record, dict) for record in tree):
        # Records with texts (times of day, "0.12", names of sensors) are a table of text.
        worded = any(isinstance(value, str) for record in tree for value in record.values())
        rows = [_flat(record) for record in tree] if worded else []
        names = list(dict.fromkeys(name for row in rows for name in row))
        refuse_if(
            len(names) * len(rows) > _MOST_CELLS,
            place,
            f"its records hold more than {_MOST_CELLS} cells",
            "export CSV",
        )
        if rows:
            cells = (names, *([row.get(name, "") for name in names] for row in rows))
            text = "\n".join("\t".join(map(str, row)) for row in cells)
            return table_of_text(place, text, replace(options, delimiter="\t", decimal="."), "json")
    return table_of_tree(place, tree, "json", options)


def _flat(record: dict[str, Any]) -> dict[str, Any]:
    """Take a record apart that holds records: ``acc.x``."""
    parts = ((k, v if isinstance(v, dict) else {"": v}) for k, v in record.items())
    return {f"{k}.{j}".strip("."): w for k, v in parts for j, w in v.items() if w is not None}


def read_tdms(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the channels of LabVIEW's TDMS, each with its interval and its unit."""
    import logging

    from nptdms import TdmsFile
    from nptdms.log import log_manager

    log_manager.set_level(logging.CRITICAL)
    with TdmsFile.open(io.BytesIO(data)) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        promised = sum(map(len, channels))
        damaged_if(promised > len(data), "it promises more samples than it has bytes")
        tree: dict[str, Any] = {channel.name: channel[:] for channel in channels}
        told = {channel.name: channel.properties for channel in channels}
    units = {name: str(each.get("unit_string", "")) for name, each in told.items()}
    for each in told.values():
        tree |= {"dt": each["wf_increment"]} if "wf_increment" in each else {}
    return table_of_tree(place, tree, "tdms", options, units)


def read_sound(place: Path, data: bytes, _options: ReadOptions) -> Table:
    """Read the channels of a .wav, full scale as 1; a tone that a swing modulates by its strength.

    A sound card passes no constant, so that some put the sensor's voltage on a tone.
    """
    from scipy.io import wavfile

    rate: float
    rate, samples = wavfile.read(io.BytesIO(data))
    damaged_if(samples.size > _MOST_SOUND, f"it holds {samples.size} samples")
    scale = {"i": float(np.iinfo(samples.dtype).max) + 1.0, "u": 128.0}.get(samples.dtype.kind, 1.0)
    values = samples.reshape(len(samples), -1) / np.float64(scale)
    notes: tuple[str, ...] = ()
    stretch = round(_STRETCH_S * rate)
    if rate >= _AUDIO_HZ and len(values) > 100 * stretch:
        blocks = values[: len(values) // stretch * stretch].reshape(-1, stretch, values.shape[1])
        strength = blocks.std(axis=1)
        if strength.mean() > blocks.mean(axis=1).std() and swing_of(strength[:, 0]).clear:
            values, rate = strength, rate / stretch
            notes = (f"a tone whose strength swings: that, every {_STRETCH_S:g} s, is the reading",)
    return Table(
        place,
        "sound",
        tuple(
            Column(f"channel {number}", "1", column, number)
            for number, column in enumerate(np.ascontiguousarray(values.T), start=1)
        ),
        interval_s=1.0 / rate,
        notes=notes,
    )
