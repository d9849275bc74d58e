"""Parts of the measurement chain that have a memory."""

from __future__ import annotations

import math

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.challenge.torques import compiled


def with_turns(
    time: FloatArray, angle: FloatArray, rate: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Put the turning angles between the samples, by the cubic through angles and rates.

    A coupling has turned round where the pendulum did, not where it was sampled last.

    Returns
    -------
    angle
        Shape (n + turns,).
    sampled
        Which of them are the samples, same shape.
    """
    step, fall = np.diff(time), angle[:-1] - angle[1:]
    before, after = step * rate[:-1], step * rate[1:]
    # The cubic's slope: square s^2 + linear s + before, for s from 0 to 1.
    square, linear = 6.0 * fall + 3.0 * (before + after), -6.0 * fall - 4.0 * before - 2.0 * after
    turns = np.flatnonzero(before * after < 0.0)
    square, linear, before, after = square[turns], linear[turns], before[turns], after[turns]
    root = np.sqrt(np.maximum(linear**2 - 4.0 * square * before, 0.0))
    # Of the two roots, the one at which the slope crosses from the first rate to the second.
    s = np.clip(2.0 * before / (-linear + np.sign(before) * root), 0.0, 1.0)
    turned = angle[turns] + s * (before + s * (0.5 * linear + s * square / 3.0))
    sampled = np.ones(len(angle) + len(turns), dtype=np.bool_)
    sampled[turns + 1 + np.arange(len(turns))] = False
    return np.insert(angle, turns + 1, turned), sampled


@compiled
def play(angle: FloatArray, width: float) -> FloatArray:
    """Backlash of a coupling: the reading follows when the play of full `width` is used up."""
    out = np.empty(len(angle))
    held = angle[0] - 0.5 * width
    for i in range(len(angle)):
        held = min(max(held, angle[i] - 0.5 * width), angle[i] + 0.5 * width)
        out[i] = held
    return out


@compiled
def bristle_coupling(angle: FloatArray, width: float) -> FloatArray:
    """Dahl's coupling: an elastic slip of full `width` instead of a sudden one.

    z' = x' - |x'| z/(width/2), reading x - z; exact for straight motion between samples.
    """
    out = np.empty(len(angle))
    reach = 0.5 * width
    slip = 0.0
    out[0] = angle[0]
    for i in range(1, len(angle)):
        moved = angle[i] - angle[i - 1]
        way = 1.0 if moved > 0.0 else -1.0
        goal = way * reach
        slip = goal + (slip - goal) * math.exp(-abs(moved) / reach)
        out[i] = angle[i] - slip
    return out


@compiled
def high_pass(time: FloatArray, volts: FloatArray, tau: float) -> FloatArray:
    """First-order AC coupling, y' + y/tau = x', cubic between samples.

    The capacitor is discharged at the first sample.
    """
    out = np.empty(len(volts))
    n = len(volts)
    held = 0.0
    out[0] = volts[0]
    for i in range(1, n):
        h = time[i] - time[i - 1]
        before = max(i - 2, 0)
        after = min(i + 1, n - 1)
        slope0 = (volts[i] - volts[before]) / (time[i] - time[before])
        slope1 = (volts[after] - volts[i - 1]) / (time[after] - time[i - 1])
        # Three-point Gauss integral of x exp(-(h - s)/tau)/tau over the interval.
        total = 0.0
        for j in range(3):
            node = 0.5 + (j - 1) * 0.3872983346207417
            weight = 0.4444444444444444 if j == 1 else 0.2777777777777778
            a, b = 1.0 - node, node
            value = volts[i - 1] * a * a * (1 + 2 * b) + volts[i] * b * b * (3 - 2 * b)
            value += h * (slope0 * b * a * a - slope1 * a * b * b)
            total += weight * value * math.exp(-h * a / tau)
        held = held * math.exp(-h / tau) + total * h / tau
        out[i] = volts[i] - held
    return out
