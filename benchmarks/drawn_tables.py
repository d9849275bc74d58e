"""Tables drawn by the commit's hash, each holding a swing that is known: right, refused or wrong.

    python -m benchmarks.drawn_tables              300 of them
    python -m benchmarks.drawn_tables --keep DIR   and keep those that were not read right

Drawn are the sign between cells, the decimal sign, the rows of the header, where units stand, how
the times are stamped, the columns beside the reading, and damage to up to one row in a hundred.
Right is a table read in its own unit, or in radians where the file states the angle's unit or its
period shows it; wrong is any other reading whose first lines do not doubt just that.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np
from numpy.typing import NDArray

from benchmarks.journal import commit
from pendpipe.errors import InputError
from pendpipe.formats import read

Floats = NDArray[np.float64]
TABLES, LEAST_RIGHT = 300, 285
SIGNS = {"comma": ",", "semicolon": ";", "tab": "\t", "blanks": "  "}
UNITS = {
    "rad": (1.0, 5),
    "deg": (180.0 / np.pi, 3),
    "V": (2.4, 4),
    "mm": (350.0, 1),
    "cm": (35.0, 2),
}
SI = {"rad": 1.0, "deg": np.pi / 180.0, "V": 1.0, "mm": 1e-3, "cm": 1e-2}
NAMES = {
    "rad": ("theta", "angle", "Winkel"),
    "deg": ("theta", "angle", "phi"),
    "V": ("voltage", "U", "CH1"),
    "mm": ("position", "x", "Weg"),
    "cm": ("position", "x", "displacement"),
}
BESIDE = ("index", "temperature", "error", "drive", "flag", "pressure")
STAMPS = ("even", "rounded", "cut", "date and time", "counter")


@dataclass(frozen=True)
class Drawn:
    """A table's bytes, what was drawn, and the swing in it: `values` as written, times in s."""

    content: bytes
    story: str
    time_s: Floats
    values: Floats
    unit: str
    stated: bool


def swing(random: Random) -> tuple[Floats, Floats]:
    """Draw a pendulum that swings by sin x, with its period lengthened to fourth order."""
    rate, period = random.choice((20.0, 25.0, 50.0, 100.0)), random.choice((0.7, 1.1, 1.6, 2.4))
    amplitude, cycles = random.choice((0.08, 0.3, 0.9)), random.choice((20, 50))
    time = np.arange(round(cycles * period * rate)) / rate
    size = amplitude * np.exp(-random.choice((1.0, 2.5)) * time / time[-1])
    phase = (
        2.0 * np.pi / period * np.cumsum(1.0 / (1.0 + size**2 / 16 + 11 * size**4 / 3072)) / rate
    )
    noise = np.random.default_rng(random.randrange(1 << 30)).standard_normal(len(time))
    return time, size * np.cos(phase) + 1e-3 * amplitude * noise


def stamps(form: str, time: Floats, decimal: str, random: Random) -> tuple[list[str], str, str]:
    """Write the times; give their name and unit."""
    start = random.choice((0.0, 0.0, 12.5))
    digits = 1 if time[1] < 0.05 else 2
    match form:
        case "rounded":
            texts = [f"{start + t:.{digits}f}" for t in time]
        case "cut":
            ticks = np.floor((start + time) * 10**digits + 1e-6) / 10**digits
            texts = [f"{t:.{digits}f}" for t in ticks]
        case "date and time":
            seconds = [int(3600 * 9 + t) for t in time]
            clock = [f"{s // 3600:02d}:{s // 60 % 60:02d}:{s % 60:02d}" for s in seconds]
            part = [f"{round(1000 * (t % 1.0)) % 1000:03d}" for t in time + 1e-7]
            rows = zip(clock, part, strict=True)
            return [f"2024-03-05 {c}.{p}" for c, p in rows], "time", ""
        case "counter":
            return [f"{round(1000 * (start + t))}" for t in time], "millis", "ms"
        case _:
            texts = [f"{start + t:.3f}" for t in time]
    return [text.replace(".", decimal) for text in texts], random.choice(("t", "time", "Zeit")), "s"


def beside(kind: str, count: int, random: Random) -> list[float]:
    """Draw a column that no pendulum swings in."""
    dice = np.random.default_rng(random.randrange(1 << 30))
    columns = {
        "index": np.arange(1.0, count + 1),
        "temperature": 21.0 + np.cumsum(dice.standard_normal(count)) * 0.01,
        "error": 0.01 + 0.001 * dice.random(count),
        "drive": np.zeros(count),
        "flag": (dice.random(count) > 0.5).astype(float),
        "pressure": 1013.0 + dice.standard_normal(count) * 0.1,
    }
    return [float(value) for value in columns[kind]]


