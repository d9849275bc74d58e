"""Non-parametric terms: what no entry of the catalogue has the form of, as a curve.

A curve is a sum of triangular basis functions (1 at a knot, 0 at its neighbours), in units of
what may reasonably be there. Which combinations of them a recording can see is worked out along
its own fitted motion (`Curve.reduced`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Motion, Sampled
from pendpipe.effects.effect import Effect, How, Pendulum, Span, phase_since_reversal, subclass


class Curve(Effect):
    """A curve over `argument`, by its values at the knots.

    Parameters
    ----------
    knots
        Where the basis functions have their peaks, rising.
    span
        Of the recording.
    coefficients
        The combinations of the basis functions that are fitted, a column each, shape
        (basis functions, sizes); each function for itself by default.
    """

    kind = "unnamed"
    prior = -3.0
    argument: ClassVar[str]
    """What the curve is drawn against, with its unit."""
    ordinate: ClassVar[str]
    """What is drawn."""
    flavour: ClassVar[str] = ""
    words: ClassVar[Mapping[str, tuple[str, str, str]]]
    """By the curve's name in `drawn`: what it is of, and what that is where larger and smaller."""
    is_torque: ClassVar[bool] = False
    """Whether it is told as a change of the stiffness: over its argument."""
    drawn: ClassVar[tuple[str, ...]] = ("value",)
    """The curves that are drawn over the same argument."""
    over_logarithm: ClassVar[bool] = False
    """Whether it is straight between the knots over the argument's logarithm."""
    make_knots: ClassVar[Callable[[Span], FloatArray]]
    """Returns where the basis functions have their peaks."""
    unit: ClassVar[Callable[[Pendulum, Span], float]]
    """Returns what may reasonably be there, in the unit of `ordinate`."""
    taken: ClassVar[Callable[[FloatArray, Pendulum], Sequence[FloatArray]]]
    """Returns what the law (or a straight sensor) has itself, at values of the argument: the curve
    is what is beyond it."""
    along: ClassVar[Callable[[Any], FloatArray]]
    """Returns the argument, from a motion or a sampled motion."""

    def __init__(
        self,
        span: Span,
        coefficients: FloatArray | None = None,
        knots: FloatArray | None = None,
    ) -> None:
        self.span = span
        self.knots = type(self).make_knots(span) if knots is None else knots
        self.basis_size = len(self.drawn) * len(self.knots)
        self.coefficients = np.eye(self.basis_size) if coefficients is None else coefficients
        self.sizes = self.coefficients.shape[1]  # type: ignore[misc]

    @property
    def count(self) -> int:
        """How many combinations are fitted."""
        return self.sizes

    @property
    def key(self) -> str:
        """Identifier and flavour."""
        return f"{self.identifier}:{self.flavour}"

    def bounds(self, duration_s: float = math.inf) -> list[tuple[float, float]]:
        """Any."""
        return [(-np.inf, np.inf)] * self.sizes

    def reduced(self, coefficients: FloatArray) -> Curve:
        """Return the same with fewer combinations."""
        return type(self)(self.span, coefficients)

    def beyond_the_law(self) -> FloatArray:
        """Return combinations of one curve's knots that the law has not, orthonormal columns."""
        taken = np.column_stack(type(self).taken(self.knots, self.span.pendulum))
        whole, _ = np.linalg.qr(taken, mode="complete")
        return np.asarray(whole[:, taken.shape[1] :])

    def smooth(self, at: FloatArray) -> tuple[Curve, FloatArray, FloatArray]:
        """Return the curve by its values at many places, and how they vary before any reading.

        Returns
        -------
        curve
            With knots there.
        bent
            Covariance of an integrated Wiener process and of a slope as large.
        beyond
            Projects out what the law has.
        """
        count, several = len(at), np.eye(len(self.drawn))
        curve = type(self)(self.span, np.eye(count * len(self.drawn)), at)
        # Its second differences are independent, of a variance as the cube of their spacing.
        bent = np.linalg.pinv(np.diff(np.eye(count), 2, axis=0) * count**1.5)
        straight, own = np.linspace(-1.0, 1.0, count), curve.beyond_the_law()
        rough, beyond = bent @ bent.T + np.outer(straight, straight), own @ own.T
        return curve, np.asarray(np.kron(several, rough)), np.asarray(np.kron(several, beyond))

    def curves(self, values: FloatArray, at: FloatArray) -> FloatArray:
        """Return the values of all curves `drawn`, in their reasonable units, a row each."""
        knots = self.knots
        if self.over_logarithm:
            at, knots = np.log(at), np.log(knots)
        heights = np.split(self.coefficients @ values, len(self.drawn))
        return np.array([np.interp(at, knots, height) for height in heights])

    def axes(self, unit: str) -> tuple[str, str]:
        """Return what it is drawn against, and what is drawn, with units, of readings in `unit`."""
        on = self.acts_on(unit)
        along, across = self.argument, self.ordinate.replace(", rad", f", {on}")
        along = along if along.startswith("phase") else along.replace("rad", on)
        if on == "rad/s":
            along, across = along.replace("angle", "rate"), across.replace("angle", "rate")
        return along, across

    def scale(self, pendulum: Pendulum) -> float:
        """Return the reasonable unit in that of `ordinate`."""
        return type(self).unit(pendulum, self.span)

    def small(self, span: Span) -> float:
        """A thousandth of what is reasonable."""
        return 1e-3


