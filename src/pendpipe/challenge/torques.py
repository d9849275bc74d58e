"""The equation of motion, one compiled right-hand side with every effect as a switch."""

from __future__ import annotations

import math
from typing import Any

import numba as nb

from pendpipe.arrays import FloatArray
from pendpipe.challenge import layout

DAHL, IWAN, MAXWELL = layout.DAHL, layout.IWAN, layout.MAXWELL
BASSET, SECOND = layout.BASSET, layout.SECOND
IWAN_ELEMENTS, MAXWELL_ELEMENTS = layout.IWAN_ELEMENTS, layout.MAXWELL_ELEMENTS
BASSET_ELEMENTS = layout.BASSET_ELEMENTS

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
        square = (p.omega * x) ** 2 + v * v
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
    p: Any, s: FloatArray, out: FloatArray, t: float, middle: float, sign: float, region: int,
    extra: float, turn: float, turned_at: float,
) -> float:  # fmt: skip
    """Fill `out` with ds/dt.

    Parameters
    ----------
    p
        The parameters' record (`layout.RECORD`).
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
