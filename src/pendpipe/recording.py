"""One recording: samples, time base, units, provenance; and its plain form on disk.

This is the only type that crosses from acquisition and formats to the analysis. The
plain form is a CSV (contract of the project): a header with ``time_s`` and one of
``angle_rad``, ``volts``, ``displacement_m``, ``reading``, optionally ``quality`` and
``radius_excess``, and before it any number of lines ``# key: value``. A ``reading`` is
anything else that swings (counts, pixels, m/s^2, light), in the unit that ``# unit: counts``
gives: Q, period and relative decay need no constant of the sensor.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import takewhile
from pathlib import Path
from typing import Final, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from pendpipe.arrays import AnyArray, BoolArray, ByteArray, FloatArray
from pendpipe.cells import inert, original
from pendpipe.errors import InputError, refuse_if
from pendpipe.facts import KINDS, Fact, guesses
from pendpipe.files import MADE_BY, MARK, RECORDED_BY, read_text, replaced

Quantity = Literal["angle_rad", "volts", "displacement_m", "reading"]
QUANTITIES: Final = ("angle_rad", "volts", "displacement_m", "reading")
UNITS: Final[Mapping[str, str]] = {"angle_rad": "rad", "volts": "V", "displacement_m": "m"}

_WEAK: Final = "weak_guess_"
"""Metadata of a plain file that are guesses: a copy must not look surer than the original."""
GOOD, SUSPECT, MISSING = 0, 1, 2
"""The values of ``quality``: a good sample, a suspect one, a row that marks a gap."""


def is_uniform(time_s: FloatArray) -> bool:
    """Say whether the samples are evenly spaced, gaps apart.

    99 % of the intervals lie within 15 % of their median (a clock printed with too few
    digits alternates by 10 %).
    """
    steps = np.diff(time_s)
    middle = float(np.median(steps)) if len(steps) > 1 else 0.0
    if not middle > 0:
        return len(steps) < 2
    return float(np.mean(np.abs(steps - middle) <= 0.15 * middle)) >= 0.99 or (
        # A handful of gaps in a short recording is no unevenness.
        bool(np.all(np.abs(steps / middle - np.rint(steps / middle)) < 0.1))
        and float(np.mean(steps < 1.5 * middle)) > 0.8
    )


def sample_rate(time_s: FloatArray) -> float:
    """Samples a second, gaps left out; of uneven samples the reciprocal median interval."""
    steps = np.diff(time_s)
    middle = float(np.median(steps)) if len(steps) else 0.0
    usual = steps[np.abs(steps - middle) <= 0.5 * middle] if is_uniform(time_s) else middle
    return 1.0 / float(np.mean(usual)) if middle > 0 else float("nan")


@dataclass(frozen=True, init=False, repr=False)
class Recording:
    """Samples of one channel against time.

    Give the readings as `angle_rad`, `volts` (with the sensor's `volts_per_radian`, where it
    is known) or `displacement_m`; readers of files give `values` and `quantity` instead.

    Parameters
    ----------
    time_s
        Times of the samples, shape (n,), strictly rising.
    values
        The readings, shape (n,), in the unit of `quantity`; NaN where `quality` is 2.
    quantity
        What `values` are: ``"angle_rad"``, ``"volts"``, ``"displacement_m"``, or
        ``"reading"`` where they are none of these; their unit is then ``metadata["unit"]``.
    quality
        0 good, 1 suspect, 2 missing, shape (n,); ``None`` when all are good.
    metadata
        Whatever stood before the header: ``volts_per_radian``, ``bits``,
        ``range_volts``, ``range_low_volts``, ``source``, ``recorded_at``, ...
    resolution
        The step between neighbouring readings in the unit of `values`, where known.
    notes
        What a reader guessed or noticed, a clause each, for the user to see.
    facts
        What is known of the file, and whether it is stated, shown or guessed.
    radius_excess
        Where the angles are those of positions: the distance from the pivot over its median,
        less 1, shape (n,). A string keeps it, so that it shows the errors of the tracking.
    angle_rad, angle_deg, volts, displacement_m
        The readings by the name of their quantity; exactly one of these or `values`.
    volts_per_radian
        The sensor's constant, kept in the metadata.

    Raises
    ------
    InputError
        If `time_s` and the readings differ in length, times do not rise, readings are not
        finite, or not exactly one quantity is given.

    Examples
    --------
    >>> recording = Recording(time_s=[0.0, 0.1, 0.2], angle_rad=[0.30, 0.28, 0.22])
    >>> recording
    Recording(3 samples of angle_rad, 0 to 0.2 s)
    >>> recording.values
    array([0.3 , 0.28, 0.22])
    """

    time_s: FloatArray
    values: FloatArray
    quantity: Quantity
    quality: ByteArray | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)
    resolution: float | None = None
    notes: tuple[str, ...] = ()
    facts: tuple[Fact, ...] = ()
    radius_excess: FloatArray | None = None

    def __init__(
        self,
        time_s: ArrayLike,
        values: ArrayLike | None = None,
        quantity: Quantity | None = None,
        quality: ByteArray | None = None,
        metadata: Mapping[str, str] | None = None,
        resolution: float | None = None,
        notes: tuple[str, ...] = (),
        facts: tuple[Fact, ...] = (),
        radius_excess: FloatArray | None = None,
        *,
        angle_rad: ArrayLike | None = None,
        angle_deg: ArrayLike | None = None,
        volts: ArrayLike | None = None,
        displacement_m: ArrayLike | None = None,
        volts_per_radian: float | None = None,
    ) -> None:
        if angle_deg is not None:
            refuse_if(
                angle_rad is not None,
                "Recording",
                "angle_rad and angle_deg are given",
                "give one of them",
            )
            angle_rad = np.radians(_column("angle_deg", angle_deg))
        named: dict[Quantity, ArrayLike | None] = {
            "angle_rad": angle_rad,
            "volts": volts,
            "displacement_m": displacement_m,
        }
        given = [(name, readings) for name, readings in named.items() if readings is not None]
        metadata = dict(metadata or {})
        if volts_per_radian is not None:
            metadata["volts_per_radian"] = repr(float(volts_per_radian))
        if values is None:
            found = ", ".join(name for name, _ in given) or "none"
            refuse_if(
                len(given) != 1,
                "Recording",
                f"exactly one quantity is needed, not {found}",
                "give angle_rad=...",
            )
            quantity, values = given[0]
        elif given or quantity not in QUANTITIES:
            raise InputError(
                "Recording", f"values of quantity {quantity!r}", f"use {', '.join(QUANTITIES)}"
            )
        times, readings = _column("time_s", time_s), _column(quantity, values)
        refuse_if(
            len(times) != len(readings),
            "Recording",
            f"{len(times)} times and {len(readings)} readings",
            "give one time for each reading",
        )
        kept = (times, readings, quantity, quality, metadata, resolution, notes, facts)
        for name, value in zip(self.__dataclass_fields__, (*kept, radius_excess), strict=True):
            object.__setattr__(self, name, value)
        if given:
            check("Recording", self)

    def __repr__(self) -> str:
        """Return the size and span; the samples are in `time_s` and `values`."""
        span = f", {self.time_s[0]:.6g} to {self.time_s[-1]:.6g} s" if len(self) else ""
        return f"Recording({len(self)} samples of {self.quantity}{span})"

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def unit_is_stated(self) -> bool:
        """Whether the unit is known, and not guessed."""
        return "unit" not in {fact.kind for fact in self.facts if fact.how == "guessed"}

    @property
    def weak_guesses(self) -> tuple[str, ...]:
        """What was guessed, a clause each, with the option that overrides it."""
        return guesses(self.facts)

    def fact(self, kind: str) -> Fact | None:
        """The fact of a kind, the last where there are several; ``None`` without any."""
        return next((fact for fact in self.facts[::-1] if fact.kind == kind), None)

    def knowing(self, fact: Fact) -> Self:
        """Return the same recording with a fact more."""
        if fact in self.facts:
            return self
        notes = (*self.notes, fact.said) if fact.said and fact.how != "guessed" else self.notes
        return replace(self, facts=(*self.facts, fact), notes=notes)

    @property
    def holds_amplitudes(self) -> bool:
        """Whether each reading is the size of a swing at its time, and not the motion itself.

        So read with a ruler, at a gate, or off turning points: y(t) of Eq. 14. Kept in the
        metadata (``holds: amplitudes``), and with it in the plain form.
        """
        return self.metadata.get("holds") == "amplitudes"

    @property
    def unit(self) -> str:
        """The unit of `values`; ``"1"`` where nobody knows it."""
        return UNITS.get(self.quantity) or self.metadata.get("unit") or "1"

    @cached_property
    def usable(self) -> BoolArray:
        """Which samples hold a reading: neither missing nor NaN; shape (n,)."""
        reading = np.isfinite(self.values)
        return reading if self.quality is None else reading & (self.quality != MISSING)

    @cached_property
    def interval_s(self) -> float:
        """The usual time between samples, as `inspect` has it: gaps are left out."""
        return 1.0 / sample_rate(self.time_s)

    def number(self, key: str, place: str | Path = "recording") -> float | None:
        """Read a number from the metadata of `place`; ``None`` where it is absent or blank."""
        text = self.metadata.get(key, "").strip()
        if not text:
            return None
        try:
            return float(text)
        except ValueError:
            raise InputError(
                f"{place}, metadata {key}", f"'{text}' is not a number", f"write '# {key}: 3.85'"
            ) from None

    def between(self, start_s: float | None, stop_s: float | None) -> Self:
        """Return the samples with ``start_s <= time_s <= stop_s`` (either may be open)."""
        low = -np.inf if start_s is None else start_s
        high = np.inf if stop_s is None else stop_s
        keep = (self.time_s >= low) & (self.time_s <= high)
        return replace(
            self,
            time_s=self.time_s[keep],
            values=self.values[keep],
            quality=None if self.quality is None else self.quality[keep],
            radius_excess=None if self.radius_excess is None else self.radius_excess[keep],
        )


def _column(name: str, values: ArrayLike) -> FloatArray:
    """Return readings as a one-dimensional array of numbers, one beside the other."""
    try:
        column = np.asarray(values, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InputError("Recording", f"{name} holds no numbers", "give numbers") from None
    refuse_if(
        column.ndim != 1, "Recording", f"{name} has {column.ndim} dimensions", "give one column"
    )
    return column


def table_lines(
    told: Iterable[tuple[str, object]], columns: Mapping[str, AnyArray], *, made: str = MARK
) -> Iterator[str]:
    """Give the lines of a table of ours: who made it, what is told of it, header and rows."""
    yield f"# {made}: {MADE_BY}\n"
    yield from (inert(f"# {key}: {' '.join(str(value).split())}") + "\n" for key, value in told)
    yield ",".join(columns) + "\n"
    for row in zip(*(map(repr, values.tolist()) for values in columns.values()), strict=True):
        yield ",".join(row) + "\n"


def plain_lines(recording: Recording, *, original: bool = False) -> Iterator[str]:
    """Give the lines of the plain CSV form; an `original` comes from an instrument."""
    columns = {
        "time_s": recording.time_s,
        recording.quantity: recording.values,
        "quality": recording.quality,
        "radius_excess": recording.radius_excess,
    }
    there = {name: values for name, values in columns.items() if values is not None}
    weak = (
        (_WEAK + f.kind, f"{f.value}; {f.words}") for f in recording.facts if f.how == "guessed"
    )
    told = [*recording.metadata.items(), *weak]
    return table_lines(told, there, made=RECORDED_BY if original else MARK)


def write_plain(path: str | Path, recording: Recording, *, original: bool = False) -> None:
    """Write the plain CSV form: metadata lines, header, one row per sample, all digits.

    An `original`, the recording of an instrument, is the user's own from then on.
    """
    with replaced(path) as stream:
        stream.writelines(plain_lines(recording, original=original))


def read_plain(path: str | Path, data: bytes | None = None) -> Recording:
    """Read the plain CSV form.

    Whoever writes it ends every row with a line end: a last row without one was cut short,
    and is no sample, for half a number is a number too.

    Parameters
    ----------
    path
        The file, for messages too.
    data
        Its content, where somebody has read it already.

    Raises
    ------
    InputError
        On a missing column, text in a number, NaN outside a marked gap, a time that
        does not rise, or a file without samples: file, line, what, remedy.
    """
    place = Path(path)
    try:
        text = read_text(place, "check the path") if data is None else data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(place, "this is not UTF-8 text", "run pendpipe convert first") from None
    lines, notes = whole_lines(text)
    above = list(takewhile(lambda line: line.startswith("#") or not line.strip(), lines))
    first = len(above)
    refuse_if(first == len(lines), place, "the file is empty", "record again, or give another file")
    told = (original(line).lstrip("# ").partition(":") for line in above)
    metadata = {key.strip(): value.strip() for key, _, value in told if value}
    names = [name.strip() for name in lines[first].split(",")]
    quantity, picked = _columns(place, first + 1, names)
    table = _numbers(place, lines, first + 1, [*picked.values()], len(names))
    column = dict(zip(picked, table.T, strict=True))
    quality = column.get("quality")
    if quality is not None:
        # What is no quality becomes 255, which `check` refuses.
        quality = np.where(np.isin(quality, (GOOD, SUSPECT, MISSING)), quality, 255)
    recording = Recording(
        time_s=column["time_s"],
        values=column[quantity],
        quantity=quantity,
        quality=None if quality is None else quality.astype(np.uint8),
        radius_excess=column.get("radius_excess"),
        metadata={
            key: text
            for key, text in metadata.items()
            if not key.startswith(_WEAK) and key not in (MARK, RECORDED_BY)
        },
        notes=notes,
        facts=tuple(
            _guess_of(key, text) for key, text in metadata.items() if key.startswith(_WEAK)
        ),
    )
    check(place, recording, first_line=first + 2)
    return replace(recording, resolution=converter_step(recording, place))


def _guess_of(key: str, text: str) -> Fact:
    """Read back a guess: ``# weak_guess_unit: V; 'x' has no unit: taken to be volts (--unit)``."""
    kind = key.removeprefix(_WEAK)
    value, _, words = text.partition("; ")
    said, _, option = (words or value).removesuffix(")").rpartition(" (")
    return Fact(
        kind if kind in KINDS else "rows",
        value,
        "guessed",
        said or option,
        option=option if said else "",
    )


