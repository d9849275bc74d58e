"""What is known of values before any reading."""

from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray, IntArray


class Priors(NamedTuple):
    """Normal priors of some values: each counts as one more datum."""

    places: IntArray
    mean: FloatArray
    sd: FloatArray

    def residual(self, value: FloatArray) -> FloatArray:
        """What is to be explained of each."""
        return (self.mean - value[self.places]) / self.sd

    def rows(self, size: int) -> FloatArray:
        """Derivatives of what explains it, shape (priors, size)."""
        found = np.zeros((len(self.places), size))
        found[np.arange(len(self.places)), self.places] = 1.0 / self.sd
        return found


NO_PRIORS: Final = Priors(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))
"""Of a problem of which nothing is known beforehand."""