def _constant(at: FloatArray, _: Pendulum) -> Sequence[FloatArray]:
    return [np.ones_like(at)]


def _torque_of_the_law(at: FloatArray, pendulum: Pendulum) -> Sequence[FloatArray]:
    return [np.ones_like(at), pendulum.torque(at)]


def _losses_of_the_law(at: FloatArray, _: Pendulum) -> Sequence[FloatArray]:
    return [at, np.ones_like(at), 1.0 / at]


def _straight(at: FloatArray, _: Pendulum) -> Sequence[FloatArray]:
    return [np.ones_like(at), at]


def follows(
    how: How,
    along: Callable[[Any], FloatArray],
    make_knots: Callable[[Span], FloatArray],
    unit: Callable[[Pendulum, Span], float],
    base: type[Curve] = Curve,
    taken: Callable[[FloatArray, Pendulum], Sequence[FloatArray]] = _constant,
    **attributes: Any,
) -> Callable[[Callable[..., FloatArray]], type[Curve]]:
    """Declare a curve by the function through which it enters.

    The function takes what that method of `Effect` takes, with the value of each curve at each
    node or reading in the place of the fitted values.

    Parameters
    ----------
    how
        The method.
    along
        The curve's argument, from a motion or a sampled motion.
    make_knots, unit, taken
        As in `Curve`.
    base
        How it is drawn: straight between knots, or a `Polynomial`.
    attributes
        Class variables of `Curve`.
    """

    def declare(function: Callable[..., FloatArray]) -> type[Curve]:
        def method(
            curve: Curve, moving: Motion | Sampled, pendulum: Pendulum, values: FloatArray
        ) -> FloatArray:
            drawn = curve.scale(pendulum) * curve.curves(values, along(moving))
            return np.asarray(function(moving, pendulum, *drawn))

        own = {how: method, "make_knots": make_knots, "unit": unit, "along": along, "taken": taken}
        return subclass(base, function.__name__, function.__doc__, own | attributes)

    return declare


def angles(span: Span) -> FloatArray:
    """Knots over the angle: closer at the middle, where every swing passes."""
    half = np.array([0.0, 0.04, 0.1, 0.2, 0.34, 0.52, 0.74, 1.02])
    return np.asarray(span.first_amplitude * np.concatenate([-half[:0:-1], half]))


def amplitudes(number: int, span: Span) -> FloatArray:
    """Knots over the amplitude, in equal ratios."""
    last = max(span.last_amplitude, 1e-3 * span.first_amplitude)
    return np.geomspace(0.95 * last, 1.05 * span.first_amplitude, number)


def instants(number: int, span: Span) -> FloatArray:
    """Knots over the time."""
    return np.linspace(span.start_s, span.stop_s, number)


def phases(_: Span) -> FloatArray:
    """Knots over the half swing."""
    return np.linspace(0.0, np.pi, 9)


def ways(span: Span) -> FloatArray:
    """Knots from a turning point to the next, closer where the way begins."""
    shares = np.array([0.0, 0.03, 0.08, 0.16, 0.28, 0.44, 0.66, 1.02])
    return np.asarray(2.0 * span.first_amplitude * shares)


