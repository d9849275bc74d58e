"""From arrays or a file to a fit and a diagnosis.

`import pendpipe as pp` offers everything here; the commands call the same functions. Heavy
packages are imported by the function that needs them.
"""

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pendpipe.analysis.readings import motion_of
from pendpipe.errors import refuse_if
from pendpipe.files import distinct_names
from pendpipe.options import (
    ALTERNATIVES,
    NATURAL,
    POSITIVE,
    Baseline,
    Fixed,
    Length,
    Number,
    Option,
    Restoring,
    VoltsPerRadian,
    checked,
    measured_number,
)
from pendpipe.reading import read
from pendpipe.recording import Recording

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pandas import DataFrame

    from pendpipe.analysis.fit.result import FitResult
    from pendpipe.analysis.free_decay import FreeDecay
    from pendpipe.analysis.turning_points import TurningPoints
    from pendpipe.diagnosis import Progress
    from pendpipe.diagnosis.result import Diagnosis
    from pendpipe.estimate import Estimate

Source = Recording | str | Path
"""What is analysed: a recording, or the path of its file. A DataFrame serves as well, with a
column ``time_s`` and one of `_COLUMNS`."""
_COLUMNS: Final = ("angle_rad", "angle_deg", "volts", "displacement_m")
_FIGURES_OF_A_FIT: Final = partial(importlib.import_module, "pendpipe.figures.decays")
_FIGURES_OF_A_DIAGNOSIS: Final = partial(importlib.import_module, "pendpipe.figures.diagnosis")
"""Who draws a result, imported when it is drawn: the result itself knows no figures."""


def find_free_decay(recording: Source) -> "FreeDecay":
    """Find the part of a recording in which the pendulum swings freely.

    Returns
    -------
    FreeDecay
        ``start_s``, ``stop_s``, and the ``cuts`` with their reasons.

    Raises
    ------
    NotAnalysableError
        If there is none: rest, a drive, or fewer than three half cycles.

    Examples
    --------
    >>> decay = find_free_decay("examples/rod-pendulum.csv")
    >>> decay.half_cycles
    103
    """
    from pendpipe.analysis.free_decay import find_free_decay as find

    return find(_motion(recording), _place(recording))


def turning_points(recording: Source) -> "TurningPoints":
    """Find the free decay of a recording and measure its turning points.

    Each turning point uses all the samples of its half cycle and has a standard deviation.

    Examples
    --------
    >>> points = turning_points("examples/rod-pendulum.csv")
    >>> len(points), round(float(points.amplitude_rad[0]), 4)
    (105, 0.0863)
    """
    from pendpipe.analysis.free_decay import measure_recording

    return measure_recording(_motion(recording), _place(recording))[0]


