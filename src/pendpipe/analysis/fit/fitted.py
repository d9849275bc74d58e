"""What a fit holds: its numbers with errors, what they were checked against, and its light."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final, Literal, TypeVar, cast

import numpy as np

from pendpipe.analysis.fit.backbone import Backbone, backbone_of
from pendpipe.analysis.fit.decrement import Check, Light
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8
from pendpipe.dynamics.eq8 import Restoring
from pendpipe.dynamics.eq8_model import Eq8Model
from pendpipe.estimate import Estimate, quality_of_rate
from pendpipe.levels import REFUTED

if TYPE_CHECKING:
    from pendpipe.recording import Recording

Method = Literal["waveform", "turning-points", "amplitudes"]
Baseline = Literal["eq8", "viscous"]
DragForm = Literal["energy", "speed", "undecided"]
Hindrance = Literal["", "beat", "cut", "overdamped"]
Fit = TypeVar("Fit", bound="Fitted")
PARTS: Final = ("quality_factor_hysteretic", "quality_factor_viscous")
PARAMETERS: Final = ("a", "b", "c", "frequency", "amplitude", "phase", "offset")


_RATES: Final = {
    "1": ("1/s", "1/s"),
    "rad/s": ("1/rad", "rad/s^2"),
    "rad/s^2": ("s/rad", "rad/s^3"),
    "m/s": ("1/m", "m/s^2"),
    "m/s^2": ("s/m", "m/s^3"),
}
"""Units of a and c where that of the motion has the second in it."""


def units(unit: str) -> dict[str, str]:
    """Unit of each parameter, for motions in a unit.

    >>> units("rad")["a"], units("m/s")["c"]
    ('1/(rad s)', 'm/s^2')
    """
    a, c = _RATES.get(unit, (f"1/({unit} s)", f"{unit}/s"))
    return {
        "a": a,
        "b": "1/s",
        "c": c,
        "frequency": "Hz",
        "amplitude": unit,
        "phase": "rad",
        "offset": unit,
    }


_APART: Final = {"json": None}
"""Of fields that are not in ``fit.json``, or in another form."""


_AMONG: Final = {"json": ""}
"""Of fields whose own fields stand among the others of ``fit.json``."""


@dataclass(frozen=True)
class Form:
    """Which law was fitted, of those in question.

    Parameters
    ----------
    baseline
        The model's name.
    restoring
        The torque that the numbers belong to.
    drag, drag_form
        The form that the fitted law has: the likelier; and which the readings prefer, undecided
        where neither is a thousand times as likely as the other: then the errors cover both.
    hysteretic_share
        Part of b that the fitted law has as hysteretic; hardly any recording tells it.
    quality_factor_hysteretic, quality_factor_viscous
        The parts of b that are held; None elsewhere: one recording does not tell them apart.
    torque_odds
        Logarithm of the likelihood of the fitted torque over the other's; None where it was not
        asked for.
    other_frequency
        Eq. 8's frequency with the other torque, where the readings can't
        decide between the two and the frequencies differ by more than their error.
    zero_drift
        By how much the zero rises in a second, where the readings ask for it.
    """

    baseline: Baseline = "eq8"
    restoring: Restoring = "linear"
    drag: Literal["energy", "speed"] = "energy"
    drag_form: DragForm = "energy"
    hysteretic_share: float = 0.5
    quality_factor_hysteretic: Estimate | None = None
    quality_factor_viscous: Estimate | None = None
    torque_odds: float | None = field(default=None, metadata={"json": "torque_log_odds"})
    other_frequency: Estimate | None = None
    zero_drift: Estimate | None = None


@dataclass(frozen=True)
class Agreement:
    """How the law agrees with what was fitted.

    Parameters
    ----------
    noise_rms_rad, residual_rms_rad, chi2_per_dof
        Noise of one reading (never below step/sqrt(12)); what the model leaves; and their
        comparison.
    fit_p_value
        Of the one test of fit, over all its questions (`goodness`, `decrement`).
    decrement_check
        The law's loss beside that of the turning points, the large amplitude first.
    samples, turning_points
        How many of each were used.
    settled
        Whether the search came to its end; a fit that did not is no result.
    bent
        Third harmonic that the law does not have (`goodness.Goodness.bent`).
    """

    noise_rms_rad: float = math.nan
    residual_rms_rad: float = math.nan
    chi2_per_dof: float = math.nan
    fit_p_value: float | None = None
    decrement_check: tuple[Check, ...] = ()
    samples: int = 0
    turning_points: int = 0
    settled: bool = field(default=True, metadata=_APART)
    bent: FloatArray | None = field(default=None, metadata=_APART)


@dataclass(frozen=True)
class Verdict:
    """How far the numbers may be believed.

    Parameters
    ----------
    light, light_reason
        By what the misfit does to them (`consequence`), and why.
    hindered
        Why a law tells little of the decay: two modes beat, most of it was cut, or a cycle loses
        most of the swing.
    quotable
        What may be quoted: ``"period"``, ``"Q"``, ``"losses"``, ``"a"``, ``"b"``, ``"c"``.
    """

    light: Light = "amber"
    light_reason: str = "the decrement was not checked"
    hindered: Hindrance = ""
    quotable: tuple[str, ...] = ()


@dataclass(frozen=True)
class Told:
    """What the user says of the apparatus.

    Parameters
    ----------
    clock_ppm
        What the clock may be off by, in parts per million, where that is in the error of the
        period.
    scale_percent
        What the scale of the readings (V/rad, a camera's) may be off by, in percent; None where
        that is not in the errors.
    length, gravity
        Of a simple pendulum: the other of the two is a number of the fit.
    """

    clock_ppm: float | None = None
    scale_percent: float | None = None
    length: Estimate | None = None
    gravity: Estimate | None = None


def view(path: str, words: str) -> property:
    """What is a field of a part: read, without a copy."""
    return property(attrgetter(path), doc=words)


@dataclass(frozen=True, repr=False)
class Fitted:
    """What was fitted of one recording, with its errors, and how far it may be believed.

    Parameters
    ----------
    method
        How it was fitted: to all readings, to turning points, or to amplitudes alone, whose
        frequency, phase and noise are NaN.
    parameters
        The seven of `PARAMETERS`: the rates of Eq. 13, Eq. 8's frequency omega/(2 pi),
        |y| at the first turning point kept, the phase at the first sample kept (the motion
        is there ``offset + amplitude cos(phase)`` to first order), and the level.
    covariance
        Of the parameters in their order, shape (7, 7).
    form, agreement, verdict, told
        Which law; how it agrees; how far to believe it; what the user says of the apparatus.
    cuts
        Spans left out: ``start_s``, ``stop_s``, ``reason``.
    provenance, warnings
        Where it comes from; and what the reader should know.
    shown
        The backbone, where it is known already (`backbone`).
    name
        Of the file that was fitted.
    minimum
        Eq. 8 in its form with its sensor, and its values at the minimum; None where the fit was
        read from a file, or is none of the readings.
    points, decay
        The turning points and the readings of the fitted decay; None where the fit was read
        from a file.
    drawn_by
        Imports what draws it (`pendpipe.api`): a result knows no figures.
    """

    method: Method
    parameters: Mapping[str, Estimate]
    covariance: FloatArray = field(metadata=_APART)
    form: Form = field(default_factory=Form, metadata=_AMONG)
    agreement: Agreement = field(default_factory=Agreement, compare=False, metadata=_AMONG)
    verdict: Verdict = field(default_factory=Verdict, metadata=_AMONG)
    told: Told = field(default_factory=Told, metadata=_AMONG)
    cuts: tuple[Mapping[str, Any], ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    shown: Backbone | None = field(default=None, compare=False, metadata=_APART)
    name: str = field(default="", compare=False, metadata=_APART)
    minimum: tuple[Eq8Model, FloatArray] | None = field(
        default=None, compare=False, metadata=_APART
    )
    points: TurningPoints | None = field(default=None, compare=False, metadata=_APART)
    decay: Recording | None = field(default=None, compare=False, metadata=_APART)
    drawn_by: Callable[[], Any] | None = field(default=None, compare=False, metadata=_APART)

    # Views of the parts.
    baseline = cast("Baseline", view("form.baseline", "The model's name."))
    restoring = cast("Restoring", view("form.restoring", "The torque that the numbers belong to."))
    drag_form = cast(
        "DragForm", view("form.drag_form", "The form of the drag that the readings prefer.")
    )
    noise_rms_rad = cast("float", view("agreement.noise_rms_rad", "Noise of one reading."))
    residual_rms_rad = cast("float", view("agreement.residual_rms_rad", "What the model leaves."))
    chi2_per_dof = cast("float", view("agreement.chi2_per_dof", "Of the readings."))
    fit_p_value = cast("float | None", view("agreement.fit_p_value", "Of the one test of fit."))
    decrement_check = cast(
        "tuple[Check, ...]",
        view("agreement.decrement_check", "The law's loss beside that of the turning points."),
    )
    samples = cast("int", view("agreement.samples", "How many readings were used."))
    turning_points = cast(
        "int", view("agreement.turning_points", "How many turning points were used.")
    )
    light = cast("Light", view("verdict.light", "How far the numbers may be believed."))
    light_reason = cast("str", view("verdict.light_reason", "Why."))
    hindered = cast("Hindrance", view("verdict.hindered", "Why a law tells little of the decay."))
    quotable = cast("tuple[str, ...]", view("verdict.quotable", "What may be quoted."))
    length = cast(
        "Estimate | None", view("told.length", "Of a simple pendulum, where it was given.")
    )
    zero_drift = cast(
        "Estimate | None", view("form.zero_drift", "By how much the zero rises in a second.")
    )
    gravity = cast("Estimate | None", view("told.gravity", "Where it was given."))

    @property
    def quality_factor_limit(self) -> Estimate | None:
        """Pi f/b: the Q that the exponential losses alone would give; None for b = 0."""
        b = self.parameters["b"]
        return quality_of_rate(self.value("frequency"), b) if b.value > 0.0 else None

    @property
    def refuted(self) -> bool:
        """Whether the readings differ from the law by more than noise explains."""
        return self.fit_p_value is not None and self.fit_p_value < REFUTED

    @cached_property
    def backbone(self) -> Backbone | None:
        """Period and decrement against amplitude, as the turning points show them without a law.

        None of too few of them, and of two modes that beat.

        Examples
        --------
        >>> import pendpipe as pp
        >>> fit = pp.fit("examples/rod-pendulum.csv")
        >>> print(fit.backbone.small_period, fit.backbone.loss(0.05))
        (1.145475 ± 0.000027) s (0.019411 ± 0.000063) s⁻¹
        """
        if self.shown is not None or self.points is None or not self.decrement_check:
            return self.shown
        return backbone_of(self.points, self.law, self.agreement.bent)

    @property
    def lawless(self) -> Backbone | None:
        """The backbone, where period and Q are quoted from it: the law is refuted."""
        return self.backbone if self.refuted or self.light == "red" else None

    @property
    def equation(self) -> str:
        """Name of the law that was fitted."""
        if self.restoring == "sine":
            return "Eq. 8 with the torque of sin x"
        return "Eq. 8" if self.method == "waveform" else "Eq. 14"

    @property
    def law(self) -> Eq8:
        """Eq. 8 with the fitted numbers; b is divided as the readings like it best."""
        held, frequency = self.form.quality_factor_hysteretic, self.value("frequency")
        a, b, c = map(self.value, "abc")
        best = self.form.hysteretic_share * b
        share = best if held is None else math.pi * frequency / held.value
        hysteretic = min(max(share, 0.0), b)
        omega = math.tau * frequency
        if not math.isfinite(omega):
            omega = fast_beside(a, b, c, self.value("amplitude"))
        return Eq8(omega, a, hysteretic, b - hysteretic, c, self.restoring, self.form.drag)

    def value(self, name: str) -> float:
        """Value of one parameter."""
        return self.parameters[name].value

    def covariance_of(self, *names: str) -> FloatArray:
        """Covariance of some parameters, in their order."""
        place = [PARAMETERS.index(name) for name in names]
        return self.covariance[np.ix_(place, place)]


def fast_beside(a: float, b: float, c: float, amplitude: float) -> float:
    """Return an angular frequency to which Eq. 13 holds to 1e-8, beside losses at an amplitude."""
    return 1e4 * max(a * amplitude + b + c / amplitude, 1e-300)
