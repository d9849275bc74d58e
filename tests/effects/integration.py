"""Motion under a law by scipy's integrator, restarted at each turning point; the slow way.

It shares nothing with the package: a law is a function of time, angle, velocity and the sign
of the velocity, written down in the test.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Floats = NDArray[np.float64]
Acceleration = Callable[[float, Floats, float, float], float]
"""x'' of (time, state, sign of the velocity, angle of the last reversal); state[:2] = x, v."""
StateRate = Callable[[float, Floats], list[float]]


def integrate(
    acceleration: Acceleration,
    start_rad: float,
    start_s: float,
    time_s: Floats,
    *,
    more: tuple[float, ...] = (),
    more_rates: StateRate | None = None,
    kicks: tuple[tuple[float, float, float], ...] = (),
    longest_s: float = 0.2,
) -> Floats:
    """Return the angles at rising times, from a turning point.

    Parameters
    ----------
    more, more_rates
        Further state, and its rates.
    kicks
        (instant, jump of the angle, jump of the velocity), in their order.
    longest_s
        Of a step, lest it pass over what acts for a short time.
    """
    state = np.array([start_rad, 0.0, *more])
    now, turn = start_s, start_rad
    direction = -math.copysign(1.0, start_rad)
    found = np.empty(len(time_s))
    pending = list(kicks)
    while now < time_s[-1]:

        def rate(t: float, y: Floats, s: float = direction, x0: float = turn) -> list[float]:
            rest = more_rates(t, y) if more_rates else []
            return [y[1], acceleration(t, y, s, x0), *rest]

        def reversal(t: float, y: Floats, s: float = direction) -> float:
            return float(s * y[1])

        reversal.terminal = True  # type: ignore[attr-defined]
        reversal.direction = -1.0  # type: ignore[attr-defined]
        end = pending[0][0] if pending else float(time_s[-1]) + 1.0
        piece = solve_ivp(
            rate,
            (now, end),
            state,
            "DOP853",
            events=reversal,
            dense_output=True,
            rtol=1e-11,
            atol=1e-14,
            max_step=longest_s,
        )
        inside = (time_s >= now) & (time_s <= piece.t[-1])
        if np.any(inside):
            found[inside] = piece.sol(time_s[inside])[0]
        now, state = float(piece.t[-1]), piece.y[:, -1].copy()
        if piece.status == 1:
            turn, direction, state[1] = float(state[0]), -direction, 0.0
            # The event is found a rounding error late: leave it behind.
            state[1] = direction * 1e-15
        elif pending:
            _, by_angle, by_velocity = pending.pop(0)
            state[0] += by_angle
            state[1] += by_velocity
            direction = math.copysign(1.0, state[1])
    return found


def swung(
    time_s: Floats,
    amplitude: float,
    omega: float,
    loss: float,
    drag: float = 0.0,
    torque: Callable[[float], float] = math.sin,
    speed: float = 0.0,
) -> Floats:
    """Angles and rates: x'' = -omega^2 torque(x) - 2 loss x' - drag |x'| x'."""

    def motion(_: float, state: Floats) -> list[float]:
        x, v = state
        return [v, -(omega**2) * torque(x) - (2.0 * loss + drag * abs(v)) * v]

    span, start = (float(time_s[0]), float(time_s[-1])), [amplitude, speed]
    return np.asarray(
        solve_ivp(motion, span, start, "DOP853", t_eval=time_s, rtol=1e-10, atol=1e-12).y
    )