@checked
def fit(
    recording: "Source | TurningPoints | ArrayLike | DataFrame",
    angle_rad: "ArrayLike | None" = None,
    *,
    method: Annotated[
        Literal["auto", "waveform", "turning-points"] | None,
        Option("fit all readings, the turning points, or let the decay decide"),
    ] = "auto",
    restoring: Restoring = "auto",
    baseline: Baseline = "eq8",
    fixed: Fixed = None,
    volts_per_radian: VoltsPerRadian = None,
    clock_ppm: Annotated[
        float | None,
        Option(
            "standard deviation of the clock's rate, parts per million: enters the errors",
            "PPM",
            POSITIVE,
        ),
    ] = None,
    scale_percent: Annotated[
        float | None,
        Option(
            "standard deviation of the scale (V/rad, a camera's), percent: enters the errors of a,"
            " c and the amplitude",
            "P",
            Number(0, 100),
        ),
    ] = None,
    length_m: Length = None,
    gravity: Annotated[
        float | None,
        Option("g in m/s^2 of a pendulum: gives the equivalent length", "G", POSITIVE),
    ] = None,
    period: Annotated[
        "float | Estimate | None",
        Option(
            "period of small swings, s, as 1.42 or 1.42(1), for a file of amplitudes",
            "S",
            measured_number,
            heading=ALTERNATIVES,
        ),
    ] = None,
    points: "TurningPoints | None" = None,
    name: str | None = None,
) -> "FitResult":
    """Fit a, b, c, frequency and amplitude to the free decay of a recording.

    Eq. 8 is fitted to all readings of the decay: angles and their rates swing by sin x, unless x
    fits better by a likelihood ratio of 1000; the drag has the more likely of two forms. If the
    law contradicts the decrement of the turning points, these are fitted instead, or only the
    larger amplitudes. ``fit.light`` is green, amber or red, and
    ``fit.light_reason`` explains it (docs/fit.md).

    Parameters
    ----------
    recording
        A recording, the path of its file, a DataFrame with ``time_s`` and ``angle_rad`` (or
        ``angle_deg``, ``volts``, ``displacement_m``), or times in s (then give `angle_rad`).
        Amplitudes (from a ruler), speeds at a gate and turning points are fitted by Eq. 14.
    angle_rad
        The angles at these times, rad.
    {options}
    points
        Turning points measured before (`turning_points`): they define the decay.
    name
        What to call the recording in messages; by default its path.

    Returns
    -------
    FitResult
        ``fit["b"].value`` and ``.sd`` in SI units and radians; prints as a short table;
        ``.plot()``, ``.to_dict()``, ``.to_frame()``, ``.save(folder)``.

    Raises
    ------
    InputError
        If there is no free decay, or the fit did not converge.

    Examples
    --------
    >>> result = fit("examples/rod-pendulum.csv")
    >>> print(result)  # doctest: +ELLIPSIS
    rod-pendulum.csv: angle, 50 Hz, 59.6 s, 52 swings from 4.94° to 1.51°   GREEN
      period, small swings  1.1454712(27) s  (1.146 s at 4.94°)
      clock                 an error of 50 ppm adds 6 × 10⁻⁵ s, not included here (--clock-ppm)
      Q                     169.76(57) at 4.94° (86.2 mrad), 138.39(12) at 2.73°, ...
      damping               from 4.94° to 1/2 in 38.441(22) s, to 1/e in 52.198(25) s; log. ...
      energy goes to        64.6(3.5) % viscous or internal (b), 30.69(91) % dry friction (c), ...
      law                   −dy/dt = a y² + b y + c: a 0.0088(50) rad⁻¹ s⁻¹, b 0.01043(54) s⁻¹, ...
      misfit                the fit follows the swings to 0.3 %; nothing but noise is left
    Copy: T0 = (1.1454712 ± 0.0000027) s; Q = 169.76 ± 0.57 at 86.2 mrad; 64.6(3.5) % of ...
    Next: pendpipe page FILE makes a sheet to hand out; --figure draws it, --json is for programs
    """
    method = None if method == "auto" else method
    length, given = _measured("length_m", length_m, "m"), _measured("period", period, "s")
    torque = _torque(restoring, is_pendulum=bool(length or gravity))
    from pendpipe.analysis.fit import fit_recording, fit_turning_points
    from pendpipe.analysis.fit.by_amplitudes import fit_amplitudes, in_seconds
    from pendpipe.analysis.fit.consequence import doubted
    from pendpipe.analysis.fit.fitted import Told
    from pendpipe.analysis.fit.result import with_clock, with_scale
    from pendpipe.analysis.free_decay import measure_recording
    from pendpipe.analysis.turning_points import (
        TurningPoints,
        is_turning_points,
        read_turning_points,
    )

    told = Told(None, None, length, _measured("gravity", gravity, "m/s^2"))
    kept: dict[str, Any] = {"told": told, "drawn_by": _FIGURES_OF_A_FIT}
    if isinstance(recording, str | Path) and is_turning_points(recording):
        recording = read_turning_points(recording)
    if isinstance(recording, TurningPoints):
        found = fit_turning_points(
            recording, length=length, restoring=torque, baseline=baseline, fixed=fixed
        )
        return replace(found, name=name or "", **kept)
    recording = _source(recording, angle_rad)
    place, motion = name or _place(recording), _motion(recording, volts_per_radian)
    own = "" if isinstance(recording, Recording) else Path(recording).name
    if motion.holds_amplitudes and points is None:
        motion = in_seconds(motion, given, place)
        found = fit_amplitudes(
            motion,
            period=given,
            length=length,
            restoring=torque,
            baseline=baseline,
            fixed=fixed,
            place=place,
        )
        return doubted(replace(found, name=own, **kept), motion.facts, motion.time_s)
    refuse_if(
        given is not None,
        "period",
        "the recording itself shows the period",
        "leave it out (--fix holds it)",
    )
    if points is None:
        seen = length.value if length and torque == "sine" else None
        points, decay = measure_recording(motion, place, length_m=seen)
    else:
        decay = motion.between(points.start_s, points.stop_s)
    if (length or gravity) and decay.unit not in ("rad", "rad/s", "m"):
        # How large the swings are nobody knows, and the period does not show it.
        torque = "linear"
    result = fit_recording(
        decay,
        points=points,
        method=method,
        restoring=torque,
        baseline=baseline,
        fixed=fixed,
        length=length,
        place=place,
    )
    result = result if clock_ppm is None else with_clock(result, clock_ppm)
    result = result if scale_percent is None else with_scale(result, scale_percent)
    cuts = (*(cut._asdict() for cut in points.cuts), *result.cuts)
    kept["told"] = replace(told, clock_ppm=clock_ppm, scale_percent=scale_percent)
    result = replace(result, cuts=cuts, name=own, decay=decay, **kept)
    return doubted(result, motion.facts, decay.time_s)


