"""One effect after another, until nothing is left at the level asked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnose.begin import Beginning
from pendpipe.diagnose.chance import Trials
from pendpipe.diagnose.data import Data, with_lattice
from pendpipe.diagnose.detect import Detection, detect, prepare
from pendpipe.diagnose.faults import CATALOGUE_SHARE, Fault, Forensics, kicked_at_random
from pendpipe.diagnose.freed import FreedParameter
from pendpipe.diagnose.model import OMEGA
from pendpipe.diagnose.naming import Rival, refit_leads
from pendpipe.diagnose.noise import Noise, estimate_noise, white_noise
from pendpipe.diagnose.progress import Progress, silent
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.curves import CURVES

GROSS: Final = 2.0
"""chi^2 per degree of freedom above which scores to first order mean nothing."""
_SLIP: Final = 0.1
"""Phase in rad, likewise."""
_MOST: Final = 6
_NEEDED: Final = 9.0
"""Delta chi^2 below which an effect that others have joined is dropped again."""
_DOUBT: Final = 12.0
"""By how much (in -2 ln L) an effect must be better than red noise to be preferred."""
_PART: Final = 0.15
"""Part of a gross misfit that an effect must explain to be worth naming."""
_LEAST_STEP: Final = 0.1
"""Noise over step below which no model of a rounded reading is believed."""


@dataclass(frozen=True)
class Step:
    """One effect that was added.

    Parameters
    ----------
    rivals
        All that were refitted, the winner first.
    p_value
        Global, when it was found.
    before
        The model that it was added to.
    """

    rivals: tuple[Rival, ...]
    p_value: float
    before: Fit

    @property
    def winner(self) -> Rival:
        """The effect that was taken."""
        return self.rivals[0]


@dataclass(frozen=True)
class Search:
    """What a search has found.

    Parameters
    ----------
    data, noise
        The readings (masks included) and their noise as it was judged last.
    baseline
        The baseline's fit, under that noise.
    improved
        The extended model's fit (the baseline's where nothing was found).
    steps
        One an effect.
    faults
        Of the measurement, found by tests of their own.
    p_value
        Global, on the baseline: of the catalogue's largest score, and of the tests.
    unexplained
        Global p-value of what is left at the end.
    detection
        The first: of the baseline.
    """

    data: Data
    noise: Noise
    baseline: Fit
    improved: Fit
    steps: tuple[Step, ...]
    faults: tuple[Fault, ...]
    p_value: float
    unexplained: float
    detection: Detection
    held: tuple[int, ...] = field(default=())


def is_gross(fit: Fit, data: Data) -> bool:
    """Say whether a misfit is so large that sensitivities can't be trusted."""
    return fit.chi2 > GROSS * data.used or fit.slip_rad > _SLIP


def applicable(catalogue: Sequence[Effect], fit: Fit, baseline: str, unit: str) -> list[Effect]:
    """Choose the effects that a baseline may lack, and curves for what has no name."""
    value = fit.value
    present = {"a": value[0] > 0.0, "b": value[1] > 0.0, "c": value[2] > 0.0}
    used = {effect.identifier for effect in fit.model.effects}
    named = [
        effect
        for effect in catalogue
        if effect.template
        and baseline not in effect.inside
        and (unit == "rad" or not effect.angular)
        and all(present[name] for name in effect.needs)
        and (effect.identifier not in used or effect.local)
    ]
    drawn = {effect.key for effect in fit.model.effects}
    curves = [curve(fit.at.span) for curve in CURVES]
    return [*named, *(curve for curve in curves if curve.key not in drawn)]


@dataclass
class _State:
    """What a search knows so far."""

    fit: Fit
    data: Data
    noise: Noise
    holding: list[int]
    origin: FloatArray
    steps: list[Step] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    first: Detection | None = None
    now: Detection | None = None


def search(
    beginning: Beginning, samples: Samples, catalogue: Sequence[Effect], *, baseline: str,
    level: float, seed: int, freed: Sequence[FreedParameter] = (), progress: Progress = silent,
) -> Search:  # fmt: skip
    """Fit the baseline, and add what improves it most, until chance explains the rest."""
    data, held = beginning.data, beginning.held
    progress(f"fitting {baseline} to {data.used} readings")
    fit = refine(beginning.model, data, first_noise(beginning), beginning.value, held=held)
    state = _State(*settled(fit, data, first_noise(beginning), held), list(held), beginning.value)
    start = state.fit.value
    forensics = Forensics(samples, level)
    while len(state.steps) < _MOST:
        forensics.before(state, progress)
        if not _add_one(state, forensics, catalogue, freed, baseline, level, seed, progress):
            break
    _prune(state, beginning, progress)
    forensics.after(state, progress)
    assert state.first is not None
    assert state.now is not None
    base = refine(beginning.model, state.data, state.noise, start, held=held)
    return Search(
        state.data, state.noise, base, state.fit, tuple(state.steps), tuple(state.faults),
        min(state.first.p_value / CATALOGUE_SHARE, forensics.p_value, 1.0),
        min(state.now.p_value / CATALOGUE_SHARE, 1.0), state.first, tuple(state.holding),
    )  # fmt: skip


