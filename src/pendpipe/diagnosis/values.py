"""The fitted values as parameters and curves in their own units, with errors."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Final

import numpy as np

from pendpipe.analysis.fit.least_squares import CHI2_95, Bounds, intervals95
from pendpipe.analysis.fit.result import PARAMETERS, units
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.refine import Fit
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.baseline import OFFSET, OMEGA, TIME, A, B, C
from pendpipe.effects.curves import Curve, damping_curve
from pendpipe.effects.model import Evaluated
from pendpipe.estimate import Estimate

_FIRST_CYCLES: Final = 4.0
_FEWEST_READINGS: Final = 16
_DERIVATIVE_STEP: Final = 1e-3
"""Step of numerical derivatives, in standard deviations."""
_CONSTANTS: Final = {"a": A, "b": B, "c": C, "offset": OFFSET}


def parameters_of(fit: Fit, data: Data) -> dict[str, Estimate]:
    """Return a, b, c, frequency, amplitude, phase and offset, as in ``fit.json``.

    The amplitude is the model's at the first turning point kept, the phase that at the first
    reading.
    """
    dress, found, time = units(data.unit), constants_of(fit, data.unit), fit.model.time_s
    # A model of the first few cycles suffices for the derivatives.
    last = max(time[0], float(fit.value[TIME])) + _FIRST_CYCLES * fit.at.span.period_s
    count = max(int(np.searchsorted(time, last)), _FEWEST_READINGS)
    early = fit.model.at_times(time[:count])

    def numbers(value: FloatArray) -> FloatArray:
        return _numbers(early.evaluate(early.settled(value)), data.turn_s)

    amplitude, phase = _numbers(fit.at, data.turn_s).tolist()
    _, (sd, phase_sd) = _with_errors(fit, numbers, constant=tuple(_CONSTANTS.values()))
    found["amplitude"] = Estimate(amplitude, float(sd), dress["amplitude"])
    phase = math.remainder(phase, 2.0 * math.pi)
    found["phase"] = Estimate(phase, float(phase_sd), dress["phase"])
    return {name: found[name] for name in PARAMETERS}


def constants_of(fit: Fit, unit: str) -> dict[str, Estimate]:
    """Return a, b, c, offset and frequency."""
    intervals, dress, sds = _intervals(fit), units(unit), _sds(fit)
    lowest, hertz = fit.model.bounds()[0], 0.5 / math.pi
    found = {}
    for name, index in _CONSTANTS.items():
        value, sd = float(fit.value[index]), float(sds[index])
        at_bound = index in fit.free and value <= lowest[index]
        found[name] = Estimate(value, sd, dress[name], intervals.get(index), bool(at_bound))
    frequency, sd = float(fit.value[OMEGA]) * hertz, float(sds[OMEGA]) * hertz
    found["frequency"] = Estimate(frequency, sd, dress["frequency"])
    return found


def _sds(fit: Fit) -> FloatArray:
    """Return the standard deviations of all values; zero for those held."""
    return np.asarray(np.sqrt(np.maximum(np.diag(fit.covariance()), 0.0)))


def _numbers(at: Evaluated, turn_s: float) -> FloatArray:
    """Return the amplitude of the turning point at a time, and the phase of the first reading."""
    motion, sampled = at.tangent.motion, at.sampled
    first = int(np.argmin(np.abs(motion.time_s[:, 0] - turn_s)))
    turned = math.pi if motion.upwards < 0.0 else 0.0
    return np.array([motion.amplitude[first, 0], sampled.phase[0] + turned])


def _with_errors(
    fit: Fit, of: Callable[[FloatArray], FloatArray], constant: Sequence[int] = ()
) -> tuple[FloatArray, FloatArray]:
    """Return numbers that follow from a fit's values, and their errors by those of the values.

    They hardly depend on the values at the indices `constant`.
    """
    sds, centre = _sds(fit), of(fit.value)
    jacobian = np.zeros((len(centre), len(fit.value)))
    for index in fit.free:
        step = _DERIVATIVE_STEP * float(sds[index])
        if step == 0.0 or index in constant:
            continue
        # Backwards if increasing it stops the pendulum too early.
        for signed in (step, -step):
            moved = fit.value.copy()
            moved[index] += signed
            with suppress(NoMotionError):
                jacobian[:, index] = (of(moved) - centre) / signed
                break
    return centre, _errors(jacobian, fit.covariance())


def quality_factors_of(fit: Fit, amplitudes: Sequence[float]) -> dict[float, Estimate]:
    """Return Q of a model's motion by amplitude: pi over what ln y loses in a period about it.

    Left out are amplitudes that it has not, and those at which it gains.
    """
    wanted = np.array(amplitudes)

    def quality(value: FloatArray) -> FloatArray:
        turning = fit.model.evaluate(fit.model.settled(value)).tangent.motion.log_amplitude[:, 0]
        lost, within = turning[:-2] - turning[2:], np.log(wanted)
        inside = (turning[-1] <= within) & (within <= turning[0])
        lost = np.interp(-within, -turning[1:-1], lost)
        return np.where(inside, math.pi / lost, math.nan)

    found, sds = _with_errors(fit, quality)
    return {
        amplitude: Estimate(float(q), float(sd), "")
        for amplitude, q, sd in zip(amplitudes, found, sds, strict=True)
        if q > 0.0 and math.isfinite(sd)
    }


def _errors(columns: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the standard deviations of linear combinations, one a row."""
    variance = np.einsum("ij,jk,ik->i", columns, covariance, columns)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _intervals(fit: Fit) -> dict[int, tuple[float, float]]:
    """Return 95 % intervals that are valid at a bound."""
    low, high = fit.model.bounds()
    held = [index for index in range(len(fit.value)) if index not in fit.free]
    normal, gradient = fit.jacobian.T @ fit.jacobian, fit.jacobian.T @ fit.residual
    if fit.scatter is not None:
        # A misfit beyond the noise widens the intervals as it widens the standard deviations.
        free, narrow = np.ix_(fit.free, fit.free), normal.copy()
        # Units differ by many powers of ten: a unit length of each value keeps the small ones.
        length = np.sqrt(np.maximum(fit.scatter.diagonal(), 1e-300))
        unit = np.outer(length, length)
        inverse = np.linalg.pinv((fit.scatter / unit)[free], hermitian=True)
        normal[free] = narrow[free] @ (inverse / unit[free]) @ narrow[free]
        # The distance to which a value is pulled beyond its bound stays as it was.
        gradient = (
            gradient * normal.diagonal() / np.where(narrow.diagonal() > 0.0, narrow.diagonal(), 1.0)
        )
    wanted = [index for index in (A, B, C) if index in fit.free]
    found = intervals95(fit.value, normal, gradient, Bounds(low, high), wanted, held)
    variance = fit.variance if len(fit.variance) else np.zeros(len(fit.value))
    wider = {}
    for index, ends in zip(wanted, found, strict=True):
        value, more = fit.value[index], math.sqrt(CHI2_95 * variance[index])
        least = float(value - math.hypot(value - ends[0], more))
        most = float(value + math.hypot(ends[1] - value, more))
        wider[index] = max(least, float(low[index])), min(most, float(high[index]))
    return wider


