"""The paper's way: Eq. 14 on the amplitudes of turning points, and a line through their times.

Turning points are counted, so that the phase of a law can't slip against them, whatever its
amplitude: they also tell which torque the half swings favour, and where fits of the motion begin.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.fitted import Agreement, Baseline, Form
from pendpipe.analysis.fit.fixed import Held
from pendpipe.analysis.fit.goodness import Goodness, tail
from pendpipe.analysis.fit.result import FitResult, result_of
from pendpipe.analysis.half_cycles import LEAST_HALF_CYCLES
from pendpipe.analysis.torque import TOP, clear, phases
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.measure import loss_rates
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.eq8 import SHARE_MEAN, SHARE_SD, Restoring
from pendpipe.levels import REFUTED
from pendpipe.physics.decay import amplitude_and_gradient
from pendpipe.physics.lengthening import elliptic
from pendpipe.priors import Priors
from pendpipe.solve import (
    Bounds,
    Quadratic,
    bounded_step,
    covariance,
    intervals95,
    minimise,
    squares,
)

ENVELOPE: Final = ("a", "b", "c", "amplitude", "level")
Decay = Callable[..., tuple[FloatArray, FloatArray]]
_LEAST: Final = 1e-12
"""Of the largest amplitude, as exactly as it is computed: by less nothing is divided."""


@dataclass(frozen=True)
class EnvelopeFit:
    """a, b, c, y0 and the error of the level, shape (5,), in the order of `ENVELOPE`."""

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
        fitted = {*range(len(ENVELOPE) - 1)} - {*self.held}
        return self.quadratic.chi2 / max(len(self.residual) - len(fitted), 1)


def fit_envelope(
    points: TurningPoints,
    fixed: Mapping[str, float] | None = None,
    decay: Decay = amplitude_and_gradient,
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
    decay
        The amplitude at some times by y0, a, b, c, with its derivatives; Eq. 14.
    """
    time, sd = points.time_s - points.time_s[0], points.angle_sd_rad
    measured = points.amplitude_rad
    shared = -points.level_coupling * points.side

    def residual(value: FloatArray) -> FloatArray:
        a, b, c, y0, level = value
        return np.asarray((measured - decay(time, y0, a, b, c)[0] - shared * level) / sd)

    def derivatives(value: FloatArray) -> FloatArray:
        a, b, c, y0, _ = value
        gradient = decay(time, y0, a, b, c)[1]
        columns = np.concatenate([gradient[:, 1:], gradient[:, :1], shared[:, None]], axis=1)
        return columns / sd[:, None]

    start, held = _start(points, fixed or {})
    bounds, prior = known_of(points)
    found = minimise(squares(residual, derivatives, bounds, prior), start, held=held)
    a, b, c, y0, level = found.value
    model = decay(time, y0, a, b, c)[0]
    left = measured - model - shared * level
    return EnvelopeFit(found.value, found.point.quadratic, held, model, left, found.converged)


def known_of(points: TurningPoints) -> tuple[Bounds, Priors]:
    """The bounds of a, b, c, y0 and the level's error, and the prior of that error."""
    least = _LEAST * float(np.max(np.abs(points.amplitude_rad)))
    bounds = Bounds(np.array([0.0, 0.0, 0.0, least, -np.inf]), np.full(5, np.inf))
    return bounds, Priors(np.array([4]), np.zeros(1), np.array([max(points.level_sd_rad, least)]))