def _add_one(
    state: _State, forensics: Forensics, catalogue: Sequence[Effect],
    freed: Sequence[FreedParameter], baseline: str, level: float, seed: int, progress: Progress,
) -> bool:  # fmt: skip
    """Scan the catalogue, and add the best effect if it is needed; say whether to go on."""
    gross = is_gross(state.fit, state.data)
    effects = applicable(catalogue, state.fit, baseline, state.data.unit)
    open_parameters = [entry for entry in freed if entry.index in state.holding]
    progress(f"scanning {len(effects)} effects")
    scanner = prepare(state.fit, state.data, state.noise, [*effects, *open_parameters])
    state.now = detect(scanner, state.fit, seed=seed, known=state.now)
    state.first = state.first or state.now
    if state.now.p_value > level * CATALOGUE_SHARE and state.noise.red > 0.0 and not gross:
        _doubt_redness(state, [*effects, *open_parameters], level, seed, progress)
    if state.now.p_value > level * CATALOGUE_SHARE or _drawn(state):
        return False
    progress(f"something is there (p = {state.now.p_value:.2g}): refitting the leaders")
    rivals = refit_leads(
        state.fit,
        state.data,
        state.noise,
        state.now,
        held=state.holding,
        gross=gross,
        origin=state.origin,
    )
    if not gross and rivals and kicked_at_random(state, rivals[0], forensics, progress):
        return False
    if not rivals or rivals[0].gain <= max(_NEEDED, _PART * state.fit.chi2 if gross else 0.0):
        return False
    state.steps.append(Step(tuple(rivals), state.now.p_value / CATALOGUE_SHARE, state.fit))
    winner = rivals[0]
    progress(f"adding {winner.identifier}: Delta chi^2 = {winner.gain:.4g}")
    if isinstance(winner.lead.effect, FreedParameter):
        state.holding.remove(winner.lead.effect.index)
    state.fit, state.data, state.noise = settled(winner.fit, state.data, state.noise, state.holding)
    return True


def _prune(state: _State, beginning: Beginning, progress: Progress) -> None:
    """Drop what later effects have made needless."""
    for step in list(state.steps[:-1]):
        effect = step.winner.lead.effect
        if isinstance(effect, FreedParameter):
            continue
        model, value = beginning.model, state.fit.value[: len(beginning.value)]
        for other, place in state.fit.model.places():
            if other is not effect:
                model = model.adding(other)
                value = np.append(value, state.fit.value[place])
        try:
            without = refine(model, state.data, state.noise, value, held=state.holding)
        except NoMotionError:
            continue
        if without.chi2 - state.fit.chi2 < _NEEDED:
            progress(f"{effect.identifier} is needless now")
            state.fit = without
            state.steps.remove(step)


def _doubt_redness(
    state: _State, effects: Sequence[Effect], level: float, seed: int, progress: Progress
) -> None:
    """Ask whether what passes for red noise is an effect: a step or a drift is red as well.

    The noise is judged again by what the best effect leaves, were the noise not red; that
    judgement is taken where effect and noise together are clearly likelier.
    """
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
    own = state.now.chance.own.get(rivals[0].lead.effect.key, Trials(1.0, 0.0))
    cost = _DOUBT + 2.0 * math.log(own.first) + 3.0 * (rivals[0].lead.effect.sizes - 1)
    if _badness(extended, noise) + cost > _badness(state.fit, state.noise):
        return
    fit = refine(state.fit.model, data, noise, state.fit.value, held=state.holding)
    state.fit, state.data, state.noise = fit, data, noise
    state.now = detect(prepare(fit, data, noise, effects), fit, seed=seed, known=state.now)
    state.first = state.now if not state.steps else state.first


def _badness(fit: Fit, noise: Noise) -> float:
    """Minus twice the log-likelihood, the noise's part included."""
    return fit.chi2 + float(np.sum(np.log(noise.variance)))


def _drawn(state: _State) -> bool:
    """Whether a curve without a name was the last: nothing is named on top of it."""
    return bool(state.steps) and state.steps[-1].winner.lead.effect.kind == "unnamed"


def first_noise(beginning: Beginning) -> Noise:
    """White noise, from differences that the motion cannot touch."""
    data = beginning.data
    slope = None
    if data.time_noise:
        slope = beginning.model.evaluate(beginning.value).sampled.velocity
    return white_noise(data, beginning.noise_rms, slope)


def noise_left(fit: Fit, data: Data, *, red: bool = True) -> Noise:
    """Judge the noise by what a fit leaves."""
    frequency = fit.value[OMEGA] / (2.0 * np.pi)
    residual = data.residual(fit.at.reading)
    return estimate_noise(data, residual, frequency, _LEAST_STEP * data.step, red=red)


def settled(
    fit: Fit, data: Data, noise: Noise, held: Sequence[int], *, red: bool = True
) -> tuple[Fit, Data, Noise]:
    """Judge the noise anew where the model is near enough, and refit."""
    if is_gross(fit, data) or data.time_noise:
        return fit, data, noise
    data = with_lattice(data, fit.at.reading)
    noise = noise_left(fit, data, red=red)
    return refine(fit.model, data, noise, fit.value, held=held), data, noise
