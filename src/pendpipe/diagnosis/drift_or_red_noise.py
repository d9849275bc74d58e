"""Drift or red noise: both have power at low frequencies, and a step has too."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.chance import CATALOGUE_SHARE, RED_NOISE_SHARE, Trials
from pendpipe.diagnosis.detect import detect, prepare
from pendpipe.diagnosis.evidence import Rival
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.refits import refit_leads
from pendpipe.diagnosis.state import State, settled
from pendpipe.effects import Effect


def reconsider_red_noise(
    state: State, effects: Sequence[Effect], level: float, seed: int, progress: Progress
) -> None:
    """Test whether apparent red noise is an effect, and re-estimate the noise if so.

    The best effect for noise that is not red is fitted, and the noise is estimated from what it
    leaves. This replaces red noise if effect and noise together are more likely by a factor 1/p,
    where p is this test's part of the significance level: a normalised density exceeds that of
    the true model by 1/p with a probability of at most p (Markov).

    Parameters
    ----------
    state
        The search so far; its noise, and the scan with it, are replaced.
    effects
        What may be missing.
    level, seed
        The significance level; the seed of the draws that count trials.
    progress
        Receives one line.
    """
    share = level * RED_NOISE_SHARE
    progress("testing whether the red noise is a drift or a step")
    effects = [effect for effect in effects if effect.kind != "unnamed"]
    assert state.now is not None
    fit, data, noise = settled(state.fit, state.data, state.noise, state.held, red=False)
    other = detect(prepare(fit, data, noise, effects), fit, seed=seed, known=state.now)
    if other.p_value > level * CATALOGUE_SHARE:
        return
    rivals = refit_leads(
        fit, data, noise, other, held=state.held, phase_lost=False, most=3, origin=state.origin
    )
    if not rivals:
        return
    extended, data, noise = settled(rivals[0].fit, data, noise, state.held)
    gained = state.fit.chi2 + state.noise.cost - extended.chi2 - noise.cost
    by_chance = math.exp(0.5 * min(_charge(state, rivals) - gained, 0.0))
    if by_chance > share:
        return
    fit = refine(state.fit.model, data, noise, state.fit.value, held=state.held)
    state.fit, state.data, state.noise = fit, data, noise
    found = detect(prepare(fit, data, noise, effects), fit, seed=seed, known=state.now)
    # The same part of the catalogue's share of the level as of this test's share.
    rare = by_chance * CATALOGUE_SHARE / RED_NOISE_SHARE
    state.now = replace(found, p_value=max(found.p_value, rare))
    state.first = state.now if not state.steps else state.first


def _charge(state: State, rivals: Sequence[Rival]) -> float:
    """Return the charge for the effects and shapes that were tried, and for the fitted sizes.

    A size is known to one part in g^(1/2) of it, for a gain of g in chi^2 (Laplace). Tones are
    scanned at every second cosine.
    """
    assert state.now is not None
    effect, gain = rivals[0].lead.effect, max(rivals[0].gain, 1.0)
    by_frequency = Trials(0.5 * len(state.data), 0.0)
    own = state.now.chance.own.get(effect.key)
    trials = own or (by_frequency if effect.spectral else Trials(1.0, 0.0))
    tried = trials.number_at(-0.5 * gain) * len(rivals)
    return 2.0 * math.log(tried) + effect.sizes * math.log(gain)
