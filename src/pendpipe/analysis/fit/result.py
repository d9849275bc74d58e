"""The result of a fit: its numbers with errors, what it says in print, its form on disk."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from pendpipe.analysis.fit.decrement import Decrement, Light, check_decrement, light_of
from pendpipe.analysis.fit.goodness import Goodness, combined
from pendpipe.analysis.fit.least_squares import CHI2_95
from pendpipe.analysis.fit.quality import (
    LOSSES,
    Quality,
    qualities,
    quality_at,
    released_quality,
    seen_qualities,
    small_period,
)
from pendpipe.analysis.turning_points import BEAT, TurningPoints, write_turning_points
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, turning_points
from pendpipe.errors import InputError, refuse_if
from pendpipe.estimate import Estimate, number, quality_of_rate
from pendpipe.files import read_json, write_json, writing
from pendpipe.quantities import compact, in_columns, stretch, with_error

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from pendpipe.recording import Recording

Method = Literal["waveform", "turning-points"]
Baseline = Literal["eq8", "viscous"]
Restoring = Literal["linear", "sine"]
DragForm = Literal["energy", "speed", "undecided"]
TORQUES: Final[tuple[Restoring, ...]] = ("linear", "sine")
PARTS: Final = ("quality_factor_hysteretic", "quality_factor_viscous")
OPTIONAL: Final = ("zero_drift", "other_frequency")
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
    """Unit of each parameter, for motions in a unit."""
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


@dataclass(frozen=True, repr=False)
class FitResult:
    """What one recording says of a, b, c and the rest.

    Parameters
    ----------
    method, baseline
        How it was fitted, and with which model.
    parameters
        The seven of `PARAMETERS`: the rates of Eq. 13, Eq. 8's frequency omega/(2 pi),
        |y| at the first turning point kept, the phase at the first sample kept (the motion
        is there ``offset + amplitude cos(phase)`` to first order), and the level.
    quality_factor_limit
        pi f/b: the Q that the exponential losses alone would give; None for b = 0.
    quality_factor_hysteretic, quality_factor_viscous
        The parts of b that are held; None elsewhere: one recording does not tell them apart.
    covariance_order, covariance
        Names and matrix, shape (n, n).
    noise_rms_rad, residual_rms_rad, chi2_per_dof
        Noise of one reading (never below step/sqrt(12)); what the model leaves; and their
        comparison.
    samples, turning_points
        How many of each were used.
    cuts
        Spans left out: ``start_s``, ``stop_s``, ``reason``.
    provenance, warnings
        Where it comes from; and what the reader should know.
    restoring
        Which restoring torque the numbers belong to.
    settled
        Whether the search came to its end; a fit that did not is no result.
    decrement_check
        The law's loss beside that of the turning points, the large amplitude first.
    fit_p_value
        Of the one test of fit, over all its questions (`goodness`, `decrement`).
    drag_form
        Which form of the drag the readings prefer; undecided where neither is a thousand times as
        likely as the other: then the errors cover both.
    drag
        The form that `law` has: the likelier.
    zero_drift
        By how much the zero rises in a second, where the readings ask for it.
    other_frequency
        Eq. 8's frequency with the other torque, where the readings can't
        decide between the two and the frequencies differ by more than their error.
    torque_odds
        Logarithm of the likelihood of the fitted torque over the other's; None where it was not
        asked for.
    light, light_reason
        How far the numbers may be believed (`decrement.light_of`), and why.
    points, decay
        The turning points and the readings of the fitted decay; None where the fit was read
        from a file.
    """

    method: Method
    baseline: Baseline
    parameters: Mapping[str, Estimate]
    quality_factor_limit: Estimate | None
    covariance_order: tuple[str, ...]
    covariance: FloatArray
    noise_rms_rad: float
    residual_rms_rad: float
    chi2_per_dof: float
    samples: int
    turning_points: int
    quality_factor_hysteretic: Estimate | None = None
    quality_factor_viscous: Estimate | None = None
    cuts: tuple[Mapping[str, Any], ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    restoring: Restoring = "linear"
    settled: bool = True
    decrement_check: tuple[Decrement, ...] = ()
    fit_p_value: float | None = None
    drag_form: DragForm = "energy"
    drag: Literal["energy", "speed"] = "energy"
    zero_drift: Estimate | None = None
    other_frequency: Estimate | None = None
    torque_odds: float | None = None
    light: Light = "amber"
    light_reason: str = "the decrement was not checked"
    points: TurningPoints | None = field(default=None, repr=False, compare=False)
    decay: Recording | None = field(default=None, repr=False, compare=False)

    def __getitem__(self, name: str) -> Estimate:
        """Return one number: a parameter, ``"Q"`` at the amplitude released, or ``"period"``.

        Examples
        --------
        >>> import pendpipe as pp
        >>> fit = pp.fit("examples/rod-pendulum.csv")
        >>> print(fit["period"], fit["Q"], sep="; ")
        (1.1454713 ± 0.0000025) s; 170.06 ± 0.56
        """
        if name == "Q":
            return released_quality(self)
        return self.period if name == "period" else self.parameters[name]

    @property
    def period(self) -> Estimate:
        """Period of small swings, s."""
        return small_period(self)

    @property
    def quality_factors(self) -> tuple[Quality, ...]:
        """Q and the shares of the losses at a large, a middle and a small amplitude."""
        return qualities(self)

    def quality_factor(self, amplitude_rad: float) -> Estimate:
        """Return Q at an amplitude, ``pi/(T loss)`` with the period and the loss there.

        Parameters
        ----------
        amplitude_rad
            In rad, or in the unit of the recording.

        Raises
        ------
        InputError
            If it is no amplitude; or, where no law describes the decay, none at which its
            turning points show Q.
        """
        return quality_at(self, amplitude_rad)

    def __str__(self) -> str:
        """Return the light, what can be quoted, and how to quote it."""
        return "\n".join(lines(self))

    def __repr__(self) -> str:
        """Return the numbers in one line."""
        numbers = ", ".join(
            f"{name}={entry.value:.6g}+-{entry.sd:.2g}" for name, entry in self.parameters.items()
        )
        return f"FitResult({self.light}: {numbers})"

    def _repr_html_(self) -> str:
        """Return the summary for a notebook."""
        from html import escape

        return f"<pre>{escape(str(self))}</pre>"

    @property
    def equation(self) -> str:
        """Name of the law that was fitted."""
        if self.restoring == "sine":
            return "Eq. 8 with the torque of sin x"
        return "Eq. 14" if self.method == "turning-points" else "Eq. 8"

    @property
    def law(self) -> Eq8:
        """Eq. 8 with the fitted numbers; b is halved where its parts are not known."""
        b, held = self.value("b"), self.quality_factor_hysteretic
        share = 0.5 * b if held is None else math.pi * self.value("frequency") / held.value
        hysteretic = min(max(share, 0.0), b)
        law = Eq8(
            2.0 * math.pi * self.value("frequency"),
            self.value("a"),
            hysteretic,
            b - hysteretic,
            self.value("c"),
            restoring=self.restoring,
        )
        speed = self.drag == "speed"
        return replace(law, drag="speed") if speed else law

    def plot(self) -> Figure:
        """Draw the decay with its fit, what the fit leaves, and Q against amplitude."""
        from pendpipe.figures.decays import Decay, draw_fit

        if self.points is None or self.decay is None:
            raise InputError("plot", "the readings are not with this fit", "fit the recording anew")
        return draw_fit(Decay("", self.points, self), self.decay)

    def to_frame(self) -> DataFrame:
        """Return a table with a row a number: value, sd, low95, high95, unit.

        The parameters, the period of small swings, Q at the amplitude released (``Q``), at the
        three amplitudes (``Q(0.51 rad)``) and its limit (``Q limit``), and the shares of the
        losses (``share of a at 0.51 rad``).
        """
        from pandas import DataFrame

        rows = [
            (name, entry.value, entry.sd, *entry.bounds95, entry.unit)
            for name, entry in self.numbers().items()
        ]
        columns = ["parameter", "value", "sd", "low95", "high95", "unit"]
        return DataFrame(rows, columns=columns).set_index("parameter")

    def numbers(self) -> dict[str, Estimate]:
        """Return every number of the fit by its name; see `to_frame`."""
        found = {**self.parameters, "period": self.period}
        unit, limit = self.parameters["amplitude"].unit, self.quality_factor_limit
        shares: dict[str, Estimate] = {}
        for each in self.quality_factors:
            where = compact(each.amplitude_rad, unit)
            found[f"Q({where})"] = each.quality_factor
            shares |= {f"share of {name} at {where}": of for name, of in each.losses.items()}
        return found | {"Q": self["Q"]} | ({} if limit is None else {"Q limit": limit}) | shares

    def save(self, folder: str | Path, *, force: bool = False) -> Path:
        """Write ``fit.json`` and, with the readings, ``turning_points.csv`` and ``fit.svg``.

        Returns the folder, which is made where it does not exist. Files of these names that
        pendpipe did not make are replaced only with `force`.
        """
        target = Path(folder)
        with writing(force=force):
            write_json(target / "fit.json", self.to_dict())
            if self.points is not None and self.decay is not None:
                from pendpipe.figures.style import save

                write_turning_points(target / "turning_points.csv", self.points)
                save(self.plot(), target / "fit")
        return target

    def value(self, name: str) -> float:
        """Value of one parameter."""
        return self.parameters[name].value

    def covariance_of(self, *names: str) -> FloatArray:
        """Covariance of some parameters, in their order."""
        place = [self.covariance_order.index(name) for name in names]
        return self.covariance[np.ix_(place, place)]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``fit.json``."""
        limit = self.quality_factor_limit
        if limit is None:
            limit = Estimate(math.nan, math.nan, "", (math.nan, math.nan))
        return {
            "schema_version": 1,
            "method": self.method,
            "baseline": self.baseline,
            "restoring": self.restoring,
            "drag_form": self.drag_form,
            "drag": self.drag,
            "fit_p_value": self.fit_p_value,
            "torque_log_odds": self.torque_odds,
            **{name: getattr(self, name) and getattr(self, name).as_json() for name in OPTIONAL},
            "light": self.light,
            "light_reason": self.light_reason,
            "decrement_check": [check._asdict() for check in self.decrement_check],
            "parameters": {name: self.parameters[name].as_json() for name in PARAMETERS},
            "period": self.period.as_json(),
            "quality_factors": [each.as_json() for each in self.quality_factors],
            "quality_factor_limit": limit.as_json(),
            **{name: getattr(self, name) and getattr(self, name).as_json() for name in PARTS},
            "covariance": {
                "order": list(self.covariance_order),
                "matrix": self.covariance.tolist(),
            },
            "noise_rms_rad": self.noise_rms_rad,
            "residual_rms_rad": self.residual_rms_rad,
            "chi2_per_dof": self.chi2_per_dof,
            "samples": self.samples,
            "turning_points": self.turning_points,
            "cuts": [dict(cut) for cut in self.cuts],
            "provenance": dict(self.provenance),
            "warnings": list(self.warnings),
        }

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> FitResult:
        """Rebuild a result from the content of ``fit.json``."""
        limit = content["quality_factor_limit"]
        covariance = content["covariance"]
        held: dict[str, Any] = {
            name: content[name] and Estimate.from_json(content[name])
            for name in (*PARTS, *OPTIONAL)
        }
        return cls(
            method=content["method"],
            baseline=content["baseline"],
            parameters={
                name: Estimate.from_json(entry) for name, entry in content["parameters"].items()
            },
            quality_factor_limit=None if limit["value"] is None else Estimate.from_json(limit),
            covariance_order=tuple(covariance["order"]),
            covariance=np.array(covariance["matrix"], dtype=np.float64),
            noise_rms_rad=number(content["noise_rms_rad"]),
            residual_rms_rad=number(content["residual_rms_rad"]),
            chi2_per_dof=number(content["chi2_per_dof"]),
            samples=content["samples"],
            turning_points=content["turning_points"],
            cuts=tuple(content["cuts"]),
            provenance=content["provenance"],
            warnings=tuple(content["warnings"]),
            restoring=content["restoring"],
            drag_form=content["drag_form"],
            drag=content["drag"],
            fit_p_value=content["fit_p_value"],
            torque_odds=content["torque_log_odds"],
            light=content["light"],
            light_reason=content["light_reason"],
            decrement_check=tuple(Decrement(**check) for check in content["decrement_check"]),
            **held,
        )


