"""Period, quality factor and shares of the losses at an amplitude.

What a fitted law says of them, and what the turning points show without one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pendpipe.analysis.fit.backbone import Backbone
from pendpipe.analysis.fit.decrement import Light, losses_of
from pendpipe.analysis.fit.fitted import Fit, Fitted, Verdict
from pendpipe.analysis.torque import TOP, swing_phase
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.estimate import Z95, Estimate, over
from pendpipe.physics.lengthening import elliptic
from pendpipe.quantities import after_number

LEAST_QUALITY: Final = 3.0
"""Below, a cycle leaves less than exp(-pi/3) of the swing, a third: it is no cycle."""
LOSSES: Final = {
    "a": "drag that grows with the square of the speed",
    "b": "viscous and internal loss",
    "c": "dry friction",
}
"""The three losses of Eq. 13 in words."""
TOLD_APART: Final = 0.15
"""Standard deviation of a loss's share up to which it is told from the others."""


@dataclass(frozen=True)
class Quality:
    """The quality factor at one amplitude, with the shares of the three losses.

    Parameters
    ----------
    amplitude_rad
        Amplitude y, in the unit of the recording.
    damping_time_s
        1 over the relative loss of amplitude.
    period_s
        The period at y; NaN where nothing shows it.
    losses
        Share of a y, b and c/y in the loss, by ``"a"``, ``"b"``, ``"c"``; empty where the
        turning points show Q without a law.
    """

    amplitude_rad: float
    damping_time_s: Estimate
    period_s: float
    losses: Mapping[str, Estimate]

    @property
    def quality_factor(self) -> Estimate:
        """``pi tau/T``: tau the damping time and T the period at y."""
        time, factor = self.damping_time_s, math.pi / self.period_s
        return Estimate(factor * time.value, factor * time.sd, "")

    @property
    def dominant(self) -> str | None:
        """The loss that takes most, ``"a"``, ``"b"`` or ``"c"``; None where it is not told."""
        if not self.losses or not all(each.sd < TOLD_APART for each in self.losses.values()):
            return None
        return max(self.losses, key=lambda name: self.losses[name].value)

    def as_json(self) -> dict[str, Any]:
        """Return an entry of ``quality_factors`` in ``fit.json``."""
        return {
            "amplitude_rad": self.amplitude_rad,
            "value": self.quality_factor.value,
            "sd": self.quality_factor.sd,
            "interval95": list(self.quality_factor.bounds95),
            "period_s": self.period_s,
            "losses": {name: each.value for name, each in self.losses.items()} or None,
            "losses_sd": {name: each.sd for name, each in self.losses.items()} or None,
            "losses_interval95": {name: [*each.bounds95] for name, each in self.losses.items()}
            or None,
        }


def qualities(result: Fitted) -> tuple[Quality, ...]:
    """Q and the shares of the losses at the release, a middle and a small amplitude of the decay.

    The fitted law's; Q is what the turning points show where the law is refuted, and with a red
    light there are no shares.
    """
    if result.light == "red":
        return seen_qualities(result)
    smaller = [check.amplitude_rad for check in result.decrement_check[1:]]
    wanted = dict.fromkeys([result.parameters["amplitude"].value, *smaller])
    return tuple(_quality(result, amplitude) for amplitude in wanted)


def seen_qualities(result: Fitted) -> tuple[Quality, ...]:
    """Return the amplitudes and quality factors that the turning points show without a law."""
    if (shown := result.backbone) is None:
        return ()
    found = (_seen_quality(result, shown, each.amplitude_rad) for each in result.decrement_check)
    return tuple(
        each for each in found if 0.0 < Z95 * each.damping_time_s.sd < each.damping_time_s.value
    )


def _quality(result: Fitted, amplitude: float) -> Quality:
    """The law's, or what the turning points show where it is refuted; with the law's shares."""
    by_law, shown = quality_by_law(result, amplitude), result.lawless
    if shown is None or not shown.reaches(amplitude):
        return by_law
    return replace(_seen_quality(result, shown, amplitude), losses=by_law.losses)


def _seen_quality(result: Fitted, shown: Backbone, amplitude: float) -> Quality:
    loss, period = shown.loss(amplitude), shown.period(amplitude).value
    period = period if math.isfinite(period) else period_of(result, amplitude)
    time = Estimate(1.0 / loss.value, loss.sd / loss.value**2, "s")
    return Quality(amplitude, time, period, {})


