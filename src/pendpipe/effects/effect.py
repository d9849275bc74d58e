"""What an effect declares of itself, once: for simulation, diagnosis, report and manual.

Behind it stands what the scans and the shapes of several effects have in common.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from inspect import get_annotations
from typing import Any, ClassVar, Final, Literal, NamedTuple, TypeVar, cast

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Release
from pendpipe.dynamics.any_law import Motion, Sampled
from pendpipe.dynamics.eq8 import Eq8

Kind = Literal["dynamics", "measurement", "parameter", "unnamed"]
AnyEffect = TypeVar("AnyEffect", bound="Effect")
How = Literal["acceleration", "kick", "reading", "delay"]
"""The methods of `Effect` by which one enters."""


_OF_RATES: Final = {
    "rad": "rad/s",
    "rad/s": "rad/s^2",
    "1/rad": "s/rad",
    "1/rad^2": "s^2/rad^2",
    "s/rad": "s^2/rad",
}
"""Units of what acts on readings in rad, and on readings in rad/s."""


class Parameter(NamedTuple):
    """A parameter of an effect, with the bounds within which it is believed."""

    name: str
    unit: str
    low: float
    high: float
    default: float | None = None
    """What a simulation takes where it is not given; None: it must be."""
    word: str = ""
    """What it is called before its number and unit; its name by default. A ``_cosine`` and its
    ``_sine`` are printed as one amplitude under the first one's word."""

    def unit_in(self, unit: str) -> str:
        """Return its unit where displacements are in `unit` (rad, m, rad/s); "" for a number."""
        own = "" if self.unit == "1" else self.unit
        return _OF_RATES.get(own, own) if unit == "rad/s" else own.replace("rad", unit)

    @property
    def power(self) -> int:
        """The power of the displacement in it: 1 of rad/s, -2 of 1/rad^2, -4 of s^3/rad^4."""
        found = re.search(r"(/.*)?\brad(?:\^(\d))?", self.unit)
        size = int(found[2] or 1) if found else 0
        return -size if found and found[1] else size


class Kick(NamedTuple):
    """A sudden change of the motion: at `time_s` the angle and the velocity jump."""

    time_s: float
    angle: float = 0.0
    velocity: float = 0.0
    log_amplitude: float = 0.0
    """Change of ln r at unchanged phase."""


@dataclass(frozen=True)
class Pendulum(Eq8):
    """The baseline's constants, and when the first reading was taken.

    Parameters
    ----------
    first_s
        When the first reading was taken: the pendulum was let go at the last turning point
        before it. By default, at the start of the motion.
    """

    first_s: float = -math.inf

    def __post_init__(self) -> None:
        """On a search's way any values may come."""

    @property
    def linear(self) -> float:
        """The sum b = b_h + b_v, 1/s."""
        return self.hysteretic + self.viscous

    def has(self, form: Mapping[str, Any]) -> bool:
        """Whether these are its forms already."""
        return all(getattr(self, name) == each for name, each in form.items())

    def losses(self, motion: Motion) -> FloatArray:
        """Return the acceleration by Eq. 8's losses at the nodes, rad/s^2."""
        return self.friction(motion.angle, motion.velocity, motion.direction)

    def along(self, motion: Motion) -> FloatArray:
        """Return x'' + omega^2 x of Eq. 8 at the nodes, rad/s^2."""
        return self.acceleration(motion.angle, motion.velocity, motion.direction)


class Start(NamedTuple):
    """Where a fit with an effect begins that would not find it from the motion without it."""

    effect: Effect
    law: Eq8
    release: Release
    values: FloatArray
    """Of the effect."""


