"""The curve of an effect that has no name, in its own units, with its errors."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.refine import Fit
from pendpipe.effects.curve import Curve
from pendpipe.effects.curves import DampingCurve, DriveCurve

_POINTS: Final = 61


def curve_values(fit: Fit, effect: Curve, unit: str = "rad") -> dict[str, Any]:
    """Return a fitted curve with its band.

    Parameters
    ----------
    fit
        The extended model, the curve in it.
    effect
        The curve.
    unit
        Of the readings: ``"rad"``, or ``"m"`` for what is no pendulum.

    Returns
    -------
    dict
        ``argument`` and ``ordinate`` (each with its unit after a comma), ``at``, ``value``
        and ``sd``, shape (k,). A drive has ``quadrature`` and ``quadrature_sd`` besides; a
        loss by amplitude ``local_exponent`` and ``local_exponent_sd``.
    """
    place = next(place for other, place in fit.model.places() if other is effect)
    covariance = fit.covariance()
    knots = effect.knots
    spaced = np.geomspace if isinstance(effect, DampingCurve) else np.linspace
    at = np.asarray(spaced(knots[0], knots[-1], _POINTS))
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
        found[name] = scale * columns @ fit.value[place]
        own = covariance[place, place]
        variance = np.einsum("ij,jk,ik->i", columns, own, columns)
        found[f"{prefix}sd"] = abs(scale) * np.sqrt(np.maximum(variance, 0.0))
    if isinstance(effect, DampingCurve):
        found |= _local_exponent(fit, effect, place, at, covariance)
    return found


def _parts(effect: Curve) -> dict[str, Any]:
    """The curves that an effect consists of, each a function of values and arguments."""
    if not isinstance(effect, DriveCurve):
        return {"value": effect.curve}
    count = len(effect.knots)

    def part(first: int) -> Any:
        def drawn(values: FloatArray, at: FloatArray) -> FloatArray:
            both = effect.mixing @ values
            return np.asarray(np.interp(at, effect.knots, both[first : first + count]))

        return drawn

    return {"value": part(0), "quadrature": part(count)}


def _local_exponent(
    fit: Fit, effect: DampingCurve, place: slice, at: FloatArray, covariance: FloatArray
) -> dict[str, FloatArray]:
    """The power n of the velocity that the whole loss follows: n = 1 + d ln(loss rate)/d ln y.

    A loss |v|^n takes -dy/dt in proportion to y^n, that is a rate y^(n - 1) (Eq. 13: a, b, c
    are n = 2, 1, 0). The error is propagated from all fitted values.
    """

    def exponent(value: FloatArray) -> FloatArray:
        pendulum = fit.model.pendulum(value)
        rate = pendulum.quadratic * at + pendulum.linear + pendulum.coulomb / at
        rate = rate + effect.scale(pendulum) * effect.curve(value[place], at)
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
