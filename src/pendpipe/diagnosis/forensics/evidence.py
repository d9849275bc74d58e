"""What a test of the measurement may read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.diagnosis.forensics.local import Local, local_residual
from pendpipe.diagnosis.found import Location
from pendpipe.diagnosis.refine import unwrapped

if TYPE_CHECKING:
    from pendpipe.analysis.turning_points.measure import Samples
    from pendpipe.arrays import BoolArray, FloatArray
    from pendpipe.diagnosis.data import Data
    from pendpipe.diagnosis.noise import Noise
    from pendpipe.diagnosis.refine import Fit
    from pendpipe.dynamics.any_law import Sampled


FEWEST: Final = 60
"""Readings from which the measurement is tested: they show the tail of their noise."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """A model beside the readings.

    Parameters
    ----------
    data, fit, noise
        The readings that are compared, the fitted model, and their noise.
    samples
        The readings as they were recorded, less what was corrected.
    """

    data: Data
    fit: Fit
    noise: Noise
    samples: Samples

    @property
    def sampled(self) -> Sampled:
        """The model's motion at the readings."""
        return self.fit.at.sampled

    @property
    def used(self) -> BoolArray:
        """Which readings count, shape (n,)."""
        return self.data.weight > 0.0

    @cached_property
    def residual(self) -> FloatArray:
        """Readings minus model, along the motion if out of phase; 0 where masked."""
        return np.asarray(unwrapped(self.data, self.fit.at)[0] * self.used)

    @cached_property
    def error(self) -> FloatArray:
        """Readings minus the motion, rounding errors included; 0 where masked.

        The tests of codes and tails treat rounding errors themselves. Subtracting their mean first
        (`Data.residual`) would move a reading beyond a code's edge by a whole step, and the motion
        to the middle of the code.
        """
        return replace(self, data=replace(self.data, lattice=None)).residual

    def local(self, values: FloatArray, leave_out: BoolArray | None = None) -> Local:
        """Subtract the smooth part of a residual."""
        return local_residual(self.sampled.phase, values, self.used, leave_out=leave_out)

    def everywhere(
        self, phase_rad: tuple[float, float] | None = None, frequency_hz: tuple[float, ...] = ()
    ) -> Location:
        """Return all of the record."""
        time_s, amplitude = self.data.time_s, self.sampled.amplitude
        return Location.over(time_s, amplitude, phase_rad, frequency_hz)
