"""A recording to a file: the plain CSV form, or WinDaq's HiRes form (.WDH)."""

import math
import re
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import refuse_if
from pendpipe.files import MADE_BY, replaced
from pendpipe.formats.reading import markers_of
from pendpipe.formats.windaq import MOST_SAMPLES, Channel, Event, gap_comment, pack
from pendpipe.recording import SUSPECT, Recording, write_plain

_UNEVEN: Final = 0.25
"""A sample may lie so many intervals off its place before the times are held to matter."""
_WORTH_SAYING: Final = 0.02


_Pauses = list[tuple[int, float]]
"""Each a scan, and the seconds beyond the usual interval that are missing before it."""


def on_grid(place: str | Path, recording: Recording) -> tuple[IntArray, float, _Pauses, list[str]]:
    """Put the usable samples on an even grid.

    Returns
    -------
    rows, interval_s, pauses, notes
        The rows with a reading, their interval, the pauses between; what was lost by it.

    Raises
    ------
    InputError
        When there is none, or they are not evenly spaced.
    """
    rows = np.flatnonzero(recording.usable)
    refuse_if(not len(rows), place, "there are no samples", "record again, or give another file")
    time_s = recording.time_s[rows]
    if len(rows) == 1:
        return rows, recording.interval_s if len(recording) > 1 else 1.0, [], []
    steps = np.diff(time_s)
    breaks = np.flatnonzero(steps > 1.5 * float(np.median(steps)))
    edges = np.concatenate(([0], breaks + 1, [len(rows)]))
    # From the ends of all stretches together, gaps left out.
    counted = int((np.diff(edges) - 1).sum())
    span_s = float((time_s[edges[1:] - 1] - time_s[edges[:-1]]).sum())
    interval_s = span_s / counted if counted else float(np.median(steps))
    off = np.concatenate(
        [
            time_s[a:b] - time_s[a] - interval_s * np.arange(b - a)
            for a, b in pairwise(edges.tolist())
        ]
    )
    worst = float(np.abs(off).max()) / interval_s
    # A step of the times that is not seen as a break would be a silent shift.
    refuse_if(
        worst > _UNEVEN,
        place,
        f"the samples are not evenly spaced (by up to {worst:.2g} of an interval)",
        "this format has no times: write OUT.csv instead",
    )
    pauses = [(int(at) + 1, float(steps[at]) - interval_s) for at in breaks]
    in_all_s = sum(missing for _, missing in pauses)
    notes = (
        (
            pauses,
            f"{len(pauses)} gap(s) of {in_all_s:.6g} s in all"
            " are pauses, each with an event that gives its length",
        ),
        (
            worst > _WORTH_SAYING,
            f"times moved by up to {worst:.2g} of an interval, onto an even grid",
        ),
    )
    return rows, interval_s, pauses, [note for said, note in notes if said]


_LOWEST, _HIGHEST = -32768, 32767
_LARGEST: Final = 1e30
"""Readings beyond it are none, and would not fit the header's scale."""
_LATEST: Final = 2**31 - 2**24
"""Times of the header are seconds since 1970 in 31 bits."""
_LONGEST_S: Final = 2.0**31 - 1
"""Time stamps are whole seconds in 31 bits."""
_TAGS: Final = {"volts": "Volt", "angle_rad": "rad", "displacement_m": "m"}
_READ_ONLY: Final = (".wdq", ".wdc", ".whc", ".mat", ".xlsx", ".xls")


def check_name(path: str | Path) -> None:
    """Refuse, before anything is recorded, a name whose form can't be written.

    Raises
    ------
    InputError
        On .WDQ, .WDC, .WHC, .mat and .xlsx.
    """
    refuse_if(
        Path(path).suffix.lower() in _READ_ONLY,
        path,
        "this format can be read, not written",
        "name it OUT.csv or OUT.wdh",
    )


def write(path: str | Path, recording: Recording, *, original: bool = False) -> tuple[str, ...]:
    """Write a recording in the form that the file's name asks for: ``.wdh``, or plain.

    An `original` comes from an instrument: it is the user's own from then on.

    Returns
    -------
    tuple of str
        What the form could not hold, a clause each.

    Raises
    ------
    InputError
        When the form is one that is only read, or can't hold the recording.
    """
    check_name(path)
    if Path(path).suffix.lower() != ".wdh":
        write_plain(path, recording, original=original)
        return ()
    content, notes = windaq_hires(path, recording)
    with replaced(path, "wb") as stream:
        # Behind the last comment, where WinDaq reads nothing.
        stream.write(content if original else content + f"\0made by {MADE_BY}\0".encode())
    return notes