def effect_parameters(fit: Fit, effect: Effect, unit: str = "rad") -> dict[str, Estimate]:
    """Return an effect's own parameters, by name; displacements are in `unit`."""
    position = next((here for other, here in fit.model.places() if other is effect), None)
    if position is None:
        return {}
    found, sds, (lowest, highest) = {}, _sds(fit), fit.model.bounds()
    own = effect.acts_on(unit)
    for index, parameter in enumerate(effect.parameters, position.start + effect.parameter_free):
        value, sd = float(fit.value[index]), float(sds[index])
        low, high = Estimate(value, sd, "").bounds95
        interval = max(low, float(lowest[index])), min(high, float(highest[index]))
        found[parameter.name] = Estimate(value, sd, parameter.unit_in(own), interval)
    return found


def last_in(fit: Fit, effect: Effect, unit: str) -> Estimate | None:
    """Return an effect's last parameter in that unit: instant and frequency follow the sizes."""
    found = [each for each in effect_parameters(fit, effect).values() if each.unit == unit]
    return found[-1] if found else None


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
        Of the readings: ``"rad"``, ``"rad/s"``, or ``"m"`` for a displacement.

    Returns
    -------
    dict
        ``argument`` and ``ordinate`` (each with its unit after a comma), ``at``, ``value``
        and ``sd``, shape (k,). A drive has ``quadrature`` and ``quadrature_sd`` besides; a
        loss by amplitude ``local_exponent`` and ``local_exponent_sd``.
    """
    by_amplitude = isinstance(effect, damping_curve)
    spaced = np.geomspace if by_amplitude else np.linspace
    at = np.asarray(spaced(effect.knots[0], effect.knots[-1], _CURVE_POINTS))
    argument, ordinate = effect.axes(unit)
    found: dict[str, Any] = {"argument": argument, "ordinate": ordinate, "at": at}
    for name, (value, sd) in curves_of(fit, effect, at).items():
        prefix = f"{name}_" if name != "value" else ""
        found |= {name: value, f"{prefix}sd": sd}
    if by_amplitude:
        exponent = _with_errors(fit, lambda value: _local_exponent(fit, effect, value, at))
        found["local_exponent"], found["local_exponent_sd"] = exponent
    return found


def curves_of(
    fit: Fit, effect: Curve, at: FloatArray, *, odd: bool = False
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return the values and errors of each curve that is drawn, or of its odd part."""
    position = next(position for other, position in fit.model.places() if other is effect)
    scale = effect.scale(fit.model.pendulum(fit.value))
    covariance = fit.covariance()[position, position]
    each = [effect.curves(one, at) for one in np.eye(effect.sizes)]
    if odd:
        each = [0.5 * (one - one[:, ::-1]) for one in each]
    drawn = np.stack(each, axis=2)
    return {
        name: (scale * columns @ fit.value[position], abs(scale) * _errors(columns, covariance))
        for name, columns in zip(effect.drawn, drawn, strict=True)
    }


def _local_exponent(fit: Fit, effect: Curve, value: FloatArray, at: FloatArray) -> FloatArray:
    """Return the exponent n of the total loss: n = 1 + d ln(loss rate)/d ln y.

    A loss |v|^n gives -dy/dt proportional to y^n, that is, a rate y^(n - 1) (Eq. 13: a, b, c
    are n = 2, 1, 0).
    """
    position = next(position for other, position in fit.model.places() if other is effect)
    pendulum = fit.model.pendulum(value)
    rate = pendulum.quadratic * at + pendulum.linear + pendulum.coulomb / at
    rate = rate + effect.scale(pendulum) * effect.curves(value[position], at)[0]
    safe = np.maximum(rate, 1e-6 * float(np.max(np.abs(rate))))
    return np.asarray(1.0 + np.gradient(np.log(safe), np.log(at)))
