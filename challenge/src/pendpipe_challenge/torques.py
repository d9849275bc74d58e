"""The equation of motion: its parameters by name, and one compiled right-hand side.

Angles in rad, times in s. `x` is the angle, `v` its rate, `w` = omega. Torques are per moment
of inertia. A zero switches a term off (scales and exponents beside it then don't matter).
"""

from __future__ import annotations

import math
from typing import Any, Final

import numba as nb
import numpy as np

from pendpipe.arrays import FloatArray

PARAMETERS: Final = {
    # The free decay of the paper.
    "omega": 1.0,  # rad/s
    "step_phase": 0.32,  # longest step, rad of the swing
    "gamma": 0.0,  # omega/Q_v, 1/s
    "coulomb": 0.0,  # f_c sgn v, rad/s^2
    "hysteretic": 0.0,  # f_h sqrt(w^2 x^2 + v^2) sgn v, 1/s
    "quadratic": 0.0,  # f_q (w^2 x^2 + v^2) sgn v, 1/rad
    # Restoring torque, all times w^2.
    "sine": 0.0,  # share of sin x in the place of x
    "cubic": 0.0,  # k3 x^3, 1/rad^2
    "square": 0.0,  # k2 x^2, 1/rad
    "sided": 0.0,  # x |x|, 1/rad
    "stiffening": 0.0,  # flexure: x^3 at first, sinh in full, 1/rad^2
    "stiffening_scale": 0.5,  # rad
    "lopsided": 0.0,  # x^2 at first, exp in full, 1/rad
    "lopsided_scale": 0.5,  # rad
    "play": 0.0,  # half width of a dead zone, rad
    # Losses.
    "drag": 0.0,  # |v| v, 1/rad
    "power": 0.0,  # |v|^n sgn v
    "power_exponent": 1.5,
    "energy": 0.0,  # rho^(2 lambda) sgn v
    "energy_exponent": 0.75,
    "reynolds": 0.0,  # Schiller-Naumann drag: rate of its linear part, 1/s
    "reynolds_speed": 0.01,  # speed at which Re is 1, rad/s
    "rayleigh": 0.0,  # v^3, s/rad^2
    "van_der_pol": 0.0,  # x^2 v, 1/(s rad^2)
    "eddy": 0.0,  # brake whose magnet leaves its plate: rate at the centre, 1/s
    "eddy_width": 0.2,  # rad
    "stribeck": 0.0,  # rad/s^2
    "stribeck_speed": 0.05,  # rad/s
    "stribeck_power": 2.0,
    "dahl": 0.0,  # bristles' stiffness over w^2
    "dahl_reach": 0.01,  # deflection at which they slide, rad
    "bristle_damping": 0.0,  # LuGre: sigma_1, 1/s
    "bristle_stribeck": 0.0,  # LuGre: static over sliding friction, less 1
    "iwan": 0.0,  # four Dahl elements of several reaches (Iwan's model)
    "iwan_reach": 0.01,
    "basset": 0.0,  # half derivative of v, 1/sqrt(s)
    "shedding": 0.0,  # burst after each reversal above an amplitude
    "shedding_amplitude": 0.1,
    "shedding_power": 1.0,
    "maxwell": 0.0,  # relaxing springs' stiffness over w^2
    "maxwell_time": 10.0,  # s, of the fastest
    "rough": 0.0,  # friction on a spot, rad/s^2
    "rough_place": 0.05,
    "rough_width": 0.01,
    "pulsed": 0.0,  # damping that is periodic in time, 1/s
    "pulsed_omega": 1.0,
    "pulsed_phase": 0.0,
    "kink": 0.0,  # damping above an amplitude, 1/(s rad)
    "kink_amplitude": 0.1,
    # In time.
    "omega_drift": 0.0,  # relative, 1/s
    "omega_drift_time": 0.0,  # s; 0: straight
    "gamma_drift": 0.0,  # 1/s^2
    "gamma_drift_time": 0.0,
    "creep": 0.0,  # of the equilibrium, rad/s
    "creep_log": 0.0,  # rad
    "creep_log_time": 10.0,
    "rest_jump": 0.0,  # rad
    "rest_jump_at": 0.0,
    "omega_jump": 0.0,  # relative
    "omega_jump_at": 0.0,
    "gamma_jump": 0.0,  # 1/s
    "gamma_jump_at": 0.0,
    "release": 0.0,  # extra damping at the start, 1/s
    "release_finger": 0.0,  # extra friction at the start, rad/s^2
    "release_time": 2.0,  # s
    "impulse": 0.0,  # rad/s
    "impulse_at": 0.0,
    "impulse_width": 0.0,  # s; a half sine
    "scaling": 0.0,  # of x and v at one moment, relative
    "scaling_at": 0.0,
    "rub": 0.0,  # damping during a short time, 1/s
    "rub_at": 0.0,
    "rub_width": 1.0,
    "parametric": 0.0,  # of omega^2, relative
    "parametric_omega": 1.0,
    "parametric_phase": 0.0,
    # A law of `BOOK`, which no catalogue has: its size and two shapes.
    "book": 0.0,
    "book_size": 0.0,
    "book_shape": 1.0,
    "book_shape_2": 1.0,
    # Drive and a second coordinate.
    "drive": 0.0,  # rad/s^2
    "drive_omega": 1.0,
    "drive_phase": 0.0,
    "second": 0.0,  # 1: the second coordinate moves
    "second_omega": 1.0,
    "second_gamma": 0.0,
    "coupling": 0.0,  # w^2 kappa u on x, and w^2 kappa x on u
    "inertial": 0.0,  # u is driven by -inertial x''
}
"""Every parameter with the value that it has by default."""