def windaq_hires(place: str | Path, recording: Recording) -> tuple[bytes, tuple[str, ...]]:
    """Turn a recording into the bytes of a HiRes file, with notes of what was lost by it.

    Gaps are pauses: the samples are strung together, and an event before the first one
    behind a gap has its time stamp (whole seconds) and the gap's length as its comment.

    Raises
    ------
    InputError
        When the samples are not evenly spaced, or too many.
    """
    rows, interval_s, pauses, notes = on_grid(place, recording)
    values = recording.values[rows]
    begin_s = float(recording.time_s[rows[0]])
    length_s = float(recording.time_s[rows[-1]]) - begin_s
    for wrong, problem, remedy in (
        (len(values) > MOST_SAMPLES, f"{len(values)} samples are too many", "cut it"),
        (np.abs(values).max() > _LARGEST, "the readings are too large", "check their unit"),
        (length_s > _LONGEST_S, f"{length_s:.3g} s are too long", "check the time's unit"),
    ):
        refuse_if(wrong, place, f"{problem} for a .WDH", remedy)
    slope, intercept, counts = _scaled(recording, values, notes)
    number = recording.metadata.get("channel", "1")
    channel = Channel(
        number=int(number) if number.isdecimal() and 0 < int(number) < 32 else 1,
        slope=slope,
        intercept=intercept,
        unit=_TAGS.get(recording.quantity, recording.unit),
        range_volts=recording.number("range_volts") if recording.quantity == "volts" else None,
        annotation=recording.metadata.get("model", "")[:31],
    )
    began = _seconds_since_1970(recording.metadata.get("recorded_at", ""))
    opened = round(began + begin_s) if began else 0
    if not 0 < opened < _LATEST:
        opened = 0
    content = pack(
        counts[:, None],
        [channel],
        interval_s,
        opened=opened,
        closed=min(opened + math.ceil(length_s), _LATEST) if opened else 0,
        events=_events(recording, rows, pauses),
    )
    constant = recording.metadata.get("volts_per_radian")
    notes += [
        note
        for lost, note in (
            (constant, f"a .WDH has no place for volts_per_radian ({constant})"),
            (
                abs(begin_s) > 0.5 * interval_s,
                f"times in the .WDH count from its first sample ({begin_s:.6g} s here)",
            ),
        )
        if lost
    ]
    return content, tuple(notes)


def _scaled(
    recording: Recording, values: FloatArray, notes: list[str]
) -> tuple[float, float, IntArray]:
    """Find slope and intercept under which 16-bit counts hold the readings.

    Tried in turn: the converter's own range (its codes at the top of the word, as WinDaq
    has those of a 12-bit box); the step between readings about their middle; the span of the
    readings over all codes. The first that errs by less than 1/1000 of its step is taken.
    """
    low, high = float(values.min()), float(values.max())
    middle = 0.5 * low + 0.5 * high
    tries: list[tuple[float, float]] = []
    range_volts = recording.number("range_volts")
    unipolar = recording.number("range_low_volts") is not None
    possible = range_volts is not None and 1e-6 < range_volts < 1e6
    if recording.quantity == "volts" and range_volts and possible and not unipolar:
        tries.append((range_volts / -_LOWEST, 0.0))
    if recording.resolution:
        tries.append((recording.resolution, float(values[np.argmin(np.abs(values - middle))])))
    span_step = max((high - low) / (_HIGHEST - _LOWEST - 1), abs(middle) * 1e-12, 1e-12)
    tries.append((span_step, middle))
    for step, intercept in tries:
        counts = np.rint((values - intercept) / step)
        if counts.min() < _LOWEST or counts.max() > _HIGHEST:
            continue
        worst = float(np.abs(counts * step + intercept - values).max())
        if worst < 1e-3 * min(step, high - low or step):
            break
    else:
        notes.append(
            f"readings rounded to the .WDH's 16 bits (by {worst:.2g} {recording.unit} at most)"
        )
    return 4.0 * step, intercept, counts.astype(np.int64)


def _events(recording: Recording, rows: IntArray, pauses: _Pauses) -> list[Event]:
    """Gather pauses, markers and the starts of suspect stretches, in the order of scans."""
    time_s = recording.time_s[rows]
    by_scan: dict[int, list[str]] = {}
    for scan, missing_s in pauses:
        by_scan.setdefault(scan, []).append(gap_comment(missing_s))
    for mark in markers_of(recording):
        scan = int(np.clip(np.searchsorted(time_s, mark.time_s - 1e-9), 0, len(rows) - 1))
        comments = by_scan.setdefault(scan, [])
        comments += [mark.comment] * (mark.comment not in comments)
    if recording.quality is not None:
        suspect = recording.quality[rows] == SUSPECT
        for scan in np.flatnonzero(suspect & ~np.concatenate(([False], suspect[:-1]))).tolist():
            by_scan.setdefault(scan, []).append("suspect")
    return [
        Event(scan, round(float(time_s[scan] - time_s[0])), "; ".join(filter(None, comments)))
        for scan, comments in sorted(by_scan.items())
    ]


def _seconds_since_1970(text: str) -> float:
    """Read a date as this package's readers write it; 0 where there is none."""
    if match := re.fullmatch(r"(\d+(?:\.\d+)?) s since 1970", text):
        return float(match[1])
    try:
        when = datetime.fromisoformat(text)
    except ValueError:
        return 0.0
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()
