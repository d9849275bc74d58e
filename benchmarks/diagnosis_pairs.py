"""Whether a recording of two effects asks for two: how much better they fit than any one thing.

The challenge's oracle sizes each of a pair beside the other at given shapes. One law with a
shape that is free, or a curve, may do as well as both (a relaxing drift of the frequency as a
straight one and a cubic torque): then no method can say that there are two.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pendpipe.diagnose.refine import Fit
    from pendpipe.diagnose.run import Outcome
    from pendpipe.effects import Effect

_TRIED = 24
"""Pairs of shapes from which the two true effects are fitted."""


def over_one(outcome: Outcome, truths: Sequence[str]) -> float | None:
    """By how much chi^2 (two a free value counted) two effects are better than the best single.

    Singles are all that the search refitted first, and its answer where that is one effect;
    pairs are the two true ones, and the answer where it holds two. None where no pair moves.
    """
    pairs = [*_pair_fits(outcome, truths), *_answer(outcome, at_least=2)]
    singles = [*_single_fits(outcome), *_answer(outcome, at_least=1, at_most=1)]
    if not pairs or not singles:
        return None
    return min(map(_cost, singles)) - min(map(_cost, pairs))


def _cost(fit: Fit) -> float:
    from pendpipe.diagnose.one_curve import cost

    return cost(fit)


def _answer(outcome: Outcome, *, at_least: int, at_most: int = 9) -> list[Fit]:
    found = outcome.search
    named = len(found.steps)
    return [found.improved] if at_least <= named <= at_most else []


def _single_fits(outcome: Outcome) -> Iterator[Fit]:
    found = outcome.search
    if not found.steps:
        return
    for rival in found.steps[0].rivals:
        effect = rival.lead.effect
        own = rival.fit.value[len(rival.fit.value) - effect.count :]
        yield from _fit(outcome, [(effect, own)])


def _pair_fits(outcome: Outcome, truths: Sequence[str]) -> Iterator[Fit]:
    from pendpipe.effects.catalogue import by_identifier

    effects = [by_identifier(name) for name in truths]
    starts = list(product(*(_starts(effect, outcome) for effect in effects)))
    # Spread over all: a scan's first shapes are neighbours.
    for start in starts[:: max(len(starts) // _TRIED, 1)]:
        yield from _fit(outcome, list(zip(effects, start, strict=True)))


def _starts(effect: Effect, outcome: Outcome) -> list[Any]:
    """Values from which an effect is fitted: no size yet, and each shape of its scan."""
    shapes = effect.shapes(outcome.search.baseline.at.span)
    return [np.array([*np.zeros(effect.sizes), *shape]) for shape in shapes]


def _fit(outcome: Outcome, effects: Sequence[tuple[Effect, Any]]) -> Iterator[Fit]:
    """Fit some effects under the noise that was judged last, if the model moves."""
    from pendpipe.diagnose.refine import refine
    from pendpipe.dynamics.any_law import NoMotionError

    found = outcome.search
    model, value = found.baseline.model, found.baseline.value
    for effect, own in effects:
        model, value = model.adding(effect), np.concatenate([value, own])
    try:
        yield refine(model, found.data, found.noise, value, held=outcome.beginning.held)
    except (NoMotionError, np.linalg.LinAlgError):
        return
