"""What is said of each effect in the end: its rivals with all the others in the model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.begin import Beginning
from pendpipe.diagnose.evidence import MISSHAPEN, Rival, of_one_class, probabilities
from pendpipe.diagnose.instants import with_instants
from pendpipe.diagnose.location import locate
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.diagnose.refits import useful_chi2
from pendpipe.diagnose.released_parameters import ReleasedParameter
from pendpipe.diagnose.result import FoundEffect
from pendpipe.diagnose.review import stands_apart
from pendpipe.diagnose.search import Search
from pendpipe.diagnose.state import Fault, Step, is_gross
from pendpipe.diagnose.values import curve_values, effect_parameters
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.baseline import BASELINE
from pendpipe.effects.curves import Curve
from pendpipe.effects.model import Model

_CLEAN: Final = 5.0
"""What a model that leaves nothing takes off the evidence (in chi^2) that it is none of the
class's: one lone name in thirteen is wrong then, as on opened challenges."""
_LISTED: Final = 0.05
"""Probability from which a curve without a name is listed beside names."""
_OF_THE_REST: Final = ("jitter", "broadband-drive", "coloured-noise")
"""Faults that are seen in what a model leaves: a curve's own misfit looks like any of them."""
_SAME: Final = 0.02
"""Part by which a gain may change in the end for its rivals not to be refitted."""


class Weighed(NamedTuple):
    """An effect and its rivals, with all the others in the model.

    Parameters
    ----------
    without
        The model without it, fitted.
    gain
        Delta chi^2 of the effect beside all others.
    mates
        What the recording cannot tell from it, the best of each identifier.
    weights
        Probabilities of the effect, of its mates, and of none of them.
    """

    without: Fit
    gain: float
    mates: tuple[Rival, ...]
    weights: FloatArray


def weigh(found: Search, beginning: Beginning, step: Step) -> Weighed:
    """Weigh one effect against its rivals with all the others in the model."""
    effect = step.winner.lead.effect
    found = beside(found, effect)
    without, rivals = _rivalry(found, beginning, step)
    gain = without.chi2 - found.improved.chi2
    own = next((rival for rival in rivals if rival.lead.effect.key == effect.key), step.winner)
    own = _weighed(found, own, gain, gain)
    others = [
        _weighed(found, rival, rival.gain, gain)
        for rival in rivals
        if rival.identifier != effect.identifier
    ]
    mates = _best_of_each([mate for mate in others if of_one_class(own, mate)])
    # What every pendulum has is likelier than its rivals beforehand, and than none of them.
    # Of a curve that follows whatever has happened it says little that it leaves nothing.
    follows = isinstance(effect, Curve) and effect.of_anything
    none = own.evidence - max(own.prior, 0.0) - (0.0 if follows else _misfit(found))
    weights = probabilities([own, *mates], none)
    if not stands_apart(effect, found.improved):
        weights = weights * _explained(found, effect, gain)
    return Weighed(without, gain, tuple(mates), weights)


def beside(found: Search, effect: Effect) -> Search:
    """What has been found, as an effect is judged beside it."""
    if effect.kind == "unnamed":
        return found
    # A curve drawn over what the names leave could imitate any of them.
    return replace(found, improved=found.named.fit, remainder=found.named.remainder)


def effect_named(found: Search, step: Step, weighed: Weighed) -> FoundEffect:
    """One effect, with what is said of it in the end."""
    effect = step.winner.lead.effect
    found = beside(found, effect)
    without, gain, mates, weights = weighed
    return FoundEffect(
        effect.identifier,
        effect.name,
        effect.kind,
        effect.equation,
        with_instants(
            effect_parameters(found.improved, effect, found.data.unit),
            effect,
            without,
            found.noise,
            found.improved.error_scale,
        ),
        gain,
        step.p_value,
        float(weights[0]),
        tuple(
            (mate.identifier, float(weight))
            for mate, weight in zip(mates, weights[1:], strict=False)
            if weight > _LISTED or not mate.drawn
        ),
        effect.discriminating_test,
        locate(without, found.improved, found.data, effect),
        curve_values(found.improved, effect, found.data.unit)
        if isinstance(effect, Curve)
        else None,
    )


def _best_of_each(rivals: Sequence[Rival]) -> list[Rival]:
    """One of each identifier, the best first: several curves may draw what has no name."""
    best: dict[str, Rival] = {}
    for rival in sorted(rivals, key=lambda rival: -rival.evidence):
        best.setdefault(rival.identifier, rival)
    return list(best.values())


