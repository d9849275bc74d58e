"""Projects kept as XML: CASSY Lab (.labx), Logger Pro (.cmbl), Tracker (.trk)."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from math import cos, radians, sin
from pathlib import Path

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, NotThisFormatError, Table

_LARGEST = 64 << 20
"""A tree of elements takes some ten times the file's memory."""
_START = re.compile(rb"\s*(?:\xef\xbb\xbf)?\s*<(\?xml|cassylab|Document|object)\b")


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:  # noqa: ARG001
    """Read the samples out of a project file.

    Entities are refused: none of these programs writes them, and they can be made to fill
    the memory.

    Raises
    ------
    NotThisFormatError
        When the file is no XML, or none of these programs' own.
    InputError
        When it is damaged, or holds no samples.
    """
    if not _START.match(data[:200]):
        raise NotThisFormatError("the file is no XML")
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise InputError(place, "the XML declares entities", "export the data as CSV")
    if len(data) > _LARGEST:
        raise InputError(
            place, f"the XML holds more than {_LARGEST >> 20} MB", "export the data as CSV"
        )
    try:
        root = ET.fromstring(data)
    except (ET.ParseError, ValueError, LookupError) as fault:
        raise InputError(
            place, f"the XML is damaged ({fault})", "save it again, or export CSV"
        ) from None
    if root.tag == "cassylab":
        name, found = "cassy-labx", list(_of_cassy(root))
    elif root.find(".//ColumnCells") is not None:
        name, found = "logger-pro", list(_of_logger_pro(root))
    elif "TrackerPanel" in root.get("class", ""):
        name, found = "tracker", list(_of_tracker(place, root))
    else:
        raise NotThisFormatError("the XML is none of CASSY Lab's, Logger Pro's or Tracker's")
    found = [(title, unit, values) for title, unit, values in found if len(values) > 3]
    if not found:
        raise InputError(place, "the project holds no samples", "export the data as CSV")
    longest = max(len(values) for _, _, values in found)
    columns = tuple(
        Column(title, unit, _filled(values, longest), number)
        for number, (title, unit, values) in enumerate(found, start=1)
    )
    return Table(place=place, format=name, columns=columns)


def _filled(values: FloatArray, length: int) -> FloatArray:
    """Runs side by side are of unlike length: the shorter end in empty cells."""
    return np.concatenate((values, np.full(length - len(values), np.nan)))


def _number(text: str | None) -> float:
    """Read a cell; what is empty, or a mark of a lost sample, is NaN."""
    try:
        value = float((text or "").strip().replace(",", "."))
    except ValueError:
        return float("nan")
    return value if abs(value) < 1e300 else float("nan")


def _of_cassy(root: ET.Element) -> Iterator[tuple[str, str, FloatArray]]:
    """Give each channel of a .labx file: quantity, symbol, unit, values."""
    for channel in root.iter("channel"):
        cells = channel.find("values")
        if cells is None:
            continue
        title = f"{channel.findtext('quantity') or ''} {channel.findtext('symbol') or ''}"
        values = np.array([_number(cell.text) for cell in cells], dtype=np.float64)
        yield title.replace("&", "").strip(), (channel.findtext("unit") or "").strip(), values


def _of_logger_pro(root: ET.Element) -> Iterator[tuple[str, str, FloatArray]]:
    """Give each filled column of each data set."""
    for column in root.iter("DataColumn"):
        cells = (column.findtext("ColumnCells") or "").split("\n")
        values = np.array([_number(cell) for cell in cells if cell.strip()], dtype=np.float64)
        title = (column.findtext("DataObjectName") or "").strip()
        if np.isfinite(values).any():
            yield title, (column.findtext("ColumnUnits") or "").strip(), values


def _of_tracker(place: Path, root: ET.Element) -> Iterator[tuple[str, str, FloatArray]]:
    """Give t, x, y of the point mass with most frames, as Tracker itself would print them.

    The image's y points down; origin, scale and tilt of the axes are those of the frame.
    """
    marks = [_frames(track, "PointMass$FrameData") for track in root.iter("object")
             if track.get("class", "").endswith("tracker.PointMass")]  # fmt: skip
    marks = [mark for mark in marks if mark]
    axes = next(
        (_frames(each, "ImageCoordSystem$FrameData") for each in root.iter("object")
         if each.get("class", "").endswith("ImageCoordSystem")), {}
    )  # fmt: skip
    if not marks:
        raise InputError(place, "the project has no point mass", "export its data as text")
    mass = max(marks, key=len)
    step_ms = next(
        (value for value in map(_number, _properties(root, "delta_t")) if value > 0), float("nan")
    )
    if not step_ms > 0:
        raise InputError(
            place, "the project does not give its frame rate", "export its data as text"
        )
    first = _number(next(iter(_properties(root, "startframe")), "0"))
    start_ms = _number(next(iter(_properties(root, "starttime")), "0"))
    rows = []
    frame_axes: dict[str, float] = {}
    known = sorted(axes)
    for number in sorted(mass):
        while known and known[0] <= number:
            frame_axes = axes[known.pop(0)]
        point = mass[number]
        if "x" not in point or "y" not in point:
            continue
        tilt = radians(frame_axes.get("angle", 0.0))
        across = point["x"] - frame_axes.get("xorigin", 0.0)
        up = frame_axes.get("yorigin", 0.0) - point["y"]
        x = (across * cos(tilt) + up * sin(tilt)) / (frame_axes.get("xscale") or 1.0)
        y = (up * cos(tilt) - across * sin(tilt)) / (frame_axes.get("yscale") or 1.0)
        rows.append((1e-3 * ((number - first) * step_ms + start_ms), x, y))
    unit = next(iter(_properties(root, "length_unit")), "")
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    scaled = any(axis.get("xscale", 1.0) != 1.0 for axis in axes.values())
    yield "t", "s", table[:, 0]
    yield "x", unit if scaled else "px", table[:, 1]
    yield "y", unit if scaled else "px", table[:, 2]


def _properties(root: ET.Element, name: str) -> Iterator[str]:
    return (each.text or "" for each in root.iter("property") if each.get("name") == name)


def _frames(track: ET.Element, kind: str) -> dict[int, dict[str, float]]:
    """Read the numbers that are kept for each frame of the video."""
    frames: dict[int, dict[str, float]] = {}
    for entry in track.iter("property"):
        place = re.fullmatch(r"\[(\d{1,9})\]", entry.get("name", ""))
        content = entry.find("object")
        if place is None or content is None or not content.get("class", "").endswith(kind):
            continue
        numbers = {
            each.get("name", ""): _number(each.text)
            for each in content.iter("property")
            if each.get("type") in ("double", "int")
        }
        # Newer versions number the entries through and keep the frame as n.
        frame = numbers.get("n", float(place[1]))
        frames[int(frame) if frame == frame else int(place[1])] = numbers
    return frames
