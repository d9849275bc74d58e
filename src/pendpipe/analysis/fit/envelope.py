"""Eq. 14 on turning points, by weighted least squares in every regime."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.fit.minimise import Quadratic, minimise
from pendpipe.analysis.fit.quadratic import Bounds
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.shape import loss_rates
from pendpipe.arrays import FloatArray
from pendpipe.physics.decay_gradient import amplitude_and_gradient

NAMES: Final = ("a", "b", "c", "amplitude", "level")
BOUNDS: Final = Bounds(np.array([0.0, 0.0, 0.0, 0.0, -np.inf]), np.full(5, np.inf))


@dataclass(frozen=True)
class EnvelopeFit:
    """a, b, c, y0 and the error of the level, shape (5,), in the order of `NAMES`."""

    value: FloatArray
    quadratic: Quadratic
    held: tuple[int, ...]
    amplitude: FloatArray
    """Eq. 14 at the turning points, shape (k,)."""
    residual: FloatArray
    converged: bool

    @property
    def chi2_per_dof(self) -> float:
        """chi^2 over points less parameters (the level brings its own datum)."""
        freedom = len(self.residual) - (4 - len([j for j in self.held if j < 4]))
        return self.quadratic.chi2 / max(freedom, 1)


def fit_envelope(
    points: TurningPoints, fixed: Mapping[str, float] | None = None, *, tolerance: float = 1e-5
) -> EnvelopeFit:
    """Fit a, b, c >= 0 and y0 of Eq. 14 to turning points.

    The shared error of the level is a parameter with a prior: it has the alternating
    sign of the half cycles, and so leaves a, b, c nearly alone.

    Parameters
    ----------
    points
        Turning points with their errors.
    fixed
        Values of a, b, c, amplitude or offset that are held.
    tolerance
        Of chi^2, see `minimise`.
    """
    time = points.time_s - points.time_s[0]
    side, weight = points.side, 1.0 / points.angle_sd_rad**2
    measured = points.amplitude_rad
    shared = -points.level_coupling * side
    prior = 1.0 / max(points.level_sd_rad, 1e-12 * float(np.max(np.abs(measured)))) ** 2

    def parts(value: FloatArray) -> tuple[FloatArray, FloatArray]:
        a, b, c, y0, level = value
        model, gradient = amplitude_and_gradient(time, y0, a, b, c)
        jacobian = np.concatenate([gradient[:, 1:], gradient[:, :1], shared[:, None]], axis=1)
        return measured - model - shared * level, jacobian

    def evaluate(value: FloatArray) -> Quadratic:
        residual, jacobian = parts(value)
        if not np.all(np.isfinite(jacobian)):
            return Quadratic(np.inf, np.zeros(5), np.eye(5))
        weighted = jacobian * weight[:, None]
        normal = weighted.T @ jacobian
        gradient = weighted.T @ residual
        normal[4, 4] += prior
        gradient[4] -= prior * value[4]
        return Quadratic(
            float(residual @ (weight * residual)) + prior * value[4] ** 2, gradient, normal
        )

    start, held = _start(points, fixed or {})
    found = minimise(evaluate, start, BOUNDS, held=held, tolerance=tolerance)
    residual, _ = parts(found.value)
    model = measured - residual - shared * found.value[4]
    return EnvelopeFit(found.value, found.quadratic, held, model, residual, found.converged)


def _start(points: TurningPoints, fixed: Mapping[str, float]) -> tuple[FloatArray, tuple[int, ...]]:
    """Where the search begins, and what is held."""
    amplitude, sd = points.amplitude_rad, points.angle_sd_rad
    seen = amplitude > 3.0 * sd
    if seen.sum() < 3:
        seen = amplitude > 0.0
    rates = loss_rates(points.time_s[seen], amplitude[seen], sd[seen])
    start = np.array([*rates, float(amplitude[np.argmax(seen)]), 0.0])
    held = []
    for index, name in enumerate(NAMES[:4]):
        if name in fixed:
            start[index] = fixed[name]
            held.append(index)
    if "offset" in fixed:
        start[4] = float(np.mean(points.level_rad)) - fixed["offset"]
        held.append(4)
    return start, tuple(held)