def usual_loss_rate(pendulum: Pendulum, span: Span) -> float:
    """The usual loss rate, 1/s: that of the middle amplitude."""
    middle = math.sqrt(span.first_amplitude * span.last_amplitude)
    return (
        pendulum.quadratic * middle + pendulum.linear + pendulum.coulomb / middle
    ) + 1e-4 * pendulum.angular_frequency


def usual_friction(pendulum: Pendulum, span: Span) -> float:
    """The usual friction, rad/s^2."""
    return usual_friction_profile(pendulum, span) * span.first_amplitude


def usual_friction_profile(pendulum: Pendulum, span: Span) -> float:
    """The usual friction over the amplitude, 1/s^2."""
    return usual_loss_rate(pendulum, span) * pendulum.angular_frequency


def share_of_swing(share: float, _: Pendulum, span: Span) -> float:
    """A part of the first amplitude, rad."""
    return share * span.first_amplitude


@follows(
    "acceleration",
    attrgetter("angle"),
    angles,
    partial(share_of_swing, 0.1),
    taken=_torque_of_the_law,
    identifier="unnamed-restoring",
    name="a restoring torque of unknown form",
    equation=r"\omega^2 x \to \omega^2 x + F(x)",
    argument="angle, rad",
    ordinate="restoring torque over omega^2 beyond the law's, rad",
    words={"value": ("the torque is", "stiffer", "softer")},
    is_torque=True,
    discriminating_test=(
        "measure the torque against the angle at rest, or map it with a second pendulum"
    ),
)
def restoring_curve(motion: Motion, pendulum: Pendulum, torque: FloatArray) -> FloatArray:
    """A restoring torque that is any function of the angle."""
    return -(pendulum.angular_frequency**2) * torque


class Polynomial(Curve):
    """A curve that is a sum of two terms in the angle over the first amplitude, u."""

    def __init__(self, span: Span, coefficients: FloatArray | None = None) -> None:
        super().__init__(span, np.eye(len(self.powers)) if coefficients is None else coefficients)
        self.basis_size = len(self.powers)

    def smooth(self, at: FloatArray) -> tuple[Curve, FloatArray, FloatArray]:
        """Return that of a torque of any form: the band is to hold others too."""
        return restoring_curve(self.span).smooth(at)

    def curves(self, values: FloatArray, at: FloatArray) -> FloatArray:
        """Return the sum of the terms."""
        of = at / self.span.first_amplitude
        rows = np.array([of * np.abs(of) ** (power - 1) for power in self.powers.values()])
        return np.tensordot(self.coefficients @ values, rows, 1)[None]

    def told(self, values: FloatArray) -> Mapping[str, float]:
        """Return the coefficients of the powers."""
        heights = self.coefficients @ values * self.scale(self.span.pendulum)
        first = self.span.first_amplitude
        return {
            name: float(height / first**power)
            for (name, power), height in zip(self.powers.items(), heights, strict=True)
        }


@follows(
    "acceleration",
    attrgetter("amplitude"),
    partial(amplitudes, 15),
    usual_loss_rate,
    taken=_losses_of_the_law,
    over_logarithm=True,
    identifier="unnamed-damping",
    name="a loss that depends on the amplitude in an unknown way",
    equation=r"2 b \dot x \to 2 [b + \beta(y)]\,\dot x",
    argument="amplitude, rad",
    ordinate="extra loss rate, 1/s",
    flavour="amplitude",
    words={"value": ("the loss is", "larger", "smaller")},
    discriminating_test=(
        "release it from several amplitudes: the loss must follow the amplitude, not the time"
    ),
)
def damping_curve(motion: Motion, pendulum: Pendulum, rate: FloatArray) -> FloatArray:
    """A loss that is any function of the amplitude."""
    return -2.0 * rate * motion.velocity


@follows(
    "acceleration",
    attrgetter("angle"),
    angles,
    usual_friction,
    identifier="unnamed-damping",
    name="a friction that depends on the angle in an unknown way",
    equation=r"\ddot x \to \ddot x + g(x)\,\mathrm{sgn}\,\dot x",
    argument="angle, rad",
    ordinate="extra friction, rad/s^2",
    flavour="angle",
    words={"value": ("the friction is", "larger", "smaller")},
    discriminating_test="turn the bearing by a few degrees: a rough spot goes with it",
)
def friction_curve(motion: Motion, pendulum: Pendulum, friction: FloatArray) -> FloatArray:
    """A friction that is any function of the angle."""
    return -motion.direction * friction


