"""Whether a recording of two effects asks for two: how much better they fit than any one thing.

The challenge's oracle sizes each of a pair beside the other at given shapes. One law with a
shape that is free, or a curve, may do as well as both (a relaxing drift of the frequency as a
straight one and a cubic torque): then no method can say that there are two.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pendpipe.diagnose.refine import Fit
    from pendpipe.diagnose.run import Outcome


def over_one(outcome: Outcome, truths: Sequence[str]) -> float:
    """By how much chi^2 (two a free value counted) two effects are better than the best single.

    Singles are the baseline alone, each true effect, all that the search refitted first, and
    its answer where that is one effect; pairs are the true ones, each found behind the other,
    and the answer where it holds two.
    """
    from pendpipe.diagnose.one_curve import cost

    singles, pairs = [outcome.search.baseline, *_answer(outcome, 1)], _answer(outcome, 2)
    for first, second in permutations(truths, 2):
        alone = _added(outcome, outcome.search.baseline, first)
        singles += alone
        pairs += [both for one in alone for both in _added(outcome, one, second)]
    singles += _first_rivals(outcome)
    return min(map(cost, singles)) - min(map(cost, pairs or singles))


def _answer(outcome: Outcome, effects: int) -> list[Fit]:
    found = outcome.search
    return [found.improved] if len(found.steps) == effects else []


def _added(outcome: Outcome, base: Fit, name: str) -> list[Fit]:
    """The best fit with one more effect of a given name, at the shape that its scan finds."""
    from pendpipe.diagnose.detect import detect, prepare
    from pendpipe.diagnose.naming import refit_leads
    from pendpipe.diagnose.state import is_gross
    from pendpipe.effects.catalogue import by_identifier

    found = outcome.search
    scanner = prepare(base, found.data, found.noise, [by_identifier(name)])
    lead = detect(scanner, base, seed=0, known=found.detection)
    rivals = refit_leads(
        base, found.data, found.noise, lead, held=outcome.beginning.held,
        gross=is_gross(base, found.data), origin=outcome.beginning.value,
    )  # fmt: skip
    return [rival.fit for rival in rivals]


def _first_rivals(outcome: Outcome) -> list[Fit]:
    """What the search refitted first, under the noise that was judged last."""
    import numpy as np

    from pendpipe.diagnose.refine import refine
    from pendpipe.dynamics.any_law import NoMotionError

    found, fits = outcome.search, []
    for rival in found.steps[0].rivals if found.steps else ():
        effect = rival.lead.effect
        own = rival.fit.value[len(rival.fit.value) - effect.count :]
        start = np.concatenate([found.baseline.value, own])
        model = found.baseline.model.adding(effect)
        try:
            fits.append(refine(model, found.data, found.noise, start, held=outcome.beginning.held))
        except (NoMotionError, np.linalg.LinAlgError):
            continue
    return fits