def quality_at(result: Fitted, amplitude_rad: float) -> Estimate:
    """Return Q at an amplitude, ``pi/(T loss)`` with the period and the loss there.

    Of the law, or what the turning points show where it is refuted.

    Parameters
    ----------
    result
        A fit.
    amplitude_rad
        In rad, or in the unit of the recording.

    Raises
    ------
    InputError
        If it is not an amplitude; or, where no law describes the decay, none at which its
        turning points show Q.
    """
    unit = result.parameters["amplitude"].unit
    refuse_if(
        not (math.isfinite(amplitude_rad) and amplitude_rad > 0.0),
        "amplitude_rad",
        f"{amplitude_rad!r} is not an amplitude",
        f"give a positive number of {unit}",
    )
    if result.light != "red":
        return _quality(result, amplitude_rad).quality_factor
    shown = result.backbone
    if shown is None or not shown.reaches(amplitude_rad):
        ends = shown and (shown.amplitude_rad[-1], shown.amplitude_rad[0])
        where = f"from {ends[0]:.3g} to {ends[1]:.3g}{after_number(unit)}" if ends else "nowhere"
        raise InputError(
            "amplitude_rad",
            f"no law describes this decay, and its turning points show Q {where}",
            "ask within, or fit a part of the recording",
        )
    return _seen_quality(result, shown, amplitude_rad).quality_factor


def released_quality(result: Fitted) -> Estimate:
    """Return Q at the first turning point kept; with a red light at the largest where it is seen.

    NaN where the turning points of a decay without a law do not show it.
    """
    if result.light != "red":
        return _quality(result, result.value("amplitude")).quality_factor
    seen = seen_qualities(result)
    return seen[0].quality_factor if seen else Estimate(math.nan, math.nan, "")


def without_swings(result: Fit) -> Fit:
    """Hold back what has no meaning where Q at the release is below 3: there no period is left.

    A cycle would lose two thirds of the amplitude. Q is then not that of any cycle, and Eq. 14,
    which is first order in the loss of a cycle, does not give a, b and c; Eq. 8 does.
    """
    quality = released_quality(result).value
    if not quality < LEAST_QUALITY:
        return result
    by_cycles = result.method != "waveform"
    held = {"Q", "losses", *("abc" if by_cycles else ())}
    kept = tuple(name for name in result.quotable if name not in held)
    what = "Q, a, b, c" if by_cycles else "Q"
    said = f"a cycle loses most of the swing, Q = {quality:.2g}: don't quote {what}"
    if result.light != "green":
        said = f"{said}; {result.light_reason}"
    light: Light = "red" if result.light == "red" else "amber"
    return replace(result, verdict=Verdict(light, said, "overdamped", kept))


def quality_by_law(result: Fitted, amplitude: float) -> Quality:
    """Evaluate the fitted law at one amplitude."""
    loss, parts = losses_of(result.law, amplitude)
    total, period = float(parts.sum()), period_of(result, amplitude)
    shares = parts / total if total > 0.0 else np.full(3, math.nan)
    value = 1.0 / loss if loss > 0.0 else math.inf
    # By each of the losses: of the whole, and of each share.
    weights = np.vstack([np.ones(3), np.eye(3) - shares[:, None]])
    whole, *sds = _sds(weights, _covariance_of_losses(result, amplitude)).tolist()
    by_rate = amplitude * value, value, value / amplitude
    return Quality(
        amplitude,
        Estimate(value, value * whole, "s"),
        period,
        {
            name: _share(share, sd, result.parameters[name], each)
            for name, share, sd, each in zip("abc", shares.tolist(), sds, by_rate, strict=True)
        },
    )


def _share(share: float, sd: float, rate: Estimate, by_rate: float) -> Estimate:
    """A share with its interval: of a rate at its bound that of the rate."""
    low, high = Estimate(share, sd, "").bounds95
    if rate.at_bound:
        low, high = 0.0, by_rate * rate.bounds95[1]
    return Estimate(share, sd, "", (max(low, 0.0), min(high, 1.0)), rate.at_bound)


