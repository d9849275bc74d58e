"""Alternatives to missing physics: wrong held parameters, red noise.

Parameters are tried first: if held parameters, released together, explain as much as the best
effect or curve, nothing need be missing. Of these parameters only those that are needed are
reported. A drift, a step and red noise all have power at low frequencies.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.detect import CATALOGUE_SHARE, RED_NOISE_SHARE, Trials, detect, prepare
from pendpipe.diagnosis.evidence import SIZE_CHARGE, Rival
from pendpipe.diagnosis.hypothesis import FURTHER, Hypothesis, settled
from pendpipe.diagnosis.refine import Fit, best_fit, refine
from pendpipe.diagnosis.refits import refit_leads
from pendpipe.diagnosis.released_parameters import ReleasedParameter


def prefer_parameters(state: Hypothesis, rivals: Sequence[Rival]) -> list[Rival]:
    """Put a held parameter first if such parameters alone explain as much as any effect.

    Parameters
    ----------
    state
        The model to which the effects would be added.
    rivals
        Refitted effects, every held parameter among them; the best first.

    Returns
    -------
    list
        The same rivals; of the fewest held parameters needed, the one that gains most leads.
    """
    released = [rival for rival in rivals if isinstance(rival.lead.effect, ReleasedParameter)]
    if not released or (len(released) == 1 and rivals[0] is released[0]):
        return list(rivals)
    most = _together(state, released)
    if most is None or not _do_as_well(state, most, released[:1], rivals):
        return list(rivals)
    needed, fit = _fewest(state, released, most)
    if not _do_as_well(state, fit, needed, rivals):
        return list(rivals)
    first = max(needed, key=lambda rival: rival.gain)
    return [first, *(rival for rival in rivals if rival is not first)]


def _fewest(state: Hypothesis, released: Sequence[Rival], most: Fit) -> tuple[Sequence[Rival], Fit]:
    """Return the fewest parameters to which no other adds more than chance, and their fit."""
    for number in range(1, len(released)):
        tried = [(some, _together(state, some)) for some in combinations(released, number)]
        fits = [(some, fit) for some, fit in tried if fit is not None]
        some, best = min(fits, key=lambda each: each[1].chi2, default=(released, most))
        if best.chi2 - most.chi2 < SIZE_CHARGE * _unit(released[0]) * (len(released) - number):
            return some, best
    return released, most


def _together(state: Hypothesis, released: Sequence[Rival]) -> Fit | None:
    """Fit the model with some held parameters released."""
    if len(released) == 1:
        return released[0].fit
    model, held = state.fit.model, state.held
    for rival in released:
        effect = rival.lead.effect
        assert isinstance(effect, ReleasedParameter)
        model, held = model.adding(effect), effect.without(held)
    best = min(released, key=lambda rival: rival.fit.chi2)
    return best_fit(model, state.data, state.noise, [best.fit.value], held=held)


def _do_as_well(
    state: Hypothesis, fit: Fit, needed: Sequence[Rival], rivals: Sequence[Rival]
) -> bool:
    """Whether wrong parameters explain as much as each effect and curve.

    A single wrong parameter has a high prior. Several must be better than one effect that does as
    well alone, by the margin that two effects need.
    """
    one, more = needed[0], len(needed) - 1
    worth = (
        (state.fit.chi2 - fit.chi2) / _unit(one) - SIZE_CHARGE * more + (0.0 if more else one.prior)
    )
    return all(
        worth >= rival.evidence + (FURTHER if more and not rival.drawn else 0.0)
        for rival in rivals
        if not isinstance(rival.lead.effect, ReleasedParameter)
    )


def _unit(rival: Rival) -> float:
    """Return the chi^2 that counts as 1."""
    return rival.gain / rival.worth if rival.worth > 0.0 else 1.0


def reconsider_red_noise(
    state: Hypothesis, level: float, seed: int, progress: Progress
) -> Hypothesis:
    """Test whether apparent red noise is an effect, and re-estimate the noise if so.

    No tone is asked: red noise has no line. The best effect for noise that is not red is fitted,
    and the noise is estimated from what it leaves. This replaces red noise if effect and noise
    together are more likely by a factor 1/p, where p is this test's part of the significance level:
    a normalised density exceeds that of the true model by 1/p with a probability of at most p
    (Markov).

    Parameters
    ----------
    state
        The search so far, with its scan; that and the noise are replaced.
    level, seed
        The significance level; the seed of the draws that count trials.
    progress
        Receives one line.
    """
    share = level * RED_NOISE_SHARE
    progress("testing whether the red noise is a drift or a step")
    assert state.scanned is not None
    effects = [each for each in state.scanned[-1] if each.kind != "unnamed" and not each.spectral]
    fit, data, noise = settled(state.fit, state.data, state.noise, state.held, red=False)
    other = detect(prepare(fit, data, noise, effects), fit, seed=seed, known=state.scan)
    if other.p_value > level * CATALOGUE_SHARE:
        return state
    rivals = refit_leads(fit, data, noise, other, held=state.held, phase_lost=False, most=3)
    if not rivals:
        return state
    extended, data, noise = settled(rivals[0].fit, data, noise, state.held)
    gained = state.fit.chi2 + state.noise.cost - extended.chi2 - noise.cost
    by_chance = math.exp(0.5 * min(_charge(state, rivals) - gained, 0.0))
    if by_chance > share:
        return state
    fit = refine(state.fit.model, data, noise, state.fit.value, held=state.held)
    found = detect(prepare(fit, data, noise, effects), fit, seed=seed, known=state.scan)
    # The same part of the catalogue's share of the level as of this test's share.
    rare = by_chance * CATALOGUE_SHARE / RED_NOISE_SHARE
    now = replace(found, p_value=max(found.p_value, rare))
    first = state.first if state.steps else now
    return replace(state, fit=fit, data=data, noise=noise, now=now, first=first)


def _charge(state: Hypothesis, rivals: Sequence[Rival]) -> float:
    """Return the charge for the effects and shapes that were tried, and for the fitted sizes.

    A size is known to one part in g^(1/2) of it, for a gain of g in chi^2 (Laplace). Tones are
    scanned at every second cosine.
    """
    effect, gain = rivals[0].lead.effect, max(rivals[0].gain, 1.0)
    by_frequency = Trials(0.5 * len(state.data), 0.0)
    own = state.scan.chance.own.get(effect.key)
    trials = own or (by_frequency if effect.spectral else Trials(1.0, 0.0))
    tried = trials.number_at(-0.5 * gain) * len(rivals)
    return 2.0 * math.log(tried) + effect.sizes * math.log(gain)