GROUPS: Final = {
    "any_restoring": (
        "play",
        "sine",
        "cubic",
        "square",
        "sided",
        "stiffening",
        "lopsided",
    ),
    "any_rate": (
        "gamma_drift",
        "gamma_jump",
        "release",
        "rub",
        "rayleigh",
        "van_der_pol",
        "eddy",
        "reynolds",
        "drag",
        "pulsed",
        "kink",
    ),
    "any_friction": (
        "energy",
        "power",
        "stribeck",
        "release_finger",
        "shedding",
        "rough",
        "book",
    ),
    "any_time": ("creep", "creep_log", "rest_jump", "omega_drift", "omega_jump", "parametric"),
    "any_push": ("drive", "impulse"),
    "any_hidden": ("dahl", "iwan", "maxwell", "basset"),
}
"""Terms of one kind, so that a whole kind which is absent is passed over at once."""

RECORD: Final = np.dtype([(name, np.float64) for name in (*PARAMETERS, *GROUPS)])

DAHL: Final = 2
IWAN: Final = 3
IWAN_ELEMENTS: Final = 4
MAXWELL: Final = IWAN + IWAN_ELEMENTS
MAXWELL_ELEMENTS: Final = 3
BASSET: Final = MAXWELL + MAXWELL_ELEMENTS
BASSET_ELEMENTS: Final = 12
SECOND: Final = BASSET + BASSET_ELEMENTS
STATES: Final = SECOND + 2
"""Where each hidden state stands behind x and v."""


BOOK: Final = {
    # (1 + s x) x'' + s x'^2 + w^2 sin x = 0: the string winds on a cylinder of radius s l.
    "winding-string": (WINDING_STRING := 1),
    # The axis rolls: the moment of inertia is 1 + 2 s (1 - cos x).
    "rolling-edge": (ROLLING_EDGE := 2),
    # A magnet under the equilibrium: s w^2 x (1 + (x/d)^2)^(-5/2).
    "magnet-below": (MAGNET_BELOW := 3),
    # An eddy-current brake beyond its best speed: s v/(1 + (v/d)^2).
    "eddy-peak": (EDDY_PEAK := 4),
    # A brake near the equilibrium only: s v exp(-(x/d)^2).
    "local-brake": (LOCAL_BRAKE := 5),
    # A cushion on one side, beyond d: s w^2 (x - d).
    "bumper": (BUMPER := 6),
    # Drag against air that moves at d: s (v - d)|v - d|.
    "wind": (WIND := 7),
    # Viscous in one direction only, as a cable that drags.
    "one-way-drag": (ONE_WAY_DRAG := 8),
    # Friction that has grown at the reversal, and wears off: s exp(-|x - x_turn|/d).
    "ageing-friction": (AGEING_FRICTION := 9),
    # Bouc and Wen: w^2 s z, z' = v - (|v| z + v |z|)|z|/(2 d^2).
    "cable-hysteresis": (CABLE_HYSTERESIS := 10),
    # Stretch and swing exchange energy.
    "elastic-string": (ELASTIC_STRING := 11),
    # Water in the bob: driven by the swing, and acting on it.
    "sloshing-bob": (SLOSHING_BOB := 12),
    # The support gives way for a tenth of a period at one of the turning points, beyond d.
    "slipping-arm": (SLIPPING_ARM := 13),
    # s sin(d x).
    "cogging": (COGGING_MOTOR := 14),
    # A pivot that vibrates fast (Kapitza): s w^2 sin(2x)/2.
    "vibrated-pivot": (VIBRATED_PIVOT := 15),
    # Air squeezed out of a gap at the end of the swing: s v/(1 - x/d)^3.
    "squeeze-film": (SQUEEZE_FILM := 16),
}
"""Laws that stand in no catalogue, from physics books and from apparatus: their numbers."""


