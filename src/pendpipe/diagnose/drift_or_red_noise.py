"""Whether what passes for red noise is an effect: a step or a drift is red as well."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pendpipe.diagnose import Progress
from pendpipe.diagnose.chance import CATALOGUE_SHARE, RED_NOISE_SHARE, Trials
from pendpipe.diagnose.colour import REFERENCE_HZ
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.detect import detect, prepare
from pendpipe.diagnose.evidence import Rival
from pendpipe.diagnose.naming import refit_leads
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.diagnose.state import State, settled
from pendpipe.effects import Effect


def reconsider_red_noise(
    state: State, effects: Sequence[Effect], level: float, seed: int, progress: Progress
) -> None:
    """Ask whether what passes for red noise is an effect: a step or a drift is red as well.

    The noise is judged again by what the best effect leaves, were the noise not red; that
    judgement is taken where effect and noise together are likelier by 1/p, p this doubt's part
    of the level: what is normalised beats the true model by so much no more often (Markov).
    """
    share = level * RED_NOISE_SHARE
    progress("the noise is red: is it an effect?")
    effects = [effect for effect in effects if effect.kind != "unnamed"]
    assert state.now is not None
    fit, data, noise = settled(state.fit, state.data, state.noise, state.holding, red=False)
    other = detect(prepare(fit, data, noise, effects), fit, seed=seed, known=state.now)
    if other.p_value > level * CATALOGUE_SHARE:
        return
    rivals = refit_leads(
        fit, data, noise, other, held=state.holding, gross=False, most=3, origin=state.origin
    )
    if not rivals:
        return
    extended, data, noise = settled(rivals[0].fit, data, noise, state.holding)
    gained = _badness(state.fit, state.data, state.noise) - _badness(extended, data, noise)
    by_chance = math.exp(0.5 * min(_cost(state, rivals[0]) - gained, 0.0))
    if by_chance > share:
        return
    fit = refine(state.fit.model, data, noise, state.fit.value, held=state.holding)
    state.fit, state.data, state.noise = fit, data, noise
    found = detect(prepare(fit, data, noise, effects), fit, seed=seed, known=state.now)
    # As rare in the catalogue's share of the level as it is in this doubt's.
    rare = by_chance * CATALOGUE_SHARE / RED_NOISE_SHARE
    state.now = replace(found, p_value=max(found.p_value, rare))
    state.first = state.now if not state.steps else state.first


def _cost(state: State, rival: Rival) -> float:
    """What must be gained: the shapes that were tried, and how finely its size is told.

    chi^2 of one size is beyond g with a probability below exp(-g/2), so that an effect of one
    size that acts throughout is charged for its shapes alone. Red noise has a step or a slow
    wave at any instant or frequency: there a size that is known to one part in g^(1/2) was one
    among as many (Laplace). A tone was looked for in every second cosine.
    """
    assert state.now is not None
    effect, gain = rival.lead.effect, max(rival.gain, 1.0)
    by_frequency = Trials(0.5 * len(state.data), 0.0)
    own = state.now.chance.own.get(effect.key)
    trials = own or (by_frequency if effect.spectral else Trials(1.0, 0.0))
    sought = effect.local or effect.spectral
    charged = effect.sizes if sought else effect.sizes - 1
    return 2.0 * math.log(trials.number_at(-0.5 * gain)) + charged * math.log(gain)


def _badness(fit: Fit, data: Data, noise: Noise) -> float:
    """Minus twice the log-likelihood, the noise's part included, and what its colour costs.

    Strength and slope are told by the cosines below the reference (Schwarz).
    """
    found = fit.chi2 + float(np.sum(np.log(noise.variance)))
    if noise.red <= 0.0:
        return found
    slow = 2.0 * REFERENCE_HZ * float(data.time_s[-1] - data.time_s[0])
    return found + 2.0 * math.log(max(slow, 1.0))
