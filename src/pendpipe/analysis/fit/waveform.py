"""Eq. 8 on all the readings, by Gauss-Newton with the engine's exact sensitivities.

Rounded readings say only between which limits the angle lay. With noise of rms s before the
rounding, a reading r stands for the interval r -+ step/2, and its probability is
Phi((r + step/2 - m)/s) - Phi((r - step/2 - m)/s) for a model m. Where s is half a step or more
this is the usual chi^2 with variance s^2 + step^2/12; below, that would take the rounding for
random, which it is not, least of all in the tail.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pendpipe.analysis.fit.least_squares import Bounds, Quadratic
from pendpipe.analysis.fit.result import Restoring
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian
from pendpipe.dynamics.eq8 import OFFSET, OMEGA, SHARE, START, TIME, A, B, C
from pendpipe.dynamics.kernel import kernel

ROOT_HALF = math.sqrt(0.5)
DENSITY = 1.0 / math.sqrt(2.0 * math.pi)
_FAR = 25.0
"""Standard deviations beyond which the tail's probability is taken from its series."""


@kernel
def rounded(
    residual: FloatArray, half_step: float, noise: float, score: FloatArray, weight: FloatArray
) -> float:
    """Return -2 ln likelihood, and fill in its derivatives by the model.

    Parameters
    ----------
    residual
        Readings less model, shape (n,).
    half_step, noise
        Half the step of the readings; rms of the noise before the rounding.
    score, weight
        To be filled: d ln P/dm and -d^2 ln P/dm^2 (never negative), shape (n,).
    """
    total = 0.0
    for i in range(len(residual)):
        low, high = (residual[i] - half_step) / noise, (residual[i] + half_step) / noise
        # By symmetry the interval lies about zero or above it.
        sign = 1.0
        if low + high < 0.0:
            low, high, sign = -high, -low, -1.0
        if low > _FAR:
            # ln P ~ -low^2/2 - ln(low sqrt(2 pi)): the far limit adds nothing.
            total += low * low + 2.0 * math.log(low / DENSITY)
            score[i] = sign * (low + 1.0 / low) / noise
            weight[i] = (1.0 - 1.0 / low**2) / noise**2
            continue
        if low > 0.0:
            chance = 0.5 * (math.erfc(low * ROOT_HALF) - math.erfc(high * ROOT_HALF))
        else:
            chance = 0.5 * (math.erf(high * ROOT_HALF) - math.erf(low * ROOT_HALF))
        at_low = DENSITY * math.exp(-0.5 * low * low) / chance
        at_high = DENSITY * math.exp(-0.5 * high * high) / chance
        slope = at_low - at_high
        total -= 2.0 * math.log(chance)
        score[i] = sign * slope / noise
        weight[i] = max(slope * slope - low * at_low + high * at_high, 0.0) / noise**2
    return total


def best_noise(residual: FloatArray, step: float, start: float) -> float:
    """The most likely noise before the rounding, between step/25 and step.

    Its logarithm is where a parabola through the three best of nine has its vertex.
    """
    score, weight = np.empty_like(residual), np.empty_like(residual)

    def unlikely(logarithm: float) -> float:
        return float(rounded(residual, 0.5 * step, math.exp(logarithm), score, weight))

    grid = np.linspace(math.log(0.04 * step), math.log(max(step, 2.0 * start)), 9)
    costs = [unlikely(each) for each in grid.tolist()]
    best = min(max(int(np.argmin(costs)), 1), 7)
    before, least, after = costs[best - 1 : best + 2]
    bend = before - 2.0 * least + after
    turn = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return math.exp(grid[best] + min(max(turn, -1.0), 1.0) * (grid[1] - grid[0]))


BOUNDS: Final = Bounds(
    np.array([0.0, 0.0, 0.0, 0.0, 1e-12, -np.inf, -np.inf, -np.inf]),
    np.array([np.inf] * 3 + [1.0] + [np.inf] * 4),
)
_PIECE: Final = 1 << 18
"""Readings whose Jacobian is in memory at a time: 16 MB."""
PRIOR_SHARE: Final = 0.5
PRIOR_INVERSE: Final = 12.0
"""Anything from 0 to 1 is as likely: mean 1/2, variance 1/12."""
_SLIGHT: Final = 0.1
"""Of chi^2 in a half cycle: a smaller misfit is not seen in the noise."""
_ENDS: Final = 10.0
"""By which the square of a phase's change is greater at the record's end than its mean."""