def of_rates(
    omega: float, a: float, viscous: float, hysteretic: float, c: float, *, speed: bool = False
) -> dict[str, float]:
    """Parameters of Eq. 8 by the rates of Eq. 13; `speed`: the drag is v|v|, not the energy's."""
    quadratic = 0.5 * math.pi * a / omega
    return {
        "omega": omega,
        "gamma": 2.0 * viscous,
        "hysteretic": 0.5 * math.pi * hysteretic,
        "coulomb": 0.5 * math.pi * omega * c,
        "quadratic": 0.0 if speed else quadratic,
        "drag": 1.5 * quadratic if speed else 0.0,
    }


compiled = nb.njit(cache=True, fastmath=False, error_model="numpy")


@compiled
def ramp(t: float, tau: float) -> float:
    """t, or its relaxing form tau (1 - exp(-t/tau))."""
    return t if tau <= 0.0 else tau * (1.0 - math.exp(-t / tau))


@compiled
def rest_angle(p: Any, t: float, middle: float) -> float:
    """Where the pendulum would rest now; `middle` tells on which side of a jump a step is."""
    angle = 0.0
    if p.creep != 0.0:
        angle += p.creep * t
    if p.creep_log != 0.0:
        angle += p.creep_log * math.log(1.0 + max(t, 0.0) / p.creep_log_time)
    if p.rest_jump != 0.0 and middle > p.rest_jump_at:
        angle += p.rest_jump
    return angle


@compiled
def omega_now(p: Any, t: float, middle: float) -> float:
    """Angular frequency with its drift and its jump."""
    factor = 1.0
    if p.omega_drift != 0.0:
        factor += p.omega_drift * ramp(t, p.omega_drift_time)
    if p.omega_jump != 0.0 and middle > p.omega_jump_at:
        factor += p.omega_jump
    if p.parametric != 0.0:
        factor *= math.sqrt(
            1.0 + p.parametric * math.cos(p.parametric_omega * t + p.parametric_phase)
        )
    return float(p.omega * factor)


@compiled
def restoring(p: Any, x: float, region: int) -> float:
    """Restoring torque over w^2; `region` is the side of the dead zone."""
    if p.any_restoring == 0.0:
        return float(x)
    if p.play != 0.0:
        x = 0.0 if region == 0 else x - region * p.play
    force = x
    if p.sine != 0.0:
        force += p.sine * (math.sin(x) - x)
    if p.cubic != 0.0:
        force += p.cubic * x * x * x
    if p.square != 0.0:
        force += p.square * x * x
    if p.sided != 0.0:
        force += p.sided * x * abs(x)
    if p.stiffening != 0.0:
        s = p.stiffening_scale
        force += p.stiffening * 6.0 * s * s * (s * math.sinh(x / s) - x)
    if p.lopsided != 0.0:
        s = p.lopsided_scale
        force += p.lopsided * 2.0 * s * (s * math.expm1(x / s) - x)
    return float(force)


@compiled
def damping_rate(p: Any, x: float, v: float, t: float, middle: float) -> float:
    """What multiplies v."""
    rate = p.gamma
    if p.any_rate == 0.0:
        return float(rate)
    if p.gamma_drift != 0.0:
        rate += p.gamma_drift * ramp(t, p.gamma_drift_time)
    if p.gamma_jump != 0.0 and middle > p.gamma_jump_at:
        rate += p.gamma_jump
    if p.release != 0.0:
        rate += p.release * math.exp(-t / p.release_time)
    if p.rub != 0.0 and p.rub_at < middle < p.rub_at + p.rub_width:
        rate += p.rub
    if p.rayleigh != 0.0:
        rate += p.rayleigh * v * v
    if p.van_der_pol != 0.0:
        rate += p.van_der_pol * x * x
    if p.eddy != 0.0:
        shape = 1.0 + (x / p.eddy_width) ** 2
        rate += p.eddy / (shape * shape)
    if p.reynolds != 0.0:
        rate += p.reynolds * (1.0 + 0.15 * (abs(v) / p.reynolds_speed) ** 0.687)
    if p.drag != 0.0:
        rate += p.drag * abs(v)
    if p.pulsed != 0.0:
        rate += p.pulsed * math.cos(p.pulsed_omega * t + p.pulsed_phase)
    if p.kink != 0.0:
        amplitude = math.sqrt(x * x + (v / p.omega) ** 2)
        rate += p.kink * max(0.0, amplitude - p.kink_amplitude)
    return float(rate)


