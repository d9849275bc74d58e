"""One effect after another, until nothing is left at the level asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.diagnose.begin import Beginning
from pendpipe.diagnose.data import Data, with_lattice
from pendpipe.diagnose.detect import Detection, detect, prepare
from pendpipe.diagnose.faults import CATALOGUE_SHARE, Fault, Forensics
from pendpipe.diagnose.freed import FreedParameter
from pendpipe.diagnose.model import OMEGA
from pendpipe.diagnose.naming import Rival, refit_leads
from pendpipe.diagnose.noise import Noise, estimate_noise, white_noise
from pendpipe.diagnose.progress import Progress, silent
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.effects import Effect
from pendpipe.effects.curves import CURVES

GROSS: Final = 2.0
"""chi^2 per degree of freedom above which scores to first order mean nothing."""
_SLIP: Final = 0.1
"""Phase in rad, likewise."""
_MOST: Final = 6
_NEEDED: Final = 9.0
"""Delta chi^2 below which an effect that others have joined is dropped again."""
_PART: Final = 0.03
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
    state = _State(*settled(fit, data, first_noise(beginning), held), list(held))
    start = state.fit.value
    forensics = Forensics(samples, level)
    while len(state.steps) < _MOST:
        forensics.before(state, progress)
        if not _add_one(state, catalogue, freed, baseline, level, seed, progress):
            break
    forensics.after(state, progress)
    assert state.first is not None and state.now is not None
    base = refine(beginning.model, state.data, state.noise, start, held=held)
    return Search(
        state.data, state.noise, base, state.fit, tuple(state.steps), tuple(state.faults),
        min(state.first.p_value / CATALOGUE_SHARE, forensics.p_value, 1.0),
        min(state.now.p_value / CATALOGUE_SHARE, 1.0), state.first, tuple(state.holding),
    )  # fmt: skip


def _add_one(
    state: _State, catalogue: Sequence[Effect], freed: Sequence[FreedParameter], baseline: str,
    level: float, seed: int, progress: Progress,
) -> bool:  # fmt: skip
    """Scan the catalogue, and add the best effect if it is needed; say whether to go on."""
    gross = is_gross(state.fit, state.data)
    effects = applicable(catalogue, state.fit, baseline, state.data.unit)
    open_parameters = [entry for entry in freed if entry.index in state.holding]
    progress(f"scanning {len(effects)} effects")
    scanner = prepare(state.fit, state.data, state.noise, [*effects, *open_parameters])
    state.now = detect(scanner, state.fit, seed=seed)
    state.first = state.first or state.now
    if state.now.p_value > level * CATALOGUE_SHARE or _drawn(state):
        return False
    progress(f"something is there (p = {state.now.p_value:.2g}): refitting the leaders")
    rivals = refit_leads(
        state.fit, state.data, state.noise, state.now, held=state.holding, gross=gross
    )
    if not rivals or rivals[0].gain <= max(_NEEDED, _PART * state.fit.chi2 if gross else 0.0):
        return False
    state.steps.append(Step(tuple(rivals), state.now.p_value / CATALOGUE_SHARE, state.fit))
    winner = rivals[0]
    progress(f"adding {winner.identifier}: Delta chi^2 = {winner.gain:.4g}")
    if isinstance(winner.lead.effect, FreedParameter):
        state.holding.remove(winner.lead.effect.index)
    state.fit, state.data, state.noise = settled(
        winner.fit, state.data, state.noise, state.holding
    )
    return True


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


def settled(
    fit: Fit, data: Data, noise: Noise, held: Sequence[int]
) -> tuple[Fit, Data, Noise]:
    """Judge the noise anew where the model is near enough, and refit."""
    if is_gross(fit, data) or data.time_noise:
        return fit, data, noise
    data = with_lattice(data, fit.at.reading)
    residual = data.residual(fit.at.reading)
    noise = estimate_noise(
        data, residual, fit.value[OMEGA] / (2.0 * np.pi), _LEAST_STEP * data.step
    )
    return refine(fit.model, data, noise, fit.value, held=held), data, noise