@dataclass(frozen=True)
class Waveform:
    """chi^2 of the readings against Eq. 8.

    Parameters
    ----------
    time_s, values
        The readings, shape (n,).
    noise_rms
        Standard deviation of one.
    step
        The step of readings whose rounding is not random (see `rounding.py`); `noise_rms` is
        then that before the rounding. Zero: the readings scatter as `noise_rms` says.
    restoring
        The restoring torque.
    split
        What is told of b's parts: ``"hysteretic"`` or ``"viscous"`` with its rate (1/s)
        held fixed; empty when the share is marginalised over its prior.
    """

    time_s: FloatArray
    values: FloatArray
    noise_rms: float
    split: Mapping[str, float]
    step: float = 0.0
    restoring: Restoring = "linear"
    _last: dict[bytes, FloatArray] = field(default_factory=dict, compare=False, repr=False)

    def model(self, value: FloatArray) -> tuple[Eq8, Release]:
        """What moves, and from where, for a set of parameters."""
        hysteretic, viscous = self.parts(value)
        a, _, c, _, omega, angle, time, offset = value.tolist()
        law = Eq8(omega, a, hysteretic, viscous, c, self.restoring)
        return law, Release(time, angle, offset)

    def parts(self, value: FloatArray) -> tuple[float, float]:
        """The hysteretic and the viscous part of b."""
        b = float(value[B])
        if "hysteretic" in self.split:
            return min(self.split["hysteretic"], b), max(b - self.split["hysteretic"], 0.0)
        if "viscous" in self.split:
            return max(b - self.split["viscous"], 0.0), min(self.split["viscous"], b)
        return float(value[SHARE]) * b, (1.0 - float(value[SHARE])) * b

    def residual(self, value: FloatArray) -> FloatArray:
        """Readings less model, shape (n,); the last is kept, for it is asked for again."""
        key = value.tobytes()
        if key not in self._last:
            self._last.clear()
            self._last[key] = self.values - sample(*self.model(value), self.time_s)
        return self._last[key]

    def predict_remaining(
        self, value: FloatArray, trial: FloatArray, quadratic: Quadratic, promised: float
    ) -> float:
        """Predict what chi^2 a Gauss-Newton step leaves to be gained (too high rather than low).

        The model is as linear as the motion stays what it was: where the step changes it by a part
        e, rms, it is wrong by about e of itself. And b's share lengthens the period by
        0.4 (b/omega)^2 times the square of its change, which the linear model does not know.
        Infinite where the residuals from which the step begins would not do for those at its end.
        """
        omega, b = float(trial[OMEGA]), float(trial[B])
        half_cycles = omega * float(self.time_s[-1] - self.time_s[0]) / np.pi
        if self.step != 0.0 or promised > _SLIGHT * half_cycles:
            return np.inf
        signal = len(self.values) * float(np.var(self.values)) / self.noise_rms**2
        slower = 0.4 * b**2 / omega * float(trial[SHARE] - value[SHARE]) ** 2
        at_ends = _ENDS * promised**2 / signal
        return at_ends + float(quadratic.normal[OMEGA, OMEGA]) * slower**2

    def evaluate(self, value: FloatArray) -> Quadratic:
        """chi^2, gradient and normal matrix, summed over pieces of the record."""
        refused = Quadratic(np.inf, np.zeros(8), np.eye(8))
        model, release = self.model(value)
        if release.time_s > self.time_s[0] or not np.isfinite(model.stop_rad):
            return refused
        try:
            summed = self._summed(value)
        except ValueError:
            # Overdamped: far from anything that turns.
            return refused
        change = self.change(value)
        gradient, normal = change.T @ summed.gradient, change.T @ summed.normal @ change
        return self._with_prior(value, Quadratic(summed.chi2, gradient, normal))

    def _summed(self, value: FloatArray) -> Quadratic:
        """chi^2, gradient and normal matrix by the engine's parameters."""
        chi2, gradient, normal = 0.0, np.zeros(8), np.zeros((8, 8))
        residual = np.empty(len(self.values))
        for first in range(0, len(residual), _PIECE):
            piece = slice(first, first + _PIECE)
            angle, jacobian = sample_with_jacobian(*self.model(value), self.time_s[piece])
            np.subtract(self.values[piece], angle, out=residual[piece])
            left, weight = residual[piece], self.noise_rms**-2
            if self.step == 0.0:
                chi2 += weight * float(left @ left)
                gradient += weight * (jacobian.T @ left)
                normal += weight * (jacobian.T @ jacobian)
            else:
                score, weights = np.empty_like(left), np.empty_like(left)
                chi2 += float(rounded(left, 0.5 * self.step, self.noise_rms, score, weights))
                gradient += jacobian.T @ score
                normal += jacobian.T @ (jacobian * weights[:, None])
        self._last.clear()
        self._last[value.tobytes()] = residual
        return Quadratic(chi2, gradient, normal)

    def change(self, value: FloatArray) -> FloatArray:
        """Derivative of the engine's parameters by ours, shape (8, 8)."""
        share = float(value[SHARE])
        if "hysteretic" in self.split:
            by_b, by_share = (0.0, 1.0), 0.0
        elif "viscous" in self.split:
            by_b, by_share = (1.0, 0.0), 0.0
        else:
            by_b, by_share = (share, 1.0 - share), float(value[B])
        change = np.zeros((8, 8))
        change[0, A] = change[3, C] = change[4, OMEGA] = 1.0
        change[5, START] = change[6, TIME] = change[7, OFFSET] = 1.0
        change[1:3, B] = by_b
        change[1:3, SHARE] = by_share, -by_share
        return change

    def _with_prior(self, value: FloatArray, likelihood: Quadratic) -> Quadratic:
        off = float(value[SHARE]) - PRIOR_SHARE
        likelihood.gradient[SHARE] -= PRIOR_INVERSE * off
        likelihood.normal[SHARE, SHARE] += PRIOR_INVERSE
        return likelihood._replace(chi2=likelihood.chi2 + PRIOR_INVERSE * off**2)
