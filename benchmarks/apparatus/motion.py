"""The motion: laws of pendulums, springs and bearings, integrated by steps of a few milliseconds.

Runge-Kutta of fourth order with a fixed step. Friction keeps its side within a step: where the
velocity changes its sign, the step is cut at the turning point. Nothing here is taken from the
library.
"""

from __future__ import annotations

from enum import IntEnum, auto
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


class P(IntEnum):
    """Places of the parameters of a law; SI, radians. What is zero is absent."""

    OMEGA = 0
    SINE = auto()
    """The share of (sin x - x) that is added to the linear torque."""
    A = auto()
    B_VISCOUS = auto()
    B_HYSTERETIC = auto()
    C = auto()
    VELOCITY_FORM = auto()
    """The share of the drag a that follows v|v| instead of the energy."""
    K2 = auto()
    K3 = auto()
    K_ABS = auto()
    PLAY = auto()
    POWER = auto()
    EXPONENT = auto()
    CUBIC = auto()
    STRIBECK = auto()
    STRIBECK_V = auto()
    DAHL = auto()
    DAHL_Z = auto()
    VORTEX = auto()
    VORTEX_FROM = auto()
    PLANE_DETUNING = auto()
    SIZE = auto()
    """Of the law out of the catalogue, `Law`, whose two shapes follow."""
    SHAPE = auto()
    SHAPE_2 = auto()


class T(IntEnum):
    """What depends on the time, in rows of half steps."""

    PUSH = 0
    """rad/s^2"""
    STIFF = auto()
    """Factor of omega^2."""
    LOSS = auto()
    """Factor of all losses."""
    BRAKE = auto()
    """Viscous rate on top, 1/s."""
    REST = auto()
    """The equilibrium, rad."""


class Law(IntEnum):
    """Laws that stand in no catalogue of the library: from physics books and from apparatus."""

    NONE = 0
    WINDING_STRING = auto()
    """The string winds on a cylinder of radius s l: (1 + s x) x'' + s x'^2 + w^2 sin x = 0."""
    ROLLING_EDGE = auto()
    """The axis rolls: the moment of inertia is 1 + 2 s (1 - cos x)."""
    MAGNET_BELOW = auto()
    """A magnet under the equilibrium: s w^2 x (1 + (x/d)^2)^(-5/2)."""
    EDDY_PEAK = auto()
    """An eddy-current brake beyond its best speed: s v/(1 + (v/v_c)^2)."""
    LOCAL_BRAKE = auto()
    """A brake that acts near the equilibrium only: s v exp(-(x/d)^2)."""
    BUMPER = auto()
    """A cushion on one side, beyond d: s w^2 (x - d)."""
    WIND = auto()
    """Drag against air that moves at u: s (v - u)|v - u|."""
    ONE_WAY = auto()
    """Viscous in one direction only, as a cable that drags."""
    AGEING = auto()
    """Friction that has grown at the reversal, and wears off over d: s exp(-|x - x_turn|/d)."""
    BOUC_WEN = auto()
    """A cable's hysteresis: w^2 s z, z' = v - (|v| z + v |z|)|z|/(2 d^2)."""
    ELASTIC = auto()
    """An elastic string: stretch and swing exchange energy."""
    SLOSHING = auto()
    """Water in the bob: a second oscillator, driven by the first and acting on it."""
    SLIPPING_ARM = auto()
    """The support gives way for a tenth of a period at one of the turning points, above d."""
    COGGING = auto()
    """A motor's cogging torque: s sin(m x)."""
    VIBRATED = auto()
    """A pivot that vibrates fast (Kapitza): s w^2 sin(2x)/2."""
    SQUEEZE_FILM = auto()
    """Air squeezed out of a gap at the end of the swing: s v/(1 - x/d)^3."""


PARAMETERS: Final = len(P)
TIMES: Final = len(T)
_NEAR: Final = 1e-12