def _measured(name: str, size: "float | Estimate | None", unit: str) -> "Estimate | None":
    """A number that is given, with its error or without one."""
    from pendpipe.estimate import Estimate

    if size is None:
        return None
    given = replace(size, unit=unit) if isinstance(size, Estimate) else Estimate(size, 0.0, unit)
    problem = f"{given.value!r} is not a positive number of {unit}"
    refuse_if(not 0.0 < given.value < math.inf, name, problem, "give another number")
    return given


def _torque(restoring: str | None, *, is_pendulum: bool) -> Any:
    """The torque that is given: who gives the length of a pendulum has said that it is one."""
    if restoring in (None, "auto"):
        return "sine" if is_pendulum else None
    return restoring


@checked
def diagnose(
    recording: Source | Sequence[Source] | Mapping[str, Source],
    *,
    restoring: Restoring = "auto",
    length_m: Length = None,
    baseline: Baseline = "eq8",
    fixed: Fixed = None,
    volts_per_radian: VoltsPerRadian = None,
    level: Annotated[
        float,
        Option("false-alarm probability for a recording that lacks nothing", "P", Number(0, 1)),
    ] = 0.01,
    seed: Annotated[int, Option("seed of the random draws", "N", NATURAL)] = 0,
    together: Annotated[bool, Option("the recordings are of one pendulum")] = False,
    own: Annotated[
        Sequence[str],
        Option(
            "with several recordings: a parameter that each has of its own (a, b, c, frequency)",
            "NAME",
        ),
    ] = (),
    same_sensor: Annotated[
        bool, Option("with several recordings: they share the sensor's errors")
    ] = False,
    points: "TurningPoints | None" = None,
    name: str | None = None,
    provenance: Mapping[str, Any] | None = None,
    progress: "Progress | None" = None,
) -> "Diagnosis":
    """Find what physics a fit of Eq. 8 leaves out of a recording.

    Eq. 8 is fitted to the free decay; its residual is searched for every effect of the catalogue
    (docs/effects.md), and what chance does not explain is named, modelled and tested again.

    Parameters
    ----------
    recording
        A recording, or the path of its file; or several of one pendulum (a list, or a mapping
        of their names): they share the physics, and each has its own start and noise
        (docs/several.md).
    {options}
    points
        Turning points measured before (`turning_points`): they define the decay.
    name
        What to call the recording in messages; by default its path.
    provenance
        Stored in the result.
    progress
        Receives a line for each step.

    Returns
    -------
    Diagnosis
        Prints as a dozen lines; ``.summary``, ``.verdict``, ``.effects``, ``.plot()``,
        ``.to_dict()``, ``.save(folder)``.

    Raises
    ------
    NotAnalysableError
        If there is no free decay.

    Examples
    --------
    >>> answer = diagnose("examples/string-pendulum.csv")
    >>> answer.verdict, answer.effects[0].identifier, answer.effects[0].presumed
    ('consistent', 'circular-error', True)
    """
    from pendpipe.diagnosis import silent
    from pendpipe.diagnosis.run import diagnose_recording
    from pendpipe.diagnosis.several import diagnose_several

    length = _measured("length_m", length_m, "m")
    common: dict[str, Any] = {
        "baseline": baseline,
        "restoring": _torque(restoring, is_pendulum=bool(length)),
        "level": level,
        "seed": seed,
        "provenance": provenance,
        "progress": progress or silent,
    }
    if not isinstance(recording, Recording | str | Path):
        refuse_if(
            not together,
            "diagnose",
            f"{len(recording)} recordings are given",
            "say together=True if they are of one pendulum; else diagnose them one by one",
        )
        refuse_if(fixed, "fixed", "no parameter can be held in several recordings", "leave it out")
        if not isinstance(recording, Mapping):
            files = [
                f"recording {number}" if isinstance(each, Recording) else each
                for number, each in enumerate(recording, 1)
            ]
            recording = dict(zip(distinct_names(files), recording, strict=True))
        found = diagnose_several(
            [_motion(each, volts_per_radian) for each in recording.values()],
            list(recording),
            diagnose=diagnose_recording,
            own=own,
            same_sensor=same_sensor,
            **common,
        )
        return replace(found, drawn_by=_FIGURES_OF_A_DIAGNOSIS)
    common |= {"fixed": fixed, "place": name or _place(recording)}
    motion = _motion(recording, volts_per_radian)
    decay = motion if points is None else motion.between(points.start_s, points.stop_s)
    found = diagnose_recording(decay, points=points, length=length, whole=motion, **common)
    return replace(found, drawn_by=_FIGURES_OF_A_DIAGNOSIS)