_MIXED: Final = 0.95
"""Correlation of a and b from which a record tells their sum, and not each."""
_UNCLEAR: Final = 0.1
"""Of the loss at the start by which the drag is then uncertain."""


def result_of(
    value: FloatArray,
    covariance: FloatArray,
    intervals: Sequence[tuple[float, float]],
    held: Sequence[int],
    points: TurningPoints,
    law: Eq8,
    *,
    goodness: Goodness,
    said: Iterable[str],
    fixed: Mapping[str, float],
    **rest: Any,
) -> FitResult:
    """Dress a fit's numbers, compare its law with the decay, and say what the reader should know.

    Parameters
    ----------
    value, covariance
        The seven parameters in the order of `PARAMETERS`, shapes (7,) and (7, 7).
    intervals
        Of a, b, c; those of the others are symmetric.
    held
        Which of a, b, c (0, 1, 2) are not fitted.
    points, law
        The turning points that were fitted, and the law.
    goodness
        The noise, and how well the law describes the readings.
    said
        Warnings of the fit itself; the notes of the turning points stand before them.
    fixed
        What is held, by name; one recording does not tell the parts of b.
    **rest
        The other fields of `FitResult`.
    """
    dress, parameters = units(points.unit), {}
    for index, name in enumerate(PARAMETERS):
        number, sd = float(value[index]), math.sqrt(max(float(covariance[index, index]), 0.0))
        half = math.sqrt(CHI2_95) * sd
        interval = intervals[index] if index < 3 else (number - half, number + half)
        at_bound = index < 3 and index not in held and number <= 0.0
        parameters[name] = Estimate(number, sd, dress[name], interval, at_bound)
    b = parameters["b"]
    limit = quality_of_rate(parameters["frequency"].value, b) if b.value > 0.0 else None
    checks = check_decrement(points, law)
    p_values = (*goodness.p_values, *(check.p_value for check in checks))
    light, reason = light_of(checks, p_values, unit=points.unit)
    rest |= {name: Estimate(fixed[name], 0.0, "") for name in PARTS if name in fixed}
    result = FitResult(
        parameters=parameters,
        quality_factor_limit=limit,
        covariance_order=PARAMETERS,
        covariance=covariance,
        restoring=law.restoring,
        drag=getattr(law, "drag", "energy"),
        noise_rms_rad=goodness.noise_rms,
        chi2_per_dof=goodness.chi2_per_dof,
        fit_p_value=combined(p_values),
        decrement_check=checks,
        light=light,
        light_reason=reason,
        **rest,
    )
    return replace(result, warnings=(*points.notes, *_warnings(result, goodness.enlarged), *said))