@njit(cache=True)
def slope(u, side, turn, k, law, now, out):  # type: ignore[no-untyped-def]
    """Time derivatives of (x, v, p, q, z), p and q a second oscillator, z an inner state."""
    x, v, p, q, z = u
    w = k[0]
    th = x - now[4]
    if k[10] > 0.0:
        th -= min(max(th, -0.5 * k[10]), 0.5 * k[10])
    torque = th + k[1] * (np.sin(th) - th) + k[7] * th * th + k[8] * th**3 + k[9] * th * abs(th)
    height = th * th + k[1] * (2.0 - 2.0 * np.cos(th) - th * th)
    energy = w * w * height + v * v
    drag = (1.0 - k[6]) * energy * side + k[6] * 1.5 * v * abs(v)
    loss = 0.5 * np.pi * ((k[5] * w + k[4] * np.sqrt(energy)) * side + k[2] / w * drag)
    loss += 2.0 * k[3] * v
    loss *= now[2]
    loss += 2.0 * now[3] * v
    if k[11] != 0.0:
        loss += k[11] * (abs(v) / 0.1) ** k[12] * side
    loss += k[13] * v**3 / (3.0 * w * w)
    if k[14] != 0.0:
        loss += k[14] * np.exp(-((v / k[15]) ** 2)) * side
    out[4] = 0.0
    if k[17] > 0.0:
        loss += w * w * k[16] * z
        out[4] = v - abs(v) * z / k[17]
    if k[18] != 0.0 and abs(turn) > k[19]:
        psi = np.arctan2(abs(v) / w, th if turn > 0 else -th)
        strength = np.pi * w * k[18] * 1.36 / (0.36 * (1.0 + np.exp(-np.pi / 0.6)))
        loss += strength * (abs(turn) - k[19]) * np.exp(-psi / 0.6) * side
    acceleration = -w * w * now[1] * torque - loss + now[0]
    s, d, e = k[21], k[22], k[23]
    push_p = 0.0
    if law == 1:
        acceleration = (acceleration - s * v * v) / (1.0 + s * x)
    elif law == 2:
        acceleration = (acceleration - s * np.sin(x) * v * v) / (1.0 + 2.0 * s * (1.0 - np.cos(x)))
    elif law == 3:
        acceleration -= s * w * w * x * (1.0 + (x / d) ** 2) ** -2.5
    elif law == 4:
        acceleration -= s * v / (1.0 + (v / d) ** 2)
    elif law == 5:
        acceleration -= s * v * np.exp(-((x / d) ** 2))
    elif law == 6:
        acceleration -= s * w * w * max(0.0, x - d)
    elif law == 7:
        acceleration -= s * ((v - d) * abs(v - d) + d * abs(d))
    elif law == 8:
        acceleration -= s * max(0.0, v)
    elif law == 9:
        acceleration -= s * side * np.exp(-abs(x - turn) / d)
    elif law == 10:
        acceleration -= w * w * s * z
        out[4] = v - 0.5 * (abs(v) * z + v * abs(z)) * abs(z) / (d * d)
    elif law == 11:
        acceleration = (acceleration - 2.0 * s * q * v) / (1.0 + s * p)
        push_p = (1.0 + p) * v * v + w * w * (np.cos(x) - 1.0)
    elif law == 12:
        acceleration += s * w * w * p
        push_p = w * w * x
    elif law == 13:
        if turn < -d and np.arctan2(abs(v) / w, -x) < 0.2 * np.pi:
            acceleration -= s
    elif law == 14:
        acceleration -= s * np.sin(d * x)
    elif law == 15:
        acceleration -= s * w * w * 0.5 * np.sin(2.0 * x)
    elif law == 16:
        acceleration -= s * v / (1.0 - x / d) ** 3
    out[0] = v
    out[1] = acceleration
    out[2] = q
    if law == 11 or law == 12:
        out[3] = -((w * d) ** 2) * p - w * d * e * q + push_p
    else:
        # A second plane: nearly the frequency, and the losses of the first.
        level = np.sqrt(energy) / w + 1e-9
        rate = (k[2] * level + k[3] + k[4] + k[5] / level) * now[2] + now[3]
        out[3] = -((w + k[20]) ** 2) * now[1] * p - 2.0 * rate * q


@njit(cache=True)
def step(u, h, side, turn, k, law, now, work):  # type: ignore[no-untyped-def]
    """One step of Runge and Kutta: the state after h; ``now`` has rows of begin, middle, end."""
    one, two, three, four, at = work[0], work[1], work[2], work[3], work[4]
    slope(u, side, turn, k, law, now[0], one)
    for i in range(5):
        at[i] = u[i] + 0.5 * h * one[i]
    slope(at, side, turn, k, law, now[1], two)
    for i in range(5):
        at[i] = u[i] + 0.5 * h * two[i]
    slope(at, side, turn, k, law, now[1], three)
    for i in range(5):
        at[i] = u[i] + h * three[i]
    slope(at, side, turn, k, law, now[2], four)
    new = np.empty(5)
    for i in range(5):
        new[i] = u[i] + h / 6.0 * (one[i] + 2.0 * two[i] + 2.0 * three[i] + four[i])
    return new


@njit(cache=True)
def integrate(start, h, k, law, times, kicks):  # type: ignore[no-untyped-def]
    """States at the ends of all steps, shape (n + 1, 5), and the turning point before each.

    Parameters
    ----------
    start
        x, v, p, q, z.
    h
        The step, s.
    k, law
        `P` and `Law`.
    times
        `T`, shape (2 n + 1, 5): at the steps and in their middles.
    kicks
        Jumps of the velocity at the steps, rad/s, shape (n + 1,).
    """
    n = len(kicks) - 1
    states, turns = np.empty((n + 1, 5)), np.empty(n + 1)
    work, probe = np.empty((5, 5)), np.empty(5)
    u = start.copy()
    turn = u[0]
    side = 1.0 if u[1] > 0.0 else -1.0
    if u[1] == 0.0 and u[0] < times[0, 4]:
        side = 1.0
    stuck = False
    for i in range(n + 1):
        if kicks[i] != 0.0:
            u[1] += kicks[i]
            if u[1] * side < 0.0:
                side, turn = -side, u[0]
            stuck = False
        states[i], turns[i] = u, turn
        if i == n:
            break
        now = times[2 * i : 2 * i + 3]
        left, cuts = h, 0
        if stuck:
            # It moves again where the torque exceeds what friction can hold, on either side.
            for way in (-1.0, 1.0):
                slope(u, way, turn, k, law, now[1], probe)
                if probe[1] * way > 0.0:
                    side, stuck = way, False
            if stuck:
                continue
        while left > 1e-3 * _NEAR + 1e-12 * h:
            new = step(u, left, side, turn, k, law, now, work)
            if new[1] * side >= 0.0 or cuts == 3:
                u, left = new, 0.0
                continue
            low, high = 0.0, left
            for _ in range(50):
                middle = 0.5 * (low + high)
                new = step(u, middle, side, turn, k, law, now, work)
                if new[1] * side >= 0.0:
                    low = middle
                else:
                    high = middle
            u = step(u, high, side, turn, k, law, now, work)
            u[1] = 0.0
            left -= high
            turn, side, cuts = u[0], -side, cuts + 1
            slope(u, side, turn, k, law, now[1], probe)
            if probe[1] * side <= 0.0:
                stuck = True
                break
    return states, turns
