"""Readings of several recordings, and their noise, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise


@dataclass(frozen=True)
class StackedData(Data):
    """Readings of several recordings.

    Parameters
    ----------
    alone
        Of each recording; the weights of all stand before theirs.
    """

    alone: tuple[Data, ...] = ()

    @classmethod
    def of(cls, alone: Sequence[Data]) -> StackedData:
        """Put them one after the other."""
        series = ("time_s", "values", "weight")
        joined = (np.concatenate([getattr(each, name) for each in alone]) for name in series)
        time_s, values, weight = joined
        return cls(
            time_s,
            values,
            alone[0].interval_s,
            uniform=False,
            weight=weight,
            unit=alone[0].unit,
            alone=tuple(alone),
        )

    def each(self) -> list[Data]:
        """Return each recording's readings, with the present weights."""
        pairs = zip(self.alone, split(self.weight, self.alone), strict=True)
        return [replace(data, weight=weight) for data, weight in pairs]

    def residual(self, reading: FloatArray) -> FloatArray:
        """Return readings minus model, with the mean rounding error of the model."""
        pairs = zip(self.alone, split(reading, self.alone), strict=True)
        return np.concatenate([data.residual(part) for data, part in pairs])


@dataclass(frozen=True)
class StackedNoise(Noise):
    """Noise of several recordings; it is known from each of them alone.

    Parameters
    ----------
    alone
        Of each recording; the weights of all stand before theirs.
    """

    known: ClassVar[bool] = True
    alone: tuple[Noise, ...] = ()

    @classmethod
    def of(cls, alone: Sequence[Noise]) -> StackedNoise:
        """Put them one after the other."""
        return cls(
            np.concatenate([each.variance for each in alone]),
            np.concatenate([each.weight for each in alone]),
            alone=tuple(alone),
        )

    def _each(self) -> list[Noise]:
        pairs = zip(self.alone, split(self.weight, self.alone), strict=True)
        return [replace(noise, weight=weight) for noise, weight in pairs]

    def _with(self, columns: FloatArray) -> Iterator[tuple[Noise, FloatArray]]:
        return zip(self._each(), split(columns, self.alone), strict=True)

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Turn readings (or columns of them) into numbers of unit variance, shape kept."""
        return np.concatenate([noise.whiten(part) for noise, part in self._with(columns)])

    def adjoint(self, columns: FloatArray) -> FloatArray:
        """Apply the transpose of `whiten`."""
        return np.concatenate([noise.adjoint(part) for noise, part in self._with(columns)])

    @property
    def scale(self) -> FloatArray:
        """What each reading is multiplied by before its cosines are taken."""
        return np.concatenate([noise.scale for noise in self._each()])

    @property
    def coloured(self) -> bool:
        """Whether any of them is."""
        return any(noise.coloured for noise in self.alone)

    @property
    def sd(self) -> FloatArray:
        """Standard deviation of each reading."""
        return np.concatenate([noise.sd for noise in self.alone])

    def log_scale_variance(
        self,
        rows: FloatArray,
        chosen: IntArray | None = None,  # noqa: ARG002
    ) -> FloatArray:
        """Return the variance of the logarithm of the noise that unit columns meet."""
        parts = split(rows[:, : len(self.variance)].T, self.alone)
        pairs = zip(self.alone, parts, strict=True)
        found = [noise.log_scale_variance(part.T) for noise, part in pairs]
        return np.asarray(np.sum(found, axis=0))


def split(columns: FloatArray, alone: Sequence[Data] | Sequence[Noise]) -> list[FloatArray]:
    """Return what belongs to each recording."""
    counts = [len(each.weight) for each in alone]
    return np.split(columns, np.cumsum(counts)[:-1])
