"""Turning points with their errors, and the file they are kept in."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Self

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.cells import original
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import MARK, read_text, replaced
from pendpipe.recording import table_lines, whole_lines

if TYPE_CHECKING:
    from pendpipe.analysis.turning_points.measure import Samples

COLUMNS: Final = (
    "half_cycle",
    "time_s",
    "time_sd_s",
    "angle_rad",
    "angle_sd_rad",
    "level_rad",
)
_NUMBERS: Final = (
    "level_sd_rad",
    "level_coupling",
    "noise_rms_rad",
    "step_rad",
    "start_s",
    "stop_s",
)


_CUTS: Final = ("cut", "rest")
"""Keys of what was left out: motion, and rest."""
_HEAD: Final = 1 << 16
"""Bytes of a file within which the header of its table begins."""
_FEW: Final = 8
"""Half cycles up to which what is left is a piece: they tell neither a law nor what it lacks."""


class Cut(NamedTuple):
    """A span of the recording that was left out."""

    start_s: float
    stop_s: float
    reason: str
    at_rest: bool = False


@dataclass(frozen=True)
class TurningPoints:
    """The turning points of one free decay.

    Parameters
    ----------
    half_cycle
        Number of each, rising; numbers are left out where the data have a gap. Shape (k,).
    time_s, time_sd_s
        When the velocity is zero, and its standard deviation, in s.
    angle_rad
        Signed angle about `level_rad`, in rad (metres where `unit` is m).
    angle_sd_rad
        Its standard deviation at a known level; these errors are independent.
    level_rad
        The local equilibrium level.
    level_sd_rad, level_coupling
        Standard deviation of the level (of a wandering one, of its local value) and by
        how much a level too high by one lowers the signed angles: the shared error.
    noise_rms_rad
        Standard deviation of one reading, never below step/sqrt(12).
    step_rad
        The step of the readings, 0 where none is known.
    start_s, stop_s
        Times of the first and the last reading.
    samples
        How many readings went in.
    unit
        ``"rad"`` or ``"m"``.
    wanders
        Whether the level is a slow function of time.
    cuts
        Spans of the recording that were left out before.
    beats
        Which two modes beat, where they do.
    metadata, notes
        Provenance for the file's head; and what the user should know, a clause each.
    readings
        From which they were measured; None of a table.
    """

    half_cycle: IntArray
    time_s: FloatArray
    time_sd_s: FloatArray
    angle_rad: FloatArray
    angle_sd_rad: FloatArray
    level_rad: FloatArray
    level_sd_rad: float = 0.0
    level_coupling: float = 4.0 / np.pi
    noise_rms_rad: float = float("nan")
    step_rad: float = 0.0
    start_s: float = 0.0
    stop_s: float = 0.0
    samples: int = 0
    unit: str = "rad"
    wanders: bool = False
    cuts: tuple[Cut, ...] = ()
    beats: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    readings: "Samples | None" = field(default=None, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.time_s)

    @cached_property
    def amplitude_rad(self) -> FloatArray:
        """Angle without the alternating sign; noise may make a small one negative."""
        return self.angle_rad * self.side

    @cached_property
    def side(self) -> FloatArray:
        """+1 for the half cycles above the level, -1 for those below; shape (k,)."""
        alternating = 1.0 - 2.0 * ((self.half_cycle - self.half_cycle[0]) % 2)
        first = float(np.sum(alternating * self.angle_rad))
        return np.asarray(alternating * math.copysign(1.0, first))

    @property
    def mostly_cut(self) -> str | None:
        """Say that more motion was cut than is left, where what is left is a few swings."""
        moving = (cut for cut in self.cuts if not cut.at_rest)
        cut, left = sum(each.stop_s - each.start_s for each in moving), self.stop_s - self.start_s
        few = self.half_cycle[-1] - self.half_cycle[0] <= _FEW
        return f"{left:.3g} s of {left + cut:.3g} s are left" if cut > left and few else None

    def first(self, count: int) -> Self:
        """The first `count` of them."""
        return self.chosen(slice(count))

    def chosen(self, keep: BoolArray | slice) -> Self:
        """Some of them, with all that they share."""
        if not isinstance(keep, slice) and keep.all():
            return self
        return replace(self, **{name: getattr(self, name)[keep] for name in COLUMNS})

    def covariance(self) -> FloatArray:
        """Covariance of the signed angles, shape (k, k): independent and shared parts."""
        shared = (self.level_coupling * self.level_sd_rad) ** 2
        return np.diag(self.angle_sd_rad**2) + shared

    @property
    def apparent_frequency_hz(self) -> float:
        """Mean number of cycles in a second over the whole record."""
        cycles = 0.5 * float(self.half_cycle[-1] - self.half_cycle[0])
        return cycles / float(self.time_s[-1] - self.time_s[0])


def write_turning_points(path: str | Path, points: TurningPoints) -> None:
    """Write ``turning_points.csv``: lines ``# key: value``, header, one row per turning point."""
    head = {
        "unit": points.unit,
        "frequency_hz": repr(points.apparent_frequency_hz),
        **{key: repr(float(getattr(points, key))) for key in _NUMBERS},
        "level": "wanders" if points.wanders else "constant",
        "samples": str(points.samples),
        **({"beats": points.beats} if points.beats else {}),
        **points.metadata,
    }
    told = [
        *head.items(),
        *(
            (_CUTS[c.at_rest], f"{float(c.start_s)!r} {float(c.stop_s)!r} {c.reason}")
            for c in points.cuts
        ),
        *(("note", note) for note in points.notes),
    ]
    with replaced(path) as stream:
        stream.writelines(table_lines(told, {name: getattr(points, name) for name in COLUMNS}))