def _warnings(result: FitResult, stretched: float) -> list[str]:
    """What the reader of these numbers should know, a clause each."""
    a, b, c = (result.parameters[name] for name in ("a", "b", "c"))
    y0 = result.parameters["amplitude"].value
    rate = a.value * y0 + b.value + c.value / y0
    matrix = result.covariance_of("a", "b")
    mixed = matrix[0, 1] < -_MIXED * a.sd * b.sd if a.sd > 0.0 and b.sd > 0.0 else False
    slow = result.chi2_per_dof <= 0.9 * stretched
    seen = "the half cycles scatter, in the square," if slow else "chi^2 of the readings is"
    warnings = (
        *(
            (estimate.at_bound, f"{name} lies at its bound 0; its interval is one-sided")
            for name, estimate in result.parameters.items()
        ),
        (
            result.quality_factor_limit is None,
            "quality_factor_limit has no finite value, since b = 0",
        ),
        (
            stretched > 1.0,
            f"{seen} {stretched:.3g} times what the noise explains: the standard deviations are"
            " enlarged by its root; see pendpipe diagnose",
        ),
        (
            result.baseline == "eq8" and mixed and a.sd * y0 > _UNCLEAR * rate,
            "a can't be told from b here: the record holds too little of large amplitudes (a tail);"
            " a, b, c of a tail depend on where it begins",
        ),
    )
    return [warning for is_so, warning in warnings if is_so]