class Span(NamedTuple):
    """What a scan over an effect's shape must know of the recording."""

    start_s: float
    stop_s: float
    interval_s: float
    """Between the readings that are analysed."""
    pendulum: Pendulum
    first_amplitude: float
    last_amplitude: float
    offset: float = 0.0
    fold: int = 1
    """How many recorded readings each of those that are analysed is the mean of."""
    sampled: Sampled | None = None
    """The motion at the readings."""
    instant_sd_s: float = math.inf
    """Standard deviation of an instant that was fitted."""

    @property
    def duration_s(self) -> float:
        """From the first reading to the last."""
        return self.stop_s - self.start_s

    @property
    def period_s(self) -> float:
        """2 pi/omega."""
        return 2.0 * math.pi / self.pendulum.angular_frequency

    def to_a_turn(self, instant_s: float) -> tuple[float, float]:
        """Return the phase to the next turning point, before or behind, and its error.

        Of a quarter turn: of an instant at random each from 0 to 1 is as likely.
        """
        if self.sampled is None:
            return 1.0, math.inf
        phase = float(np.interp(instant_s, self.sampled.time_s, self.sampled.phase))
        quarter = 0.5 * math.pi
        error = self.pendulum.angular_frequency * self.instant_sd_s / quarter
        return abs(math.remainder(phase, math.pi)) / quarter, error

    def times(self, count: int) -> FloatArray:
        """Instants for a scan: inside the record, one and a half periods from its ends.

        They lie closer towards the ends, where less of the record determines them.
        """
        edge = min(1.5 * self.period_s, 0.25 * self.duration_s)
        share = np.linspace(0.0, 1.0, count)
        closer = 0.5 * share + 0.25 * (1.0 - np.cos(math.pi * share))
        return np.asarray(self.start_s + edge + (self.duration_s - 2.0 * edge) * closer)


