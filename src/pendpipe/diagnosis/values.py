"""The fitted values as parameters and curves in their own units, with errors."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from pendpipe.analysis.fit.least_squares import CHI2_95, Bounds, intervals95
from pendpipe.analysis.fit.result import PARAMETERS, units
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.refine import Fit
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.baseline import OFFSET, OMEGA, TIME, A, B, C
from pendpipe.effects.curves import Curve, DampingCurve, DriveCurve
from pendpipe.effects.model import Evaluated, Model
from pendpipe.estimate import Estimate

_FIRST_CYCLES: Final = 4.0
_FEWEST_READINGS: Final = 16
_DERIVATIVE_STEP: Final = 1e-3
"""Step of numerical derivatives, in standard deviations."""


def parameters_of(fit: Fit, unit: str) -> dict[str, Estimate]:
    """Return a, b, c, frequency, amplitude, phase and offset, as in ``fit.json``.

    The amplitude is the model's at the first turning point in the readings, the phase that at the
    first reading.
    """
    covariance = fit.covariance()
    numbers = _numbers(fit.model, fit.at)
    early = _early(fit)
    jacobian = np.zeros((2, len(fit.value)))
    for index in fit.free:
        sd = math.sqrt(max(float(covariance[index, index]), 0.0))
        if sd == 0.0 or index in (A, B, C, OFFSET):
            continue
        jacobian[:, index] = _slope(fit, early, index, _DERIVATIVE_STEP * sd / fit.error_scale)
    errors = np.sqrt(np.maximum(np.diag(jacobian @ covariance @ jacobian.T), 0.0))
    dress, found = units(unit), constants_of(fit, unit)
    found["amplitude"] = Estimate(float(numbers[0]), float(errors[0]), dress["amplitude"])
    phase = math.remainder(float(numbers[1]), 2.0 * math.pi)
    found["phase"] = Estimate(phase, float(errors[1]), dress["phase"])
    return {name: found[name] for name in PARAMETERS}


def constants_of(fit: Fit, unit: str) -> dict[str, Estimate]:
    """Return a, b, c, offset and frequency."""
    covariance, intervals, dress = fit.covariance(), _intervals(fit), units(unit)
    found = {}
    for name, index in (("a", A), ("b", B), ("c", C), ("offset", OFFSET)):
        found[name] = _estimate(fit, covariance, index, dress[name], intervals.get(index))
    hertz = 0.5 / math.pi
    frequency = float(fit.value[OMEGA]) * hertz
    sd = math.sqrt(max(float(covariance[OMEGA, OMEGA]), 0.0)) * hertz
    found["frequency"] = Estimate(frequency, sd, dress["frequency"])
    return found


def _early(fit: Fit) -> Model:
    """Return the model of the first few cycles, which suffices for the derivatives."""
    time = fit.model.time_s
    last = max(time[0], float(fit.value[TIME])) + _FIRST_CYCLES * fit.at.span.period_s
    return fit.model.at_times(time[: max(int(np.searchsorted(time, last)), _FEWEST_READINGS)])


def _numbers(model: Model, at: Evaluated) -> FloatArray:
    """Return the amplitude of the first turning point, and the phase of the first reading."""
    motion, sampled = at.tangent.motion, at.sampled
    first = int(np.searchsorted(motion.time_s[:, 0], model.time_s[0] - 1e-9))
    first = min(first, len(motion.time_s) - 1)
    turned = math.pi if motion.upwards < 0.0 else 0.0
    return np.array([motion.amplitude[first, 0], sampled.phase[0] + turned])


def _slope(fit: Fit, early: Model, index: int, step: float) -> FloatArray:
    """Return derivatives by one value; backwards if increasing it stops the pendulum too early."""
    numbers = _numbers(early, early.evaluate(fit.value))
    for signed in (step, -step):
        moved = fit.value.copy()
        moved[index] += signed
        try:
            there = _numbers(early, early.evaluate(early.settled(moved)))
        except NoMotionError:
            continue
        return np.asarray((there - numbers) / signed)
    return np.zeros(2)


def _intervals(fit: Fit) -> dict[int, tuple[float, float]]:
    """Return 95 % intervals that are valid at a bound."""
    low, high = fit.model.bounds()
    held = [index for index in range(len(fit.value)) if index not in fit.free]
    # A misfit beyond the noise widens the intervals as it widens the standard deviations.
    normal = fit.jacobian.T @ fit.jacobian / fit.error_scale**2
    gradient = fit.jacobian.T @ fit.residual / fit.error_scale**2
    wanted = [index for index in (A, B, C) if index in fit.free]
    found = intervals95(fit.value, normal, gradient, Bounds(low, high), wanted, held)
    if len(fit.variance) == 0:
        return dict(zip(wanted, found, strict=True))
    wider = {}
    for index, ends in zip(wanted, found, strict=True):
        value, more = fit.value[index], math.sqrt(CHI2_95 * fit.variance[index])
        least = float(value - math.hypot(value - ends[0], more))
        most = float(value + math.hypot(ends[1] - value, more))
        wider[index] = max(least, float(low[index])), min(most, float(high[index]))
    return wider


def _estimate(
    fit: Fit, covariance: FloatArray, index: int, unit: str, interval: tuple[float, float] | None
) -> Estimate:
    value = float(fit.value[index])
    sd = math.sqrt(max(float(covariance[index, index]), 0.0))
    lowest = float(fit.model.bounds()[0][index])
    at_bound = index in fit.free and index in (A, B, C) and value <= lowest
    return Estimate(value, sd, unit, interval, at_bound)


def effect_parameters(fit: Fit, effect: Effect, unit: str = "rad") -> dict[str, Estimate]:
    """Return an effect's own parameters, by name; displacements are in `unit`."""
    position = next((here for other, here in fit.model.places() if other is effect), None)
    if position is None:
        return {}
    covariance = fit.covariance()
    found = {}
    first = position.start + effect.parameter_free
    for offset, parameter in enumerate(effect.parameters):
        index = first + offset
        sd = math.sqrt(max(float(covariance[index, index]), 0.0))
        value = float(fit.value[index])
        half = 1.959963984540054 * sd
        interval = (max(value - half, parameter.low), min(value + half, parameter.high))
        found[parameter.name] = Estimate(value, sd, parameter.unit_in(unit), interval)
    return found