def read_fit(path: str | Path) -> FitResult:
    """Read ``fit.json``.

    Raises
    ------
    InputError
        If the file is absent, is no fit, or holds the refusal of its record.
    """
    content = read_json(path)
    refuse_if(
        "refused" in content,
        path,
        f"the record was refused ({content.get('refused')})",
        "correct it first",
    )
    try:
        return FitResult.from_json(content)
    except (KeyError, TypeError) as fault:
        raise InputError(path, f"this is no fit ({fault})", "run pendpipe fit") from None


WITHOUT_LAW: Final = "from the turning points alone"
_TOP: Final = 3.13
"""Amplitude in rad beyond which no correction is made for sin x."""


def cause(quality: Quality) -> str:
    """Say which loss takes most at an amplitude, and how much, as far as it is told."""
    if not quality.losses:
        return WITHOUT_LAW
    if (name := quality.dominant) is None:
        return "by losses that this fit does not tell apart"
    return f"{100.0 * quality.losses[name].value:.0f} % {LOSSES[name]} ({name})"


def gravity_line(
    result: FitResult, *, length_m: float | None = None, gravity: float | None = None
) -> str:
    """Print g from the length of a simple pendulum, or its length from g: omega_0^2 = g/l.

    Parameters
    ----------
    result
        A fit of angles.
    length_m, gravity
        The one that is known, m or m/s^2.

    Notes
    -----
    With the torque of sin x the fitted omega is omega_0, that of small amplitudes. Otherwise
    omega_0 = omega 2 K(sin(y/2))/pi at the root-mean-square amplitude y, and the line names this
    correction.
    """
    omega = 2.0 * math.pi * result.value("frequency")
    relative = 2.0 * result["frequency"].sd / result.value("frequency")
    corrected = ""
    if result.restoring == "linear":
        squares = [quality.amplitude_rad**2 for quality in qualities(result)]
        amplitude = math.sqrt(sum(squares) / len(squares))
        release = Release(0.0, min(amplitude, _TOP))
        swing = turning_points(Eq8(1.0, restoring="sine"), release, count=2)
        factor = float(swing.time_s[1]) / math.pi
        omega *= factor
        corrected = f", finite-amplitude correction {100.0 * (factor**2 - 1.0):+.2g} % included"
    if length_m is not None:
        value, name, unit = omega**2 * length_m, "g", "m/s^2"
    else:
        assert gravity is not None
        value, name, unit = gravity / omega**2, "length", "m"
    return _line(name, with_error(value, relative * value, unit, short=True) + corrected)


