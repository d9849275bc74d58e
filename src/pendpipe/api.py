"""The front door: from arrays or a file to a fit and a diagnosis.

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

from pendpipe.errors import refuse_if
from pendpipe.files import distinct_names
from pendpipe.options import (
    A_GUESS,
    ALTERNATIVES,
    NATURAL,
    POSITIVE,
    SENSOR,
    Baseline,
    Fixed,
    Number,
    Option,
    Restoring,
    VoltsPerRadian,
    checked,
    measured_number,
)
from pendpipe.recording import Recording

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pandas import DataFrame

    from pendpipe.acquisition.devices.simulated import Signal
    from pendpipe.acquisition.recorder import ProgressLine
    from pendpipe.analysis.fit.result import FitResult
    from pendpipe.analysis.free_decay import FreeDecay
    from pendpipe.analysis.turning_points import TurningPoints
    from pendpipe.diagnosis import Progress
    from pendpipe.diagnosis.result import Diagnosis
    from pendpipe.estimate import Estimate
    from pendpipe.formats import Inspection, ReadOptions

Source = Recording | str | Path
"""What is analysed: a recording, or the path of its file. A DataFrame serves as well, with a
column ``time_s`` and one of `_COLUMNS`."""
_COLUMNS: Final = ("angle_rad", "angle_deg", "volts", "displacement_m")
_FIGURES_OF_A_FIT: Final = partial(importlib.import_module, "pendpipe.figures.decays")
_FIGURES_OF_A_DIAGNOSIS: Final = partial(importlib.import_module, "pendpipe.figures.diagnosis")
"""Who draws a result, imported when it is drawn: the result itself knows no figures."""


@checked
def read(
    path: str | Path,
    *,
    channel: Annotated[
        str | int | None,
        Option("number (from 1) or name of the channel, see inspect", "CHANNEL", heading=A_GUESS),
    ] = None,
    column: Annotated[
        str | int | None,
        Option(
            "number (from 1) or name of the column; X,Y for a position seen from the pivot;"
            " TIME:COLUMN names both",
            "COLUMN",
            heading=A_GUESS,
        ),
    ] = None,
    unit: Annotated[
        str | None,
        Option(
            "of the readings: rad, deg, V, mm, counts, ...; of both: ms:deg",
            "UNIT",
            heading=A_GUESS,
        ),
    ] = None,
    sample_rate: Annotated[
        float | None,
        Option("samples a second, instead of the time column", "HZ", heading=A_GUESS),
    ] = None,
    decimal: Annotated[
        str | None, Option("decimal sign, '.' or ','", "SIGN", heading=A_GUESS)
    ] = None,
    delimiter: Annotated[
        str | None, Option("sign between cells, or tab, space", "SIGN", heading=A_GUESS)
    ] = None,
    volts_per_radian: VoltsPerRadian = None,
    start: Annotated[
        float | None, Option("first time to read, s, by the file's clock", "S", heading=A_GUESS)
    ] = None,
    stop: Annotated[
        float | None, Option("last time to read, s, by the file's clock", "S", heading=A_GUESS)
    ] = None,
) -> Recording:
    """Read a recording from a file in any supported format.

    The layout is guessed, and each guess stands in the recording's `notes`. The options
    replace a wrong guess; they are those of the commands (``pendpipe inspect --help``).

    Parameters
    ----------
    path
        CSV in most dialects, WinDaq, MATLAB, Excel, ...
    {options}

    Raises
    ------
    InputError
        If the file can't be read: the file and line, what is wrong, what to do.

    Examples
    --------
    >>> recording = read("examples/string-pendulum.csv")
    >>> recording
    Recording(3600 samples of angle_rad, 0 to 119.967 s)
    >>> len(read("examples/string-pendulum.csv", start=10, stop=60))
    1501
    """
    from pendpipe.formats import read as read_file

    return read_file(
        path,
        _read_options(
            channel=channel,
            column=column,
            unit=unit,
            sample_rate=sample_rate,
            decimal=decimal,
            delimiter=delimiter,
            volts_per_radian=volts_per_radian,
            start=start,
            stop=stop,
        ),
    )


@checked
def acquire(
    port: str,
    *,
    model: Annotated[
        str | None,
        Option("the instrument: di154rs, di2108, ...; it is asked when not given", "MODEL"),
    ] = None,
    rate_hz: Annotated[float, Option("scans a second", "HZ", flag="--rate")] = 60.0,
    duration_s: Annotated[float, Option("length, s", "S", flag="--duration")] = 60.0,
    range_volts: Annotated[float | None, Option("the signal stays within +-V", "V")] = None,
    reconnect_s: Annotated[
        float,
        Option("how long a device that was unplugged is waited for, s", "S", flag="--reconnect"),
    ] = 30.0,
    clock_scale: Annotated[
        float, Option("simulated seconds in a real one", "FACTOR", POSITIVE)
    ] = 1.0,
    volts_per_radian: Annotated[float | None, Option(SENSOR, "V")] = None,
    channel: int = 1,
    signal: "Signal | None" = None,
    raw_path: str | Path | None = None,
    progress: "ProgressLine | None" = None,
) -> Recording:
    """Record from a Dataq instrument, or from a simulated one.

    Parameters
    ----------
    port
        A device file, a COM port, ``socket://HOST:PORT`` or ``rfc2217://HOST:PORT``;
        ``"simulated:di2108"`` needs none.
    {options}
    channel
        As printed on the box.
    signal
        What a simulated instrument reads: times in s to volts. By default a decaying pendulum.
    raw_path
        A new file that keeps the bytes off the wire; in memory only where not given.
    progress
        A display that is kept up to date.

    Returns
    -------
    Recording
        In volts.

    Raises
    ------
    InputError
        If the port can't be opened, the device does not answer, or the setting is impossible.

    Examples
    --------
    >>> acquire("simulated:di2108", duration_s=20, clock_scale=100)
    Recording(1200 samples of volts, 0 to 19.9833 s)
    """
    from pendpipe.acquisition.recorder import acquire_simulated, example_signal, record

    request: dict[str, Any] = {
        "channels": (channel,),
        "rate_hz": rate_hz,
        "duration_s": duration_s,
        "range_volts": range_volts,
        "reconnect_s": reconnect_s,
        "volts_per_radian": volts_per_radian,
        "raw_path": raw_path,
        "progress": progress,
    }
    where, _, kind = port.partition(":")
    if where == "simulated":
        signal = signal or example_signal()
        return acquire_simulated(kind, signal, clock_scale=clock_scale, **request)
    return record(port, model, **request)


def inspect(path: str | Path, **options: Any) -> "Inspection":
    """Describe a file: format, channels, rate, gaps, clipping, and what was guessed.

    Parameters
    ----------
    path
        As for `read`.
    **options
        As for `read`.

    Examples
    --------
    >>> found = inspect("examples/string-pendulum.csv")
    >>> round(found.sample_rate_hz, 3), found.unit
    (30.0, 'rad')
    """
    from pendpipe.formats import inspect as inspect_file

    return inspect_file(path, _read_options(**options))


def find_free_decay(recording: Source) -> "FreeDecay":
    """Find the part of a recording in which the pendulum swings by itself.

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
        Option("waveform or turning-points to have only that one"),
    ] = "auto",
    restoring: Restoring = "auto",
    baseline: Baseline = "eq8",
    fixed: Fixed = None,
    volts_per_radian: VoltsPerRadian = None,
    clock_ppm: Annotated[
        float | None,
        Option(
            "what the clock may be off by, parts per million: it enters the errors", "PPM", POSITIVE
        ),
    ] = None,
    scale_percent: Annotated[
        float | None,
        Option(
            "what V/rad, or a camera's scale, may be off by, in percent: in the errors of a, c and"
            " the amplitude",
            "P",
            Number(0, 100),
        ),
    ] = None,
    length_m: Annotated[
        float | None,
        Option(
            "length of a simple pendulum, m, as 0.600 or 0.600(1): gives g, and angles of"
            " positions",
            "M",
            measured_number,
            flag="--length",
        ),
    ] = None,
    period: Annotated[
        "float | Estimate | None",
        Option(
            "period of small swings, s, as 1.42 or 1.42(1), where amplitudes alone are given",
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
    alone fits better by a likelihood ratio of 1000, and the drag has the likelier form. Where the
    law contradicts the decrement of the turning points, these are fitted instead, or the larger
    amplitudes alone. ``fit.light`` is green, amber or red, and
    ``fit.light_reason`` explains it (docs/fit.md).

    Parameters
    ----------
    recording
        A recording, the path of its file, a DataFrame with ``time_s`` and ``angle_rad`` (or
        ``angle_deg``, ``volts``, ``displacement_m``), or times in s with the angles behind them.
        Amplitudes alone (a ruler's, or speeds at a gate), and turning points, are fitted by Eq. 14.
    angle_rad
        The angles at these times, rad.
    {options}
    points
        Turning points measured before (`turning_points`): they name the decay.
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
        If there is no free decay, or the search did not settle.

    Examples
    --------
    >>> result = fit("examples/rod-pendulum.csv")
    >>> print(result)  # doctest: +ELLIPSIS
    rod-pendulum.csv: angle, 50 Hz, 59.6 s, 52 swings from 4.94° to 1.51°   GREEN
      period, small swings  1.1454712(28) s  (1.1459 s at 4.21°)
      clock                 one off by 50 ppm adds 6 × 10⁻⁵ s, which is not in the error ...
      Q                     162.27(20) at 4.21° (73.4 mrad), 138.39(12) at 2.73° (47.6 mrad), ...
      damping               to 1/e in 59.186(73) s, to 1/2 in 41.025(51) s, decrement ...
      energy goes to        62 % viscous or internal (b), 34 % dry friction (c), at 4.21°; no ...
      law                   −dy/dt = a y² + b y + c: a 0.0088(50) rad⁻¹ s⁻¹, b 0.01043(54) s⁻¹, ...
      misfit                the fit follows the swings to 0.3 %; nothing but noise is left
    Copy: T0 = (1.1454712 ± 0.0000028) s; Q = 162.27 ± 0.20 at 73.4 mrad; 62 % of the loss ...
    Next: pendpipe page FILE makes a sheet to hand out; --figure draws it, --json is for programs
    """
    method = None if method == "auto" else method
    restoring = None if restoring == "auto" else restoring
    from pendpipe.analysis.fit import fit_recording, fit_turning_points
    from pendpipe.analysis.fit.by_amplitudes import fit_amplitudes
    from pendpipe.analysis.fit.by_points import as_angles
    from pendpipe.analysis.fit.result import with_clock, with_scale
    from pendpipe.analysis.free_decay import measure_recording
    from pendpipe.analysis.turning_points import (
        TurningPoints,
        is_turning_points,
        read_turning_points,
    )

    if isinstance(recording, str | Path) and is_turning_points(recording):
        recording = read_turning_points(recording)
    if isinstance(recording, TurningPoints):
        found = fit_turning_points(recording, restoring=restoring, baseline=baseline, fixed=fixed)
        return replace(found, name=name or "", drawn_by=_FIGURES_OF_A_FIT)
    recording = _source(recording, angle_rad)
    place, motion = name or _place(recording), _motion(recording, volts_per_radian)
    own = "" if isinstance(recording, Recording) else Path(recording).name
    if motion.holds_amplitudes and points is None:
        found = fit_amplitudes(
            motion,
            period=_given_period(period),
            length_m=length_m,
            baseline=baseline,
            fixed=fixed,
            place=place,
        )
        return replace(found, name=own, drawn_by=_FIGURES_OF_A_FIT)
    refuse_if(
        period is not None,
        "period",
        "the recording shows its own",
        "leave it out (--fix holds it)",
    )
    if points is None:
        points, decay = measure_recording(motion, place)
    else:
        decay = motion.between(points.start_s, points.stop_s)
    result = fit_recording(
        decay,
        points=points,
        method=method,
        restoring=restoring,
        baseline=baseline,
        fixed=fixed,
        length_m=length_m,
        place=place,
    )
    result = result if clock_ppm is None else with_clock(result, clock_ppm)
    result = result if scale_percent is None else with_scale(result, scale_percent)
    if points.unit != result["amplitude"].unit:
        # Of its rate, or of a position, the angle was fitted.
        points, _ = as_angles(points, position=points.unit == "m")
    return replace(
        result,
        cuts=(*(cut._asdict() for cut in points.cuts), *result.cuts),
        name=own,
        decay=decay,
        drawn_by=_FIGURES_OF_A_FIT,
    )


def _given_period(period: "float | Estimate | None") -> "Estimate | None":
    from pendpipe.estimate import Estimate

    if period is None:
        return None
    given = period if isinstance(period, Estimate) else Estimate(float(period), 0.0, "s")
    refuse_if(
        not 0.0 < given.value < math.inf, "period", f"{given.value!r} is no period", "give seconds"
    )
    return given


@checked
def diagnose(
    recording: Source | Sequence[Source] | Mapping[str, Source],
    *,
    restoring: Restoring = "auto",
    baseline: Baseline = "eq8",
    fixed: Fixed = None,
    volts_per_radian: VoltsPerRadian = None,
    level: Annotated[
        float,
        Option("false-alarm probability for a recording that lacks nothing", "P", Number(0, 1)),
    ] = 0.01,
    seed: Annotated[int, Option("of the random draws", "N", NATURAL)] = 0,
    together: Annotated[bool, Option("several recordings are of one pendulum")] = False,
    own: Annotated[
        Sequence[str],
        Option("of several recordings: what each has of its own (a, b, c, frequency)", "NAME"),
    ] = (),
    same_sensor: Annotated[
        bool, Option("of several recordings: the sensor's errors are shared as well")
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
        of their names), which are then one measurement: physics shared, start and noise each
        its own (docs/several.md).
    {options}
    points
        Turning points measured before (`turning_points`): they name the decay.
    name
        What to call the recording in messages; by default its path.
    provenance
        Goes into the result.
    progress
        Receives a line for each step.

    Returns
    -------
    Diagnosis
        Prints as a dozen lines; ``.summary``, ``.verdict``, ``.effects``, ``.plot()``,
        ``.to_dict()``,
        ``.save(folder)``.

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
    from pendpipe.diagnosis.run import diagnose_decay, diagnose_recording
    from pendpipe.diagnosis.several import diagnose_several

    common: dict[str, Any] = {
        "baseline": baseline,
        "restoring": None if restoring == "auto" else restoring,
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
        refuse_if(fixed, "fixed", "nothing is held in several recordings", "leave it out")
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
    if points is None:
        found = diagnose_recording(motion, **common)
    else:
        decay = motion.between(points.start_s, points.stop_s)
        found = diagnose_decay(decay, points, whole=motion, **common)
    return replace(found, drawn_by=_FIGURES_OF_A_DIAGNOSIS)


@checked
def simulate(
    model: str | Path | Mapping[str, Any],
    *,
    seed: Annotated[
        int | None, Option("seed of the noise, instead of the model's", "N", NATURAL)
    ] = None,
) -> Recording:
    """Simulate a recording from a described pendulum and measurement chain.

    Parameters
    ----------
    model
        A TOML file like ``config/model.toml``, or its content as a mapping.
    {options}

    Examples
    --------
    >>> recording = simulate(
    ...     {
    ...         "pendulum": {"frequency_hz": 0.5, "c": 1e-3, "release_angle_rad": 0.1},
    ...         "sampling": {"sample_rate_hz": 50.0, "duration_s": 20.0},
    ...     }
    ... )
    >>> recording
    Recording(1000 samples of angle_rad, 0 to 19.98 s)
    """
    from pendpipe.simulation import model as models

    described = models.read_model(model)
    if seed is not None:
        described = described.model_copy(update={"seed": seed})
    place = "model" if isinstance(model, Mapping) else str(model)
    return models.simulate(described, f"simulated: {Path(place).name}", place=place)


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


def _read_options(
    start: float | None = None, stop: float | None = None, **given: Any
) -> "ReadOptions":
    """Turn the overrides into the readers' options; numbers of columns are words there."""
    from pendpipe.formats import ReadOptions

    given |= {
        key: str(given[key]) for key in ("channel", "column") if isinstance(given.get(key), int)
    }
    return ReadOptions(start_s=start, stop_s=stop, **given)


def _motion(recording: Source, volts_per_radian: float | None = None) -> Recording:
    """Return the recording in radians (or metres), read from its file where it is one."""
    read_in = recording if isinstance(recording, Recording) else read(recording)
    return read_in.as_motion(volts_per_radian, _place(recording))


def _place(recording: Source) -> str:
    """Name the recording in messages."""
    return "recording" if isinstance(recording, Recording) else str(recording)
