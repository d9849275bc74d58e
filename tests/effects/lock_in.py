"""What a lock-in amplifier would say of readings: level, frequency, harmonics, window by window.

Least squares on cosines and sines; nothing of the package is used.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
HARMONICS = 5


@dataclass(frozen=True)
class Lines:
    """y = level + sum of Re(line_k e^(i k phase)), the first line growing linearly in time.

    The phase is that of the first harmonic, so that `lines[1]` is real and positive, and a
    harmonic's real part is in phase with the displacement, its imaginary part in quadrature
    (positive: it leads).
    """

    time_s: float
    level: float
    angular_frequency: float
    phase: float
    lines: tuple[complex, ...]
    decay: float
    """-d ln(amplitude)/dt, 1/s."""

    @property
    def amplitude(self) -> float:
        return abs(self.lines[1])


def lock_in(
    time_s: Floats, reading: Floats, angular_frequency: float, start_s: float, stop_s: float
) -> Lines:
    """Fit a window; the frequency is refined until it stands still."""
    inside = (time_s >= start_s) & (time_s <= stop_s)
    middle = 0.5 * (start_s + stop_s)
    time, values = time_s[inside] - middle, reading[inside]
    omega = angular_frequency
    for _ in range(6):
        columns = [np.ones_like(time), time]
        for order in range(1, HARMONICS + 1):
            columns += [np.cos(order * omega * time), np.sin(order * omega * time)]
        columns += [
            time * columns[2],
            time * columns[3],
            time**2 * columns[2],
            time**2 * columns[3],
        ]
        found = np.linalg.lstsq(np.stack(columns, axis=1), values, rcond=None)[0]
        first = found[2] - 1j * found[3]
        slope = (found[-4] - 1j * found[-3]) / first
        omega += float(slope.imag)
    phase = math.atan2(first.imag, first.real)
    lines = [complex(found[0])]
    for order in range(1, HARMONICS + 1):
        line = complex(found[2 * order], -found[2 * order + 1])
        lines.append(line * complex(math.cos(order * phase), -math.sin(order * phase)))
    return Lines(middle, float(found[0]), omega, phase, tuple(lines), -float(slope.real))


def windows(
    time_s: Floats, reading: Floats, angular_frequency: float, cycles: int, count: int
) -> list[Lines]:
    """Windows of whole cycles, evenly over the record."""
    lasts = cycles * 2.0 * math.pi / angular_frequency
    starts = np.linspace(time_s[0], time_s[-1] - lasts, count)
    return [
        lock_in(time_s, reading, angular_frequency, float(start), float(start) + lasts)
        for start in starts
    ]