@follows(
    "acceleration",
    phase_since_reversal,
    phases,
    usual_friction_profile,
    identifier="unnamed-damping",
    name="a friction of unknown form along each half swing",
    equation=r"\ddot x \to \ddot x + y\,h(\psi)\,\mathrm{sgn}\,\dot x",
    argument="phase since the last turning point, rad",
    ordinate="extra friction over amplitude, 1/s^2",
    flavour="profile",
    words={"value": ("the friction over the amplitude is", "larger", "smaller")},
    discriminating_test=(
        "sample the swing faster, and look at the velocity about the turning points"
    ),
)
def profile_curve(motion: Motion, pendulum: Pendulum, profile: FloatArray) -> FloatArray:
    """A friction in proportion to the amplitude, of any form along the half swing."""
    return -motion.direction * motion.amplitude * profile


@follows(
    "acceleration",
    attrgetter("time_s"),
    partial(instants, 10),
    lambda _, __: 0.01,
    drawn=("value", "quadrature"),
    in_time=True,
    prior=-6.0,
    identifier="unnamed-drive",
    name="a torque that depends on the time in an unknown way",
    equation=r"\ddot x \to \ddot x + p(t)\,\omega^2 x + q(t)\,\omega \dot x",
    argument="time, s",
    ordinate="extra torque over omega^2 y",
    words={
        "value": ("the torque is", "softer", "stiffer"),
        "quadrature": ("the swing is", "driven", "braked"),
    },
    discriminating_test="repeat the run: what depends on the time of day does not come again",
)
def drive_curve(
    motion: Motion, pendulum: Pendulum, in_phase: FloatArray, quadrature: FloatArray
) -> FloatArray:
    """A torque that comes and goes with the time, in step with the motion."""
    omega = pendulum.angular_frequency
    return omega * (in_phase * omega * motion.angle + quadrature * motion.velocity)


@follows(
    "reading",
    attrgetter("angle"),
    angles,
    partial(share_of_swing, 0.05),
    taken=_straight,
    identifier="unnamed-measurement",
    name="a sensor curve of unknown form",
    equation=r"y = x + s(x)",
    argument="angle, rad",
    ordinate="reading minus angle, rad",
    flavour="angle",
    words={"value": ("the reading is", "higher", "lower")},
    discriminating_test="calibrate the sensor at rest over the whole range",
)
def reading_curve(sampled: Sampled, pendulum: Pendulum, added: FloatArray) -> FloatArray:
    """A sensor whose reading is any function of the angle."""
    return added


@follows(
    "reading",
    attrgetter("time_s"),
    partial(instants, 14),
    partial(share_of_swing, 0.05),
    in_time=True,
    identifier="unnamed-measurement",
    name="a wandering offset",
    equation=r"y = x + s(t)",
    argument="time, s",
    ordinate="offset, rad",
    flavour="time",
    words={"value": ("the offset is", "higher", "lower")},
    discriminating_test="record the pendulum at rest for as long",
)
def offset_curve(sampled: Sampled, pendulum: Pendulum, added: FloatArray) -> FloatArray:
    """An offset that wanders in time."""
    return added


CURVES: Sequence[type[Curve]] = (
    restoring_curve,
    damping_curve,
    friction_curve,
    profile_curve,
    drive_curve,
    reading_curve,
    offset_curve,
)


def way_since_reversal(motion: Motion) -> FloatArray:
    """r (1 - cos psi), psi from the last turning point, rad."""
    return np.asarray(motion.amplitude * (1.0 - np.cos(phase_since_reversal(motion))))


def _resists_the_more(curve: Curve, values: FloatArray) -> bool:
    """A contact that is pushed on resists the more the farther it has crept."""
    first, *_, last = curve.coefficients @ values
    return bool(last > first)