def lines(result: FitResult, *, law: bool | None = None) -> list[str]:
    """Print a fit: the light first, then what can be quoted, each with its error.

    Parameters
    ----------
    result
        The fit.
    law
        Whether to print a, b, c; by default unless the light is red.
    """
    unit = result.parameters["amplitude"].unit

    def quality(found: Quality) -> str:
        q = with_error(found.quality_factor.value, found.quality_factor.sd, short=True)
        return _line(f"Q at {compact(found.amplitude_rad, unit)}", f"{q}, {cause(found)}")

    by_points = result.method == "turning-points"
    count = result.turning_points if by_points else result.samples
    head = [
        f"{result.light}: {result.light_reason}",
        f"  {result.equation} fitted to {count} {'turning points' if by_points else 'readings'}",
        *(
            _line("left out", f"{stretch(cut['start_s'], cut['stop_s'])}: {cut['reason']}")
            for cut in result.cuts
        ),
    ]
    if not (result.light != "red" if law is None else law):
        checks = (f"  {check.sentence(unit)}" for check in result.decrement_check)
        seen = (quality(each) for each in seen_qualities(result))
        return [*head, *checks, *seen, "  " + quotable(result)]
    period, limit = small_period(result), result.quality_factor_limit
    name = "period, small amplitude" if result.restoring == "sine" else "period"
    told = [limit] if limit is not None and limit.value > 3.0 * limit.sd else []
    return [
        *head,
        _line(name, with_error(period.value, period.sd, "s", short=True)),
        *(_line(letter, rate_with_error(result[letter])) for letter in "abc"),
        *(quality(each) for each in qualities(result)),
        *(_line("Q limit πf/b", with_error(each.value, each.sd, short=True)) for each in told),
        "  " + quotable(result),
    ]


