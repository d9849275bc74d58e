"""Final review of the named effects where a large misfit remains: doubtful ones are withdrawn."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.distributions import chi2_beyond
from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.chance import Trials, printed
from pendpipe.diagnosis.detect import Detection
from pendpipe.diagnosis.evidence import Rival
from pendpipe.diagnosis.location import tone_of
from pendpipe.diagnosis.naming import refit_leads
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.remainder import Remainder, remainder_of
from pendpipe.diagnosis.state import State, Step, is_gross
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.curves import Curve

_EXPLAINED_SHARE: Final = 0.75
"""Part of the misfit that a named effect must explain where more than noise remains."""
_OFF_HARMONIC: Final = 0.1
"""Distance of a separate line from the nearest harmonic, over the motion's frequency."""
_EQUALLY_GOOD: Final = 0.99
"""Part of the largest gain from which another curve counts as equally good."""
_CURVE_SHARE: Final = 0.5
"""Part of the excess chi^2 that a curve must remove to be added to named effects."""


def credible(step: Step, state: State, level: float) -> bool:
    """Return whether a step's winner is significant against its remainder; curves always are."""
    winner = step.winner
    if winner.lead.effect.kind == "unnamed" or stands_apart(winner.lead.effect, winner.fit):
        return True
    remainder = remainder_of(winner.fit, state.data, state.noise)
    if not remainder.systematic:
        return True
    return credibility(step, remainder, winner.gain) < level


def credibility(step: Step, remainder: Remainder, gain: float) -> float:
    """Return the global p-value of a gain in chi^2 against the remaining misfit.

    It is 1 if the effect does not explain most of the misfit: then it may only imitate what is
    missing.

    Parameters
    ----------
    step
        Where the effect was added.
    remainder
        Misfit of the final model.
    gain
        By how much chi^2 rises without the effect.
    """
    if gain < _EXPLAINED_SHARE * (gain + remainder.excess):
        return 1.0
    effect = step.winner.lead.effect
    values = max(effect.count, 1)
    local = float(chi2_beyond(remainder.worth(gain), values))
    return _trials(step).global_p_value(local)


def stands_apart(effect: Effect, fit: Fit) -> bool:
    """Return whether the remaining misfit can't be mistaken for an effect.

    This holds for a separate spectral line, off the motion's harmonics, and for effects that
    every pendulum has.
    """
    if effect.expected:
        return True
    line = tone_of(fit, effect)
    if line is None:
        return False
    order = line / (0.5 * float(fit.value[OMEGA]) / np.pi)
    return abs(order - round(order)) > _OFF_HARMONIC and order > _OFF_HARMONIC


def _trials(step: Step) -> Trials:
    # Any of the refitted rivals might have been reported.
    return Trials(float(max(len(step.rivals), 1)), 0.0)


def withdraw_doubtful(state: State, level: float, progress: Progress) -> None:
    """Withdraw, one after another, the effects that could be part of the remaining misfit.

    Nothing is withdrawn where little more than noise remains. Curves are removed first (and
    fitted again later), since they would hide the misfit.
    """
    if not remainder_of(state.fit, state.data, state.noise).systematic:
        return
    for step in [step for step in state.steps if step.winner.lead.effect.kind == "unnamed"]:
        without = fit_without(state, step)
        if without is not None:
            state.fit = without
            state.steps.remove(step)
    while True:
        remainder = remainder_of(state.fit, state.data, state.noise)
        worst = _least_credible(state, remainder)
        if worst is None or not remainder.systematic:
            return
        step, without, p_value = worst
        if p_value < level:
            return
        progress(
            f"withdrawing {step.winner.name}: part of the remaining misfit ({printed(p_value)})"
        )
        state.fit = without
        state.steps.remove(step)


def _least_credible(state: State, remainder: Remainder) -> tuple[Step, Fit, float] | None:
    found = []
    for step in state.steps:
        effect = step.winner.lead.effect
        if isinstance(effect, ReleasedParameter) or stands_apart(effect, state.fit):
            continue
        without = fit_without(state, step)
        if without is not None:
            gain = without.chi2 - state.fit.chi2
            found.append((step, without, credibility(step, remainder, gain)))
    return max(found, key=lambda each: each[2], default=None)


def fit_without(state: State, step: Step) -> Fit | None:
    """Fit the model without one effect; None where it has no such motion: the effect is needed."""
    effect: Effect = step.winner.lead.effect
    model, value = state.fit.model.dropping(effect, state.fit.value)
    bare = np.concatenate([state.bare, value[len(state.bare) :]])
    found = []
    for start in (value, bare):
        try:
            found.append(refine(model, state.data, state.noise, start, held=state.held))
        except (NoMotionError, np.linalg.LinAlgError):
            continue
        if len(found) == 1 and found[0].converged:
            break
    return min(found, key=lambda fit: fit.chi2, default=None)


def describe_rest(state: State, detection: Detection, p_value: float) -> bool:
    """Add the curve that describes the remaining misfit best; return whether there is one.

    If nothing has been named, any curve that helps is added.
    """
    leads = tuple(lead for lead in detection.leads if lead.effect.kind == "unnamed")
    rivals = refit_leads(
        state.fit,
        state.data,
        state.noise,
        replace(detection, leads=leads),
        held=state.held,
        gross=is_gross(state.fit, state.data),
        origin=state.origin,
    )
    if not rivals:
        return False
    best = _best_curve(rivals)
    excess = remainder_of(state.fit, state.data, state.noise).excess
    if best.gain < (_CURVE_SHARE * excess if state.steps else 0.0):
        return False
    others = tuple(rival for rival in rivals if rival is not best)
    state.steps.append(Step((best, *others), p_value, state.fit))
    state.settle(best.fit)
    return True


def _best_curve(rivals: list[Rival]) -> Rival:
    """Return the curve of the largest gain, preferring laws of the motion to curves in time.

    A curve in time can follow anything that happens once. A law of angle or amplitude, which
    repeats in each cycle, is preferred if it does as well.
    """
    largest = max(rival.gain for rival in rivals)
    # Where no curve helps, the gains are negative.
    near = [rival for rival in rivals if rival.gain >= min(_EQUALLY_GOOD * largest, largest)]
    return min(
        near,
        key=lambda rival: (
            isinstance(rival.lead.effect, Curve) and rival.lead.effect.in_time,
            -rival.gain,
        ),
    )
