"""Eq. 14 on turning points, by weighted least squares in every regime."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.fit.minimise import Quadratic, minimise
from pendpipe.analysis.fit.period import TOP, elliptic, fit_period
from pendpipe.analysis.fit.quadratic import Bounds, bounded_step
from pendpipe.analysis.fit.result import Restoring
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


def fit_energies(
    points: TurningPoints,
    fixed: Mapping[str, float] | None = None,
    *,
    restoring: Restoring = "sine",
    share: float = 0.5,
) -> EnvelopeFit:
    """Fit a, b, c >= 0 and y0 to the energies of turning points.

    From a turning point at A to the next at A' the energy over the moment of inertia,
    omega^2 (1 - cos A), falls by omega (A + A') [pi c/2 + pi b_h k + 2 pi a k^2]
    + 16 omega b_v [E - (1 - k^2) K], with k the mean of sin(A/2) and of sin(A'/2) and the complete
    elliptic integrals of modulus k; with the linear torque it is omega^2 A^2/2, and k is small. The
    losses up to a turning point are linear in a, b, c.

    Parameters
    ----------
    points
        Turning points with their errors.
    fixed
        Values of a, b, c, amplitude or offset that are held.
    restoring
        The restoring torque.
    share
        The hysteretic share of b.
    """
    measured, side = points.amplitude_rad, points.side
    base = np.array([0.0, 0.0, 0.0, measured[0], 0.0])
    start, held = _held(points, fixed or {}, base)
    free = fit_period(points, measured, 0.0, 0.0, 0.0, share=share, restoring=restoring)
    swings = np.diff(points.half_cycle) / free.angular_frequency
    sine = restoring == "sine"
    most = TOP if sine else None
    y = np.clip(measured, 0.0, most)
    energy, slope = (-np.cos(y), np.sin(y)) if sine else (0.5 * y**2, y)
    slope = np.maximum(slope, 1e-3 * np.max(slope))
    shared = -points.level_coupling * side
    weight = 1.0 / points.angle_sd_rad**2
    for _ in range(2):
        both = y[1:] + y[:-1]
        k = np.sin(0.5 * y) if sine else 0.5 * y
        # The energy falls evenly along the path: means of k^2 and k of a half swing.
        high, low = k[:-1], k[1:]
        square = 0.5 * (high**2 + low**2)
        mean = (2.0 * square + high * low) / (1.5 * np.maximum(high + low, 1e-300))
        viscous = 4.0 * math.pi * square
        if sine:
            first, second = elliptic(square)
            viscous = 16.0 * (second - (1.0 - square) * first)
        linear = share * math.pi * both * mean + (1.0 - share) * viscous
        losses = np.stack([2.0 * math.pi * both * square, linear, 0.5 * math.pi * both]) * swings
        lost = np.cumsum(np.pad(losses, ((0, 0), (1, 0))), axis=1)
        jacobian = np.stack([*(-lost / slope), slope[0] / slope, shared], axis=1)
        residual = (energy - energy[0]) / slope - jacobian @ (start - base)
        normal = jacobian.T @ (weight[:, None] * jacobian)
        gradient = jacobian.T @ (weight * residual)
        prior = 1.0 / max(points.level_sd_rad, 1e-12 * float(np.max(np.abs(measured)))) ** 2
        normal[4, 4] += prior
        gradient[4] -= prior * start[4]
        step = bounded_step(normal, gradient, BOUNDS.about(start), held)
        value = BOUNDS.clip(start + step)
        residual = residual - jacobian @ step
        model = measured - residual - shared * value[4]
        y = np.clip(model, 0.0, most)
    chi2 = float(residual @ (weight * residual)) + prior * float(value[4]) ** 2
    quadratic = Quadratic(chi2, gradient - normal @ step, normal)
    return EnvelopeFit(value, quadratic, held, model, residual, converged=True)


def _start(points: TurningPoints, fixed: Mapping[str, float]) -> tuple[FloatArray, tuple[int, ...]]:
    """Where the search begins, and what is held."""
    amplitude, sd = points.amplitude_rad, points.angle_sd_rad
    seen = amplitude > 3.0 * sd
    if seen.sum() < 3:
        seen = amplitude > 0.0
    rates = loss_rates(points.time_s[seen], amplitude[seen], sd[seen])
    return _held(points, fixed, np.array([*rates, float(amplitude[np.argmax(seen)]), 0.0]))


def _held(
    points: TurningPoints, fixed: Mapping[str, float], start: FloatArray
) -> tuple[FloatArray, tuple[int, ...]]:
    """The start with what is held in its place, and the places."""
    start, level = start.copy(), float(np.mean(points.level_rad))
    known = {index: fixed[name] for index, name in enumerate(NAMES[:4]) if name in fixed}
    if "offset" in fixed:
        known[4] = level - fixed["offset"]
    start[list(known)] = list(known.values())
    return start, tuple(known)
