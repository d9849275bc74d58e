"""Whether a recording of two effects asks for two: how much better they fit than any one thing.

The challenge's oracle sizes each of a pair beside the other at given shapes. One law with a
shape that is free, or a curve, may do as well as both (a relaxing drift of the frequency as a
straight one and a cubic torque): then no method can say that there are two.
"""

from __future__ import annotations

import math
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
    and the answer where it holds two. Infinite where the true pair can't be fitted: it counts
    as needed then.
    """
    from pendpipe.diagnose.one_curve import cost
    from pendpipe.diagnose.weighing import refitted

    found, held = outcome.search, outcome.beginning.held
    singles, pairs = [found.baseline, *_answer(outcome, 1)], _answer(outcome, 2)
    for first, second in permutations(truths, 2):
        alone = _added(outcome, found.baseline, first)
        singles += alone
        pairs += [both for one in alone for both in _added(outcome, one, second)]
    rivals = found.steps[0].rivals if found.steps else ()
    fits = [refitted(found.baseline, found, held, rival) for rival in rivals]
    singles += [fit for fit in fits if fit is not None]
    return min(map(cost, singles)) - min(map(cost, pairs), default=-math.inf)


def _answer(outcome: Outcome, effects: int) -> list[Fit]:
    found = outcome.search
    return [found.improved] if len(found.steps) == effects else []


def _added(outcome: Outcome, base: Fit, name: str) -> list[Fit]:
    """The fit with one more effect of a given name, at the shape its scan finds, if it moves."""
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
