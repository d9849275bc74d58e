"""One effect after another, until nothing is left at the level asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pendpipe.diagnose.begin import Beginning
from pendpipe.diagnose.data import Data, with_lattice
from pendpipe.diagnose.detect import Detection, detect, prepare
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
    """

    rivals: tuple[Rival, ...]
    p_value: float

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
    p_value
        Global, of the catalogue on the baseline.
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


def search(
    beginning: Beginning, catalogue: Sequence[Effect], *, baseline: str, level: float, seed: int,
    freed: Sequence[FreedParameter] = (), progress: Progress = silent,
) -> Search:  # fmt: skip
    """Fit the baseline, and add what improves it most, until chance explains the rest."""
    data, held = beginning.data, beginning.held
    progress(f"fitting {baseline} to {data.used} readings")
    noise = first_noise(beginning)
    fit = refine(beginning.model, data, noise, beginning.value, held=held)
    fit, data, noise = settled(fit, data, noise, held)
    steps: list[Step] = []
    first: Detection | None = None
    now: Detection | None = None
    holding = list(held)
    while len(steps) < _MOST:
        gross = is_gross(fit, data)
        effects = applicable(catalogue, fit, baseline, data.unit)
        open_parameters = [entry for entry in freed if entry.index in holding]
        scanner = prepare(fit, data, noise, [*effects, *open_parameters])
        progress(f"scanning {len(effects)} effects")
        now = detect(scanner, fit, seed=seed)
        first = first or now
        if now.p_value > level:
            break
        progress(f"something is there (global p = {now.p_value:.2g}): refitting the leaders")
        rivals = refit_leads(fit, data, noise, now, held=holding, gross=gross)
        if not rivals or rivals[0].gain <= _NEEDED:
            break
        steps.append(Step(tuple(rivals), now.p_value))
        winner = rivals[0]
        progress(f"adding {winner.identifier}: Delta chi^2 = {winner.gain:.4g}")
        if isinstance(winner.lead.effect, FreedParameter):
            holding.remove(winner.lead.effect.index)
        fit, data, noise = settled(winner.fit, data, noise, holding)
        if winner.lead.effect.kind == "unnamed":
            now = None
            break
    assert first is not None
    if now is None or len(steps) == _MOST:
        scanner = prepare(fit, data, noise, applicable(catalogue, fit, baseline, data.unit))
        now = detect(scanner, fit, seed=seed, known=now)
    base = refine(beginning.model, data, noise, beginning.value, held=held)
    return Search(
        data, noise, base, fit, tuple(steps), first.p_value, now.p_value, first, tuple(holding)
    )


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