def whole_lines(text: str) -> tuple[list[str], tuple[str, ...]]:
    r"""Split a table into its lines, without a last row that may be cut.

    Returns
    -------
    lines
        Those that end; a first line is kept in any case.
    notes
        What the user should know of it.

    Examples
    --------
    >>> whole_lines("time_s,volts\n0.0,1.5\n0.1,1.")
    (['time_s,volts', '0.0,1.5'], ('the last row has no line end and may be cut: not used',))
    """
    lines = text.splitlines()
    if len(lines) < 2 or text.endswith(("\n", "\r")):
        return lines, ()
    return lines[:-1], ("the last row has no line end and may be cut: not used",)


def _columns(place: Path, line: int, names: list[str]) -> tuple[Quantity, dict[str, int]]:
    """Find the columns of the plain form in its header."""
    where, headed = f"{place}, line {line}", f"(found {', '.join(names)})"
    refuse_if(
        "time_s" not in names, where, f"the column time_s is missing {headed}", "name it time_s"
    )
    found = [name for name in QUANTITIES if name in names]
    refuse_if(
        len(found) != 1,
        where,
        f"exactly one of {', '.join(QUANTITIES)} is needed {headed}",
        "rename the column, or run pendpipe convert",
    )
    wanted = ("time_s", found[0], "quality", "radius_excess")
    return found[0], {name: names.index(name) for name in wanted if name in names}


