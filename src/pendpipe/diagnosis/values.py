"""The fitted values as parameters and curves in their own units, with errors."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.fitted import PARAMETERS, units
from pendpipe.arrays import FloatArray, scaled_qr
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.projection import whitened
from pendpipe.diagnosis.refine import Fit, span_of
from pendpipe.dynamics.any_law import Motion, NoMotionError
from pendpipe.dynamics.eq8 import OFFSET, OMEGA, TIME, A, B, C
from pendpipe.effects import Effect
from pendpipe.effects.curves import Curve, damping_curve
from pendpipe.effects.model import Evaluated
from pendpipe.estimate import Estimate, over
from pendpipe.solve import Bounds, intervals95

_FIRST_CYCLES: Final = 4.0
"""Cycles of the model by which its first turning point is differentiated."""
_FEWEST_READINGS: Final = 16
"""Readings of it, where a cycle has few."""
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
    lowest = fit.model.bounds()[0]
    found = {}
    for name, index in _CONSTANTS.items():
        value, sd = float(fit.value[index]), float(sds[index])
        at_bound = index in fit.free and value <= lowest[index]
        found[name] = Estimate(value, sd, dress[name], intervals.get(index), bool(at_bound))
    others = tuple(index for index in range(fit.model.first) if index != OMEGA)
    mean, error = _with_errors(
        fit, lambda value: small_periods(fit, value).mean(keepdims=True), constant=others
    )
    period = Estimate(float(mean[0]), float(error[0]), "s")
    found["frequency"] = over(1.0, period, dress["frequency"])
    return found


_SMALL: Final = 1e-5
"""Of the smallest amplitude: torques of higher order that change a swing are nothing there."""


def small_periods(fit: Fit, value: FloatArray) -> FloatArray:
    """Return the period of small swings, s, from each turning point of a recording (the loudest).

    An effect's acceleration f along a swing r cos(psi) so small that torques are linear makes
    omega sqrt(1 + k) of omega, k = -(2/pi) integral of f cos(psi)/(omega^2 r) over half a cycle.
    What does not change its sign with the swing, a drive, has no part in it. By a clock whose
    rate drifts it is as that clock shows it.
    """
    model, at = fit.model, fit.at
    if at.parts:
        part = max(at.parts, key=lambda each: each.at.span.first_amplitude)
        model, at, value = part.at.model, part.at, part.mixing @ value
    motion, omega, own = at.tangent.motion, float(value[OMEGA]), model.pendulum(value)
    # A loss that jumps within a half cycle pulls one way there, and is no stiffness; by dry
    # friction small swings stop.
    smooth = replace(own, coulomb=0.0)
    middle_s = np.broadcast_to(motion.time_s.mean(axis=1, keepdims=True), motion.time_s.shape)
    begun = motion.time_s[:, 0]
    seen = (at.span.start_s <= begun) & (begun <= at.span.stop_s)
    stiffer, late = np.zeros(len(begun)), np.zeros(np.count_nonzero(seen) + 1)
    for effect, place in model.places():
        if effect.form:
            continue
        size = at.span.last_amplitude * (1.0 if effect.contact else _SMALL)
        delay = effect.delay(np.append(at.span.start_s, begun[seen]), value[place])
        late += 0.0 if delay is None or effect.local else delay
        for upwards in (1.0, -1.0):
            log_amplitude = np.full_like(motion.time_s, math.log(size))
            time_s, pendulum = (middle_s, smooth) if effect.local else (motion.time_s, own)
            small = Motion(motion.clock, omega, log_amplitude, time_s, upwards)
            force = effect.acceleration(small, pendulum, value[place])
            if force is not None:
                done = motion.clock.integral(force * motion.clock.cosine)
                stiffer -= upwards / math.pi * (done[:, -1] - done[:, 0]) / (omega**2 * size)
    with np.errstate(invalid="ignore"):
        true = 2.0 * math.pi / (omega * np.sqrt(1.0 + stiffer[seen]))
    return np.asarray(true / (1.0 + np.gradient(late[1:], begun[seen])))


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


_FEWEST_TURNING_POINTS: Final = 6
"""Of which two are known with two neighbours on each side."""


def quality_factors_of(fit: Fit, amplitudes: Sequence[float]) -> dict[float, Estimate]:
    """Return Q of a model's motion by amplitude: pi over the relative loss in a period about it.

    The amplitude is half the way from one side to the other, wherever the equilibrium is; the
    period is that without losses. Left out are cycles with a kick in them, and amplitudes that it
    has not, or at which nothing is known of its loss.
    """
    wanted, motion = np.log(amplitudes), fit.at.tangent.motion
    model, slowed = replace(fit.model, _last={"motion": motion}), _slowed(fit)
    own_s = motion.time_s[1:-1, 0]

    def quality(value: FloatArray) -> FloatArray:
        pieces = model.follow(model.settled(value))
        motion = pieces[-1][1]
        turned_s, turning = motion.time_s[:, 0], motion.amplitude[:, 0]
        if len(turning) < _FEWEST_TURNING_POINTS:
            return np.full(len(wanted), math.nan)
        # What alternates from turning point to turning point is no amplitude; it changes smoothly.
        side = 1.0 - 2.0 * (np.arange(len(turning)) % 2)
        bent = side[1:-1] * (np.sqrt(turning[:-2] * turning[2:]) - turning[1:-1])
        inner = 0.25 * bent[1:-1] + 0.125 * (bent[:-2] + bent[2:])
        first, last = inner[0] - inner[1], inner[-1] - inner[-2]
        begins = inner[0] + first * np.array([2.0, 1.0])
        ends = inner[-1] + last * np.array([1.0, 2.0])
        log_amplitude = np.log(turning + side * np.concatenate([begins, inner, ends]))
        free = np.full(len(turning) - 2, True)
        for kicked_s, _ in pieces[1:]:
            # It begins half a cycle early, where the motion is smooth; and a shift has neighbours.
            near = 2.0 * fit.at.span.period_s
            free &= (turned_s[2:] < kicked_s - near) | (turned_s[:-2] > kicked_s + near)
        # A motion from other values may turn more often than the fit's own.
        longer = np.interp(turned_s[1:-1], own_s, slowed)
        by_loss = (log_amplitude[:-2] - log_amplitude[2:]) / longer
        found = math.pi / _between(-log_amplitude[1:-1][free], by_loss[free], -wanted)
        inside = (log_amplitude[-1] <= wanted) & (wanted <= log_amplitude[0])
        return np.where(inside, found, math.nan)

    try:
        found, sds = _with_errors(fit, quality, constant=(OMEGA, TIME, OFFSET))
    except NoMotionError:
        # From another start it stops before the last reading.
        return {}
    return {
        amplitude: Estimate(float(q), float(sd), "")
        for amplitude, q, sd in zip(amplitudes, found, sds, strict=True)
        if q > sd
    }


def _slowed(fit: Fit) -> FloatArray:
    """Return by what factor losses lengthen the cycle about each turning point but the ends.

    What has the same sign on the way back, at the same angle, is no loss.
    """
    motion, pull = fit.at.tangent.motion, fit.at.tangent.rates.pull
    kept = 0.5 * (pull[:-1] + pull[1:, ::-1])
    pace = np.zeros_like(pull)
    pace[:-1] = 1.0 / (motion.angular_frequency * (1.0 - kept * motion.clock.cosine[:-1]))
    done = motion.clock.integral(pace)
    half = (done[:, -1] - done[:, 0])[:-2]
    return np.asarray((motion.time_s[2:, 0] - motion.time_s[:-2, 0]) / (2.0 * half))


def _between(x: FloatArray, y: FloatArray, at: FloatArray) -> FloatArray:
    """Return cubics through the four neighbours of each place; NaN of fewer."""
    four = np.arange(-2, 2)
    if len(x) < len(four):
        return np.full(len(at), math.nan)
    rows = np.clip(np.searchsorted(x, at), 2, len(x) - 2)[:, None] + four
    nodes, total = x[rows], np.zeros(len(at))
    for k in range(len(four)):
        others = np.delete(nodes, k, axis=1)
        own = nodes[:, k, None]
        total += y[rows[:, k]] * np.prod((at[:, None] - others) / (own - others), axis=1)
    return total


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
    return dict(zip(wanted, found, strict=True))


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
"""Of a drawn curve: ten between its knots."""
_SMOOTHNESS: Final = np.exp(np.linspace(-20.0, 6.0, 53))
"""Variances of a curve's change of slope: standard deviations from 1e-4 to 20 of what is usual."""
_LAWS: Final = 1.0
"""Variance of what of a curve the law has: that of what is usual."""


