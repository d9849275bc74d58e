"""Eq. 8 by ways that share nothing with the engine's tables.

The challenge's integrator goes in time, in steps of the eighth order; `in_stretches` has the engine
itself take up the motion anew at every eighth turning point.
"""

from dataclasses import replace

import numpy as np

from pendpipe.dynamics import (
    Eq8,
    Release,
    sample_with_jacobian,
    turning_points,
    turning_points_with_jacobian,
)
from pendpipe_challenge.motion import Motion
from pendpipe_challenge.torques import of_rates


def integrated(model: Eq8, y: float) -> Motion:
    """The same pendulum in steps of a 25th of a radian: right to 1e-13 of the swing."""
    rates = of_rates(
        *(model.angular_frequency, model.quadratic),
        *(model.viscous, model.hysteretic, model.coulomb),
        speed=model.drag == "speed",
    )
    return Motion(rates | {"sine": float(model.restoring == "sine"), "step_phase": 0.04}, y)


def assert_turns(
    model: Eq8,
    y: float,
    time_s: np.ndarray,
    angle_rad: np.ndarray,
    within: float,
    floor: float,
    late: float = 1.0,
) -> None:
    """The integrator turns at these times and angles, and rests after the last if friction does.

    Parameters
    ----------
    within
        In radians of the phase, and of the angle over its amplitude.
    floor
        What the angle may be off besides, rad.
    late
        How many times that the rate may be off, over omega: where friction leaves hardly any
        torque, a turning point is as late as the root of what the angle is off.
    """
    w = model.angular_frequency
    track = integrated(model, y).run(time_s)
    np.testing.assert_allclose(track.angle_rad, angle_rad, rtol=within, atol=floor)
    assert np.all(np.abs(track.rate_rad_s) < w * (within * np.abs(angle_rad) + late * floor))


STRETCH = 8
"""Half cycles that are too few for the engine to tabulate: it solves them one by one."""


def turning_points_in_stretches(
    model: Eq8, release: Release, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return turning points, the motion taken up anew at every eighth of them."""
    times, angles = np.array([release.time_s]), np.array([release.angle_rad])
    while len(times) < count:
        release = Release(float(times[-1]), float(angles[-1]))
        points = turning_points(model, release, count=min(STRETCH + 1, count + 1 - len(times)))
        times, angles = np.append(times, points.time_s[1:]), np.append(angles, points.angle_rad[1:])
        if points.stopped:
            break
    return times, angles


def samples_in_stretches(
    model: Eq8, release: Release, time_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return samples and Jacobian, the motion taken up anew at every eighth turning point."""
    angle, jacobian = np.empty(len(time_s)), np.empty((len(time_s), 8))
    first, carried = 0, np.eye(8)
    while True:
        points, times, angles = turning_points_with_jacobian(model, release, STRETCH + 1)
        end = float(points.time_s[-1])
        last = len(time_s) if points.stopped else int(np.searchsorted(time_s, end))
        angle[first:last], own = sample_with_jacobian(model, release, time_s[first:last])
        jacobian[first:last] = own @ carried
        if last == len(time_s):
            return angle, jacobian
        # The next release, by the parameters of this stretch: its angle is without the offset.
        step = np.eye(8)
        step[5], step[6] = angles[-1], times[-1]
        step[5, 7] -= 1.0
        carried = step @ carried
        release = replace(release, time_s=end, angle_rad=points.angle_rad[-1] - release.offset_rad)
        first = last
