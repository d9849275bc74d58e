"""How one swing is written into tables and files, and what has to be read from them."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pendpipe.formats import ReadOptions, read
from pendpipe.recording import Recording

from .decays import Floats, swing

AS_FOUND = ReadOptions()
TIME, ANGLE = swing(1000, 50.0, 0.5)
RATE, DEGREES = np.gradient(ANGLE, TIME), np.degrees(ANGLE)


def text(
    *columns: Floats, sign: str = ",", decimal: str = ".", digits: int = 6, head: str = ""
) -> str:
    """A table of columns below a header."""
    rows = (sign.join(f"{x:.{digits}f}" for x in row) for row in zip(*columns, strict=True))
    return head + "".join(row.replace(".", decimal) + "\n" for row in rows)


def each(form: str, *columns: Floats | Sequence[object]) -> str:
    """Rows of the form, which may hold several lines."""
    return "".join(form.format(*row) for row in zip(*columns, strict=True))


def clock(form: str, seconds: Floats) -> list[str]:
    """Times of day by the form's h, m and s."""
    return [form.format(h=int(t // 3600), m=int(t // 60) % 60, s=t % 60) for t in seconds]


def with_lines(content: str, changed: dict[int, str]) -> str:
    """A text with some of its lines put otherwise."""
    lines = content.splitlines()
    return "\n".join(changed.get(number, line) for number, line in enumerate(lines)) + "\n"


def read_as(
    folder: Path, content: str | bytes, name: str = "a.txt", options: ReadOptions = AS_FOUND
) -> Recording:
    """What is read from a file of this content and name."""
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read(path, options)


def same(
    recording: Recording, values: Floats = ANGLE, time_s: Floats = TIME, within_s: float = 2e-3
) -> None:
    """Times from the first one on and readings are those."""
    assert len(recording) == len(values), len(recording)
    found_s = recording.time_s - recording.time_s[0]
    np.testing.assert_allclose(found_s, (time_s - time_s[0])[: len(values)], atol=within_s)
    good, size = recording.usable, float(np.ptp(values))
    np.testing.assert_allclose(recording.values[good], values[good], atol=3e-4 * size)


class Case(NamedTuple):
    """A file, and what has to be read from it."""

    content: str | bytes
    values: Floats = ANGLE
    unit: str = "rad"
    said: str = ""
    """Part of a note or of a weak guess."""
    doubted: str | None = None
    """Part of the weak guesses; "" if there has to be none."""
    lost: Sequence[int] = ()
    time_s: Floats = TIME
    within_s: float = 2e-3
    name: str = "a.txt"
    options: ReadOptions = AS_FOUND


def check(folder: Path, case: Case) -> None:
    """Read a case's file."""
    recording = read_as(folder, case.content, case.name, case.options)
    same(recording, case.values, case.time_s, case.within_s)
    doubts = " / ".join(recording.weak_guesses)
    assert recording.unit == case.unit, recording.unit
    assert np.flatnonzero(~recording.usable).tolist() == list(case.lost)
    said = " / ".join(recording.notes) + doubts
    assert re.search(case.said, said), said
    if case.doubted is not None:
        assert case.doubted in doubts, doubts
        assert bool(case.doubted) == bool(doubts), doubts