def _line(name: str, value: str) -> str:
    return f"  {name:<26}{value}"


def rate_with_error(rate: Estimate, *, short: bool = True) -> str:
    """Print a rate with its error, or its upper limit where it lies at zero."""
    if rate.at_bound:
        limit = float(f"{rate.bounds95[1]:.2g}")
        return f"below {with_error(limit, None, rate.unit)} (95 %)"
    return with_error(rate.value, rate.sd, rate.unit, short=short)


def quotable(result: FitResult) -> str:
    """Advise which of the numbers to quote."""
    if result.light == "green":
        if all(each.dominant for each in qualities(result)):
            return "Quote these numbers with their errors."
        return (
            "Quote the period and Q with their errors: this decay does not tell a, b and c apart."
        )
    if result.light_reason.startswith(BEAT):
        return "Quote the frequency and the loss of each mode; pendpipe diagnose fits both."
    if result.light == "red":
        what = "Q alone" if seen_qualities(result) else "none of these numbers"
        return f"Quote {what}, not a, b or c: run pendpipe diagnose to learn what the law lacks."
    if result.chi2_per_dof > 2.0:
        return (
            "Quote Q at these amplitudes. The fit leaves more than white noise: ask pendpipe"
            " diagnose for the cause before you quote a, b or c."
        )
    return "Quote Q at these amplitudes. a, b and c are correlated: quote all three."


HEAD: Final = ("file", "light", "period (s)", "a (1/rad s)", "b (1/s)", "c (rad/s)", "Q", "at")


def row(file: str, result: FitResult | None) -> tuple[str, ...]:
    """Make a line of `table`; a recording that was refused has its name only."""
    if result is None:
        return (file, "refused", *[""] * (len(HEAD) - 2))
    period, large = small_period(result), qualities(result)[0]
    # Without the unit, which is in the head of the table.
    rates = [
        ""
        if result.light == "red"
        else rate_with_error(replace(result[name], unit=""))
        .removesuffix(" (95 %)")
        .replace("below ", "< ")
        for name in "abc"
    ]
    return (
        file,
        result.light,
        with_error(period.value, period.sd, short=True),
        *rates,
        ""
        if result.light == "red"
        else with_error(large.quality_factor.value, large.quality_factor.sd, short=True),
        compact(large.amplitude_rad, result["amplitude"].unit),
    )


def table(rows: list[tuple[str, ...]]) -> str:
    """Lay rows out below their head."""
    return in_columns([HEAD, *rows])