def is_turning_points(path: str | Path) -> bool:
    """Whether a file is a table of turning points of ours."""
    try:
        with Path(path).open("rb") as stream:
            head = stream.read(_HEAD)
    except OSError:
        return False
    return f"# {MARK}: ".encode() in head and f"\n{','.join(COLUMNS)}\n".encode() in head


def read_turning_points(path: str | Path) -> TurningPoints:
    """Read ``turning_points.csv``.

    Raises
    ------
    InputError
        If the file is absent, is no table of turning points, or was refused.
    """
    place = Path(path)
    lines, cut_short = whole_lines(read_text(place, "run pendpipe turning-points"))
    start = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    lines[:start] = map(original, lines[:start])
    head = [tuple(line.lstrip("# ").split(": ", 1)) for line in lines[:start] if ": " in line]
    metadata = {key: value for key, value in head if key not in (*_CUTS, "note", MARK)}
    refuse_if(
        "refused" in metadata,
        place,
        f"the record was refused ({metadata.get('refused')})",
        "correct it first",
    )
    refuse_if(
        start == len(lines) or lines[start].strip() != ",".join(COLUMNS),
        place,
        "this is not a table of turning points",
        "run pendpipe turning-points",
    )
    try:
        table = np.loadtxt(lines[start + 1 :], delimiter=",", ndmin=2)
        columns = dict(zip(COLUMNS, np.ascontiguousarray(table.T), strict=True))
        numbers: dict[str, Any] = {key: float(metadata.pop(key)) for key in _NUMBERS}
        told = ((*value.split(" ", 2), key) for key, value in head if key in _CUTS)
        cuts = tuple(
            Cut(float(start_s), float(stop_s), reason, key == _CUTS[True])
            for start_s, stop_s, reason, key in told
        )
    except (KeyError, ValueError) as fault:
        raise InputError(place, f"it can't be read ({fault})", "make it again") from None
    metadata.pop("frequency_hz", None)
    numbers |= columns | {"half_cycle": columns["half_cycle"].astype(np.int64)}
    return TurningPoints(
        **numbers,
        samples=int(metadata.pop("samples", "0")),
        unit=metadata.pop("unit", "rad"),
        wanders=metadata.pop("level", "constant") == "wanders",
        cuts=cuts,
        beats=metadata.pop("beats", ""),
        metadata=metadata,
        notes=(*(value for key, value in head if key == "note"), *cut_short),
    )
