"""The missing force as a curve with its band, in words, and a named effect drawn over it.

Of each effect that acts throughout, the curve is shown that the evidence prefers among those that
may stand in its place: a torque against the angle, a loss against amplitude, angle or time, an
error of the sensor. It is a rival of the effect, refitted beside all others; where the search has
kept none, the curve whose signature explains most is fitted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pendpipe.analysis.fit.printed import short_size
from pendpipe.answer import factor
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.detect import detect, prepare
from pendpipe.diagnosis.hypothesis import Hypothesis, Step, undrawn
from pendpipe.diagnosis.refine import Fit, loses_phase, with_errors
from pendpipe.diagnosis.rivals import Rival, refit_leads
from pendpipe.diagnosis.values import Drawn, curve_values, drawn_of
from pendpipe.dynamics.any_law import Motion
from pendpipe.effects import Effect
from pendpipe.effects.curves import CURVES, FOLLOW_UP_CURVES, Curve
from pendpipe.estimate import ALONE, Z95, Estimate
from pendpipe.levels import deviations
from pendpipe.quantities import compact, with_error

_CLOSE: Final = 64
"""Nodes of half a cycle at which a part of the swing is cut out."""
_ROUNDING: Final = 1e-9
"""Of the usual size: a motion is right to 1e-10 of itself, and a curve below tells of that."""


def force_of(found: Hypothesis, step: Step) -> dict[str, Any] | None:
    """Return the curve that stands in the place of an effect, with the effect as such a curve.

    None of what happens at an instant, and of a line, which no curve describes.
    """
    winner = step.winner
    effect = winner.effect
    if isinstance(effect, Curve):
        shown = drawn_of(found.fit, effect, found.noise)
        return curve_told(found.fit, effect, shown, found.data.unit)
    likely = zip(step.weights[1:-1], step.mates, strict=True)
    drawn = [mate for _, mate in sorted(likely, key=lambda each: -each[0]) if mate.drawn]
    drawn += sorted((each for each in step.rivals if each.drawn), key=lambda each: -each.evidence)
    drawn = [each for each in drawn if _may_be_drawn(step, each.effect)]
    if not drawn:
        if effect.local or effect.spectral or effect.kind == "parameter":
            return None
        drawn = _curves_in_place(found, step)
    if not drawn:
        return None
    curve = drawn[0].effect
    assert isinstance(curve, Curve)
    fit = with_errors(drawn[0].fit, found.data, found.noise)
    shown = drawn_of(fit, curve, found.noise)
    told, named = curve_told(fit, curve, shown, found.data.unit), seen_as(found.fit, fit, shown)
    parts = [None, None] if named is None else named.reshape(-1, len(shown.at))
    names = ("named", *(f"named_{name}" for name in shown.names[1:]))
    return {**told, **dict(zip(names, parts, strict=False)), "named_as": effect.name}


def _is_of_kind(effect: Effect, curve: Effect) -> bool:
    """Whether a curve is over what an effect follows: the time, else the motion or the reading."""
    shapes = effect.parameters[effect.sizes :]
    in_time = effect.local or effect.in_time or any(each.unit in ("s", "Hz") for each in shapes)
    read = "measurement" in curve.identifier, effect.kind == "measurement"
    return in_time if curve.in_time else not in_time and read[0] == read[1]


def _may_be_drawn(step: Step, curve: Effect) -> bool:
    """Whether a curve may stand for an effect: of its kind for one that is named alone, else any.

    What no name is sure of the readings themselves place: in the motion, the reading or the time.
    """
    return step.weights[0] < ALONE or _is_of_kind(step.winner.effect, curve)


def _curves_in_place(found: Hypothesis, step: Step) -> list[Rival]:
    """Fit the curve whose signature explains most of what an effect explains."""
    before, readings = step.before, (found.data, found.noise)
    curves = undrawn((*CURVES, *FOLLOW_UP_CURVES), before)
    curves = [each for each in curves if _may_be_drawn(step, each)]
    scanned = detect(prepare(before, *readings, curves), before, seed=0, known=found.scan)
    best = max(scanned.leads, key=lambda lead: lead.score, default=None)
    if best is None:
        return []
    one = replace(scanned, leads=(best,))
    return refit_leads(before, *readings, one, held=found.held, phase_lost=loses_phase(before))


def seen_as(named: Fit, fit: Fit, drawn: Drawn) -> FloatArray | None:
    """Return what the curve of a fit would be if the readings were those of the model with a name.

    Both are then told beside the same baseline, whatever it takes of each, and equally smooth.
    Of several curves one follows the other.
    """
    if named.residual.shape != fit.residual.shape:
        return None
    return np.asarray(drawn.gain @ (drawn.readings - named.residual))


def share_of_loss(
    fit: Fit, curve: Curve, at: FloatArray, value: FloatArray, low: float, high: float
) -> float:
    """Return which part of the work of all losses a drawn curve does, its argument within.

    Zero of what is no loss, and where the losses do no work.
    """
    if curve.identifier != "unnamed-damping":
        return 0.0
    pendulum, motion = fit.model.pendulum(fit.value), _closer(fit.at.tangent.motion)
    place = next(place for other, place in fit.model.places() if other is curve)
    inside = (low <= type(curve).along(motion)) & (type(curve).along(motion) <= high)
    drawn = curve.smooth(at)[0]
    # The work is that of each half cycle by itself, over the phase.
    own, whole = (
        float(np.sum(_work(np.where(inside, force * motion.velocity, 0.0), motion)))
        for force in (
            np.asarray(drawn.acceleration(motion, pendulum, value / drawn.scale(pendulum))),
            pendulum.losses(motion)
            + np.asarray(curve.acceleration(motion, pendulum, fit.value[place])),
        )
    )
    return own / whole if whole < 0.0 else 0.0


def _closer(motion: Motion) -> Motion:
    """Return a motion at nodes that lie closer, to a fiftieth of the swing."""
    clock, psi = replace(motion.clock, order=_CLOSE), motion.clock.psi.ravel()
    log_amplitude, time_s = (
        np.interp(clock.psi, psi, each.ravel()) for each in (motion.log_amplitude, motion.time_s)
    )
    return Motion(clock, motion.angular_frequency, log_amplitude, time_s, motion.upwards)


def _work(power: FloatArray, motion: Motion) -> FloatArray:
    return np.diff(motion.clock.integral(power)[:, [0, -1]], axis=1)


def curve_told(fit: Fit, effect: Curve, drawn: Drawn, unit: str) -> dict[str, Any]:
    """Return a fitted curve as `curve_values` does, with its ``name`` and a clause, ``summary``.

    The clause says where and how large it is: of the points whose 95 % band excludes zero on one
    side, with none on the other side among them, those of the largest square, and their mean; of a
    loss which part of the whole loss there it is. A torque is told as a stiffness, alike on both
    sides of the lowest point. ``stands_out`` is whether one of them does so over all knots.
    """
    found = curve_values(fit, effect, drawn, unit)
    axes = (found[name].partition(", ") for name in ("argument", "ordinate"))
    (along, _, per), (_, _, across) = axes
    told, most = f"the 95 % band of {effect.name} holds zero everywhere", (False, 0.0)
    # What is odd in the angle is the same on both sides.
    right = drawn.at > 0.0 if effect.is_torque else np.full(len(drawn.at), True)
    at = drawn.at[right]
    for name, (value, sd) in drawn.curves().items():
        subject, larger, smaller = effect.words[name]
        force, whole_size = value, abs(effect.scale(fit.model.pendulum(fit.value)))
        if effect.is_torque:
            value, sd = 0.5 * (value - value[::-1]), 0.5 * (sd + sd[::-1])
            value, sd, whole_size = value[right] / at, sd[right] / at, 1.0
        beyond = np.flatnonzero(np.abs(value) > np.maximum(Z95 * sd, _ROUNDING * whole_size))
        sure = np.abs(value) > deviations(len(effect.knots)) * sd
        sides = np.split(beyond, np.flatnonzero(np.diff(np.sign(value[beyond]))) + 1)
        totals = [(bool(np.any(sure[side])), float(value[side] @ value[side])) for side in sides]
        total, here = max(zip(totals, sides, strict=True), key=lambda each: each[0])
        if total <= most:
            continue
        # A point that stands out is no place.
        usual = np.quantile(np.abs(value[here]), 0.75)
        here, most = here[np.abs(value[here]) >= 0.5 * usual], total
        size, low, high = float(value[here].mean()), float(at[here[0]]), float(at[here[-1]])
        pure = effect.is_torque or not across
        number = f"{100.0 * abs(size):.2g} %" if pure else compact(abs(size), across)
        number += " of the restoring torque" if name == "quadrature" else ""
        place = f"from {short_size(low, per)} to {short_size(high, per)} ({along})"
        if effect.is_torque and here[0] > 0:
            place = f"from {short_size(low, per)} to {short_size(high, per)} off the lowest point"
        elif along == "angle" and (effect.is_torque or low <= 0.0 <= high):
            place = f"within {short_size(max(-low, high), per)} of the lowest point"
        told = f"{subject} {larger if size > 0.0 else smaller} by {number} {place}"
        share = share_of_loss(fit, effect, drawn.at, force, low, high)
        of = (
            f"{100.0 * share:.2g} % of" if (share := abs(share)) < 1.0 else f"{factor(share)} times"
        )
        told += f", {of} the loss there" if share else ""
        told += "" if total[0] else ", or by chance"
    found["stands_out"] = most[0]
    if effect.powers and (terms := polynomial_of(fit, unit)):
        told, found["polynomial"] = _formula(terms, fit, per), terms
    return {"name": effect.name, "summary": told, **found}


def polynomial_of(fit: Fit, unit: str) -> dict[str, Estimate]:
    """Return the whole torque over omega^2 beyond the law's by powers of the angle, by term.

    All torques with a formula are summed. None where the fit has fewer values than terms: it
    knows but some combinations of these.
    """
    mixing, powers = dict[str, FloatArray](), dict[str, tuple[int, str]]()
    for effect, place in fit.model.places():
        for index, row in zip(range(place.start, place.stop), np.eye(effect.count), strict=True):
            for name, each in effect.told(row).items():
                mixing.setdefault(name, np.zeros(len(fit.value)))[index] = each
        powers |= {name: (power, effect.acts_on(unit)) for name, power in effect.powers.items()}
    rows = [mixing[name] * fit.at.span.first_amplitude ** powers[name][0] for name in mixing]
    if not rows or np.linalg.matrix_rank(np.array(rows)[:, fit.free]) < len(rows):
        return {}
    found = {}
    for name in sorted(mixing, key=lambda name: powers[name][0]):
        power, of = powers[name]
        sd = math.sqrt(float(mixing[name] @ fit.covariance() @ mixing[name]))
        value = float(mixing[name] @ fit.value)
        found[name] = Estimate(value, sd, f"1/{of}^{power - 1}".removesuffix("^1"))
    return found


def _formula(terms: Mapping[str, Estimate], fit: Fit, unit: str) -> str:
    """Print the whole torque as terms of the largest swing A: each is its part of the torque there.

    The law's own part of it is none of them.
    """
    largest, said, share = fit.at.span.first_amplitude, list[str](), 0.0
    for name, each in terms.items():
        # The unit is that of so many lengths.
        power = int(each.unit.partition("^")[2] or 1)
        part = Estimate(each.value * largest**power, each.sd * largest**power, "")
        number = with_error(abs(part.value), part.sd, short=True)
        over = "/A" + " ²³⁴"[power - 1].strip()
        said.append(f"{'+' if part.value > 0.0 else '−'} {number} {name}{over}")
        share += part.value
    law = "sin x" if fit.model.restoring == "sine" else "x"
    way = "stiffer" if share > 0.0 else "softer"
    at = f"A = {short_size(largest, unit)}: {100.0 * abs(share):.2g} % {way} there than at rest"
    return f"the torque is as {law} {' '.join(said)}, {at}"