def _numbers(
    place: Path, lines: list[str], start: int, picked: list[int], width: int
) -> FloatArray:
    """Turn the rows into numbers, quickly; on a fault go through them one by one."""
    rows = {n: line for n, line in enumerate(lines[start:], start=start + 1) if line.strip()}
    refuse_if(not rows, place, "there are no samples", "record again, or give another file")
    with suppress(ValueError):
        return np.loadtxt(
            [*rows.values()], delimiter=",", usecols=picked, ndmin=2, dtype=np.float64
        )
    for number, line in rows.items():
        cells, where = line.split(","), f"{place}, line {number}"
        refuse_if(
            len(cells) < width,
            where,
            f"{len(cells)} cells, not {width}",
            "complete or drop the row",
        )
        for index in picked:
            try:
                float(cells[index])
            except ValueError:
                raise InputError(
                    where, f"'{cells[index].strip()}' is not a number", "correct or drop the row"
                ) from None
    raise InputError(place, "the rows can't be read as numbers", "run pendpipe inspect")


def check(place: str | Path, recording: Recording, *, first_line: int | None = None) -> None:
    """Refuse a recording whose samples can't be true.

    Parameters
    ----------
    place
        The file, for the message.
    recording
        What was read from it.
    first_line
        The line of the first sample in a file, so that the message can name the row; without
        it the message counts samples from 0, as Python does.
    """
    row = f"{place}, sample" if first_line is None else f"{place}, line"
    first = first_line or 0
    time, values = recording.time_s, recording.values
    refuse_if(len(time) == 0, place, "there are no samples", "record again, or give another file")
    quality = np.zeros(len(time)) if recording.quality is None else recording.quality
    bad = ~np.isfinite(time) | (~np.isfinite(values) & (quality != MISSING))
    falls = np.append(False, np.diff(time) <= 0)
    at = int(np.argmax(falls))
    for wrong, problem, remedy in (
        (quality > MISSING, "quality is not 0, 1 or 2", "correct the row"),
        (
            bad,
            f"{np.sum(bad)} value(s) that are NaN or infinite",
            "drop the rows, or mark them with quality 2",
        ),
        (
            falls,
            f"time_s does not rise ({time[at - 1]:.9g} is followed by {time[at]:.9g})",
            "sort the rows by time and drop repeated ones",
        ),
    ):
        refuse_if(wrong.any(), f"{row} {first + int(np.argmax(wrong))}", problem, remedy)


def converter_step(recording: Recording, place: str | Path = "recording") -> float | None:
    """The step of the converter, from `bits` and `range_volts`, where both are told."""
    bits, high = recording.number("bits", place), recording.number("range_volts", place)
    if bits is None or high is None or recording.quantity != "volts":
        return None
    low = recording.number("range_low_volts", place)
    span = high - (-high if low is None else low)
    # What no converter has tells nothing of the step.
    return span / 2.0**bits if 1 <= bits <= 64 and 0 < span < 1e9 else None
