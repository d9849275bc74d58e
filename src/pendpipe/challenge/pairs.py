"""Two effects in one recording."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.challenge.bench import Bench, Point
from pendpipe.challenge.item import Item, effect_truth, judge, oracle_truth, truth_of
from pendpipe.challenge.registry import hide
from pendpipe.challenge.scenario import Scenario, draw_scenario
from pendpipe.challenge.singles import TRIES, easier
from pendpipe.challenge.sizing import Sized, size

OWN_LEVEL = 13.0
"""Where the oracle counts one of two known effects as found: 1 % for an effect without scan."""


def make_pair(
    random: np.random.Generator, first: str, second: str, delta_chi2: tuple[float, float], *,
    cancelling: bool = False, marginal: bool = False, own_form: bool | None = None,
    oracle: bool = True, **scenario_options: Any,
) -> Item:  # fmt: skip
    """Hide two effects at once.

    ``marginal_delta_chi2`` of each is what is left of it when the other one is known.

    Parameters
    ----------
    delta_chi2
        Of each alone.
    cancelling
        Give the second effect the sign that hides the first, where it has a sign.
    marginal
        Size each by its marginal Delta chi^2 instead (approximately).
    own_form
        Ask for laws that are (or are not) the catalogue's own.
    """
    for _ in range(TRIES):
        found = _draw(random, first, second, delta_chi2, own_form, easier(scenario_options))
        if found is None:
            continue
        prepared, a, b, inner = found
        cosine = inner / np.sqrt(a.delta_chi2 * b.delta_chi2)
        if marginal:
            share = 1.0 - min(cosine**2, 0.999)
            more = size(a.hidden, delta_chi2[0] / share)
            other = size(b.hidden, delta_chi2[1] / share)
            if more is None or other is None:
                continue
            a, b = more, other
        strength = -b.strength if cancelling and inner > 0 else b.strength
        scenario = b.hidden.build(a.hidden.build(prepared, a.strength), strength)
        bench = a.bench if a.bench.count <= b.bench.count else b.bench
        point, _, total = bench.refit(scenario.reading_rad(np.random.default_rng(0)))
        if not np.isfinite(total):
            continue
        codes = scenario.record(random)
        effects = [effect_truth(a), effect_truth(b)]
        effects[1]["parameters"] = b.hidden.truth(strength)
        for entry in effects:
            entry["marginal_delta_chi2"] = entry["delta_chi2"] * (1.0 - cosine**2)
        truth = truth_of("combination", bench.scenario, effects, bench)
        truth |= {"cosine": cosine, "total_delta_chi2": total, "cancelling": cancelling}
        if oracle:
            truth["oracle"] = oracle_truth(judge(bench, point, scenario, codes), first)
            both = _found(bench, point, scenario.chain.step_rad * codes.astype(np.float64), a, b)
            truth["oracle"]["found_each"] = both
        return Item(scenario, codes, truth)
    raise ValueError(f"{first} with {second} can't be made at {delta_chi2}")


def _draw(
    random: np.random.Generator, first: str, second: str, wanted: tuple[float, float],
    own_form: bool | None, options: dict[str, Any],
) -> tuple[Scenario, Sized, Sized, float] | None:  # fmt: skip
    """Size each alone on the same pendulum.

    Returns
    -------
    prepared, first, second, product
        What both need, each at its strength, and the inner product of what they leave.
    """
    drawn: Scenario = draw_scenario(random, **options)
    one = hide(random, first, drawn, own_form=own_form)
    two = hide(random, second, one.prepared, own_form=own_form)
    # What the second needs (a release from rest, say) holds for the first as well.
    one = replace(one, prepared=two.prepared)
    if one.moves and two.moves:
        return None
    # An effect whose strength is the amplitude itself decides where the other one is sized.
    a = None if two.moves else size(one, wanted[0])
    b = size(replace(two, prepared=a.without) if a and one.moves else two, wanted[1])
    if two.moves and b is not None:
        a = size(replace(one, prepared=b.without), wanted[0])
    if a is None or b is None:
        return None
    count = min(len(a.residual), len(b.residual))
    return two.prepared, a, b, float(a.residual[:count] @ b.residual[:count])


def _found(bench: Bench, point: Point, angle: FloatArray, a: Sized, b: Sized) -> list[bool]:
    """Whether each is significant when the other one is fitted too."""
    noisy = bench.whiten((angle - bench.reading(point))[bench.kept])
    answers = []
    for own, other in ((a.residual, b.residual), (b.residual, a.residual)):
        own, other = own[: bench.count], other[: bench.count]
        size_other = float(other @ other)
        left = own - other * (float(own @ other) / size_other if size_other > 0.0 else 0.0)
        length = float(np.linalg.norm(left))
        score = float(left @ noisy / length) ** 2 if length > 0.0 else 0.0
        answers.append(score > OWN_LEVEL)
    return answers
