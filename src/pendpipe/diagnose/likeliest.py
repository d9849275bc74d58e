"""The name that is likelier in the end goes before the one that was taken first."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from pendpipe.diagnose.begin import Beginning
from pendpipe.diagnose.freed import FreedParameter
from pendpipe.diagnose.remainder import remainder_of
from pendpipe.diagnose.search import Search
from pendpipe.diagnose.weighing import refitted, weigh

_LIKELIER: Final = 1.5
"""By how much another name must be more probable to take an effect's place."""


def with_likeliest(found: Search, beginning: Beginning) -> Search:
    """Put the name that is likelier in the end in the place of the one that was taken first.

    A search takes what improves a gross misfit most; where much is left that no model explains,
    a little more of the gain means nothing, and what is known beforehand decides.
    """
    if not found.remainder.systematic or any(step.winner.drawn for step in found.steps):
        return found
    for place, step in enumerate(found.steps):
        weighed = weigh(found, beginning, step)
        names = [
            (float(weight), mate) for mate, weight in
            zip(weighed.mates, weighed.weights[1:], strict=False)
            if not mate.drawn and not isinstance(mate.lead.effect, FreedParameter)
        ]  # fmt: skip
        most, best = max(names, key=lambda each: each[0], default=(0.0, step.winner))
        if most < _LIKELIER * weighed.weights[0]:
            continue
        fit = refitted(weighed.without, found, list(found.held), best)
        if fit is None:
            continue
        remainder = remainder_of(fit, found.data, found.noise)
        fit = replace(fit, spread=remainder.spread)
        key = best.lead.effect.key
        # As it was found: what it weighs in the end is no gain.
        own = [rival for rival in step.rivals if rival.lead.effect.key == key]
        rest = [rival for rival in step.rivals if rival.lead.effect.key != key]
        steps = list(found.steps)
        steps[place] = replace(step, rivals=(*own, *rest))
        found = replace(
            found, improved=fit, steps=tuple(steps), remainder=remainder,
            named=found.named._replace(fit=fit, remainder=remainder),
        )  # fmt: skip
    return found
