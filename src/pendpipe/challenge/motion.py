"""A motion to be integrated: parameters by name, a start, and what comes from outside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.challenge import layout
from pendpipe.challenge.integrator import follow

_SWITCHES: Final = (
    ("rest_jump", "rest_jump_at", None),
    ("omega_jump", "omega_jump_at", None),
    ("gamma_jump", "gamma_jump_at", None),
    ("impulse", "impulse_at", "impulse_width"),
    ("scaling", "scaling_at", None),
    ("rub", "rub_at", "rub_width"),
)


@dataclass(frozen=True)
class Track:
    """x, v and the second coordinate at the asked times; rad, rad/s, rad."""

    time_s: FloatArray
    angle_rad: FloatArray
    rate_rad_s: FloatArray
    second_rad: FloatArray


@dataclass(frozen=True)
class Motion:
    """One pendulum: where it starts and what acts on it.

    Parameters
    ----------
    parameters
        What differs from `layout.PARAMETERS`, by name.
    angle_rad, rate_rad_s
        State at the first sample.
    second_rad, second_rate_rad_s
        The second coordinate's.
    held_rad
        Angle at which relaxing springs had settled before the start.
    kicks_rad_s, rubs_rad_s2
        Change of v at the start of each sampling interval; friction during each.
    """

    parameters: Mapping[str, float]
    angle_rad: float
    rate_rad_s: float = 0.0
    second_rad: float = 0.0
    second_rate_rad_s: float = 0.0
    held_rad: float = 0.0
    kicks_rad_s: FloatArray = field(default_factory=lambda: np.empty(0))
    rubs_rad_s2: FloatArray = field(default_factory=lambda: np.empty(0))

    def value(self, name: str) -> float:
        """A parameter, or what it is when nothing is said."""
        return self.parameters.get(name, layout.PARAMETERS[name])

    def changed(self, **parameters: float) -> Motion:
        """The same motion with other parameters."""
        return replace(self, parameters={**self.parameters, **parameters})

    def run(self, time_s: FloatArray) -> Track:
        """Integrate and sample.

        Parameters
        ----------
        time_s
            Rising, s, shape (samples,); the start holds at the first.
        """
        unknown = set(self.parameters) - set(layout.PARAMETERS)
        if unknown:
            raise KeyError(f"no such parameters: {sorted(unknown)}")
        record = np.zeros(1, layout.RECORD)
        for name, value in (layout.PARAMETERS | dict(self.parameters)).items():
            record[name] = value
        for group, names in layout.GROUPS.items():
            record[group] = any(self.value(name) != 0.0 for name in names)
        found = follow(
            record, self._start(), np.ascontiguousarray(time_s, np.float64), self._breaks(),
            self.kicks_rad_s, self.rubs_rad_s2, self._states(),
        )  # fmt: skip
        return Track(time_s, found[:, 0].copy(), found[:, 1].copy(), found[:, 2].copy())

    def _start(self) -> FloatArray:
        state = np.zeros(layout.STATES)
        state[:2] = self.angle_rad, self.rate_rad_s
        state[layout.MAXWELL : layout.MAXWELL + layout.MAXWELL_ELEMENTS] = self.held_rad
        state[layout.SECOND :] = self.second_rad, self.second_rate_rad_s
        return state

    def _breaks(self) -> FloatArray:
        moments: set[float] = set()
        for size, at, width in _SWITCHES:
            if self.value(size) != 0.0:
                moments.add(self.value(at))
                if width is not None and self.value(width) > 0.0:
                    moments.add(self.value(at) + self.value(width))
        return np.array(sorted(moments), np.float64)

    def _states(self) -> int:
        """How many states move: the list is as long as the last one in use."""
        ends = {
            "dahl": layout.IWAN,
            "iwan": layout.MAXWELL,
            "maxwell": layout.BASSET,
            "basset": layout.SECOND,
            "second": layout.STATES,
        }
        return max([2, *(end for name, end in ends.items() if self.value(name) != 0.0)])
