"""Swap in the likelier effect: the order in which a search found them is not evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from pendpipe.diagnosis import Progress, silent
from pendpipe.diagnosis.begin import Beginning
from pendpipe.diagnosis.evidence import Rival
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.remainder import remainder_of
from pendpipe.diagnosis.search import Search
from pendpipe.diagnosis.state import Step
from pendpipe.diagnosis.weighing import Weighed, refitted, weigh
from pendpipe.effects import Effect

_LIKELIER: Final = 1.5
"""Ratio of probabilities from which another effect replaces the one that was added."""
_LIKELIER_CURVE: Final = 20.0
"""The same for a curve that replaces a named effect. Names precede curves that the recording
cannot distinguish from them; at odds of twenty to one it can."""


def swap_in_likelier(
    found: Search, beginning: Beginning, progress: Progress = silent
) -> tuple[Search, tuple[Weighed, ...]]:
    """Replace each added effect by a likelier rival, if there is one, and weigh all steps.

    A search adds what reduces a gross misfit most. Where much remains unexplained, a slightly
    larger gain means nothing and the prior decides; and effects added later, or the final
    estimate of the noise, may have changed the odds.

    Returns
    -------
    Search
        With the swaps made.
    tuple of Weighed
        One for each of its steps.
    """
    weighed = [weigh(found, beginning, step) for step in found.steps]
    # Names under a curve stay: their probabilities show how little they explain.
    if found.named.fit.model is not found.improved.model:
        return found, tuple(weighed)
    for number in range(len(found.steps)):
        best = _likelier(found, found.steps[number], weighed[number])
        after = _exchanged(found, number, best, weighed[number].without) if best else None
        if best is not None and after is not None:
            own = found.steps[number].winner
            progress(f"replacing {own.name} by {best.name}, which is likelier")
            found = after
            weighed = [weigh(found, beginning, step) for step in found.steps]
    return found, tuple(weighed)


def _likelier(found: Search, step: Step, weighed: Weighed) -> Rival | None:
    """Return the likelier rival that may replace a step's winner."""
    present = {effect.key for effect in found.improved.model.effects}
    own = step.winner
    likelier = [
        (float(weight), rival)
        for rival, weight in zip(weighed.mates, weighed.weights[1:], strict=False)
        if rival.lead.effect.key not in present
        # What no model explains has its curve already, on top of the names.
        and not (rival.drawn and found.remainder.systematic)
        and weight
        > weighed.weights[0] * (_LIKELIER_CURVE if rival.drawn and not own.drawn else _LIKELIER)
    ]
    return max(likelier, key=lambda each: each[0], default=(0.0, None))[1]


def _exchanged(found: Search, number: int, best: Rival, without: Fit) -> Search | None:
    """Replace a step's winner by a rival; None where the model has no such motion."""
    step, effect = found.steps[number], best.lead.effect
    own, held = step.winner.lead.effect, set(found.held)
    # A held part of b has no index: the model itself holds it.
    if isinstance(own, ReleasedParameter) and own.index is not None:
        held.add(own.index)
    if isinstance(effect, ReleasedParameter):
        held = set(effect.without(held))
    fit = refitted(without, found, sorted(held), best)
    if fit is None:
        return None
    remainder = remainder_of(fit, found.data, found.noise)
    fit = replace(fit, error_scale=remainder.error_scale)
    return replace(
        found,
        improved=fit,
        steps=_reordered(found.steps, number, effect),
        remainder=remainder,
        held=tuple(sorted(held)),
        named=found.named._replace(fit=fit, remainder=remainder),
    )


def _reordered(steps: Sequence[Step], number: int, effect: Effect) -> tuple[Step, ...]:
    """Return the steps with an effect moved to the front of its rivals at one of them."""
    own = [rival for rival in steps[number].rivals if rival.lead.effect.key == effect.key]
    rest = [rival for rival in steps[number].rivals if rival.lead.effect.key != effect.key]
    after = list(steps)
    after[number] = replace(steps[number], rivals=(*own, *rest))
    if number + 1 < len(steps):
        # The next step is tested without its own effect: start from this model.
        after[number + 1] = replace(steps[number + 1], before=own[0].fit)
    return tuple(after)