def _source(recording: Any, angle_rad: "ArrayLike | None" = None) -> Source:
    """Return a recording or a path, from arrays or a DataFrame as well."""
    if angle_rad is not None:
        return Recording(time_s=recording, angle_rad=angle_rad)
    if isinstance(recording, Recording | str | Path):
        return recording
    columns = [str(name) for name in getattr(recording, "columns", ())]
    found = [name for name in _COLUMNS if name in columns]
    refuse_if(
        "time_s" not in columns or len(found) != 1,
        "recording",
        f"a DataFrame with columns {', '.join(columns)}"
        if columns
        else f"a {type(recording).__name__}",
        f"give columns time_s and one of {', '.join(_COLUMNS)}, or times and angles",
    )
    readings: dict[str, Any] = {found[0]: recording[found[0]].to_numpy()}
    return Recording(time_s=recording["time_s"].to_numpy(), **readings)


def _motion(recording: Source, volts_per_radian: float | None = None) -> Recording:
    """Return the recording in radians (or metres), read from its file where it is one."""
    read_in = recording if isinstance(recording, Recording) else read(recording)
    return motion_of(read_in, volts_per_radian, _place(recording))


def _place(recording: Source) -> str:
    """Name the recording in messages."""
    return "recording" if isinstance(recording, Recording) else str(recording)
