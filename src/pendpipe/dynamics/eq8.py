"""Eq. 8: its constants, turning points and samples, and their derivatives by every parameter."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal, cast, get_args

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.kernel import Kernel, kernel
from pendpipe.dynamics.layout import (
    ENDINGS,
    HEAD,
    MOST_PANELS,
    NODE_COUNT,
    OVERDAMPED,
    REQUEST,
    ROW,
    STOPPED,
    WORK,
    WORK_SIZE,
)
from pendpipe.dynamics.march import march

RATES = ("quadratic", "hysteretic", "viscous", "coulomb")
"""The losses of Eq. 8, in the order of Eq. 13: a, the two parts of b, c."""
JACOBIAN_COLUMNS = (*RATES, "angular_frequency", "angle", "time", "offset")
"""The columns of every Jacobian."""
BASELINE: Final = ("a", "b", "c", "share", "omega", "start_rad", "start_s", "offset")
"""The vector that fit and diagnosis search: Eq. 13's rates; the hysteretic share of b; omega; the
turning point from which the motion starts (about the equilibrium) and when; and the reading of the
equilibrium."""
A, B, C, SHARE, OMEGA, START, TIME, OFFSET = range(8)
SHARE_MEAN: Final = 0.5
"""Of b's hysteretic share before any reading. Any roots of both parts are as likely (Jeffreys'
prior of rates), so that the share is sin^2 of an arc that lies anywhere from 0 to pi/2."""
SHARE_SD: Final = 8.0**-0.5
"""Its standard deviation: that of such a sin^2."""
PLACES: Final = {"a": A, "b": B, "c": C, "frequency": OMEGA, "amplitude": START, "offset": OFFSET}
"""Where what a user may hold stands in it."""


Restoring = Literal["linear", "sine"]
"""The torque: omega^2 x, or omega^2 sin x."""
Drag = Literal["energy", "speed"]
"""The form of the quadratic loss: the paper's rho^2 sgn v, or v|v|."""


_TERMS: Final = 11
"""Of the series of a sine, up to pi/2: the next is 3e-18."""
_SINES: Final = np.array([(-1.0) ** k / math.factorial(2 * k + 1) for k in range(_TERMS)])


@kernel(inline=True)
def _braked(square: Any, v: Any, side: Any, law: FloatArray) -> Any:
    """The acceleration by all four losses of a `law` (`Eq8.numbers`); of twice the energy."""
    omega, drag = law[0], square + law[5] * (1.5 * v * v - square)
    dry = omega * law[4] + law[2] * math.sqrt(square) + law[1] / omega * drag
    return -0.5 * math.pi * dry * side - 2.0 * law[3] * v


@kernel(inline=True)
def _acceleration(x: Any, v: Any, side: Any, law: FloatArray) -> Any:
    """The acceleration x'' + omega^2 x."""
    s, less = x, 0.0
    if law[6] != 0.0:
        # sin x is 2 sin u cos u of half the angle less whole half turns.
        u = 0.5 * x - math.pi * np.floor(x / (2.0 * math.pi) + 0.5)
        z, sine = u * u, _SINES[_TERMS - 1]
        for k in range(_TERMS - 2, -1, -1):
            sine = sine * z + _SINES[k]
        s = 2.0 * sine * u
        less = x - s * math.sqrt(abs(1.0 - 0.25 * s * s))
    square = law[0] * law[0]
    return _braked(square * s * s + v * v, v, side, law) + square * less


def _all_accelerated(
    angle: FloatArray, velocity: FloatArray, side: FloatArray, law: FloatArray, found: FloatArray
) -> None:
    found[:] = cast("Kernel", _acceleration).plain(angle, velocity, side, law)


@kernel(any_order=True, arrays=_all_accelerated)
def _accelerate(
    angle: FloatArray, velocity: FloatArray, side: FloatArray, law: FloatArray, found: FloatArray
) -> None:
    for i in range(angle.size):
        found[i] = _acceleration(angle[i], velocity[i], side[i], law)