class Effect:
    """One thing that may have been left out.

    `enters` declares one by these class variables and the function by which it changes the
    acceleration, the state (a kick), the reading, or the reading's clock. Its `values` are
    those of `parameters` in their order: first the sizes, at zero of which the effect is
    absent, then the shape (an exponent, an instant, a time constant ...).
    """

    identifier: ClassVar[str]
    name: ClassVar[str]
    kind: ClassVar[Kind]
    equation: ClassVar[str]
    """LaTeX."""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    example: ClassVar[tuple[float, ...]] = ()
    """Values at which it is plain to see for a pendulum of about 1 Hz released at 0.15 rad; in the
    manual, and what the tests of every effect take."""
    discriminating_test: ClassVar[str]
    """The one further measurement that would tell it from its rivals."""
    sizes: ClassVar[int] = 1
    parameter_free: ClassVar[bool] = False
    """True where the effect has no free size: it is there, or it is not (size 1 or 0)."""
    form: ClassVar[Mapping[str, Any]] = {}
    """What it makes of the law itself, by names of `Eq8`: sin x for x, or another form of drag."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Parameters of the baseline without which it is nothing (a drag's form needs a drag)."""
    inside: ClassVar[tuple[str, ...]] = ()
    """Baselines that hold it already."""
    carried: ClassVar[bool] = False
    """Whether what it adds to the readings is a motion that the pendulum's own carries with it, so
    that derivatives by the pendulum's values follow it."""
    local: ClassVar[bool] = False
    """Whether it happens at an instant."""
    spectral: ClassVar[bool] = False
    """Whether it is a tone, looked for at thousands of frequencies by Fourier transform (see
    `tone`); `shapes` is a rough grid."""
    expected: ClassVar[bool] = False
    """Whether every pendulum has some of it, so that it is to be doubted last."""
    rare: ClassVar[bool] = False
    """Whether the scan leaves it out, since it looks much like others. It is a rival of what it
    looks like, and leads where a curve, or a tone at a harmonic, would be added otherwise."""
    prior: ClassVar[float] = 0.0
    """Twice the logarithm of how much likelier it is beforehand than others."""
    has_signature: ClassVar[bool] = True
    """False where it has no template in the readings, and is found by a test of its own."""
    frees: ClassVar[str | None] = None
    """The held part of b ("hysteretic" or "viscous") that is free with it."""
    angular: ClassVar[bool] = False
    """Whether it is about angles, and means nothing for an oscillator in metres."""

    powers: ClassVar[Mapping[str, int]] = {}
    """Of the angle, by term, where it is a torque that is odd in it and has a formula."""
    contact: ClassVar[bool] = False
    """Whether it holds or frees swings that are small enough, so that the period of small swings is
    that of the smallest that were seen."""
    nodes: ClassVar[int] = 0
    """Nodes of half a cycle that its torque needs: more than usual where it has corners."""
    in_time: ClassVar[bool] = False
    """Whether it is drawn against time, and so can follow anything that happens once."""

    @property
    def key(self) -> str:
        """What distinguishes it from other entries."""
        return self.identifier

    def acts_on(self, unit: str) -> str:
        """Return the unit of what it acts on, of readings in `unit`.

        A gyroscope's motion is an angle, whatever is read.
        """
        on_motion = type(self).reading is Effect.reading or type(self).kick is not Effect.kick
        return "rad" if unit == "rad/s" and on_motion else unit

    @property
    def has_lines(self) -> bool:
        """Whether a scan over frequency may find it (`tone`)."""
        return type(self).tone is not Effect.tone

    @property
    def one_sided(self) -> bool:
        """Whether it has one size, which is never negative."""
        positive = self.parameter_free or (bool(self.parameters) and self.parameters[0].low >= 0.0)
        return self.sizes == 1 and positive

    @property
    def count(self) -> int:
        """How many values describe it, a switch's size included."""
        return len(self.parameters) + (1 if self.parameter_free else 0)

    def bounds(self, duration_s: float = math.inf) -> list[tuple[float, float]]:
        """Return lowest and highest values in a record of some length, a pair each."""
        limits = [(parameter.low, parameter.high) for parameter in self.parameters]
        return [(0.0, 1.0), *limits] if self.parameter_free else limits

    def limits(self, duration_s: float, scale: float) -> FloatArray:
        """Return its bounds where amplitudes are `scale` and not about 1; shape (values, 2)."""
        found = np.array(self.bounds(duration_s), dtype=np.float64).reshape(-1, 2)
        first = len(found) - len(self.parameters)
        for row, parameter in enumerate(self.parameters, first):
            found[row] *= scale**parameter.power
        return found

    def acceleration(
        self, motion: Motion, pendulum: Pendulum, values: FloatArray
    ) -> FloatArray | None:
        """Return the extra acceleration, rad/s^2, at the nodes of a motion.

        Of another form of the law it is the difference between the two.
        """
        if not self.form:
            return None
        usual = {name: getattr(Eq8, name) for name in self.form}
        with_it, without = replace(pendulum, **self.form), replace(pendulum, **usual)
        return np.asarray(values[0] * (with_it.along(motion) - without.along(motion)))

    def believable(self, values: FloatArray) -> bool:
        """Whether fitted values are those of the thing that is named."""
        return True

    def told(self, values: FloatArray) -> Mapping[str, float]:
        """Return the coefficients of its `powers` of the angle, of the torque over omega^2."""
        return dict(zip(self.powers, values, strict=False))

    def displacement(self, values: FloatArray, duration_s: float) -> float:
        """Return how far the reading is moved within a record at most, rad."""
        sizes = zip(self.parameters[: self.sizes], values, strict=False)
        return math.hypot(*(float(value) for size, value in sizes if size.unit == "rad"))

    def prior_penalty(self, values: FloatArray, span: Span) -> float:
        """Return twice the logarithm by which so large values are less likely beforehand."""
        return 0.0

    def kick(self, values: FloatArray) -> Kick | None:
        """Return the sudden change of the motion."""
        return None

    def reading(
        self, sampled: Sampled, pendulum: Pendulum, values: FloatArray
    ) -> FloatArray | None:
        """Return what is added to the readings, rad."""
        return None

    def delay(self, time_s: FloatArray, values: FloatArray) -> FloatArray | None:
        """Return by how much later than its stamp each reading was taken, s."""
        return None

    def shapes(self, span: Span) -> Sequence[Sequence[float]]:
        """Return the shapes that a scan tries, each a row of the values behind the sizes."""
        return ((),)

    def finer(self, span: Span, shape: Sequence[float]) -> Sequence[Sequence[float]]:
        """Return shapes about one that stands out in a scan, where a fit alone would get stuck."""
        return ()

    def tone(self, frequency_hz: float, decay_time_s: float, span: Span) -> Sequence[float] | None:
        """Return the shape of a tone that a scan has found; None if this effect makes none such.

        `decay_time_s` is inf for a steady tone.
        """
        return None

    def start(self, time_s: FloatArray, values: FloatArray, period_s: float) -> Start | None:
        """Return where a fit with it begins, if these readings beat and a fit would not find it."""
        return None

    def restart(
        self, time_s: FloatArray, values: FloatArray, pendulum: Pendulum, about_s: float
    ) -> Start | None:
        """Return where a refit with it begins, of these readings, that would get stuck at size 0.

        The start is to be the turning point about an instant.
        """
        return None

    def small(self, span: Span) -> float:
        """Return a size so small that the effect is linear in it."""
        return 1e-6