@compiled
def friction(p: Any, x: float, v: float, t: float, turn: float, turned_at: float) -> float:
    """What multiplies sgn v; `turn` is the last turning point, reached at `turned_at`."""
    force = p.coulomb
    if p.hysteretic != 0.0 or p.quadratic != 0.0 or p.energy != 0.0:
        # Twice the energy: of a pendulum, where it swings by sin x.
        potential = x * x + p.sine * (4.0 * math.sin(0.5 * x) ** 2 - x * x)
        square = p.omega**2 * potential + v * v
        force += p.hysteretic * math.sqrt(square) + p.quadratic * square
        if p.energy != 0.0 and square > 0.0:
            force += p.energy * square**p.energy_exponent
    if p.any_friction == 0.0:
        return float(force)
    if p.power != 0.0:
        force += p.power * abs(v) ** p.power_exponent
    if p.stribeck != 0.0:
        force += p.stribeck * math.exp(-((abs(v) / p.stribeck_speed) ** p.stribeck_power))
    if p.release_finger != 0.0:
        force += p.release_finger * math.exp(-t / p.release_time)
    if p.shedding != 0.0 and abs(turn) > p.shedding_amplitude:
        burst = math.exp(-p.omega * (t - turned_at) / 0.6)
        force += p.shedding * (abs(turn) - p.shedding_amplitude) ** p.shedding_power * burst
    if p.rough != 0.0:
        force += p.rough * math.exp(-(((x - p.rough_place) / p.rough_width) ** 2))
    if p.book == AGEING_FRICTION:
        force += p.book_size * math.exp(-abs(x - turn) / p.book_shape)
    return float(force)


@compiled
def push(p: Any, t: float, middle: float) -> float:
    """Acceleration from outside."""
    force = 0.0
    if p.drive != 0.0:
        force += p.drive * math.cos(p.drive_omega * t + p.drive_phase)
    width = p.impulse_width
    if p.impulse != 0.0 and width > 0.0 and p.impulse_at < middle < p.impulse_at + width:
        force += p.impulse * 0.5 * math.pi / width * math.sin(math.pi * (t - p.impulse_at) / width)
    return float(force)


@compiled
def hidden(p: Any, s: FloatArray, out: FloatArray, sign: float) -> float:
    """Rates of the hidden states that feel only x and v, and their acceleration of x."""
    x, v, w2 = s[0], s[1], p.omega * p.omega
    speed, force = sign * v, 0.0
    if p.dahl != 0.0:
        reach = p.dahl_reach
        if p.bristle_stribeck != 0.0:
            reach *= 1.0 + p.bristle_stribeck * math.exp(-((v / p.stribeck_speed) ** 2))
        out[DAHL] = v - speed * s[DAHL] / reach
        force -= w2 * p.dahl * s[DAHL] + p.bristle_damping * out[DAHL]
    if p.iwan != 0.0:
        reach = 0.5 * p.iwan_reach
        for i in range(IWAN_ELEMENTS):
            out[IWAN + i] = v - speed * s[IWAN + i] / reach
            force -= w2 * p.iwan * s[IWAN + i] / IWAN_ELEMENTS
            reach *= 2.0
    if p.maxwell != 0.0:
        tau = p.maxwell_time
        for i in range(MAXWELL_ELEMENTS):
            stretch = x - s[MAXWELL + i]
            out[MAXWELL + i] = stretch / tau
            force -= w2 * p.maxwell * stretch
            tau *= 4.0
    if p.basset != 0.0:
        # 1/sqrt(pi t) = (1/pi) integral of exp(u/2 - t exp u) du, rates a factor e apart.
        rate = 4.0 * p.omega
        for i in range(BASSET_ELEMENTS):
            out[BASSET + i] = v - rate * s[BASSET + i]
            force -= p.basset * math.sqrt(rate) / math.pi * out[BASSET + i]
            rate /= math.e
    return float(force)