def _weighed(found: Search, rival: Rival, gain: float, best: float) -> Rival:
    """A rival as its gain counts beside the best, where much is left that no model explains."""
    if not found.remainder.systematic:
        return rival
    # Relative to what the best leaves: m ln(excess) counts, for m independent numbers. As much
    # as real laws leave to the catalogue's forms is no distance either.
    behind, left = max(best - gain, 0.0), found.remainder.excess + MISSHAPEN * max(best, 0.0)
    worth = -found.remainder.numbers * math.log1p(behind / max(left, 1.0))
    return replace(rival, gain=worth, evidence=worth + rival.prior)


def _explained(found: Search, effect: Effect, gain: float) -> float:
    """The part of the misfit that an effect explains: it is believed no more than that.

    What a curve without a name describes beside it is not explained.
    """
    curves = [step.winner for step in found.steps if step.winner.drawn]
    open_still = sum(each.gain for each in curves if each.lead.effect is not effect)
    if found.remainder.systematic:
        open_still += found.remainder.excess
    return max(gain, 0.0) / max(max(gain, 0.0) + open_still, 1.0)


def fault_named(found: Search, fault: Fault) -> FoundEffect:
    """A fault of the measurement that a test of its own has found."""
    from pendpipe.effects.catalogue import by_identifier

    finding = fault.finding
    effect = by_identifier(finding.identifier)
    doubt = math.exp(-0.5 * _misfit(found))
    # What would have given the very same codes is as likely.
    each = 1.0 / (1.0 + len(finding.also) + doubt)
    if finding.identifier in _OF_THE_REST:
        each *= _explained(found, effect, finding.delta_chi2)
    return FoundEffect(
        effect.identifier,
        effect.name,
        effect.kind,
        effect.equation,
        finding.parameters,
        finding.delta_chi2,
        fault.p_value,
        each,
        tuple((name, each) for name in finding.also),
        effect.discriminating_test,
        replace(finding.location, summary=finding.summary),
    )


def _misfit(found: Search) -> float:
    """How much of the doubt a model that leaves nothing takes away."""
    return _CLEAN if found.unexplained > 0.01 else 0.0


def _rivalry(found: Search, beginning: Beginning, step: Step) -> tuple[Fit, Sequence[Rival]]:
    """The model without one effect, and who else could take its place in it."""
    effect = step.winner.lead.effect
    held = list(found.held)
    model, value = found.improved.model.dropping(effect, found.improved.value)
    if isinstance(effect, ReleasedParameter) and effect.index is not None:
        held.append(effect.index)
        value[effect.index] = beginning.value[effect.index]
    bare = np.concatenate([found.baseline.value, value[len(BASELINE) :]])
    without = _refined(model, found, held, value, bare, step.before.value) or step.before
    gain = without.chi2 - found.improved.chi2
    same = abs(gain - step.winner.gain) < _SAME * gain
    if len(found.steps) == 1 and same and not is_gross(without, found.data):
        return without, step.rivals
    # Even whom the search left far behind: how far that is depends on the noise and on the other
    # effects, and both were others then.
    useful = without.chi2
    if not found.remainder.systematic:
        useful = useful_chi2(found.improved.chi2, gain, drawn=step.winner.drawn)
    rivals = []
    for rival in step.rivals:
        own = rival.lead.effect.key == effect.key
        fit = found.improved if own else refitted(without, found, held, rival, useful)
        if fit is not None:
            rivals.append(rival.reaching(fit, without.chi2 - fit.chi2))
    return without, rivals


def _refined(
    model: Model,
    found: Search,
    held: Sequence[int],
    *starts: FloatArray,
    useful: float = math.inf,
) -> Fit | None:
    """The best fit of a model from several starts; None if it can't move from any."""
    fits = []
    for start in starts:
        if len(start) != model.size:
            continue
        try:
            fits.append(refine(model, found.data, found.noise, start, held=held, useful=useful))
        except (NoMotionError, np.linalg.LinAlgError):
            continue
        if fits[-1].converged and not is_gross(fits[-1], found.data):
            break
    return min(fits, key=lambda fit: fit.chi2, default=None)


def refitted(
    without: Fit, found: Search, held: Sequence[int], rival: Rival, useful: float = math.inf
) -> Fit | None:
    """Refit a rival in the final model, from where it ended before, as far as it is of use."""
    effect = rival.lead.effect
    if isinstance(effect, ReleasedParameter):
        held = effect.without(held)
    own = rival.fit.value[len(rival.fit.value) - effect.count :]
    start = np.concatenate([without.value, own])
    return _refined(
        without.model.adding(effect), found, held, start, rival.fit.value, useful=useful
    )