def damaged(rows: list[str], random: Random) -> list[str]:
    """Garble, tear or join up to one row in a hundred."""
    rows = list(rows)
    for _ in range(random.choice((0, 0, int(0.005 * len(rows)), int(0.008 * len(rows))))):
        at = random.randrange(2, len(rows) - 2)
        kind = random.choice(("torn", "garbled", "nul", "two in one"))
        row = rows[at]
        rows[at] = {
            "torn": row[: len(row) // 3],
            "garbled": row[: len(row) // 2] + "\N{REPLACEMENT CHARACTER}~" + row[len(row) // 2 :],
            "nul": "\0\0" + row[2:],
            "two in one": row + rows[at + 1],
        }[kind]
    return rows


def draw(random: Random) -> Drawn:
    """Draw one table."""
    time, angle = swing(random)
    unit, form = random.choice(tuple(UNITS)), random.choice(STAMPS)
    sign_name, decimal = random.choice(tuple(SIGNS)), random.choice(".,")
    if sign_name == "blanks" and form == "date and time":
        sign_name = "semicolon"
    sign, (factor, digits) = SIGNS[sign_name], UNITS[unit]
    head, units_in = random.choice((0, 1, 2)), random.choice(("header", "beside", "nowhere"))
    units_in = (
        "nowhere" if head == 0 else "header" if head == 1 and units_in == "beside" else units_in
    )
    values = factor * angle + random.choice((0.0, 0.0, 0.3 * factor))
    values = np.array([float(f"{value:.{digits}f}") for value in values])
    cells, clock, tick = stamps(form, time, decimal, random)
    columns = [
        (clock, tick, cells),
        (
            random.choice(NAMES[unit]),
            unit,
            [f"{x:.{digits}f}".replace(".", decimal) for x in values],
        ),
    ]
    for kind in random.sample(BESIDE, random.randrange(len(BESIDE) + 1)):
        width = {"index": 0, "flag": 0, "temperature": 2, "error": 4}.get(kind, 3)
        texts = [f"{x:.{width}f}".replace(".", decimal) for x in beside(kind, len(time), random)]
        columns.insert(random.choice((1, len(columns))), (kind, "", texts))
    names = [f"{n} ({u})" if u and units_in == "header" else n for n, u, _ in columns]
    lines = [sign.join(names)] if head else []
    if head == 2:
        below = [f"[{u or '-'}]" if units_in == "beside" else "" for _, u, _ in columns]
        lines = [*lines, sign.join(below)] if units_in == "beside" else ["run 7, air", *lines]
    rows = [sign.join(row) for row in zip(*(texts for _, _, texts in columns), strict=True)]
    text = random.choice(("\n", "\r\n")).join([*lines, *damaged(rows, random), ""])
    story = (
        f"{sign_name}, decimal '{decimal}', {head} rows of header, units {units_in}, {form} stamps,"
        f" {unit}, {len(columns)} columns ({', '.join(name for name, _, _ in columns)})"
    )
    stated = units_in in ("header", "beside")
    return Drawn(
        text.encode(random.choice(("utf-8", "utf-8-sig"))), story, time, values, unit, stated
    )


def judge(path: Path, drawn: Drawn) -> tuple[str, str]:
    """Read a table: ``right``, ``doubted`` (the first lines say so), ``refused`` or ``wrong``."""
    path.write_bytes(drawn.content)
    try:
        recording = read(path)
    except InputError as fault:
        return "refused", f"{fault.problem}; {fault.remedy}"
    doubts = " / ".join(recording.weak_guesses)
    time, usable = recording.time_s - recording.time_s[0], recording.usable
    if len(recording) < 0.985 * len(drawn.time_s):
        return "wrong", f"{len(recording)} of {len(drawn.time_s)} rows"
    faults = []
    span = drawn.time_s[-1] - drawn.time_s[0]
    if abs(time[-1] / span - 1.0) > 0.02:
        faults.append(("unit", f"span {time[-1]:.5g} s for {span:.5g}"))
    truth = np.interp(time[usable] * span / time[-1], drawn.time_s - drawn.time_s[0], drawn.values)
    values = recording.values[usable]
    # Rounded stamps are known to a part of a row, what was damaged to a row or two.
    if abs(float(np.corrcoef(values, truth)[0, 1])) < 0.95:
        faults.append(("column", "another column, or times that are not its own"))
    else:
        scale = float(np.std(values) / np.std(truth))
        known = SI[drawn.unit] if recording.unit in ("rad", "V", "m") else 1.0
        mine = {"rad": "rad", "deg": "rad", "V": "V", "mm": "m", "cm": "m"}[drawn.unit]
        named = recording.unit == mine or (recording.unit in ("1", "counts") and not drawn.stated)
        if not named or abs(scale / known - 1.0) > 0.05:
            faults.append(("unit", f"unit {recording.unit}, {scale / known:.4g} times"))
    if not faults:
        return "right", ""
    said = all(f"--{option}" in doubts for option, _ in faults)
    return "doubted" if said else "wrong", "; ".join(fault for _, fault in faults) + f" [{doubts}]"


def main() -> None:
    """Draw, read and print the counts; fail where one is wrong, or fewer are right than are due."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tables", type=int, default=TABLES)
    parser.add_argument("--seed", default=commit())
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    random = Random(int(hashlib.sha256(given.seed.encode()).hexdigest(), 16))
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.tables):
            drawn = draw(random)
            outcome, said = judge(Path(folder) / "table.txt", drawn)
            counts[outcome] += 1
            if outcome != "right":
                print(f"{number}: {outcome}: {drawn.story}: {said}")
                if given.keep:
                    given.keep.mkdir(exist_ok=True)
                    (given.keep / f"{number}.txt").write_bytes(drawn.content)
    print(
        f"{given.tables} tables drawn by {given.seed}: {counts['right']} read right,"
        f" {counts['doubted']} with a wrong guess in the first line, {counts['refused']} refused,"
        f" {counts['wrong']} wrong"
    )
    sys.exit(counts["wrong"] > 0 or counts["right"] < LEAST_RIGHT / TABLES * given.tables)


if __name__ == "__main__":
    main()