@compiled
def by_the_book(p: Any, s: FloatArray, out: FloatArray, turn: float) -> None:
    """Add a law of `BOOK` to the acceleration, and move what it moves besides."""
    x, v, u, z, w = s[0], s[1], s[SECOND], s[DAHL], p.omega
    size, d, e, law = p.book_size, p.book_shape, p.book_shape_2, p.book
    if law == WINDING_STRING:
        out[1] = (out[1] - size * v * v) / (1.0 + size * x)
    elif law == ROLLING_EDGE:
        inertia = 1.0 + 2.0 * size * (1.0 - math.cos(x))
        out[1] = (out[1] - size * math.sin(x) * v * v) / inertia
    elif law == MAGNET_BELOW:
        out[1] -= size * w * w * x * (1.0 + (x / d) ** 2) ** -2.5
    elif law == EDDY_PEAK:
        out[1] -= size * v / (1.0 + (v / d) ** 2)
    elif law == LOCAL_BRAKE:
        out[1] -= size * v * math.exp(-((x / d) ** 2))
    elif law == BUMPER:
        out[1] -= size * w * w * max(0.0, x - d)
    elif law == WIND:
        out[1] -= size * ((v - d) * abs(v - d) + d * abs(d))
    elif law == ONE_WAY_DRAG:
        out[1] -= size * max(0.0, v)
    elif law == CABLE_HYSTERESIS:
        out[1] -= w * w * size * z
        out[DAHL] = v - 0.5 * (abs(v) * z + v * abs(z)) * abs(z) / (d * d)
    elif law == ELASTIC_STRING:
        out[1] = (out[1] - 2.0 * size * s[SECOND + 1] * v) / (1.0 + size * u)
        pulled = (1.0 + u) * v * v + w * w * (math.cos(x) - 1.0)
        out[SECOND] = s[SECOND + 1]
        out[SECOND + 1] = pulled - (w * d) ** 2 * u - w * d * e * s[SECOND + 1]
    elif law == SLOSHING_BOB:
        out[1] += size * w * w * u
        out[SECOND] = s[SECOND + 1]
        out[SECOND + 1] = w * w * x - (w * d) ** 2 * u - w * d * e * s[SECOND + 1]
    elif law == SLIPPING_ARM and turn < -d and math.atan2(abs(v) / w, -x) < 0.2 * math.pi:
        out[1] -= size
    elif law == COGGING_MOTOR:
        out[1] -= size * math.sin(d * x)
    elif law == VIBRATED_PIVOT:
        out[1] -= size * w * w * 0.5 * math.sin(2.0 * x)
    elif law == SQUEEZE_FILM:
        out[1] -= size * v / (1.0 - x / d) ** 3


@compiled
def rates(
    p: Any,
    s: FloatArray,
    out: FloatArray,
    t: float,
    middle: float,
    sign: float,
    region: int,
    turn: float,
    turned_at: float,
) -> float:
    """Fill `out` with ds/dt.

    Parameters
    ----------
    p
        The parameters' record (`RECORD`).
    s, out
        State and its rate: x, v and the hidden states.
    t, middle
        Time, and the middle of the step it belongs to, which decides about switches.
    sign, region
        The sides of v = 0 and of the dead zone that hold throughout the step.
    turn, turned_at
        The last turning point, rad and s.

    Returns
    -------
    float
        The acceleration without what multiplies `sign`: it decides about sticking.
    """
    x, v = s[0], s[1]
    w, rest, free = p.omega, 0.0, 0.0
    if p.any_time != 0.0:
        w, rest = omega_now(p, t, middle), rest_angle(p, t, middle)
    if p.any_push != 0.0:
        free += push(p, t, middle)
    if p.any_hidden != 0.0:
        free += hidden(p, s, out, sign)
    free -= w * w * restoring(p, x - rest, region) + damping_rate(p, x, v, t, middle) * v
    if p.second != 0.0:
        free += p.coupling * p.omega * p.omega * s[SECOND]
    out[0] = v
    out[1] = free - sign * friction(p, x, v, t, turn, turned_at)
    if p.second != 0.0:
        u, tension = s[SECOND], 0.0
        if p.sine != 0.0 and p.inertial == 0.0:
            # What holds a pendulum in its plane: it swings out of it against the same string.
            tension = p.sine * (v * v + w * w * (math.cos(x) - 1.0))
        out[SECOND] = s[SECOND + 1]
        out[SECOND + 1] = (
            -(p.second_omega * p.second_omega + tension) * u
            - p.second_gamma * s[SECOND + 1]
            + p.coupling * p.omega * p.omega * x
            - p.inertial * out[1]
        )
    if p.book != 0.0:
        by_the_book(p, s, out, turn)
    return float(free)
