"""Others' ways of asking what a recording lacks: the peers of `diagnosis.py`.

Each judges one recording and returns whether something is missing and the catalogue's
identifier that it names (None where it can't name). Their common ground is Eq. 8 fitted by
scipy over the challenge's integrator, and templates written down here, so that they owe
nothing to ``pendpipe.diagnosis`` or ``pendpipe.effects``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe_challenge.peers import Judgement, by_sindy

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray

__all__ = ["Baseline", "Judgement", "by_criterion", "by_sindy", "by_whiteness", "fit_eq8"]

NAMES: Final = ("angle", "rate", "omega", "gamma", "hysteretic", "quadratic", "coulomb", "offset")


@dataclass(frozen=True)
class Baseline:
    """Eq. 8 at its best: motion, what it leaves, and its sensitivities (readings, 8)."""

    time_s: FloatArray
    angle_rad: FloatArray
    rate_rad_s: FloatArray
    omega: float
    residual_rad: FloatArray
    tangent: FloatArray


def fit_eq8(time_s: FloatArray, angle_rad: FloatArray, noise_rad: float) -> Baseline:
    """Least squares with central differences; losses stay at or above nought."""
    from scipy.optimize import least_squares

    from pendpipe_challenge.motion import Motion, Track

    span = float(time_s[-1] - time_s[0])
    swing = angle_rad - np.median(angle_rad)
    amplitude = float(np.abs(swing).max())
    omega = _omega(time_s, swing)
    third = len(swing) // 3
    decay = max(2.0 / span * np.log(swing[:third].std() / swing[-third:].std()), 1e-3 / span)
    shape = np.column_stack([np.cos(omega * time_s), np.sin(omega * time_s)])
    window = time_s - time_s[0] < 12.0 / omega
    c, s = np.linalg.lstsq(shape[window], swing[window], rcond=None)[0]
    rate = 3.0 / span
    unit = np.array(
        [
            amplitude,
            amplitude * omega,
            0.1 / (omega * span),
            rate,
            rate,
            rate / (omega * amplitude),
            rate * omega * amplitude,
            amplitude,
        ]
    )
    start = np.array([c, omega * s, omega, decay, 0.0, 0.0, 0.0, np.median(angle_rad)])

    def run(u: FloatArray) -> Track:
        p = start + unit * u
        named = dict(zip(NAMES[2:7], p[2:7], strict=True))
        return Motion(named, float(p[0]), float(p[1])).run(time_s)

    def reading(u: FloatArray) -> FloatArray:
        return np.asarray(run(u).angle_rad + start[7] + unit[7] * u[7])

    def jacobian(u: FloatArray) -> FloatArray:
        columns = []
        for k in range(8):
            step = np.zeros(8)
            step[k] = 1e-4
            columns.append((reading(u + step) - reading(u - step)) / 2e-4 / noise_rad)
        return np.column_stack(columns)

    low = np.full(8, -np.inf)
    low[3:7] = -start[3:7] / unit[3:7] - 1e-3
    found = least_squares(
        lambda u: np.nan_to_num((reading(u) - angle_rad) / noise_rad, nan=1e6),
        np.zeros(8),
        jac=jacobian,
        bounds=(low, np.inf),
        max_nfev=60,
    )
    track = run(found.x)
    left = angle_rad - reading(found.x)
    omega = float(start[2] + unit[2] * found.x[2])
    tangent = jacobian(found.x) * noise_rad
    return Baseline(time_s, track.angle_rad, track.rate_rad_s, omega, left, tangent)


def _omega(time_s: FloatArray, swing: FloatArray) -> float:
    """Angular frequency from the crossings of the median, noise between neighbours ignored."""
    from scipy.signal import find_peaks

    size = np.abs(np.fft.rfft(swing * np.hanning(len(swing))))
    rough = int(np.argmax(size[1:])) + 1
    gap = max(int(0.6 * len(swing) / rough), 1)
    peaks, _ = find_peaks(swing, distance=gap)
    times = time_s[peaks]
    return float(2.0 * np.pi * (len(times) - 1) / (times[-1] - times[0]))


def templates(base: Baseline) -> dict[str, list[FloatArray]]:
    """Simple linear shapes of effects: (readings, 1 or 2) each, several of one name."""
    t = base.time_s - base.time_s[0]
    x, v = base.angle_rad, base.rate_rad_s / base.omega
    square = x**2 + v**2
    size, step = np.sqrt(square), np.gradient(t)
    found: dict[str, list[FloatArray]] = {
        "cubic-stiffness": [np.cumsum(square * step) * v],
        "quadratic-stiffness": [square / 2.0 - (x**2 - v**2) / 6.0],
        "cubic-damping": [np.cumsum(square * step) * x],
        "power-law-damping": [np.cumsum(size**n * step) * x for n in (-0.5, 0.5)],
        "frequency-drift": [t**2 * v],
        "damping-drift": [t**2 * x],
        "sensor-quadratic": [x**2],
        "sensor-cubic": [x**3],
        "offset-drift": [t],
    }
    found["tone-pickup"] = [_tone(base, t)]
    phase = np.unwrap(np.arctan2(-v, x))
    for at in np.linspace(0.08, 0.92, 33) * t[-1]:
        k = int(np.searchsorted(t, at))
        after, ring = t >= at, size / size[k]
        turned = phase - phase[k]
        for name, shape in (
            ("equilibrium-step", 1.0 - ring * np.cos(turned)),
            ("impulse", ring * np.sin(turned)),
            ("amplitude-step", x),
            ("frequency-step", (t - at) * v),
            ("damping-step", (t - at) * x),
        ):
            found.setdefault(name, []).append(np.where(after, shape, 0.0))
    return {name: [s.reshape(len(t), -1) for s in shapes] for name, shapes in found.items()}


def _tone(base: Baseline, t: FloatArray) -> FloatArray:
    """Cosine and sine of the strongest line of what is left."""
    padded = 4 * len(t)
    power = np.abs(np.fft.rfft(base.residual_rad, padded)) ** 2
    hertz = np.fft.rfftfreq(padded, t[-1] / (len(t) - 1))
    line = 2.0 * np.pi * hertz[int(np.argmax(power[8:])) + 8]
    return np.column_stack([np.cos(line * t), np.sin(line * t)])


def by_criterion(base: Baseline, noise_rad: float, *, white: bool, criterion: str) -> Judgement:
    """The best template by ``aic`` or ``bic``: what forward selection would add first.

    Noise that is not white is taken for a first-order memory, as the residual shows it.
    """
    count = len(base.time_s)
    cost = {"aic": 2.0, "bic": float(np.log(count))}[criterion]
    memory, sd = (0.0, noise_rad) if white else _first_order(base.residual_rad)

    def whitened(columns: FloatArray) -> FloatArray:
        return np.asarray((columns[1:] - memory * columns[:-1]) / sd)

    basis = np.linalg.qr(whitened(base.tangent / np.abs(base.tangent).max(axis=0)))[0]
    left = whitened(base.residual_rad)
    left = left - basis @ (basis.T @ left)
    best, name = 0.0, None
    for effect, shapes in templates(base).items():
        for shape in shapes:
            columns = whitened(shape / np.abs(shape).max())
            columns = columns - basis @ (basis.T @ columns)
            inside, weight = np.linalg.qr(columns)
            if np.abs(np.diag(weight)).min() < 1e-9 * np.sqrt(count) / sd:
                continue
            gain = float(np.sum((inside.T @ left) ** 2)) - cost * shape.shape[1]
            if gain > best:
                best, name = gain, effect
    return Judgement(name is not None, name)


def _first_order(residual: FloatArray) -> tuple[float, float]:
    """Noise that remembers: its first-order coefficient, and the sd of what is new."""
    memory = float(residual[1:] @ residual[:-1] / (residual[:-1] @ residual[:-1]))
    return memory, float(np.std(residual[1:] - memory * residual[:-1]))


def by_whiteness(base: Baseline, lags: int = 20, level: float = 0.01) -> Judgement:
    """Ljung and Box's test of what Eq. 8 leaves; it names nothing."""
    from scipy.stats import chi2

    r, count = base.residual_rad - base.residual_rad.mean(), len(base.residual_rad)
    rho = np.array([r[k:] @ r[:-k] for k in range(1, lags + 1)]) / (r @ r)
    statistic = count * (count + 2.0) * np.sum(rho**2 / (count - np.arange(1, lags + 1)))
    return Judgement(bool(chi2.sf(statistic, lags) < level), None)
