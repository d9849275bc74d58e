"""How much of a pendulum's sin x periods ask for: the one test of a period that lengthens so."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.kernel import kernel
from pendpipe.estimate import Z95

SEEN: Final = 3.0
"""Standard deviations from which an amplitude, or a coefficient, is seen, and up to which the
coefficient may be off: chance makes one of 400 so large."""
TELLS: Final = 0.2
"""Error of the share of sin x up to which a period tells the unit."""
_NEAR: Final = 0.2
"""How near to 1 it must be where sin x removes most of chi^2."""


class Coefficient(NamedTuple):
    """How much of sin x the times of the turning points ask for: 0 nothing, 1 all of it."""

    value: float
    sd: float
    """From the scatter of the times, and what a drift of the frequency would change."""
    removed: float
    """Part of chi^2 of the times that the whole of sin x removes."""

    @property
    def agrees(self) -> bool:
        """Whether the times alone ask for sin x.

        The coefficient is seen and agrees with 1; or sin x removes most of chi^2, and the
        coefficient is within 0.2 of 1, or as near as a drift would bring it.
        """
        off = abs(self.value - 1.0)
        near = off < Z95 * self.sd and self.value > SEEN * self.sd
        return near or (self.removed > 0.5 and off < max(_NEAR, self.sd))

    @property
    def excludes_sine(self) -> bool:
        """Whether the whole of sin x contradicts the times, a drift of the frequency granted."""
        return abs(self.value - 1.0) > SEEN * self.sd

    @property
    def tells(self) -> bool:
        """Whether it says of readings in which unit they are angles: in one where it agrees."""
        return self.agrees and self.sd < TELLS


ANGLES: Final[Mapping[str, float]] = {
    "radians": 1.0,
    "degrees": math.pi / 180.0,
    "turns": 2.0 * math.pi,
}
"""Of an angle, in rad."""


def unit_shown(
    share: Callable[[float], Coefficient | None], units: Mapping[str, float] = ANGLES
) -> str | None:
    """The one of `units` in which the `share` of sin x, a function of their size, is 1.

    The period lengthens with the swing as K(sin(A/2)^2), to second order as 1 + A^2/16: of units
    that differ by a factor of 6 or more at most one fits.
    """
    found = {name: share(size) for name, size in units.items()}
    fitting = [name for name, each in found.items() if each is not None and each.tells]
    return fitting[0] if len(fitting) == 1 else None


_APART: Final = 1e-8
"""Of two means, both 0.1 to 1, whose next ones differ by its square over eight of them."""


def elliptic(m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Complete elliptic integrals K and E of the parameter m = k^2 < 1, by Gauss's means."""
    k, e = np.empty_like(m), np.empty_like(m)
    _elliptic(np.ravel(m), k.reshape(-1), e.reshape(-1))
    return k, e


@kernel()
def _elliptic(m: FloatArray, k: FloatArray, e: FloatArray) -> None:
    """Fill in both."""
    for i in range(m.size):
        a, b, total, factor, apart = 1.0, math.sqrt(1.0 - m[i]), 0.5 * m[i], 0.25, 1.0
        # Each step doubles the digits: behind one that began 1e-8 apart the means are one number.
        while apart > _APART:
            apart, factor = a - b, 2.0 * factor
            a, b = 0.5 * (a + b), math.sqrt(a * b)
            total += 0.5 * factor * apart * apart
        k[i] = 0.5 * math.pi / a
        e[i] = k[i] * (1.0 - total)


def sine_share(
    lasts: FloatArray,
    plain: FloatArray,
    sine: FloatArray,
    drift: FloatArray,
    *others: FloatArray,
    weight: FloatArray | float = 1.0,
) -> Coefficient:
    """Fit times, or periods, with a free coefficient of sin x.

    A half swing lasts ``[pi (1 + losses) + eta (K + K' - pi)]/omega``: times are linear in
    1/omega and in eta/omega. By what eta changes if the frequency may drift, it is uncertain too.

    Parameters
    ----------
    lasts
        What was measured, shape (n,).
    plain, sine
        Phases that it takes by x, and by sin x.
    drift
        What a frequency that changes evenly in time adds to `plain`.
    others
        Columns with factors of their own.
    weight
        The reciprocal of each one's standard deviation, up to a common factor.
    """
    columns = np.stack([*others, plain, sine - plain, drift, lasts], axis=1)
    weighted = np.zeros((max(len(lasts), columns.shape[1]), columns.shape[1]))
    weighted[: len(lasts)] = columns * np.reshape(weight, (-1, 1))
    # Of the triangle what others do not explain: models differ by its last columns.
    triangle = np.asarray(np.linalg.qr(weighted, mode="r"))
    # The unit of time does not matter, nor that of the weights: no square overflows.
    for part in triangle[:, :-1], triangle[:, -1]:
        part /= np.max(np.abs(part))
    first, *last = triangle[len(others) :, len(others) :].tolist()
    (_, by_sine, across, second), (*_, by_drift, third), (*_, rest) = last
    by_sine, by_drift = (each or math.ulp(first[0]) for each in (by_sine, by_drift))
    freedom = max(len(lasts) - len(others) - 2, 1)

    def share(sines: float, drifts: float = 0.0) -> tuple[float, float]:
        """Factor of sin x over that of `plain`, and the latter."""
        own = (first[3] - first[1] * sines - first[2] * drifts) / first[0]
        return sines / own, own

    value, own = share(second / by_sine)
    error = math.sqrt((third**2 + rest**2) / freedom) / abs(by_sine * own)
    drifts = third / by_drift
    drifting, _ = share((second - across * drifts) / by_sine, drifts)
    linear, left = second**2 + third**2 + rest**2, third**2 + rest**2
    # The whole of sin x goes with both columns.
    off = (first[0] + first[1]) * second - by_sine * first[3]
    whole = off**2 / ((first[0] + first[1]) ** 2 + by_sine**2) + left
    removed = 1.0 - whole / linear if linear > 0.0 else 0.0
    return Coefficient(value, math.hypot(error, drifting - value), removed)
