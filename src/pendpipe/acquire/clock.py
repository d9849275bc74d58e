"""The clock of the recorder, which for a simulated device may run faster than the wall's."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Protocol


class Clock(Protocol):
    """What the recorder and a simulated device need of a clock."""

    @property
    def scale(self) -> float:
        """How many seconds of this clock pass in one second of the wall's."""

    def now(self) -> float:
        """Return the time in seconds of this clock since some fixed instant."""

    def sleep(self, duration_s: float) -> None:
        """Wait `duration_s` seconds of this clock."""


@dataclass(frozen=True)
class ScaledClock:
    """The host's monotonic clock, `scale` times as fast.

    Two clocks of one scale agree in rate and differ in their zero, as the clock of an
    instrument and that of a computer do.

    Parameters
    ----------
    scale
        1 is real time, for real instruments; 1000 lets 1000 s pass in one.
    """

    scale: float = 1.0
    origin_s: float = field(default_factory=time.perf_counter, repr=False)

    def __post_init__(self) -> None:
        if not self.scale > 0:
            raise ValueError(f"a clock's scale is positive, not {self.scale}")

    def now(self) -> float:
        """Return the seconds of this clock since it was made."""
        return (time.perf_counter() - self.origin_s) * self.scale

    def sleep(self, duration_s: float) -> None:
        """Wait `duration_s` seconds of this clock."""
        if duration_s > 0:
            time.sleep(duration_s / self.scale)