def relative_loss_sd(result: Fitted, amplitude: float) -> float:
    """Relative standard deviation of the law's loss, and so of Q, at one amplitude."""
    return float(_sds(np.ones((1, 3)), _covariance_of_losses(result, amplitude))[0])


def _sds(weights: FloatArray, covariance: FloatArray) -> FloatArray:
    """Standard deviations of weighted sums, shape (k,)."""
    if not np.isfinite(covariance).all():
        return np.full(len(weights), math.inf)
    return np.asarray(np.sqrt(np.maximum(np.sum(weights @ covariance * weights, axis=1), 0.0)))


def _covariance_of_losses(result: Fitted, amplitude: float) -> FloatArray:
    """Return the covariance of a y, b and c/y, over their sum squared, shape (3, 3)."""
    slope = np.array([amplitude, 1.0, 1.0 / amplitude])
    loss = float(slope @ [result.value(name) for name in "abc"])
    if not loss > 0.0:
        return np.diag(np.full(3, math.inf))
    relative = slope / loss
    return relative[:, None] * result.covariance[:3, :3] * relative


def period_of(result: Fitted, amplitude: float) -> float:
    """Period at one amplitude, s; that of small amplitudes where the law cannot swing there."""
    period = 1.0 / result.value("frequency")
    if not (result.restoring == "sine" and 0.0 < amplitude < math.pi):
        return period
    quarter = elliptic(np.array(math.sin(0.5 * amplitude) ** 2))[0]
    return 2.0 / math.pi * float(quarter) * period


def mean_square(result: Fitted) -> float:
    """Mean of the squares of a large, a middle and a small amplitude, by which the period grows."""
    seen = [check.amplitude_rad for check in result.decrement_check]
    return float(np.mean(np.square(seen or [result.value("amplitude")])))


def small_period(result: Fitted) -> Estimate:
    """Period 1/f of Eq. 8's frequency, s: with the torque of sin x that of small amplitudes.

    Where the law is refuted that of the turning points, extrapolated to small swings.
    """
    shown = result.lawless
    if shown is not None and math.isfinite(shown.small_period.value):
        return shown.small_period
    return period_of_frequency(result.parameters["frequency"])


def small_frequency(result: Fitted) -> Estimate:
    """Frequency of small swings, Hz: the law's, or where that is refuted 1/T of `small_period`."""
    small, fitted = small_period(result), result.parameters["frequency"]
    return fitted if small == period_of_frequency(fitted) else over(1.0, small, "Hz")


def period_of_frequency(frequency: Estimate) -> Estimate:
    """Return 1/f, s."""
    return Estimate(1.0 / frequency.value, frequency.sd / frequency.value**2, "s")


def pendulum_of(result: Fitted) -> dict[str, Estimate]:
    """Return ``g`` by the length of a simple pendulum, or its ``length`` by g: omega_0^2 = g/l.

    With the torque of sin x the fitted omega is omega_0, that of small swings. Otherwise
    omega_0 = omega 2 K(sin(y/2))/pi at the root-mean-square angle y, where that is known.
    """
    if result.length is None and result.gravity is None:
        return {}
    linear = result.restoring == "linear"
    period = period_of_frequency(result.parameters["frequency"]) if linear else small_period(result)
    omega = math.tau / period.value * (swings_longer(result) or 1.0)
    relative = 2.0 * period.sd / period.value
    if result.length is not None:
        value, given, name, unit = omega**2 * result.length.value, result.length, "g", "m/s^2"
    else:
        assert result.gravity is not None
        value, given, name, unit = result.gravity.value / omega**2, result.gravity, "length", "m"
    return {name: Estimate(value, math.hypot(relative, given.sd / given.value) * value, unit)}


def swings_longer(result: Fitted) -> float | None:
    """The swings' period over that of small ones; 1 of the torque of sin x, None of no angle."""
    if result.restoring == "sine":
        return 1.0
    unit = result.parameters["amplitude"].unit
    length = {"rad": math.inf, "m": result.length.value if result.length else None}.get(unit)
    if length is None:
        return None
    size = math.sqrt(mean_square(result))
    angle = size if unit == "rad" else math.asin(min(size / length, 1.0))
    return float(swing_phase(np.array([min(angle, TOP)] * 2), "sine")[0]) / math.pi