@follows(
    "acceleration",
    way_since_reversal,
    ways,
    usual_friction,
    identifier="unnamed-damping",
    name="a friction that remembers the last turning point",
    contact=True,
    equation=r"\ddot x \to \ddot x + g(|x - x_\mathrm{turn}|)\,\mathrm{sgn}\,\dot x",
    argument="way since the turning point, rad",
    ordinate="extra friction, rad/s^2",
    flavour="memory",
    words={"value": ("the friction is", "larger", "smaller")},
    discriminating_test=(
        "turn it back in mid swing, by hand and slowly: the friction must start anew from there"
    ),
    believable=_resists_the_more,
)
def memory_curve(motion: Motion, pendulum: Pendulum, friction: FloatArray) -> FloatArray:
    """A friction that is any function of the way since the last turning point.

    Contacts that creep before they slide do so (Iwan's and Masing's loops): each half cycle
    they lose, and stiffen, by the amplitude.
    """
    return -motion.direction * friction


@follows(
    "acceleration",
    attrgetter("time_s"),
    partial(instants, 25),
    usual_loss_rate,
    in_time=True,
    identifier="unnamed-damping",
    name="a loss that depends on the time in an unknown way",
    equation=r"2 b \dot x \to 2 [b + \beta(t)]\,\dot x",
    argument="time, s",
    ordinate="extra loss rate, 1/s",
    flavour="time",
    words={"value": ("the loss is", "larger", "smaller")},
    discriminating_test=(
        "release it again with the same amplitude: what depends on the time is not the same"
    ),
)
def damping_in_time_curve(motion: Motion, pendulum: Pendulum, rate: FloatArray) -> FloatArray:
    """A loss that is any function of the time."""
    return -2.0 * rate * motion.velocity


@follows(
    "reading",
    attrgetter("amplitude"),
    partial(amplitudes, 13),
    lambda _, __: 0.01,
    over_logarithm=True,
    identifier="unnamed-measurement",
    name="a gain that depends on the swing in an unknown way",
    equation=r"y = x\,[1 + g(y)]",
    argument="amplitude, rad",
    ordinate="gain less 1",
    flavour="gain",
    words={"value": ("the gain is", "higher", "lower")},
    discriminating_test="film the swing: a second sensor must see the same amplitudes",
)
def gain_curve(sampled: Sampled, pendulum: Pendulum, gain: FloatArray) -> FloatArray:
    """A sensor whose gain is any function of the swing."""
    return gain * sampled.angle


@follows(
    "reading",
    attrgetter("amplitude"),
    partial(amplitudes, 13),
    lambda pendulum, _: 0.01 / pendulum.angular_frequency,
    over_logarithm=True,
    identifier="unnamed-measurement",
    name="a delay that depends on the swing in an unknown way",
    equation=r"y = x(t - \tau(y))",
    argument="amplitude, rad",
    ordinate="delay, s",
    flavour="delay",
    words={"value": ("the reading is", "later", "earlier")},
    discriminating_test=(
        "pass a light barrier at the middle: its times must show the same frequency"
    ),
)
def delay_curve(sampled: Sampled, pendulum: Pendulum, delay: FloatArray) -> FloatArray:
    """A reading that comes later by any function of the swing."""
    return -delay * sampled.velocity


def _polynomial(flavour: str, powers: Mapping[str, int]) -> type[Curve]:
    """Declare a torque of two terms that are odd in the angle."""
    return follows(
        "acceleration",
        attrgetter("angle"),
        angles,
        partial(share_of_swing, 0.1),
        base=Polynomial,
        powers=powers,
        identifier="unnamed-restoring",
        name="a restoring torque of two terms",
        equation=r"\omega^2 x \to \omega^2 x + F(x)",
        argument="angle, rad",
        ordinate="restoring torque over omega^2 beyond the law's, rad",
        flavour=flavour,
        words=restoring_curve.words,
        is_torque=True,
        discriminating_test=restoring_curve.discriminating_test,
    )(_torque)


def _torque(motion: Motion, pendulum: Pendulum, torque: FloatArray) -> FloatArray:
    """A restoring torque that is a sum of two terms in the angle."""
    return -(pendulum.angular_frequency**2) * torque


fifth_curve = _polynomial("fifth power", {"x³": 3, "x⁵": 5})
second_curve = _polynomial("second power", {"x|x|": 2, "x³": 3})
FOLLOW_UP_CURVES: Sequence[type[Curve]] = (
    fifth_curve,
    second_curve,
    memory_curve,
    damping_in_time_curve,
    gain_curve,
    delay_curve,
)