class Drawn(NamedTuple):
    """A fitted curve as it is drawn.

    Parameters
    ----------
    names
        Of the curves over one argument.
    at
        The argument, shape (k,).
    value
        Of each curve, one after the other, shape (m,).
    covariance
        Shape (m, m).
    gain
        The value by the whitened readings that the curve is to describe, shape (m, n + 1).
    readings
        These: what the fit leaves, with the curve's own part, shape (n + 1,).
    """

    names: tuple[str, ...]
    at: FloatArray
    value: FloatArray
    covariance: FloatArray
    gain: FloatArray
    readings: FloatArray

    def curves(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Return the values and errors of each curve, by name."""
        sd = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        values, sds = (each.reshape(len(self.names), -1) for each in (self.value, sd))
        return dict(zip(self.names, zip(values, sds, strict=True), strict=True))


def curve_values(fit: Fit, effect: Curve, drawn: Drawn, unit: str = "rad") -> dict[str, Any]:
    """Return a fitted curve with its error band.

    Parameters
    ----------
    fit
        The extended model, the curve in it.
    effect
        The curve.
    drawn
        Of these (`drawn_of`).
    unit
        Of the readings: ``"rad"``, ``"rad/s"``, or ``"m"`` for a displacement.

    Returns
    -------
    dict
        ``argument`` and ``ordinate`` (each with its unit after a comma), ``at``, ``value``
        and ``sd``, shape (k,). A drive has ``quadrature`` and ``quadrature_sd`` besides; a
        loss by amplitude ``local_exponent`` and ``local_exponent_sd``.
    """
    argument, ordinate = effect.axes(unit)
    found: dict[str, Any] = {"argument": argument, "ordinate": ordinate, "at": drawn.at}
    for name, (value, sd) in drawn.curves().items():
        prefix = f"{name}_" if name != "value" else ""
        found |= {name: value, f"{prefix}sd": sd}
    if isinstance(effect, damping_curve):
        exponent = _with_errors(fit, lambda value: _local_exponent(fit, effect, value, drawn.at))
        found["local_exponent"], found["local_exponent_sd"] = exponent
    return found


def drawn_of(fit: Fit, effect: Curve, noise: Noise) -> Drawn:
    """Draw a fitted curve: the smoothest that the readings allow, with its error band.

    To first order about the fit, the readings r beside all other parameters are A f + noise, with
    the values f at `_CURVE_POINTS` places. Before the readings f is an integrated Wiener process
    of variance t beside any amount of what the law has itself, which is then taken off
    (`Curve.smooth`), and t is unknown: with C = 1 + A K(t) A' each of `_SMOOTHNESS` counts by
    sqrt(t/det C) exp(-r' C^-1 r/2). The 95 % band of such a curve holds 95 % of the truth over all
    its places (Wahba, J. R. Stat. Soc. B 45, 133, 1983).
    """
    place = next(place for other, place in fit.model.places() if other is effect)
    unit, described = effect.scale(fit.model.pendulum(fit.value)), fit.value[place]
    spaced = np.geomspace if effect.over_logarithm else np.linspace
    at = np.asarray(spaced(effect.knots[0], effect.knots[-1], _CURVE_POINTS))
    curve, bent, beyond = effect.smooth(at)
    described = fit.jacobian[:, place] @ described
    readings = fit.residual + described
    others = fit.jacobian.copy()
    for index in (A, B, C):
        # The curve's unit follows the losses; what is drawn does not.
        moved = fit.value.copy()
        moved[index] += max(1e-6 * abs(float(moved[index])), 1e-9)
        grown = effect.scale(fit.model.pendulum(moved)) / unit - 1.0
        others[:, index] -= described * grown / (moved[index] - fit.value[index])
    others = others[:, [k for k in fit.free if not place.start <= k < place.stop]]
    law, columns = span_of(others, 1e-11), whitened(fit, noise, curve, ((),)).T
    columns -= law @ (law.T @ columns)
    basis, triangle, lengths = scaled_qr(columns)
    basis, seen = basis.T / fit.error_scale, triangle * lengths / fit.error_scale
    told = basis @ readings
    fitted, costs = [], []
    for variance in _SMOOTHNESS:
        prior = variance * bent + _LAWS * (np.eye(len(bent)) - beyond)
        spread = np.eye(len(seen)) + seen @ prior @ seen.T
        gain = np.linalg.solve(spread, seen @ prior).T
        fitted.append((gain, prior - gain @ seen @ prior))
        chi2 = told @ np.linalg.solve(spread, told)
        # No standard deviation is likelier than another before the readings, up to the largest.
        costs.append(chi2 + np.linalg.slogdet(spread)[1] - math.log(variance))
    weights = np.exp(-0.5 * (np.array(costs) - min(costs)))
    weights /= weights.sum()
    gains, covariances = zip(*fitted, strict=True)
    gain = np.tensordot(weights, gains, 1)
    apart = np.array(gains) @ told - gain @ told
    covariance = np.tensordot(weights, covariances, 1) + (weights * apart.T) @ apart
    law = np.zeros(len(bent))
    if effect.is_torque:
        # It swings about where the whole torque is zero: there the angle is.
        pendulum, model_at = fit.model.pendulum(fit.value), at
        law = pendulum.torque(at) / pendulum.angular_frequency**2
        there = unit * effect.curves(fit.value[place], at)[0]
        rest = float(np.interp(0.0, law + there, at)) if np.all(np.diff(law + there) > 0.0) else 0.0
        at = np.linspace(at[0] - min(rest, 0.0), at[-1] - max(rest, 0.0), len(at))
        law = pendulum.torque(at + rest) / pendulum.angular_frequency**2
        moved = np.array([np.interp(at + rest, model_at, one) for one in np.eye(len(at))]).T
        own = effect.smooth(at)[0].beyond_the_law()
        beyond, law = own @ own.T @ moved, own @ own.T @ law
    gain, covariance = unit * beyond @ gain @ basis, unit**2 * beyond @ covariance @ beyond.T
    return Drawn(effect.drawn, at, law + gain @ readings, covariance, gain, readings)


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
