"""What is likelier in the end goes before what was taken first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from pendpipe.diagnose.begin import Beginning
from pendpipe.diagnose.evidence import Rival
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.released_parameters import ReleasedParameter
from pendpipe.diagnose.remainder import remainder_of
from pendpipe.diagnose.search import Search
from pendpipe.diagnose.state import Step
from pendpipe.diagnose.weighing import Weighed, refitted, weigh
from pendpipe.effects import Effect

_LIKELIER: Final = 1.5
"""By how much another must be more probable to take an effect's place."""
_TOLD_FROM: Final = 20.0
"""The same for a curve in the place of a name. Names go before curves that the record cannot tell
from them: at odds of one in twenty it can."""


def swap_in_likelier(found: Search, beginning: Beginning) -> tuple[Search, tuple[Weighed, ...]]:
    """Put what is likelier in the end in the place of what was taken first; weigh all steps.

    A search takes what improves a gross misfit most; where much is left that no model explains,
    a little more of the gain means nothing, and what is known beforehand decides. And what was
    added later, or the noise as it was judged last, may have turned the odds.
    """
    weighed = [weigh(found, beginning, step) for step in found.steps]
    # Where a curve has been drawn over what the names leave, they stay: their probabilities say
    # how little they explain.
    if found.named.fit.model is not found.improved.model:
        return found, tuple(weighed)
    for place in range(len(found.steps)):
        best = _likeliest(found, found.steps[place], weighed[place])
        after = _exchanged(found, place, best, weighed[place].without) if best else None
        if after is not None:
            found = after
            weighed = [weigh(found, beginning, step) for step in found.steps]
    return found, tuple(weighed)


def _likeliest(found: Search, step: Step, weighed: Weighed) -> Rival | None:
    """Who may take the place of a step's winner, and is likelier by enough."""
    present = {effect.key for effect in found.improved.model.effects}
    own = step.winner
    likelier = [
        (float(weight), mate)
        for mate, weight in zip(weighed.mates, weighed.weights[1:], strict=False)
        if mate.lead.effect.key not in present
        # Of what no model explains curves are drawn already, over the names.
        and not (mate.drawn and found.remainder.systematic)
        and weight
        > weighed.weights[0] * (_TOLD_FROM if mate.drawn and not own.drawn else _LIKELIER)
    ]
    return max(likelier, key=lambda each: each[0], default=(0.0, None))[1]


def _exchanged(found: Search, place: int, best: Rival, without: Fit) -> Search | None:
    """Take a rival in the place of a step's winner; None where the model can't move so."""
    step, effect = found.steps[place], best.lead.effect
    own, held = step.winner.lead.effect, set(found.held)
    # A held part of b is no index: the model knows of it.
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
        steps=_reordered(found.steps, place, effect),
        remainder=remainder,
        held=tuple(sorted(held)),
        named=found.named._replace(fit=fit, remainder=remainder),
    )


def _reordered(steps: Sequence[Step], place: int, effect: Effect) -> tuple[Step, ...]:
    """The steps with an effect's rivals first at one of them, all as they were found."""
    # What they weigh in the end is no gain.
    own = [rival for rival in steps[place].rivals if rival.lead.effect.key == effect.key]
    rest = [rival for rival in steps[place].rivals if rival.lead.effect.key != effect.key]
    after = list(steps)
    after[place] = replace(steps[place], rivals=(*own, *rest))
    if place + 1 < len(steps):
        # What came next is judged without its effect: this is where that model is near.
        after[place + 1] = replace(steps[place + 1], before=own[0].fit)
    return tuple(after)
