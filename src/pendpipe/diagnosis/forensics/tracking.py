"""A tracked mark that wanders: what it does to the distance from the pivot it does to the angle."""

import math
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.found import Confirmation, Finding, Location
from pendpipe.estimate import Estimate

_SMOOTH: Final = 5
"""Degree in the angle of what the camera's geometry makes of the distance from the pivot."""
_OF_A_THIRD: Final = 5
"""Degree in time that follows the motion over a third of a period: to 1e-4 of it."""
_FEWEST_ROWS: Final = 9
"""Rows: a polynomial of the fifth degree leaves three of nine to judge it by."""


def wander(samples: Samples) -> FloatArray | None:
    """Return what the distance is more than a smooth function of the angle, over the distance."""
    if samples.radius_excess is None or samples.unit != "rad":
        return None
    smooth = np.polynomial.Polynomial.fit(samples.values, samples.radius_excess, _SMOOTH)
    return np.asarray(samples.radius_excess - smooth(samples.values))


def rows_of(samples: Samples, period_s: float) -> int:
    """Return the rows within a third of a period, an odd number."""
    interval = float(np.median(np.diff(samples.time_s)))
    return max(_FEWEST_ROWS, 2 * int(period_s / (6.0 * interval)) + 1)


def wander_confirmed(samples: Samples, along: FloatArray, rows: int) -> Confirmation:
    """Test whether angle and distance scatter together within a third of a period, without a model.

    What polynomials in time leave of them is uncorrelated where the errors of the two coordinates
    are. The variance of a correlation of n values is ``sum of rho_1(k) rho_2(k)/n`` over all lags
    k (Bartlett 1935).
    """
    from scipy.signal import savgol_filter

    both = np.array(
        [each - savgol_filter(each, rows, _OF_A_THIRD) for each in (samples.values, along)]
    )
    both /= np.linalg.norm(both, axis=1)[:, None]
    together = float(both[0] @ both[1])
    lags = [(both[:, k:] * both[:, :-k]).sum(axis=1).prod() for k in range(1, 2 * rows)]
    sd = math.sqrt(max(1.0 + 2.0 * sum(lags), 1.0) / len(along))
    return Confirmation(
        "angle and distance scatter together within a third of a period (correlation"
        f" {together:.2f} ± {sd:.2f})",
        math.erfc(abs(together) / (sd * math.sqrt(2.0))),
    )


def find(evidence: Evidence) -> Finding | None:
    """Test for a wander that both coordinates show, and correct the angles in proportion.

    The p-value is that of the test without the model; ``kappa`` is the change of the angle with
    the relative distance.
    """
    from scipy.ndimage import uniform_filter1d

    data, fit, samples = evidence.data, evidence.fit, evidence.samples
    along, rows = wander(samples), rows_of(samples, fit.at.span.period_s)
    if along is None or not np.any(along) or len(along) < rows:
        return None
    sure = wander_confirmed(samples, along, rows)
    # The mean over as many rows: what is faster is mostly another error in each coordinate.
    slow = uniform_filter1d(along, rows, mode="nearest")
    seen = np.interp(data.time_s, samples.time_s, slow) * data.weight
    left = data.residual(fit.at.reading) * data.weight
    square = float(seen @ seen)
    kappa = float(left @ seen) / square
    # Neighbouring readings wander together: so many of them are one.
    memory = max(1.0, square / max(float(np.sum(np.diff(seen) ** 2)), 1e-300))
    rest = left - kappa * seen
    sd = math.sqrt(memory * float(rest @ rest) / max(data.used, 1) / square)
    rms = math.sqrt(square / data.used)
    return Finding(
        "tracking-noise",
        sure.p_value,
        parameters={
            "kappa": Estimate(kappa, sd, "rad"),
            "rms": Estimate(rms, rms / math.sqrt(2.0 * data.used / memory), ""),
        },
        location=Location((float(data.time_s[0]), float(data.time_s[-1]))),
        taken=kappa * seen,
        price=1.0,  # within a standard deviation it is the same
        summary="the tracked mark wanders: the distance from the pivot, which a string keeps,"
        " changes with the angle's errors",
        confirmed=sure,
    )