@dataclass(frozen=True)
class Eq8:
    r"""The pendulum of Eq. 8, by the first-order rates of Eq. 13.

    .. math::

        \ddot x + [f_c + f_h \rho + f_q \rho^2]\,\mathrm{sgn}\,\dot x + 2 b_v \dot x
        + \omega^2 x = 0, \qquad \rho = \sqrt{\omega^2 x^2 + \dot x^2},

    with :math:`f_c = \pi\omega c/2`, :math:`f_h = \pi b_h/2`, :math:`f_q = \pi a/(2\omega)`.

    With ``restoring="sine"`` the torque is that of a pendulum of any amplitude below pi,

    .. math::

        \ddot x + [f_c + f_h \rho + f_q \rho^2]\,\mathrm{sgn}\,\dot x + 2 b_v \dot x
        + \omega^2 \sin x = 0, \qquad
        \rho = \sqrt{2 \omega^2 (1 - \cos x) + \dot x^2}:

    rho^2 is twice the energy in both, so that the losses keep the paper's energy form (Eq. 9a).
    Balancing the energy over half a swing gives the decay of the amplitude y to first order in
    the losses, with :math:`k = \sin(y/2)` and the complete elliptic integrals K and E of modulus k,

    .. math::

        \frac{dy}{dt} = -\frac{\pi y\,(c + 2 k\,b_h + 4 k^2 a)
        + 16\,b_v\,[E - (1 - k^2) K]}{2 K \sin y},

    and the angular frequency :math:`\pi\omega/(2 K)`. For small y this is Eq. 13,
    :math:`-(c + b y + a y^2)`, so that a, b and c mean the same.

    A drag that follows :math:`\dot x |\dot x|` has another cycle integral with the sine. If it has
    the same a at small amplitudes, it takes :math:`3 (\sin y - y \cos y)/[2 y (1 - \cos y)]` of
    what the energy form takes in half a swing: :math:`1 - y^2/60`, 0.98 at 1 rad, 0.87 at 2.5 rad.
    With ``drag="speed"`` that is the law: the quadratic term is

    .. math::

        \tfrac{3}{2} f_q\, \dot x |\dot x| \quad \text{in place of} \quad
        f_q \rho^2\, \mathrm{sgn}\,\dot x,

    whose a is the same first-order rate of Eq. 13; the other losses keep their form. The two
    forms differ in the third harmonic at small amplitudes, and with the sine in the envelope.

    At rest at an amplitude y the friction is that of the square bracket with
    :math:`\rho = \omega y` (sine: :math:`2 \omega \sin(y/2)`), whatever its terms; the pendulum
    moves only if :math:`\omega^2 y` (:math:`\omega^2 \sin y`) exceeds it. (A drag that follows
    the speed holds nothing at rest.) So hysteretic friction
    alone locks it for
    :math:`Q_h = \omega/(2 b_h) \le \pi/4`, and quadratic friction locks it beyond a largest
    amplitude; see `stop_rad`.

    Parameters
    ----------
    angular_frequency
        omega, rad/s.
    quadratic
        a, 1/(rad s); a = omega/(2 y0 Q_f0).
    hysteretic, viscous
        The two parts of b, 1/s; b_h = omega/(2 Q_h), b_v = omega/(2 Q_v).
    coulomb
        c, rad/s; c = omega y0/(2 Q_c0).
    restoring
        The torque: ``"linear"``, omega^2 x, or ``"sine"``, omega^2 sin x.
    drag
        The form of the quadratic term: ``"energy"``, the paper's, or ``"speed"``, v\|v\|.

    Examples
    --------
    Released at 2 rad, a pendulum swings at three quarters of its frequency at small amplitudes.

    >>> from pendpipe.dynamics import Eq8, Release, turning_points
    >>> pendulum = Eq8(6.28, viscous=1e-6, restoring="sine")
    >>> points = turning_points(pendulum, Release(0.0, 2.0), count=3)
    >>> round(float(6.283185 / 6.28 / points.time_s[2]), 4)
    0.7525
    """

    angular_frequency: float
    quadratic: float = 0.0
    hysteretic: float = 0.0
    viscous: float = 0.0
    coulomb: float = 0.0
    restoring: Restoring = "linear"
    drag: Drag = "energy"

    def __post_init__(self) -> None:
        for name, known in (("restoring", get_args(Restoring)), ("drag", get_args(Drag))):
            if getattr(self, name) not in known:
                either = " or ".join(f'"{each}"' for each in known)
                raise ValueError(f"{name} must be {either}, not {getattr(self, name)!r}")
        if not 0.0 < self.angular_frequency < math.inf:
            raise ValueError(
                f"angular_frequency must be positive and finite, not {self.angular_frequency}"
            )
        for name in RATES:
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(
                    f"{name} must be finite and not negative, not {getattr(self, name)}"
                )

    def rates(self) -> tuple[float, float, float, float]:
        """Return the losses in the order of `RATES`."""
        return self.quadratic, self.hysteretic, self.viscous, self.coulomb

    @property
    def share(self) -> float:
        """The hysteretic share of b; of no b, what it is beforehand."""
        b = self.hysteretic + self.viscous
        return self.hysteretic / b if b > 0.0 else SHARE_MEAN

    def torque(self, angle: FloatArray) -> FloatArray:
        """Return omega^2 x, or omega^2 sin x, at any angles, rad/s^2."""
        bent = np.sin(angle) if self.restoring == "sine" else angle
        return np.asarray(self.angular_frequency**2 * bent)

    def energy(self, angle: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return rho^2, twice the energy, at any angles and velocities, rad^2/s^2."""
        s = 2.0 * np.sin(0.5 * angle) if self.restoring == "sine" else angle
        return np.asarray((self.angular_frequency * s) ** 2 + velocity**2)

    def friction(
        self, angle: FloatArray, velocity: FloatArray, direction: FloatArray
    ) -> FloatArray:
        """Return the acceleration by all four losses, rad/s^2; `direction` is sgn v."""
        square = self.energy(angle, velocity)
        return np.asarray(
            cast("Kernel", _braked).plain(square, velocity, direction, self.numbers())
        )

    def acceleration(
        self, angle: FloatArray, velocity: FloatArray, direction: FloatArray
    ) -> FloatArray:
        """Return x'' + omega^2 x, rad/s^2, shape (k, n); `direction` is that of k half cycles."""
        found, side = np.empty(angle.shape), np.repeat(direction[:, 0], angle.shape[1])
        flat = (each.reshape(-1) for each in (angle, velocity, side, self.numbers(), found))
        _accelerate(*flat)
        return found

    def numbers(self) -> FloatArray:
        """Return omega, `RATES`, and 1 for a drag v|v| and for sin x, else 0."""
        forms = self.drag == "speed", self.restoring == "sine"
        return np.array([self.angular_frequency, *self.rates(), *forms], dtype=np.float64)

    @property
    def stop_rad(self) -> float:
        """The amplitude at and below which the pendulum, once at rest, stays; inf if locked.

        The smallest root m of delta + h m + q m^2 = m, with delta = pi c/(2 omega),
        h = pi b_h/(2 omega) and q = pi a/(2 omega): Coulomb friction alone stops it below
        delta, and the other terms add to that. For the sine delta + h s + q s^2 = sin m with
        s = 2 sin(m/2).
        """
        m = self._stop()
        return 2.0 * math.asin(0.5 * m) if self.restoring == "sine" and m < math.inf else m

    @property
    def _quadratic_at_rest(self) -> float:
        """What holds a pendulum at rest of a."""
        return self.quadratic if self.drag == "energy" else 0.0

    def _stop(self) -> float:
        """Return the m of `panel.py`."""
        half_turn = 0.5 * math.pi / self.angular_frequency
        h, free = half_turn * self.hysteretic, 1.0 - half_turn * self.hysteretic
        delta, q = half_turn * self.coulomb, half_turn * self._quadratic_at_rest
        discriminant = free * free - 4.0 * q * delta
        if free <= 0.0 or discriminant < 0.0:
            return math.inf
        m = 2.0 * delta / (free + math.sqrt(discriminant))
        if self.restoring == "linear" or m == 0.0:
            return m
        # m C(m) is concave, so that Newton's method comes from below and passes no root.
        while m < 2.0:
            c = math.sqrt(1.0 - 0.25 * m * m)
            slope = (1.0 - 0.5 * m * m) / c - h - 2.0 * q * m
            if slope <= 0.0:
                return math.inf
            step = (delta + (h + q * m - c) * m) / slope
            m += step
            if step <= 4e-16 * m:
                return m
        return math.inf

    def shape(self) -> tuple[float, float, float, float, float, float]:
        """Return m, h, q, g, k, f: Eq. 8 with time in radians (see `panel.py`)."""
        half_turn = 0.5 * math.pi / self.angular_frequency
        return (
            self._stop(),
            half_turn * self.hysteretic,
            half_turn * self.quadratic,
            self.viscous / self.angular_frequency,
            1.0 if self.restoring == "sine" else 0.0,
            1.0 if self.drag == "speed" else 0.0,
        )

    def shape_derivatives(self) -> FloatArray:
        """Return derivatives of m, h, q, g (columns) by the amplitude (none), a, b_h, b_v, c."""
        m, h, _, _, k, f = self.shape()
        half_turn = 0.5 * math.pi / self.angular_frequency
        q = half_turn * self._quadratic_at_rest
        stop = 0.0 if math.isinf(m) else m
        steepness = (1.0 - 0.5 * k * stop**2) / math.sqrt(1.0 - 0.25 * k * stop**2)
        by_delta = 0.0 if math.isinf(m) else 1.0 / (steepness - h - 2.0 * q * m)
        return np.array(
            [
                [0.0, 0.0, 0.0, 0.0],
                [half_turn * by_delta * stop * stop * (1.0 - f), 0.0, half_turn, 0.0],
                [half_turn * by_delta * stop, half_turn, 0.0, 0.0],
                [0.0, 0.0, 0.0, 1.0 / self.angular_frequency],
                [half_turn * by_delta, 0.0, 0.0, 0.0],
            ]
        )


def share_of(parts: Mapping[str, float], b: float) -> float | None:
    """The hysteretic share of b by its held parts (1/s, by name); None where it is free."""
    if not parts or b <= 0.0:
        return None
    if "hysteretic" in parts:
        return min(parts["hysteretic"] / b, 1.0)
    return max(1.0 - parts["viscous"] / b, 0.0)


@dataclass(frozen=True)
class Release:
    """The turning point from which the motion starts, at rest.

    Parameters
    ----------
    time_s
        When.
    angle_rad
        Where, about the equilibrium; its sign is the side.
    offset_rad
        What is added to every reading: the reading of the equilibrium.
    """

    time_s: float
    angle_rad: float
    offset_rad: float = 0.0

    def __post_init__(self) -> None:
        for name in ("time_s", "angle_rad", "offset_rad"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, not {getattr(self, name)}")


_NONE: FloatArray = np.empty(0)
"""No times."""
_COLUMNS = len(JACOBIAN_COLUMNS)
_NO_LIMIT = 2**62
"""Turning points: as many as there are."""


@dataclass(frozen=True)
class TurningPoints:
    """Where the pendulum turns.

    Parameters
    ----------
    time_s
        When, the release first.
    angle_rad
        Where: signed, offset included.
    stopped
        Whether friction holds the pendulum at the last of them.
    """

    time_s: FloatArray
    angle_rad: FloatArray
    stopped: bool


def turning_points(
    model: Eq8,
    release: Release,
    *,
    count: int | None = None,
    until_s: float | None = None,
) -> TurningPoints:
    """Return the turning points of Eq. 8.

    Parameters
    ----------
    model, release
        What moves, and from where.
    count
        At most so many, the release among them.
    until_s
        None after this time. Without `count` and `until_s` there must be Coulomb friction, and
        the motion is followed to its stop.

    Raises
    ------
    ValueError
        If there is no end to the motion asked for, or `model` is overdamped.
    """
    if count is None and until_s is None and model.coulomb == 0.0:
        raise ValueError("give count or until_s: without Coulomb friction the motion has no end")
    if count is not None and count < 1:
        raise ValueError(f"count must be at least 1, not {count}")
    end_s = math.inf if until_s is None else until_s
    if not end_s >= release.time_s:
        raise ValueError(f"until_s is {end_s}, before the release at {release.time_s}")
    # Damping makes the half cycles fewer.
    half_cycles = (end_s - release.time_s) * model.angular_frequency / math.pi
    room = 1024 if math.isinf(end_s) else math.ceil(half_cycles) + 16
    while True:
        turning = np.empty((2, room if count is None else min(count, room)))
        found, stopped = _run(model, release, turning, until_s=end_s)
        if stopped or found == count or found < room:
            return TurningPoints(turning[0, :found], turning[1, :found], stopped)
        room *= 4


def turning_points_with_jacobian(
    model: Eq8, release: Release, count: int
) -> tuple[TurningPoints, FloatArray, FloatArray]:
    """Return turning points and the exact derivatives of their times and angles.

    Returns
    -------
    points
        At most `count`; fewer if the pendulum stops.
    time_jacobian, angle_jacobian
        (points, 8), with the columns `JACOBIAN_COLUMNS`.
    """
    if count < 1:
        raise ValueError(f"count must be at least 1, not {count}")
    turning = np.empty((2 + 2 * _COLUMNS, count))
    found, stopped = _run(model, release, turning, derivatives=True)
    turning = turning[:, :found]
    points = TurningPoints(turning[0], turning[1], stopped)
    return points, turning[2 : 2 + _COLUMNS].T, turning[2 + _COLUMNS :].T


def sample(model: Eq8, release: Release, time_s: FloatArray) -> FloatArray:
    """Return the readings of Eq. 8 at given times; rad, with offset.

    Parameters
    ----------
    model, release
        What moves, and from where.
    time_s
        Ascending, evenly spaced or not, none before the release. After the pendulum has stopped
        the reading is that of its rest, exactly.

    Raises
    ------
    ValueError
        If the times are not as required, or `model` is overdamped.
    """
    times = _checked_times(time_s, release)
    readings: FloatArray = np.empty((1, times.size))
    _run(model, release, readings, time_s=times)
    return np.asarray(readings[0])


def sample_with_jacobian(
    model: Eq8, release: Release, time_s: FloatArray, *, more: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Return the readings and their exact derivatives by every parameter.

    Parameters
    ----------
    model, release, time_s
        As in `sample`.
    more
        Columns of zeros behind the others, for parameters of the caller's own.

    Returns
    -------
    angle_rad
        (n,).
    jacobian
        (n, 8 + more), with the columns `JACOBIAN_COLUMNS`, stored by columns. At c = 0 the
        derivative by c is that towards c > 0.
    """
    times = _checked_times(time_s, release)
    readings = np.empty((1 + _COLUMNS + more, times.size))
    _run(model, release, readings, derivatives=True, time_s=times)
    readings[_COLUMNS], readings[_COLUMNS + 1 :] = 1.0, 0.0
    return readings[0], readings[1:].T


def _checked_times(time_s: FloatArray, release: Release) -> FloatArray:
    """Return the times as the engine needs them."""
    times = np.ascontiguousarray(time_s, dtype=np.float64)
    if times.ndim != 1 or (times.size and not math.isfinite(times[0] + times[-1])):
        raise ValueError("time_s must be one-dimensional and finite")
    # Written so that a nan in the middle is found as well.
    if not (times[1:] >= times[:-1]).all():
        raise ValueError("time_s must ascend")
    if times.size and times[0] < release.time_s:
        raise ValueError(f"time_s starts at {times[0]}, before the release at {release.time_s}")
    return times


def _run(
    model: Eq8,
    release: Release,
    out: FloatArray,
    *,
    derivatives: bool = False,
    time_s: FloatArray = _NONE,
    until_s: float = math.inf,
) -> tuple[int, bool]:
    """Fill `out`; return the number of turning points and whether the last is the stop."""
    if model.restoring == "sine" and not abs(release.angle_rad) < math.pi:
        raise ValueError(
            f"with sin x the release must lie within pi, not at {release.angle_rad} rad"
        )
    most = out.shape[1]
    if most == 0:
        return 0, False
    if time_s.size:
        most, until_s = _NO_LIMIT, float(time_s[-1])
    rates = len(RATES) if derivatives else 0
    sensitivities = rates + 1 if rates else 0
    polynomials = sensitivities + 1 if time_s.size else 0
    head, per_panel = HEAD + 2 * sensitivities, 1 + polynomials * NODE_COUNT if polynomials else 0
    side = -1.0 if release.angle_rad < 0.0 else 1.0
    work, rows = np.empty(WORK_SIZE), np.empty((ROW + 1, head + MOST_PANELS * per_panel))
    REQUEST.pack_into(
        work.data,
        0,
        *model.shape(),
        model.angular_frequency,
        release.time_s,
        release.offset_rad,
        side,
        side,
        abs(release.angle_rad),
        until_s,
        most,
        rates,
        sensitivities,
        polynomials,
        head,
        per_panel,
    )
    if derivatives:
        record = work.view(WORK)
        record["rate"], record["directions"] = model.rates(), model.shape_derivatives()
    found, ending = divmod(march(work, rows, time_s, out), ENDINGS)
    if ending == OVERDAMPED:
        raise ValueError(
            f"{model} is overdamped: it creeps towards its equilibrium and does not turn"
        )
    return found, ending == STOPPED