def enters(
    how: How, base: type[Effect] = Effect, **attributes: Any
) -> Callable[[Callable[..., Any]], Effect]:
    """Declare an effect by the function through which it enters.

    The function takes what that method of `Effect` takes, its values one by one; its docstring
    is the effect's text in the manual.

    Parameters
    ----------
    how
        The method.
    base
        The kind of scan: `Effect`, `Relaxing`, `Sudden`.
    attributes
        Class variables of `Effect`, and methods of it as functions without ``self``.

    Examples
    --------
    >>> @enters(
    ...     "reading",
    ...     identifier="tilt",
    ...     name="tilted sensor",
    ...     equation=r"y = x + s_2 x^2",
    ...     parameters=(Parameter("s2", "1/rad", -1.0, 1.0, word="quadratic term"),),
    ...     discriminating_test="turn the sensor round: the sign must change",
    ... )
    ... def tilt(sampled, pendulum, s2):
    ...     return s2 * sampled.angle**2
    >>> tilt.identifier, tilt.kind, tilt.count
    ('tilt', 'measurement', 1)
    """
    kind = "dynamics" if how in ("acceleration", "kick") else "measurement"

    def declare(function: Callable[..., Any]) -> Effect:
        def method(_: Effect, *given: Any) -> Any:
            *where, values = given
            return function(*where, *values)

        own = {how: method, "__module__": function.__module__, "kind": kind}
        given = {
            name: staticmethod(each) if callable(each) else each
            for name, each in attributes.items()
        }
        made = subclass(base, function.__name__, function.__doc__, own | given)
        if missing := [word for word in _WORDS if not hasattr(made, word)]:
            raise TypeError(f"{function.__name__}: an effect needs {', '.join(missing)}")
        return made()

    return declare


_WORDS: Final = ("identifier", "name", "equation", "discriminating_test")
"""What the catalogue and every answer print of an effect."""


def other_form(module: str, text: str, form: Mapping[str, Any], **attributes: Any) -> Effect:
    """Declare another form of Eq. 8 (see `Effect.form`), by its text in the manual."""
    own = {"__module__": module, "kind": "dynamics", "parameter_free": True, "form": form}
    own["example"] = (1.0,)
    return subclass(Effect, str(attributes["identifier"]), text, own | attributes)()


def without_template(module: str, text: str, **attributes: Any) -> Effect:
    """Declare an effect that a test of its own finds, by its text in the manual."""
    own = {"__module__": module, "kind": "measurement", "has_signature": False}
    return subclass(Effect, str(attributes["identifier"]), text, own | attributes)()


def subclass(
    base: type[AnyEffect], name: str, text: str | None, attributes: dict[str, Any]
) -> type[AnyEffect]:
    """Return a subclass with a docstring, class variables and methods."""
    known = {name for kind in base.__mro__ for name in (*vars(kind), *get_annotations(kind))}
    if unknown := attributes.keys() - known:
        raise TypeError(f"{name}: an effect has no {', '.join(sorted(unknown))}")
    return cast(type[AnyEffect], type(name, (base,), {"__doc__": text, **attributes}))


def rows(*axes: Iterable[float]) -> list[tuple[float, ...]]:
    """Return every combination of the values along several axes."""
    return [tuple(float(value) for value in row) for row in itertools.product(*axes)]


def between(low: float, high: float, count: int) -> FloatArray:
    """Return values in equal ratios; up to twice the lowest at least."""
    return np.geomspace(low, max(high, 2.0 * low), count)


STRAIGHT_S: Final = 1e7
"""A relaxation time that no record can tell from infinity."""
RELAXATION: Final = Parameter("tau", "s", 1e-2, STRAIGHT_S, STRAIGHT_S, word="time constant")
"""Of what fades: from a hundredth of a second to a straight line."""


def relaxed(time_s: FloatArray, tau: float) -> FloatArray:
    """Return tau (1 - e^(-t/tau)): how far a drift has come that relaxes; t where tau is long."""
    return np.asarray(-tau * np.expm1(-time_s / tau))


