"""A last look at the names where much is left: what could be part of the rest is withdrawn."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.distributions import chi2_beyond
from pendpipe.diagnose import Progress
from pendpipe.diagnose.chance import Trials
from pendpipe.diagnose.detect import Detection
from pendpipe.diagnose.evidence import Rival
from pendpipe.diagnose.location import tone_of
from pendpipe.diagnose.naming import refit_leads
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.diagnose.released_parameters import ReleasedParameter
from pendpipe.diagnose.remainder import Remainder, remainder_of
from pendpipe.diagnose.state import State, Step, is_gross
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.curves import Curve

_MOST: Final = 0.75
"""Part of the misfit that a name must explain where the model leaves more than noise."""
_OFF: Final = 0.1
"""Of the motion's frequency: how far from a harmonic a line must be."""
_AS_WELL: Final = 0.99
"""Part of the largest gain from which a curve describes a record as well."""
_DESCRIBES: Final = 0.5
"""Part of the excess that a curve must take away to be drawn on top of names."""


def credible(step: Step, state: State, level: float) -> bool:
    """Say whether a step's winner stands against what it would leave itself; curves do."""
    winner = step.winner
    if winner.lead.effect.kind == "unnamed" or stands_apart(winner.lead.effect, winner.fit):
        return True
    remainder = remainder_of(winner.fit, state.data, state.noise)
    if not remainder.systematic:
        return True
    return credibility(step, remainder, winner.gain) < level


def credibility(step: Step, remainder: Remainder, gain: float) -> float:
    """Global p-value of a gain in chi^2 against what is left, the effect's shapes counted.

    It is 1 where the effect does not explain most of the misfit: then it may just as well be
    the nearest thing to what is missing.

    Parameters
    ----------
    step
        Where the effect was added.
    remainder
        What the final model leaves.
    gain
        By how much chi^2 rises without the effect.
    """
    if gain < _MOST * (gain + remainder.excess):
        return 1.0
    effect = step.winner.lead.effect
    values = max(effect.count, 1)
    local = float(chi2_beyond(remainder.worth(gain), values))
    return _trials(step).global_p_value(local)


def stands_apart(effect: Effect, fit: Fit) -> bool:
    """Say whether an effect needs no doubt beside what is left.

    A line of its own in the spectrum, off the motion's harmonics, has no rival in what is
    left of the motion; and what every pendulum has is there in any case.
    """
    if effect.expected:
        return True
    line = tone_of(fit, effect)
    if line is None:
        return False
    order = line / (0.5 * float(fit.value[OMEGA]) / np.pi)
    return abs(order - round(order)) > _OFF and order > _OFF


def _trials(step: Step) -> Trials:
    # Any of those that were refitted might have been the one.
    return Trials(float(max(len(step.rivals), 1)), 0.0)


def withdraw_doubtful(state: State, level: float, progress: Progress) -> None:
    """Withdraw, one after another, the names that could be part of what is left.

    Nothing is withdrawn where the model leaves little more than noise. A curve is drawn anew
    behind the names, since it would hide what they leave.
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
        progress(f"{step.winner.identifier} could be part of what is left (p = {p_value:.2g})")
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
    """The model without one effect; None where it can't move so: then it is needed."""
    effect: Effect = step.winner.lead.effect
    model, value = state.fit.model.dropping(effect, state.fit.value)
    bare = np.concatenate([state.bare, value[len(state.bare) :]])
    found = []
    for start in (value, bare):
        try:
            found.append(refine(model, state.data, state.noise, start, held=state.holding))
        except (NoMotionError, np.linalg.LinAlgError):
            continue
        if len(found) == 1 and found[0].converged:
            break
    return min(found, key=lambda fit: fit.chi2, default=None)


def describe_rest(state: State, detection: Detection, p_value: float) -> bool:
    """Add the curve that describes what is left best; say whether there is one.

    Where nothing has been named, any curve that helps is better than silence.
    """
    leads = tuple(lead for lead in detection.leads if lead.effect.kind == "unnamed")
    rivals = refit_leads(
        state.fit,
        state.data,
        state.noise,
        replace(detection, leads=leads),
        held=state.holding,
        gross=is_gross(state.fit, state.data),
        origin=state.origin,
    )
    if not rivals:
        return False
    best = _of_the_motion(rivals)
    excess = remainder_of(state.fit, state.data, state.noise).excess
    if best.gain < (_DESCRIBES * excess if state.steps else 0.0):
        return False
    others = tuple(rival for rival in rivals if rival is not best)
    state.steps.append(Step((best, *others), p_value, state.fit))
    state.settle(best.fit)
    return True


def _of_the_motion(rivals: list[Rival]) -> Rival:
    """The curve of the largest gain; before one in time, one of the motion that does as well.

    A curve in time follows whatever happens once; where a law of the angle or the amplitude,
    that must repeat itself each cycle, leaves as little, it is the law that is drawn.
    """
    largest = max(rival.gain for rival in rivals)
    # Where no curve helps, the gains are negative.
    near = [rival for rival in rivals if rival.gain >= min(_AS_WELL * largest, largest)]
    return min(
        near,
        key=lambda rival: (
            isinstance(rival.lead.effect, Curve) and rival.lead.effect.in_time,
            -rival.gain,
        ),
    )
