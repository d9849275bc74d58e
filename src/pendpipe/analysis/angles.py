"""A pendulum's angle from readings that follow it: its rate, a position L sin x, an acceleration.

Where nobody says how long the arm L is, or in which unit it is read, the period tells: it lengthens
with the swing by A^2/16, and so shows how large the swings are.
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.readings import motion_of
from pendpipe.analysis.torque import may_be_sine, sine_coefficient, swing_phase
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.estimate import Estimate
from pendpipe.physics.lengthening import ANGLES, SEEN, TELLS, Coefficient, unit_shown
from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2
from pendpipe.quantities import with_error
from pendpipe.recording import Recording

_ON_EARTH: Final = 0.0015
"""Relative spread of g between the equator at 9.780 and the poles at 9.832 m/s^2, as a standard
deviation: a range of 0.0053 over its root of twelve."""
_ROUNDS: Final = 4
"""In which the frequency of small swings and their angles settle."""
_TRIAL_RAD: Final = 0.3
"""Amplitude from which the search for a scale begins; the share of sin x goes as its square."""
_LIKE_SINE: Final = ("pixels", "m/s^2", "rad/s^2")
"""Units of readings that go as sin x, whatever they are worth."""
_SCALE_SD: Final = "scale_sd"
READ_AS: Final = "read_as"
"""Metadata: the relative error of a scale that the period shows, and what it says of the unit."""
_LENGTHS: Final = {"metres": 1.0, "centimetres": 0.01, "millimetres": 0.001}
"""Of a position, in m."""


def as_angles(
    points: TurningPoints, length: Estimate | None = None, *, position: bool = False
) -> tuple[TurningPoints, Estimate | None]:
    """Turning points of the angle, from those of its rate or of a position L sin x.

    Between two extremes of the rate, where the pendulum hangs down, the angle turns: its amplitude
    there is that of both, 2 arcsin(u/2 omega). The level stays that of the readings.

    Parameters
    ----------
    points
        In rad, rad/s, or m.
    length
        L; by default that of `arm_of`.
    position
        Whether metres are a pendulum's position.

    Returns
    -------
    points, length
        In rad, and L in m; as they are given where they are neither, and no length.
    """
    if position:
        arm = length or arm_of(points)
        return seen_along(points, arm.value), arm
    if points.unit != "rad/s":
        return points, None
    half = np.diff(points.half_cycle)
    rate, paces = points.amplitude_rad, np.diff(points.time_s) / half
    omega = math.pi / float(np.median(paces))
    for _ in range(_ROUNDS):
        angle = 2.0 * np.arcsin(np.clip(0.5 * rate / omega, -1.0, 1.0))
        omega = float(np.median(swing_phase(np.abs(angle), "sine") / paces))
    whole = half == 1
    sd = points.angle_sd_rad / (omega * np.maximum(np.cos(0.5 * angle), 0.1))
    turned = np.sqrt(np.maximum(angle[1:] * angle[:-1], 0.0)) * points.side[:-1]

    def between(values: FloatArray) -> FloatArray:
        return np.asarray(0.5 * (values[1:] + values[:-1])[whole])

    return replace(
        points,
        half_cycle=points.half_cycle[:-1][whole],
        time_s=between(points.time_s),
        time_sd_s=between(points.time_sd_s),
        angle_rad=turned[whole],
        angle_sd_rad=between(sd),
        level_rad=between(points.level_rad),
        level_sd_rad=points.level_sd_rad / omega,
        step_rad=points.step_rad / omega,
        unit="rad",
    ), None


def seen_along(points: TurningPoints, length: float) -> TurningPoints:
    """Turning points arcsin(s/L) of the angle, from those of a position s on an arm of length L."""
    angle = np.arcsin(np.clip(points.angle_rad / length, -1.0, 1.0))
    slope = 1.0 / (length * np.maximum(np.cos(angle), 0.1))
    found = replace(points, angle_rad=angle, angle_sd_rad=points.angle_sd_rad * slope)
    return replace(found, level_sd_rad=points.level_sd_rad / length, unit="rad")


def arm_of(points: TurningPoints) -> Estimate:
    """Length L of the arm at which a position L sin x is read, m.

    g/omega^2 with standard gravity, weighed with what the period's growth with the swing shows
    (`sine_coefficient`, as (g/omega^2/L)^2). Where the two contradict each other, the mark is not
    in the centre of oscillation, and the period alone tells.
    """
    half = np.diff(points.half_cycle)
    length = STANDARD_GRAVITY_M_PER_S2 / (math.tau * points.apparent_frequency_hz) ** 2
    for _ in range(_ROUNDS):
        swings = swing_phase(seen_along(points, length).amplitude_rad, "sine") * half
        pace = float(np.sum(swings)) / float(np.ptp(points.time_s))
        length = STANDARD_GRAVITY_M_PER_S2 / pace**2
    share, sd = 1.0, 2.0 * _ON_EARTH
    shown = sine_coefficient(seen_along(points, length))
    if abs(shown.value - 1.0) < SEEN * math.hypot(shown.sd, sd):
        weight = sd**2 / (sd**2 + shown.sd**2)
        share, sd = 1.0 + weight * (shown.value - 1.0), math.sqrt(weight) * shown.sd
    elif _tells(shown):
        share, sd = shown.value, shown.sd
    return Estimate(length / math.sqrt(share), 0.5 * length * sd / share**1.5, "m")


def _tells(shown: Coefficient) -> bool:
    return shown.sd < TELLS * shown.value


class Scale(NamedTuple):
    """What a reading of unknown unit is worth."""

    name: str
    factor: float
    sd: float
    """Relative; 0 of a unit."""


def as_pendulum(
    recording: Recording, points: TurningPoints, length_m: float | None = None
) -> Recording | None:
    """Take readings of an unknown unit as what makes the period lengthen so with the swing.

    As an angle; or, of a pendulum whose length is known, as a position L sin x in one of the usual
    units, or else in proportion to sin x, as pixels and an accelerometer along the swing are. A
    step, or a size, tells no unit.
    """
    unknown = recording.unit == "1" and recording.quantity == "reading"
    if not (unknown or (length_m and recording.unit in _LIKE_SINE)):
        return None
    found = _scale_of(points, length_m, named=unknown)
    if found is None:
        return None
    name, factor, sd = found
    what = "pendulum's" if length_m is None else "pendulum's of this length"
    worth = with_error(factor, sd * factor, "m", short=True)
    size = f"taken to be {name}" if name else f"a reading of 1 is worth {worth}"
    step = None if recording.resolution is None else factor * recording.resolution
    said = f"the period lengthens with the swing as a {what} does: {size}"
    return motion_of(
        replace(
            recording,
            values=factor * recording.values,
            quantity="angle_rad" if length_m is None else "displacement_m",
            resolution=step,
            notes=(*recording.notes, said),
            metadata={**recording.metadata, _SCALE_SD: repr(sd), READ_AS: said},
        )
    )


def scale_of(recording: Recording) -> float:
    """Relative standard deviation of a scale that the period has shown; 0 of others."""
    return float(recording.metadata.get(_SCALE_SD, 0.0))


def _scale_of(points: TurningPoints, length_m: float | None, *, named: bool) -> Scale | None:
    """The unit, or else the scale, in which the share of sin x is 1."""

    def shown(factor: float) -> Coefficient | None:
        angles = replace(
            points,
            angle_rad=factor * points.angle_rad,
            angle_sd_rad=factor * points.angle_sd_rad,
            unit="rad",
        )
        if length_m is not None:
            if np.max(np.abs(angles.angle_rad)) >= length_m:
                return None
            angles = seen_along(angles, length_m)
        return sine_coefficient(angles) if may_be_sine(angles) else None

    units = (ANGLES if length_m is None else _LENGTHS) if named else {}
    if (name := unit_shown(shown, units)) is not None:
        return Scale(name, units[name], 0.0)
    if length_m is None:
        return None
    factor = _TRIAL_RAD * length_m / float(np.max(points.amplitude_rad))
    sd = math.inf
    for _ in range(_ROUNDS):
        found = shown(factor)
        if found is None or not _tells(found):
            return None
        factor, sd = factor * math.sqrt(found.value), 0.5 * found.sd / found.value
    return Scale("", factor, sd)
