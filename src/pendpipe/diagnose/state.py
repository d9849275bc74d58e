"""What a search knows so far, and how a fit and its noise are brought into agreement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnose.begin import Beginning
from pendpipe.diagnose.data import Data, with_lattice
from pendpipe.diagnose.detect import Detection
from pendpipe.diagnose.evidence import Rival
from pendpipe.diagnose.forensics.finding import Finding
from pendpipe.diagnose.instants import with_better_instants
from pendpipe.diagnose.noise import Noise, estimate_noise, white_noise
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.effects.baseline import OMEGA

GROSS: Final = 2.0
"""chi^2 per degree of freedom above which scores to first order mean nothing."""
_SLIP: Final = 0.1
"""Phase in rad, likewise."""
_MISJUDGED: Final = 1.6
"""By how much the first guess of the noise may be too small; more is a misfit."""
_AGAIN: Final = 0.95
"""Of the noise: where a refit leaves less, it was no noise of the model before."""
_ROUNDS: Final = 3
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
class Fault:
    """A finding of the measurement's tests that counts, and its global p-value.

    `behind` is how many effects had been added before; `mask`, which readings have been left
    out for it, in however many rounds; None for none.
    """

    finding: Finding
    p_value: float
    behind: int = 0
    mask: BoolArray | None = None


@dataclass
class State:
    """What a search knows so far.

    Parameters
    ----------
    fit, data, noise
        The model as it is, the readings (masked, their times mended), and their noise.
    holding
        Indices of what is not fitted.
    origin
        The values that the search started from.
    bare
        The baseline's values when it was fitted alone.
    """

    fit: Fit
    data: Data
    noise: Noise
    holding: list[int]
    origin: FloatArray
    bare: FloatArray
    steps: list[Step] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    first: Detection | None = None
    now: Detection | None = None

    def settle(self, fit: Fit, data: Data | None = None, noise: Noise | None = None) -> None:
        """Take a new fit, and judge the noise by it."""
        data, noise = data or self.data, noise or self.noise
        fit = with_better_instants(fit, data, noise, self.holding)
        self.fit, self.data, self.noise = settled(fit, data, noise, self.holding)
        if not fit.model.effects:
            self.bare = self.fit.value


def is_gross(fit: Fit, data: Data) -> bool:
    """Say whether a misfit is so large that sensitivities can't be trusted."""
    return fit.chi2 > GROSS * data.used or fit.max_phase_error_rad > _SLIP


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
    if data.time_noise or fit.max_phase_error_rad > _SLIP:
        return fit, data, noise
    finer = with_lattice(data, fit.at.reading)
    left = noise_left(fit, finer, red=red)
    misjudged = not fit.model.effects and left.white_rms < _MISJUDGED * noise.white_rms
    if is_gross(fit, data) and not misjudged:
        return fit, data, noise
    better = refine(fit.model, finer, left, fit.value, held=held)
    # What is gross beside the first guess of the noise may be noise: it is if it is so anywhere.
    if is_gross(fit, data) and is_gross(better, finer):
        return fit, data, noise
    for _ in range(_ROUNDS):
        again = noise_left(better, finer, red=red)
        if again.rms > _AGAIN * left.rms:
            break
        left, better = again, refine(fit.model, finer, again, better.value, held=held)
    return better, finer, left
