"""The clock of the recorder, which for a simulated device may run faster than wall-clock time."""

import time


class ScaledClock:
    """The host's monotonic clock, `scale` times as fast, which can be stopped.

    Two clocks of one scale agree in rate and differ in their zero, as the clock of an
    instrument and that of a computer do. A simulated line that is full stops the world: else the
    data would come late, and the recorder would see a device slower than it is. Real lines do not
    wait; there the recorder's clock goes on.

    Parameters
    ----------
    scale
        1 is real time, for real instruments; 1000 lets 1000 s pass in one.
    """

    def __init__(self, scale: float = 1.0) -> None:
        if not scale > 0:
            raise ValueError(f"a clock's scale is positive, not {scale}")
        self.scale = scale
        self._origin_s = time.perf_counter()
        self._held_at_s: float | None = None

    def now(self) -> float:
        """Return the seconds of this clock since it was made, pauses left out."""
        held_at_s = self._held_at_s
        running_s = (time.perf_counter() - self._origin_s) * self.scale
        return running_s if held_at_s is None else held_at_s

    def sleep(self, duration_s: float) -> None:
        """Wait `duration_s` seconds of this clock."""
        if duration_s > 0:
            time.sleep(duration_s / self.scale)

    def hold(self) -> None:
        """Stop the clock; stopping it again changes nothing."""
        if self._held_at_s is None:
            self._held_at_s = self.now()

    def release(self) -> None:
        """Run on from where the clock stands."""
        if self._held_at_s is not None:
            # In this order a reader in another thread never sees time go back.
            self._origin_s = time.perf_counter() - self._held_at_s / self.scale
            self._held_at_s = None
