"""The paper's way: Eq. 14 on turning points."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.fit.assemble import (
    Bounded,
    Numbers,
    estimates,
    misfit,
    quality_factor,
    with_intervals,
)
from pendpipe.analysis.fit.assemble import warn as warnings_of
from pendpipe.analysis.fit.decrement import check_decrement, light_of
from pendpipe.analysis.fit.envelope import BOUNDS, EnvelopeFit, fit_energies, fit_envelope
from pendpipe.analysis.fit.fixed import loss_rates_of
from pendpipe.analysis.fit.period import Period, fit_period
from pendpipe.analysis.fit.quadratic import covariance
from pendpipe.analysis.fit.result import PARAMETERS, Baseline, FitResult, Restoring
from pendpipe.analysis.fit.swings import clear
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8
from pendpipe.estimate import Estimate

_LATE: Final = 3.0
HELD: Final = ("a", "b", "c", "amplitude", "offset")


def held_values(
    fixed: Mapping[str, float], baseline: Baseline, frequency: float
) -> tuple[dict[str, float], dict[str, float]]:
    """What of a, b, c and the amplitude is held, and the held parts of b."""
    held = {name: fixed[name] for name in HELD if name in fixed}
    if baseline == "viscous":
        held |= {"a": 0.0, "c": 0.0}
    parts = loss_rates_of(fixed, frequency)
    if parts and baseline == "viscous":
        parts["hysteretic"] = 0.0
    if len(parts) == 2:
        held["b"] = parts["hysteretic"] + parts["viscous"]
    return held, parts


def share_of(parts: Mapping[str, float], b: float, baseline: Baseline) -> float | None:
    """The hysteretic share of b where the user, or the baseline, tells it."""
    if baseline == "viscous":
        return 0.0
    if not parts or b <= 0.0:
        return None
    if "hysteretic" in parts:
        return min(parts["hysteretic"] / b, 1.0)
    return max(1.0 - parts["viscous"] / b, 0.0)


def envelope_and_period(
    points: TurningPoints,
    held: Mapping[str, float],
    parts: Mapping[str, float],
    fixed: Mapping[str, float],
    baseline: Baseline,
    restoring: Restoring,
    tolerance: float = 1e-5,
) -> tuple[EnvelopeFit, Period]:
    """Fit the amplitudes of turning points, and then their times."""
    if restoring == "linear":
        envelope = fit_envelope(points, held, tolerance=tolerance)
    else:
        middle = share_of(parts, held.get("b", 0.0), baseline)
        envelope = fit_energies(points, held, share=0.5 if middle is None else middle)
    a, b, c = (float(rate) for rate in envelope.value[:3])
    share = share_of(parts, b, baseline)
    omega = 2.0 * math.pi * fixed["frequency"] if "frequency" in fixed else None
    return envelope, fit_period(
        points, envelope.amplitude, a, b, c, share=share, held=omega, restoring=restoring
    )


def fit_points(
    points: TurningPoints,
    *,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    restoring: Restoring = "linear",
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

    Returns
    -------
    FitResult
        Without ``cuts`` and ``provenance``, which the caller knows.
    """
    fixed = fixed or {}
    points = points if restoring == "linear" else clear(points)
    held, parts = held_values(fixed, baseline, points.apparent_frequency_hz)
    envelope, period = envelope_and_period(points, held, parts, fixed, baseline, restoring)
    a, b, c = (float(rate) for rate in envelope.value[:3])
    stretched = misfit(envelope.chi2_per_dof, len(points) - 4.0)
    numbers = _numbers(points, envelope, period, stretched)
    parameters = estimates(numbers, points.unit)
    share = share_of(parts, b, baseline)
    hysteretic = (0.5 if share is None else share) * b
    checks = check_decrement(
        points, Eq8(period.angular_frequency, a, hysteretic, b - hysteretic, c, restoring)
    )
    light, reason = light_of(checks, misfit=stretched, unit=points.unit)
    known = {name: Estimate(number, 0.0, "") for name, number in fixed.items()}
    result = FitResult(
        method="turning-points",
        baseline=baseline,
        restoring=restoring,
        parameters=parameters,
        quality_factor_limit=quality_factor(parameters["b"], parameters["frequency"].value),
        covariance_order=PARAMETERS,
        covariance=numbers.covariance,
        noise_rms_rad=points.noise_rms_rad,
        residual_rms_rad=float(np.sqrt(np.mean(envelope.residual**2))),
        chi2_per_dof=envelope.chi2_per_dof,
        samples=points.samples,
        turning_points=len(points),
        quality_factor_hysteretic=known.get("quality_factor_hysteretic"),
        quality_factor_viscous=known.get("quality_factor_viscous"),
        settled=envelope.converged,
        decrement_check=checks,
        light=light,
        light_reason=reason,
    )
    said = [*points.notes, *warnings_of(result, stretched)]
    if period.chi2_per_dof > _LATE:
        said.append(
            "the period changes along the record as Eq. 8's does not"
            f" (chi^2 of the times is {period.chi2_per_dof:.3g} per point):"
            " the frequency is a mean"
        )
    return replace(result, warnings=tuple(said))


def _numbers(
    points: TurningPoints,
    envelope: EnvelopeFit,
    period: Period,
    stretched: float,
) -> Numbers:
    """The seven parameters with their covariance; amplitudes and times are independent."""
    normal = envelope.quadratic.normal / stretched
    gradient = envelope.quadratic.gradient / stretched
    rates = covariance(normal, envelope.held)
    matrix = np.zeros((7, 7))
    # a, b, c, amplitude, and the level, which is what was used less its error.
    place = np.array([0, 1, 2, 4, 6])
    sign = np.array([1.0, 1.0, 1.0, 1.0, -1.0])
    matrix[np.ix_(place, place)] = rates * sign[:, None] * sign
    level = float(np.mean(points.level_rad)) - float(envelope.value[4])
    lag = points.start_s - period.time_s
    phase = period.angular_frequency * lag + (0.0 if points.side[0] > 0 else math.pi)
    timing = np.array([[0.5 / math.pi, 0.0], [lag, -period.angular_frequency]])
    matrix[np.ix_([3, 5], [3, 5])] = timing @ period.covariance @ timing.T
    a, b, c, amplitude, _ = envelope.value
    value: FloatArray = np.array(
        [
            a,
            b,
            c,
            0.5 * period.angular_frequency / math.pi,
            amplitude,
            math.remainder(phase, 2.0 * math.pi),
            level,
        ]
    )
    fit = Bounded(envelope.value, normal, gradient, envelope.held, rates)
    return with_intervals(value, matrix, fit, BOUNDS)
