"""The slow flow of a spherical pendulum: a string's two planes, of which a camera sees one.

With x = Re[a e^(i psi)] and y = Re[b e^(i psi)] along the axes of the suspension, a and b being
what averaging over a cycle leaves, and psi the phase at small amplitude,

    a' = -i omega/16 (|a|^2 + |b|^2) a - W b,
    b' = -i omega/16 (|a|^2 + |b|^2) b + W a + 2 pi i delta b,    W = -3/8 omega Im(a* b):

the circular error of both planes together, the turn of the ellipse by 3/8 of its area, the product
of its half axes (Olsson 1978), and the detuning delta of the second axis. Both lose alike by b; a
drag |v| v takes from the smaller half axis of a narrow ellipse half as much of it as of the larger.

The next power comes from Birkhoff's normal form. With N = (|a|^2 + |b|^2)/2 and the area
L = Im(a* b), H = N - N^2/16 - N^3/256 + 3/16 L^2 + 9/256 N L^2 is that of the plane pendulum for
L = 0 and of the cone, whose omega^2 is 1/cos(theta), for L = N; rates are its derivatives. An
amplitude R in one plane is N = R^2/2 (1 - 5/96 R^2).
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple, cast

import numpy as np

from pendpipe.arrays import AnyArray, FloatArray
from pendpipe.dynamics.kernel import Kernel, Matrix, Stack, kernel
from pendpipe.effects.two_modes import slow_amplitude

_TURN: Final = 0.15
"""Angle of a step, rad: its error, a twelfth of the cube, is 3e-4, and steps change sign."""
_WINDOWS: Final = 60
"""Of a record at most: six beats of ten each."""
_FEWEST: Final = 10
"""Windows, each of a period or more: two planes have eight numbers."""


@kernel(inline=True)
def _stepped(a: Any, b: Any, reached: Any, square: Any, lost: Any, detuned: Any) -> tuple[Any, Any]:
    """Follow both planes over a step: omega r^2 integrates to `reached`, a r to `lost`.

    Both halves of the detuning about the rest, whose turns are by Cayley's transform: unitary, and
    the same for numbers and for arrays.
    """
    b = b * detuned
    more, across = _apart(a, b, 0.5 * lost)
    more, across = _apart(a - more, b - across, lost)
    a, b = a - more, b - across
    energy = a.real**2 + a.imag**2 + b.real**2 + b.imag**2
    area = a.imag * b.real - a.real * b.imag
    slower = energy - 1.0 + square * (3.0 / 64.0 * (energy**2 - 1.0) - 9.0 / 16.0 * area**2)
    turn = 3.0 / 16.0 * area * reached * (1.0 + 3.0 / 32.0 * square * energy)
    late = -1j / 32.0 * slower * reached
    scale = (1.0 + late) / (1.0 - late) / (1.0 + turn * turn)
    cosine, sine = scale * (1.0 - turn * turn), scale * (2.0 * turn)
    return cosine * a - sine * b, (sine * a + cosine * b) * detuned


@kernel(inline=True)
def _apart(a: Any, b: Any, lost: Any) -> tuple[Any, Any]:
    """What a drag |v| v takes more than of one plane, where it takes the part `lost` of that.

    With m = |a^2 + b^2|/(|a|^2 + |b|^2), |v| is d_0 + d_1 cos(2 psi), whose series in m end with
    those of a circle, m = 0, and of a line, m = 1: d_0 = 2/pi, d_1 = 4/(3 pi); over 8/(3 pi).
    """
    energy, both = a.real**2 + a.imag**2 + b.real**2 + b.imag**2, a * a + b * b
    root, narrow = math.sqrt(energy), (both.real**2 + both.imag**2) / energy**2
    same = _CIRCLE * root * (1.0 - narrow / 16.0 - _LINE_SAME * narrow**2) - 1.0
    cross = 0.5 * _CIRCLE * root * (0.5 + _LINE_CROSS * narrow) * both / energy
    return lost * (same * a + cross * np.conj(a)), lost * (same * b + cross * np.conj(b))


_CIRCLE: Final = 3.0 * math.pi / 8.0 / math.sqrt(2.0)
_LINE_SAME: Final = 1.0 - 1.0 / 16.0 - 0.75 / _CIRCLE
_LINE_CROSS: Final = 0.5 / _CIRCLE - 0.5
"""Both from the sums at m = 1, 3/4 and 1/4."""


def _together(steps: Stack, detuned: Matrix, found: Stack) -> None:
    turned, both = detuned.view(np.complex128), found.view(np.complex128)
    step = cast("Kernel", _stepped).plain
    for k in range(steps.shape[2]):
        now = step(*both[:, k].T, *steps[:, :, k], turned[:, min(k, 1)])
        both[:, k + 1] = np.stack(now, axis=1)


@kernel(arrays=_together)
def _follow(steps: Stack, detuned: Matrix, found: Stack) -> None:
    """Follow both amplitudes of some pairs: `found`, shape (pairs, k + 1, 4), begins with them.

    `steps` holds what a step takes, shape (3, pairs, k); `detuned` half the detuning's turn of the
    first step, and of the others, shape (pairs, 4). Complex numbers are their two parts.
    """
    for row in range(steps.shape[1]):
        for k in range(steps.shape[2]):
            now, then, half = found[row, k], found[row, k + 1], detuned[row, 2 * min(k, 1) :]
            a, b = complex(now[0], now[1]), complex(now[2], now[3])
            reached, square, lost = steps[0, row, k], steps[1, row, k], steps[2, row, k]
            a, b = _stepped(a, b, reached, square, lost, complex(half[0], half[1]))
            then[0], then[1], then[2], then[3] = a.real, a.imag, b.real, b.imag


def _followed(a: AnyArray, b: AnyArray, steps: Stack, *detuned: AnyArray) -> AnyArray:
    """Return both amplitudes at the beginning and after each step, shape (2, pairs, k + 1)."""
    found = np.empty((len(a), steps.shape[2] + 1, 2), dtype=np.complex128)
    found[:, 0] = np.stack([a, b], axis=1)
    turned = np.stack(detuned, axis=1, dtype=np.complex128)
    _follow(steps, turned.view(np.float64), found.view(np.float64))
    return np.moveaxis(found, 2, 0)


def _begun(other: Any) -> tuple[Any, Any, Any, Any]:
    """Return the amplitudes along both axes, and how each is seen.

    What is seen is 1 + q, q being the second mode's part. The angle of the axes, tan^2 = |q|, is
    that with which the hidden plane moves least; let go at rest in the plane that is seen, q is
    real and nothing is hidden.
    """
    ratio = np.sqrt(np.maximum(np.abs(other), 1e-300))
    seen = 1.0 / np.sqrt(1.0 + ratio**2)
    hidden = ratio * seen
    return 1.0 / seen, -other / hidden, seen, hidden


def planes(
    time_s: FloatArray,
    reached: FloatArray,
    square: FloatArray,
    other: complex,
    detuning: float,
    quadratic: float = 0.0,
) -> tuple[AnyArray, AnyArray]:
    """Return the complex amplitudes in the plane that is seen, and across, over the first mode's.

    Parameters
    ----------
    time_s
        Since the first reading, s, shape (n,).
    reached
        The integral of omega r^2 until then, r being the first mode's amplitude as it is seen.
    square
        r^2 at those times, rad^2.
    other
        The second mode's part of what is seen at the first reading, over the first one's.
    detuning
        Of the second mode, rad/s.
    quadratic
        The loss a of Eq. 14, 1/(rad s).
    """
    a, b, seen, hidden = _begun(np.array([other]))
    size = (1.0 + abs(other)) ** 2
    both, place = _along(a, b, time_s, reached, square, detuning, quadratic, size)
    turned = np.array([[seen[0], -hidden[0]], [hidden[0], seen[0]]]) @ both[:, 0]
    u, w = _cubic(turned, place)
    return u, w


def beside(
    time_s: FloatArray,
    reached: FloatArray,
    square: FloatArray,
    detuning: float,
    quadratic: float = 0.0,
) -> AnyArray:
    """Return what a small swing across, 1 and -i at the first reading, becomes; shape (2, n).

    Over the amplitude of the plane that swings, which it leaves alone. In phase with that it turns
    the plane and stays; in quadrature it is an ellipse, which turns.
    """
    small = np.array([_SMALL, -1j * _SMALL])
    both, place = _along(np.ones(2), small, time_s, reached, square, detuning, quadratic, 1.0)
    return _cubic(both[1] / both[0] / _SMALL, place)


_SMALL: Final = 1e-6
"""Of a swing, whose square moves the other plane by less than anyone has measured."""


def _along(
    a: AnyArray,
    b: AnyArray,
    time_s: FloatArray,
    reached: FloatArray,
    square: FloatArray,
    detuning: float,
    quadratic: float,
    size: float,
) -> tuple[AnyArray, FloatArray]:
    """Follow pairs of amplitudes along a motion; and where among the steps its readings lie."""
    last_s = float(time_s[-1])
    turns = abs(detuning) * last_s + 0.375 * size * float(reached[-1])
    count = min(8 + math.ceil(turns / _TURN), 20_000)
    at = np.linspace(0.0, last_s, count + 1)
    parts = np.diff(np.interp(at, time_s, reached))
    squares = np.interp(0.5 * (at[1:] + at[:-1]), time_s, square)
    lost = quadratic * last_s / count * np.sqrt(squares)
    detuned = np.full(len(a), np.exp(0.5j * detuning * last_s / count))
    steps = np.repeat(np.stack([parts, squares, lost])[:, None], len(a), axis=1)
    return _followed(a, b, steps, detuned, detuned), time_s * (count / last_s)


def waveform(amplitude: FloatArray, phase: FloatArray, u: AnyArray, w: AnyArray) -> FloatArray:
    """Return the angle that is seen, less that of one plane alone, to the third power of r.

    The horizontal displacements are those of Birkhoff's normal form, of the actions, and
    -r^2/16 (|u|^2 + |w|^2)(u, w) - r^2/32 (u^2 + w^2)(u*, w*) at the same frequency, and
    -3/64 r^3 (u^2 + w^2)(u, w) e^(3 i phi); seen is arctan(x/|z|) = x + x^3/6 + x y^2/2 of them.
    """
    square = amplitude**2
    turning = 1.0 + square / 24.0 * (1.0 - np.cos(phase) ** 4)
    square = square * turning**2
    phi = phase + square / 24.0 * np.sin(2.0 * phase) + square / 192.0 * np.sin(4.0 * phase)
    wave = amplitude * turning * (1.0 - 5.0 / 192.0 * square) * np.exp(1j * phi)
    third = -3.0 / 64.0 * (u * u + w * w) * u + u**3 / 24.0 + u * w * w / 8.0 + 1.0 / 192.0
    first = u - 1.0 + square / 32.0 * (_further(u, w) - 1.0)
    return np.asarray((first * wave + third * wave**3).real)


def _further(u: AnyArray, w: AnyArray) -> AnyArray:
    """Return what the cube of the amplitude adds to the fundamental that is seen, over r^3/32."""
    size = u.real**2 + u.imag**2 + 6.0 * (w.real**2 + w.imag**2)
    return np.asarray(size * u + 3.0 * w * w * u.conj())


def _cubic(values: AnyArray, place: FloatArray) -> AnyArray:
    """Interpolate at fractional places by cubics through four neighbours."""
    first = np.clip(place.astype(np.int64) - 1, 0, values.shape[-1] - 4)
    s = place - first
    weights = (
        -(s - 1.0) * (s - 2.0) * (s - 3.0) / 6.0,
        s * (s - 2.0) * (s - 3.0) / 2.0,
        -s * (s - 1.0) * (s - 3.0) / 2.0,
        s * (s - 1.0) * (s - 2.0) / 6.0,
    )
    return np.asarray(sum(weight * values[..., first + k] for k, weight in enumerate(weights)))


class Planes(NamedTuple):
    """What two planes leave least of the slow amplitude."""

    amplitude: float
    """Of the first mode, as seen at the first reading."""
    phase_rad: float
    omega: float
    linear: float
    """Relative loss of amplitude, 1/s, and what it grows by with amplitude, 1/(rad s)."""
    quadratic: float
    other: complex
    """The second mode's part of what is seen, over the first one's."""
    detuning: float
    """rad/s."""


_TRIED: Final = tuple(
    (size * np.exp(1j * angle), turned)
    for size in (0.03, 0.1, 0.3, 0.9)
    for angle in (0.0, 0.5, -0.5, 1.8, -1.8)
    for turned in (0.0, 2.0, -2.0, 6.0, -6.0, 15.0, -15.0)
)
"""Second modes, and their detuning over the record, rad, from which the search begins."""
_FIRST, _THEN, _BEST = 6, 15, 30
"""Steps of all, and of the best of them."""


def two_planes(time_s: FloatArray, values: FloatArray, omega: float) -> Planes | None:
    """Find the two planes that explain the slow amplitude of readings; None of too few cycles."""
    time = time_s - time_s[0]
    width = max(2.0 * math.pi / omega, float(time[-1]) / _WINDOWS)
    edges = np.searchsorted(time, np.arange(0.0, time[-1], width)).tolist()
    slow = slow_amplitude(omega * time, values, edges, slopes=True)
    if len(slow) < _FEWEST:
        return None
    last_s, size = width * len(slow), float(np.abs(slow).max())
    aim = slow / size
    count = len(aim)

    def model(value: FloatArray) -> AnyArray:
        """The slow amplitude at the windows' middles; shape (..., windows)."""
        log, phase, faster, b, a, cosine, sine, turned = value.T[..., None]
        at = (np.arange(count) + 0.5) / count
        decayed = np.exp(-b * at)
        level = np.exp(log) * decayed / (1.0 + a * np.exp(log) * -np.expm1(-b * at) / b)
        square = (size * level) ** 2
        whole = omega * last_s / count * square
        part = np.concatenate([0.5 * whole[..., :1], 0.5 * (whole[..., 1:] + whole[..., :-1])], -1)
        # On the search's way a window may seem to lose all.
        lost = np.minimum(a * level / count, 0.5)
        other = cosine - 1j * sine
        x, y, seen, hidden = _begun(other[..., 0])
        half = np.exp(0.5j * turned[..., 0] / count)
        steps = np.stack([part, square, lost])
        x, y = _followed(x, y, steps, np.sqrt(half), half)[:, :, 1:]
        seen, hidden = seen[:, None], hidden[:, None]
        u, w = seen * x - hidden * y, hidden * x + seen * y
        found = u + square / 32.0 * _further(u, w)
        turn = phase + faster * at - np.cumsum(part, axis=-1) / 16.0
        return np.asarray(found * level * np.exp(1j * turn))

    def residual(value: FloatArray) -> FloatArray:
        left = model(value) - aim
        return np.concatenate([left.real, left.imag], axis=-1)

    starts = []
    early = np.unwrap(np.angle(aim[:4]))
    faster = (early[-1] - early[0]) * count / 3.0
    for other, turned in _TRIED:
        now = aim[0] / (1.0 + other)
        log, square = math.log(max(abs(now), 1e-3)), (size * abs(aim[0])) ** 2
        quick = faster + omega * last_s * square / 16.0
        starts.append([log, np.angle(now), quick, 0.3, 0.1, other.real, -other.imag, turned])
    value = np.array(starts)
    least, damped = np.sum(residual(value) ** 2, axis=1), np.full(len(value), 1e-2)
    for round_ in range(_FIRST + _THEN):
        if round_ == _FIRST:
            best = np.argsort(least)[:_BEST]
            value, least, damped = value[best], least[best], damped[best]
        steps = 1e-5 * np.eye(value.shape[1])
        moved = residual((value[:, None] + steps).reshape(-1, value.shape[1]))
        here = residual(value)
        slopes = (moved.reshape(len(value), -1, here.shape[1]) - here[:, None]) / 1e-5
        gram = slopes @ np.swapaxes(slopes, 1, 2)
        diagonal = np.einsum("kii->ki", gram)
        gram = gram + (damped[:, None] * diagonal + 1e-12)[:, :, None] * np.eye(value.shape[1])
        step = np.linalg.solve(gram, slopes @ here[..., None])[..., 0]
        new = value - np.clip(step, -3.0, 3.0)
        new[:, 3:5] = np.clip(new[:, 3:5], 1e-6, 50.0)
        new[:, 0] = np.minimum(new[:, 0], 2.0)
        squares = np.sum(residual(new) ** 2, axis=1)
        better = squares < least
        value[better], least[better] = new[better], squares[better]
        damped = np.clip(np.where(better, 0.2 * damped, 5.0 * damped), 1e-7, 1e6)
    log, phase, faster, b, a, cosine, sine, turned = value[int(np.argmin(least))].tolist()
    amplitude = size * math.exp(log)
    return Planes(
        amplitude,
        phase,
        omega + faster / last_s,
        b / last_s,
        a / last_s / size,
        complex(cosine, -sine),
        turned / last_s,
    )
