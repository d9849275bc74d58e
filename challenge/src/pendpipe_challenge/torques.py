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
    "gamma": 0.0,  # omega/Q_v, 1/s
    "coulomb": 0.0,  # f_c sgn v, rad/s^2
    "hysteretic": 0.0,  # f_h sqrt(w^2 x^2 + v^2) sgn v, 1/s
    "quadratic": 0.0,  # f_q (w^2 x^2 + v^2) sgn v, 1/rad
    # Restoring torque, all times w^2.
    "sine": 0.0,  # share of sin x in the place of x
    "cubic": 0.0,  # k3 x^3, 1/rad^2
    "square": 0.0,  # k2 x^2, 1/rad
    "stiffening": 0.0,  # flexure: x^3 at first, sinh in full, 1/rad^2
    "stiffening_scale": 0.5,  # rad
    "lopsided": 0.0,  # x^2 at first, exp in full, 1/rad
    "lopsided_scale": 0.5,  # rad
    "play": 0.0,  # half width of a dead zone, rad
    "magnet": 0.0,  # m x/(1 + (x/width)^2)^2
    "magnet_width": 0.02,  # rad
    "cogging": 0.0,  # rad
    "cogging_teeth": 40.0,
    "cogging_phase": 0.0,
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
    "memory": 0.0,  # friction that grows with |x - last turning point|^p
    "memory_power": 0.5,
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
        "stiffening",
        "lopsided",
        "magnet",
        "cogging",
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
        "memory",
    ),
    "any_time": ("creep", "creep_log", "rest_jump", "omega_drift", "omega_jump"),
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
    if p.stiffening != 0.0:
        s = p.stiffening_scale
        force += p.stiffening * 6.0 * s * s * (s * math.sinh(x / s) - x)
    if p.lopsided != 0.0:
        s = p.lopsided_scale
        force += p.lopsided * 2.0 * s * (s * math.expm1(x / s) - x)
    if p.magnet != 0.0:
        shape = 1.0 + (x / p.magnet_width) ** 2
        force += p.magnet * x / (shape * shape)
    if p.cogging != 0.0:
        force += p.cogging * (
            math.sin(p.cogging_teeth * x + p.cogging_phase) - math.sin(p.cogging_phase)
        )
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
def friction(
    p: Any, x: float, v: float, t: float, extra: float, turn: float, turned_at: float
) -> float:
    """What multiplies sgn v; `turn` is the last turning point, reached at `turned_at`."""
    force = p.coulomb + extra
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
    if p.memory != 0.0:
        force += p.memory * abs(x - turn) ** p.memory_power
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
def rates(
    p: Any,
    s: FloatArray,
    out: FloatArray,
    t: float,
    middle: float,
    sign: float,
    region: int,
    extra: float,
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
    extra
        Friction of this sampling interval beside the parameters', rad/s^2.
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
    out[1] = free - sign * friction(p, x, v, t, extra, turn, turned_at)
    if p.second != 0.0:
        u = s[SECOND]
        out[SECOND] = s[SECOND + 1]
        out[SECOND + 1] = (
            -p.second_omega * p.second_omega * u
            - p.second_gamma * s[SECOND + 1]
            + p.coupling * p.omega * p.omega * x
            - p.inertial * out[1]
        )
    return float(free)