class Relaxing(Effect):
    """A change that relaxes with tau, and is straight where tau is long; tau is the shape."""

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Straight, and over two fifths and a sixth of the record.

        The time that is fitted afterwards starts from the best of them.
        """
        return [(STRAIGHT_S,), (0.4 * span.duration_s,), (span.duration_s / 6.0,)]


USUAL_DRIFT: Final = 1e-3
"""Part by which a frequency or a clock may well change within a record: steel's modulus changes
so in a few kelvin, the clock of a program that times itself so at the worst."""


def unusual_drift(values: FloatArray, span: Span) -> float:
    """Return twice the logarithm by which a drift is larger than usual ones; 0 where it is not.

    A density that falls as 1/change^2 beyond the usual, and is flat in the logarithm within.
    """
    rate, tau = values.tolist()
    change = abs(rate) * float(relaxed(np.asarray(span.duration_s), tau))
    return 2.0 * math.log(max(change / USUAL_DRIFT, 1.0))


_LATE: Final = 0.1
"""Of a half cycle, by which the release may seem to come after the first reading."""


def half_cycle_of_release(motion: Motion, pendulum: Pendulum) -> int:
    """Return the number of the half cycle that begins where the pendulum was let go.

    That is the last turning point before the first reading, or a little behind it: what begins
    with the first reading begins, within its error, at a turning point.
    """
    begins, lasts = motion.time_s[:, 0], math.pi / pendulum.angular_frequency
    before = int(np.searchsorted(begins, pendulum.first_s + _LATE * lasts, side="right"))
    return max(before - 1, 0)


def since_release(motion: Motion, pendulum: Pendulum) -> FloatArray:
    """Return the time since the turning point at which the pendulum was let go, s; 0 before."""
    released = motion.time_s[half_cycle_of_release(motion, pendulum), 0]
    return np.asarray(np.maximum(motion.time_s - released, 0.0))


def phase_since_reversal(motion: Motion) -> FloatArray:
    """Return the phase since the turning point before, 0 to pi, at the nodes, rad."""
    return np.asarray(motion.clock.psi - motion.clock.psi[:, :1])


def smooth_step(motion: Motion, instant_s: float) -> FloatArray:
    """Return a step from 0 to 1 at an instant, at the nodes of a motion.

    It takes about half a period (three tenths from 10 % to 90 %), which no free decay can
    tell from a sharper one, and so stays smooth within the half cycles.
    """
    late = motion.angular_frequency * (motion.time_s - instant_s)
    return np.asarray(0.5 + 0.5 * np.tanh(1.2 * late))


def elapsed(time_s: FloatArray) -> FloatArray:
    """Return the time since the first reading, s."""
    return np.asarray(time_s - time_s[0])


def reading_step(time_s: FloatArray, instant_s: float) -> FloatArray:
    """Return a step from 0 to 1 at an instant, at the readings; it lasts one interval."""
    interval = (time_s[-1] - time_s[0]) / max(len(time_s) - 1, 1)
    return np.asarray(np.clip((time_s - instant_s) / interval + 0.5, 0.0, 1.0))


INSTANT: Final = Parameter("time", "s", -math.inf, math.inf, word="at")


class Sudden(Effect):
    """What happens at an instant; the instant is the shape."""

    local = True
    tried: ClassVar[int]
    """Instants of the scan."""
    turn: ClassVar[float] = 0.0
    """Phase in rad between the four instants that are tried about each; 0 where one is enough."""
    refined: ClassVar[bool] = True
    """Whether a fit would get stuck between the scan's instants, so that it needs finer ones."""

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Instants; where the effect depends on the phase at which it comes, at several phases."""
        later = self.turn / span.pendulum.angular_frequency
        phases = range(4 if self.turn else 1)
        return [(float(time + k * later),) for time in span.times(self.tried) for k in phases]

    def finer(self, span: Span, shape: Sequence[float]) -> list[tuple[float]]:
        """Instants from one of the scan's neighbours to the other, an eighth cycle apart."""
        if not self.refined:
            return []
        rough = span.times(self.tried)
        place = int(np.argmin(np.abs(rough - shape[0])))
        low = rough[max(place - 1, 0)]
        high = rough[min(place + 1, self.tried - 1)] + 0.5 * span.period_s
        number = min(int((high - low) / (0.125 * span.period_s)) + 2, 300)
        return [(float(time),) for time in np.linspace(low, high, number)]
