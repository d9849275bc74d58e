"""What the figures of a diagnosis draw from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.cycles import Cycles, Spans, between, cycles, span_ends
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.run import Outcome
from pendpipe.effects.model import Evaluated
from pendpipe.figures.data import NothingToDrawError

NAMES = {"eq8": "Eq. 8", "viscous": "Eq. 3"}


@dataclass(frozen=True)
class Shown:
    """A diagnosis with the readings and the models that it compared.

    Parameters
    ----------
    diagnosis, data, noise
        The answer, the readings and their noise.
    baseline, extended
        The two models; `extended` is None where nothing was found.
    """

    diagnosis: Diagnosis
    data: Data
    noise: Noise
    baseline: Fit
    extended: Fit | None

    @property
    def clock(self) -> Evaluated:
        """The model whose phase tells the cycles apart: the one that stays in step."""
        best = self.extended
        if best is None or best.max_phase_error_rad > self.baseline.max_phase_error_rad:
            best = self.baseline
        return best.at

    @property
    def baseline_name(self) -> str:
        """For legends."""
        return NAMES.get(self.diagnosis.baseline_name, self.diagnosis.baseline_name)

    @property
    def extended_name(self) -> str:
        """For legends: what was added."""
        found = [effect.identifier for effect in self.diagnosis.effects]
        more = f" and {len(found) - 1} more" if len(found) > 1 else ""
        return f"with {found[0]}{more}"

    def residual(self, fit: Fit) -> FloatArray:
        """Readings minus model, NaN where a reading is masked; shape (n,)."""
        left = self.data.residual(fit.at.reading)
        return np.where(self.data.weight > 0.0, left, math.nan)

    @cached_property
    def _measured(self) -> Cycles:
        found = cycles(self.data.values, self.data.weight, self.clock, self.noise.white_rms)
        if len(found.time_s) < 3:
            raise NothingToDrawError("there are too few whole cycles")
        return found

    @cached_property
    def _ends(self) -> list[int]:
        ends = span_ends(self._measured)
        if len(ends) < 3:
            raise NothingToDrawError("the amplitude is lost in the noise")
        return ends

    @cached_property
    def measured(self) -> Spans:
        """Loss and frequency of the readings."""
        return between(self._measured, self._ends)

    def of_model(self, fit: Fit) -> Spans:
        """The same of a model's readings, between the same times."""
        own = cycles(fit.at.reading, self.data.weight, fit.at, 0.0)
        return between(own.at(self._measured.time_s), self._ends)


def shown(outcome: Outcome) -> Shown:
    """Take from an outcome what is drawn."""
    found = outcome.search
    extended = found.improved if outcome.diagnosis.effects else None
    return Shown(outcome.diagnosis, found.data, found.noise, found.baseline, extended)
