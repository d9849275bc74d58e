"""The parts of b = b_h + b_v that are held: what that leaves of b and of its share."""

from __future__ import annotations

from collections.abc import Mapping

from pendpipe.arrays import FloatArray
from pendpipe.effects.baseline import SHARE, B

HYSTERETIC, VISCOUS = "hysteretic", "viscous"


def held_indices(parts: Mapping[str, float]) -> list[int]:
    """Indices of the values that held parts leave no freedom: with one, b moves the share."""
    return ([], [SHARE], [B, SHARE])[len(parts)]


def with_parts(value: FloatArray, parts: Mapping[str, float]) -> FloatArray:
    """Values with the share (and, if both parts are held, the b) that held parts make."""
    if not parts:
        return value
    value = value.copy()
    least = sum(parts.values())
    value[B] = least if len(parts) == 2 else max(float(value[B]), least)
    if value[B] > 0.0 and HYSTERETIC in parts:
        value[SHARE] = parts[HYSTERETIC] / value[B]
    elif value[B] > 0.0:
        value[SHARE] = 1.0 - parts[VISCOUS] / value[B]
    return value


def share_by_b(value: FloatArray, parts: Mapping[str, float]) -> float:
    """Derivative of the share by b where one part of b is held; else b has it for itself."""
    if len(parts) != 1 or value[B] <= 0.0:
        return 0.0
    return float(-value[SHARE] if HYSTERETIC in parts else 1.0 - value[SHARE]) / float(value[B])