def fit_energies(
    points: TurningPoints,
    fixed: Mapping[str, float] | None = None,
    *,
    restoring: Restoring = "sine",
    share: float = SHARE_MEAN,
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
    measured, sd, (bounds, prior) = points.amplitude_rad, points.angle_sd_rad, known_of(points)
    base = bounds.clip(np.array([0.0, 0.0, 0.0, measured[0], 0.0]))
    start, held = _with_held(points, fixed or {}, base)
    free = fit_period(points, measured, (0.0, 0.0, 0.0), share=share, restoring=restoring)
    swings = np.diff(points.half_cycle) / free.angular_frequency
    sine = restoring == "sine"
    most = TOP if sine else None
    y = np.clip(measured, 0.0, most)
    energy, slope = (-np.cos(y), np.sin(y)) if sine else (0.5 * y**2, y)
    slope = np.maximum(slope, 1e-3 * np.max(slope))
    shared = -points.level_coupling * points.side
    for _ in range(2):
        lost = np.zeros((3, len(y)))
        np.cumsum(_half_swing_losses(y, share, sine=sine) * swings, axis=1, out=lost[:, 1:])
        jacobian = np.stack([*(-lost / slope), slope[0] / slope, shared], axis=1)
        rows = np.vstack([jacobian / sd[:, None], prior.rows(5)])
        residual = (energy - energy[0]) / slope - jacobian @ (start - base)
        left = np.append(residual / sd, prior.residual(start))
        step = bounded_step(rows.T @ rows, rows.T @ left, bounds.about(start), held)
        value, residual, left = start + step, residual - jacobian @ step, left - rows @ step
        model = measured - residual - shared * value[4]
        y = np.clip(model, 0.0, most)
    quadratic = Quadratic(float(left @ left), rows.T @ left, rows.T @ rows)
    return EnvelopeFit(bounds.clip(value), quadratic, held, model, residual, converged=True)


def _half_swing_losses(y: FloatArray, share: float, *, sine: bool) -> FloatArray:
    """Energy lost between neighbouring turning points for a, b, c of one, over omega: (3, k - 1).

    The energy falls evenly along the path, which gives the means of the modulus and its square.
    """
    both, modulus = y[1:] + y[:-1], np.sin(0.5 * y) if sine else 0.5 * y
    high, low = modulus[:-1], modulus[1:]
    square = 0.5 * (high**2 + low**2)
    mean = (2.0 * square + high * low) / (1.5 * np.maximum(high + low, 1e-300))
    viscous = 4.0 * math.pi * square
    if sine:
        first, second = elliptic(square)
        viscous = 16.0 * (second - (1.0 - square) * first)
    linear = share * math.pi * both * mean + (1.0 - share) * viscous
    return np.stack([2.0 * math.pi * both * square, linear, 0.5 * math.pi * both])


def _start(points: TurningPoints, fixed: Mapping[str, float]) -> tuple[FloatArray, tuple[int, ...]]:
    """Where the search begins, and what is held."""
    amplitude, sd = points.amplitude_rad, points.angle_sd_rad
    seen = amplitude > 3.0 * sd
    if seen.sum() < LEAST_HALF_CYCLES:
        seen = amplitude > 0.0
    rates = loss_rates(points.time_s[seen], amplitude[seen], sd[seen])
    return _with_held(points, fixed, np.array([*rates, float(amplitude[np.argmax(seen)]), 0.0]))


def _with_held(
    points: TurningPoints, fixed: Mapping[str, float], start: FloatArray
) -> tuple[FloatArray, tuple[int, ...]]:
    """The start with what is held in its place, and the places."""
    start, level = start.copy(), float(np.mean(points.level_rad))
    known = {index: fixed[name] for index, name in enumerate(ENVELOPE[:4]) if name in fixed}
    if "offset" in fixed:
        known[4] = level - fixed["offset"]
    start[list(known)] = list(known.values())
    return start, tuple(known)


_LOUD: Final = 2.0
"""chi^2 per degree of freedom of the times from which the error follows their scatter."""


class Period(NamedTuple):
    """Eq. 8's angular frequency and the time of the first turning point."""

    angular_frequency: float
    time_s: float
    covariance: FloatArray
    """Of the two, shape (2, 2); it holds what the unknown share adds."""
    chi2_per_dof: float
    late_rad: FloatArray
    """Phase by which each turning point is later than the law's, shape (k,)."""


def fit_period(
    points: TurningPoints,
    amplitude: FloatArray,
    rates: Sequence[float],
    *,
    share: float | None = None,
    held: float | None = None,
    restoring: Restoring = "linear",
) -> Period:
    """Fit a straight line to the times, in half cycles lengthened by the losses (and by sin x).

    Turning points cannot tell how b divides into hysteretic and viscous: the middle is
    taken, and what the ends would change is added to the standard deviations.

    Parameters
    ----------
    points
        The turning points.
    amplitude, rates
        What Eq. 14 made of them, and its a, b, c.
    share
        The hysteretic share of b, where it is known.
    held
        An angular frequency that is not to be fitted.
    restoring
        The restoring torque.
    """
    omega = 2.0 * math.pi * points.apparent_frequency_hz if held is None else held
    a, b, c = rates
    shares = np.array([SHARE_MEAN, 0.0, 1.0] if share is None else [share])[:, None]
    half_cycles = phases(points, amplitude, (a, b, c, shares), omega, restoring) / math.pi
    weight, first_s = points.time_sd_s**-2.0, float(points.time_s[0])
    # Straight lines t = first + half period times half cycles, one a share.
    total, time = float(weight.sum()), points.time_s - first_s
    centre, middle = half_cycles @ weight / total, float(time @ weight) / total
    off = half_cycles - centre[:, None]
    square = off**2 @ weight
    if held is None:
        half = (off * weight) @ time / square
        variance = 1.0 / square[0]
    else:
        half, variance = np.full(len(shares), math.pi / omega), 0.0
    begun = middle - half * centre
    late = time - begun[0] - half[0] * half_cycles[0]
    found = math.pi / half
    by_half = np.array([-found[0] / half[0], -centre[0]])
    matrix = variance * np.outer(by_half, by_half) + np.diag([0.0, 1.0 / total])
    chi2 = float(late**2 @ weight) / max(len(points) - 2, 1)
    if chi2 > _LOUD:
        matrix *= chi2
    if share is None:
        ends = [(found[end] - found[0], begun[end] - begun[0]) for end in (1, 2)]
        off_by = max(ends, key=lambda change: abs(change[0]))
        part = (SHARE_SD / SHARE_MEAN) ** 2
        matrix += part * np.outer(off_by, off_by)
        # All times share what the unknown division of b does to the half cycles' shape.
        matrix[1, 1] += (b / (4.0 * float(found[0]) ** 2)) ** 2 * part
    omega = float(found[0])
    return Period(omega, first_s + float(begun[0]), matrix, chi2, omega * late)


_LATE: Final = 3.0
"""Variance of the times over their own beyond which they are late as no law has it."""


def envelope_and_period(
    points: TurningPoints, held: Held, restoring: Restoring, *, start: bool = False
) -> tuple[EnvelopeFit, Period]:
    """Fit the amplitudes of turning points, and then their times; as a start without errors."""
    if restoring == "linear" and not start:
        envelope = fit_envelope(points, held.envelope)
    else:
        middle = held.likely_share(held.envelope.get("b", 0.0))
        envelope = fit_energies(points, held.envelope, restoring=restoring, share=middle)
    rates = envelope.value[:3].tolist()
    period = fit_period(
        points,
        envelope.amplitude,
        rates,
        share=(held.likely_share if start else held.share)(rates[1]),
        held=held.angular_frequency,
        restoring=restoring,
    )
    return envelope, period


def fit_points(
    points: TurningPoints,
    *,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    restoring: Restoring = "linear",
    bent: FloatArray | None = None,
) -> FitResult:
    """Fit Eq. 14 to turning points, and Eq. 8's frequency to their times.

    With sin x it is the energies that are fitted (`fit_energies`), and the period is that of small
    amplitudes.

    Parameters
    ----------
    points
        Turning points with their errors.
    baseline
        ``"eq8"``, or ``"viscous"`` for Eq. 3 (a = c = 0).
    fixed
        Parameters that are held, by name.
    restoring
        The restoring torque.
    bent
        What the readings show of a bent scale (`goodness.Goodness.bent`).

    Returns
    -------
    FitResult
        Without ``cuts`` and ``provenance``, which the caller knows.
    """
    fixed = fixed or {}
    points = points if restoring == "linear" else clear(points)
    held = Held(fixed, baseline, points.apparent_frequency_hz)
    envelope, period = envelope_and_period(points, held, restoring)
    freedom = max(len(points) - 4.0, 1.0)
    p_value = tail(envelope.chi2_per_dof, freedom, 1e9)
    misfit = max(envelope.chi2_per_dof, 1.0) if p_value < REFUTED else 1.0
    late = (
        "the period changes along the record as Eq. 8's does not (chi^2 of the times is"
        f" {period.chi2_per_dof:.3g} per point): the frequency is a mean"
    )
    return result_of(
        *numbers_of(points, envelope, period, misfit),
        envelope.held,
        points,
        held.law(period.angular_frequency, envelope.value[:3].tolist(), restoring),
        goodness=Goodness(
            points.noise_rms_rad,
            envelope.chi2_per_dof,
            (p_value, tail(period.chi2_per_dof / _LATE, freedom, 1e9)),
            misfit,
            bent,
        ),
        said=[late] if period.chi2_per_dof > _LATE else [],
        fixed=fixed,
        form=Form(baseline),
        agreement=Agreement(
            residual_rms_rad=float(np.sqrt(np.mean(envelope.residual**2))),
            samples=points.samples,
            turning_points=len(points),
            settled=envelope.converged,
        ),
        method="turning-points",
    )


def numbers_of(
    points: TurningPoints, envelope: EnvelopeFit, period: Period, misfit: float = 1.0
) -> tuple[FloatArray, FloatArray, list[tuple[float, float]]]:
    """Return the seven parameters, their covariance, and the intervals of a, b, c.

    Amplitudes and times are independent; what the amplitudes leave is `misfit` times their noise.
    """
    _, gradient, normal = envelope.quadratic
    rates = covariance(normal, envelope.held)
    matrix = np.zeros((7, 7))
    # a, b, c, amplitude, and the level, which is what was used less its error.
    place, sign = [0, 1, 2, 4, 6], np.array([1.0, 1.0, 1.0, 1.0, -1.0])
    matrix[np.ix_(place, place)] = misfit * rates * sign[:, None] * sign
    level = float(np.mean(points.level_rad)) - float(envelope.value[4])
    lag = points.start_s - period.time_s
    phase = period.angular_frequency * lag + (0.0 if points.side[0] > 0 else math.pi)
    timing = np.array([[0.5 / math.pi, 0.0], [lag, -period.angular_frequency]])
    matrix[np.ix_([3, 5], [3, 5])] = timing @ period.covariance @ timing.T
    a, b, c, amplitude, _ = envelope.value
    frequency, phase = 0.5 * period.angular_frequency / math.pi, math.remainder(phase, math.tau)
    value: FloatArray = np.array([a, b, c, frequency, amplitude, phase, level])
    bounds, held = known_of(points)[0], envelope.held
    ends = intervals95(envelope.value, normal, gradient, bounds, range(3), held)
    return value, matrix, ends
