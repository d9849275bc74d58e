"""How b divides into hysteretic and viscous: only as far as Eq. 8's form is believed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from pendpipe.analysis.fit.waveform import OMEGA, SHARE, B
from pendpipe.analysis.losses import quality_of_rate
from pendpipe.arrays import FloatArray
from pendpipe.estimate import Estimate

_KNOWN: Final = 0.1
"""Standard deviation of the share (0 to 1) below which the waveform has told it."""
_CAVEAT: Final = (
    "quality_factor_hysteretic and quality_factor_viscous hold given Eq. 8's form: they rest on"
    " a third harmonic that another form of drag, or the sensor, would swamp"
)


def split_quality_factors(
    value: FloatArray, covariance: FloatArray, fixed: Mapping[str, float]
) -> tuple[Estimate | None, Estimate | None, list[str]]:
    """Quality factors of the two parts of b, where they are held or well known.

    Returns
    -------
    hysteretic, viscous
        None where the record does not tell them.
    warnings
        A clause each.
    """
    names = ("quality_factor_hysteretic", "quality_factor_viscous")
    held = {name: Estimate(fixed[name], 0.0, "") for name in names if name in fixed}
    if held:
        return held.get(names[0]), held.get(names[1]), []
    sd = math.sqrt(max(float(covariance[SHARE, SHARE]), 0.0))
    if not 0.0 < sd < _KNOWN or value[B] <= 0.0:
        return None, None, []
    b, share = float(value[B]), float(value[SHARE])
    variance_b, variance_share = float(covariance[B, B]), float(covariance[SHARE, SHARE])
    mixed = 2.0 * b * float(covariance[B, SHARE])
    parts = []
    for part, sign in ((share, 1.0), (1.0 - share, -1.0)):
        # Of the product b x part.
        variance = part**2 * variance_b + sign * part * mixed + b**2 * variance_share
        rate = Estimate(part * b, math.sqrt(max(variance, 0.0)), "1/s")
        known = rate.bounds95[0] > 0.0
        parts.append(quality_of_rate(0.5 * float(value[OMEGA]) / math.pi, rate) if known else None)
    return parts[0], parts[1], [_CAVEAT]