_CURVE_POINTS: Final = 61


def curve_values(fit: Fit, effect: Curve, unit: str = "rad") -> dict[str, Any]:
    """Return a fitted curve with its error band.

    Parameters
    ----------
    fit
        The extended model, the curve in it.
    effect
        The curve.
    unit
        Of the readings: ``"rad"``, or ``"m"`` for a displacement.

    Returns
    -------
    dict
        ``argument`` and ``ordinate`` (each with its unit after a comma), ``at``, ``value``
        and ``sd``, shape (k,). A drive has ``quadrature`` and ``quadrature_sd`` besides; a
        loss by amplitude ``local_exponent`` and ``local_exponent_sd``.
    """
    position = next(position for other, position in fit.model.places() if other is effect)
    covariance = fit.covariance()
    knots = effect.knots
    spaced = np.geomspace if isinstance(effect, DampingCurve) else np.linspace
    at = np.asarray(spaced(knots[0], knots[-1], _CURVE_POINTS))
    scale = effect.scale(fit.model.pendulum(fit.value))
    found: dict[str, Any] = {
        "argument": effect.argument.replace("rad", unit)
        if "phase" not in effect.argument
        else effect.argument,
        "ordinate": effect.ordinate.replace(", rad", f", {unit}"),
        "at": at,
    }
    for name, drawn in _parts(effect).items():
        columns = np.stack([drawn(one, at) for one in np.eye(effect.sizes)], axis=1)
        prefix = f"{name}_" if name != "value" else ""
        found[name] = scale * columns @ fit.value[position]
        own = covariance[position, position]
        variance = np.einsum("ij,jk,ik->i", columns, own, columns)
        found[f"{prefix}sd"] = abs(scale) * np.sqrt(np.maximum(variance, 0.0))
    if isinstance(effect, DampingCurve):
        found |= _local_exponent(fit, effect, position, at, covariance)
    return found


def _parts(effect: Curve) -> dict[str, Any]:
    """Return the curves of an effect, each a function of values and arguments."""
    if not isinstance(effect, DriveCurve):
        return {"value": effect.curve}
    count = len(effect.knots)

    def part(first: int) -> Any:
        def drawn(values: FloatArray, at: FloatArray) -> FloatArray:
            both = effect.coefficients @ values
            return np.asarray(np.interp(at, effect.knots, both[first : first + count]))

        return drawn

    return {"value": part(0), "quadrature": part(count)}


def _local_exponent(
    fit: Fit, effect: DampingCurve, position: slice, at: FloatArray, covariance: FloatArray
) -> dict[str, FloatArray]:
    """Return the exponent n of the total loss: n = 1 + d ln(loss rate)/d ln y.

    A loss |v|^n gives -dy/dt proportional to y^n, that is, a rate y^(n - 1) (Eq. 13: a, b, c
    are n = 2, 1, 0). The error is propagated from all fitted values.
    """

    def exponent(value: FloatArray) -> FloatArray:
        pendulum = fit.model.pendulum(value)
        rate = pendulum.quadratic * at + pendulum.linear + pendulum.coulomb / at
        rate = rate + effect.scale(pendulum) * effect.curve(value[position], at)
        safe = np.maximum(rate, 1e-6 * float(np.max(np.abs(rate))))
        return 1.0 + np.gradient(np.log(safe), np.log(at))

    centre = exponent(fit.value)
    jacobian = np.zeros((len(at), len(fit.value)))
    for index in fit.free:
        sd = float(np.sqrt(max(covariance[index, index], 0.0)))
        if sd == 0.0:
            continue
        moved = fit.value.copy()
        moved[index] += 1e-3 * sd
        jacobian[:, index] = (exponent(moved) - centre) / (1e-3 * sd)
    variance = np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)
    return {
        "local_exponent": centre,
        "local_exponent_sd": np.sqrt(np.maximum(variance, 0.0)),
    }
