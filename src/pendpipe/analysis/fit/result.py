"""The result of a fit: its numbers with errors, what it says in print, its form on disk."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendpipe.analysis.fit.backbone import Backbone
from pendpipe.analysis.fit.consequence import judged, scaled
from pendpipe.analysis.fit.damping import damping_of
from pendpipe.analysis.fit.decrement import Check, check_decrement
from pendpipe.analysis.fit.fitted import PARAMETERS, PARTS, Agreement, Fitted, Form, units
from pendpipe.analysis.fit.goodness import Goodness, combined
from pendpipe.analysis.fit.printed import answer_of, called
from pendpipe.analysis.fit.quality import (
    mean_square,
    pendulum_of,
    period_of,
    qualities,
    quality_at,
    released_quality,
    small_period,
)
from pendpipe.analysis.turning_points import TurningPoints, write_turning_points
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8
from pendpipe.errors import InputError, nearest, refuse_if
from pendpipe.estimate import Estimate
from pendpipe.files import fields_of, plain, read_json, write_json, writing
from pendpipe.levels import REFUTED
from pendpipe.quantities import compact
from pendpipe.solve import CHI2_95

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike
    from pandas import DataFrame

    from pendpipe.recording import Recording


def drawer_of(drawn_by: Callable[[], Any] | None) -> Any:
    """Return the module that draws a result: that of the front door (`pendpipe.api`)."""
    if drawn_by is None:
        remedy = "take that of pendpipe.fit or pendpipe.diagnose, or a function of pendpipe.figures"
        raise InputError("plot", "this result can't be drawn", remedy)
    return drawn_by()


class FitResult(Fitted):
    """What one recording says of a, b, c and the rest; it prints as a dozen lines."""

    def __getitem__(self, name: str) -> Estimate:
        """Return one number: a parameter, ``"Q"`` at the amplitude released, or ``"period"``.

        With the length of a pendulum also ``"g"``, with g ``"length"``.

        Examples
        --------
        >>> import pendpipe as pp
        >>> fit = pp.fit("examples/rod-pendulum.csv")
        >>> print(fit["period"], fit["Q"], sep="; ")
        (1.1454712 ± 0.0000027) s; 169.76 ± 0.57
        """
        if name == "Q":
            return released_quality(self)
        if name == "period":
            return small_period(self)
        if name in self.parameters:
            return self.parameters[name]
        numbers: dict[str, Estimate] = self.numbers()
        if name not in numbers:
            remedy = nearest(name, numbers, f"give one of {', '.join(numbers)}")
            raise InputError(f"fit[{name!r}]", "there is no such number", remedy)
        return numbers[name]

    period = property(small_period)
    quality_factors = cached_property(qualities)
    quality_factor = quality_at
    damping = damping_of

    @property
    def period_check(self) -> tuple[Check, ...]:
        """The law's period beside the backbone's, at the amplitudes of `decrement_check`."""
        shown = self.backbone
        if shown is None:
            return ()
        at = [check.amplitude_rad for check in self.decrement_check]
        seen = [shown.period(amplitude) for amplitude in at]
        return tuple(
            Check(y, period_of(self, y), each.value, each.sd, shown.period_scatter)
            for y, each in zip(at, seen, strict=True)
        )

    def __str__(self) -> str:
        """Return what is known, the sentence to copy, and what to do next."""
        return "\n".join(answer_of(self).lines(called(self), math.inf))

    def _repr_html_(self) -> str:
        return answer_of(self).html(called(self))

    def __repr__(self) -> str:
        """Return the numbers in one line."""
        numbers = ", ".join(
            f"{name}={entry.value:.6g}±{entry.sd:.2g}" for name, entry in self.parameters.items()
        )
        return f"FitResult({self.light}: {numbers})"

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the decay with its fit, what the fit leaves, and Q against amplitude.

        Parameters
        ----------
        ax
            Axes of your own; on them the decay with its fit alone is drawn.

        Returns
        -------
        matplotlib.figure.Figure
            It shows itself in a notebook; ``.show()`` opens a window, ``.savefig(path)`` writes.
        """
        points, decay = self._readings("plot")
        drawer = drawer_of(self.drawn_by)
        figure: Figure = drawer.plot(drawer.Decay("", points, self), decay, ax)
        return figure

    def predict(self, time_s: ArrayLike) -> FloatArray:
        """Return the fitted motion at some times, in the unit of the amplitude, shape (n,).

        Parameters
        ----------
        time_s
            On the clock of the recording, s. Before the first turning point that was fitted the
            motion is taken back by its loss there.

        Raises
        ------
        InputError
            If the fit was read from a file, without its turning points.
        """
        from pendpipe.analysis.fit.prediction import predicted

        self._readings("predict")
        return predicted(self, np.asarray(time_s, dtype=np.float64))

    @property
    def residual(self) -> FloatArray:
        """Readings less fitted motion, shape (n,), in the unit of the amplitude.

        Raises
        ------
        InputError
            If the fit was read from a file, or its readings are a rate or a position.
        """
        _, decay = self._readings("residual")
        refuse_if(
            decay.unit != self.parameters["amplitude"].unit,
            "residual",
            f"the readings are in {decay.unit}, and the motion is an angle",
            "use fit.predict",
        )
        return np.asarray(decay.values - self.predict(decay.time_s))

    def _readings(self, what: str) -> tuple[TurningPoints, Recording]:
        if self.points is None or self.decay is None:
            raise InputError(what, "this fit does not hold its readings", "fit the recording anew")
        return self.points, self.decay

    def to_frame(self) -> DataFrame:
        """Return a table with one row per number: value, sd, low95, high95, unit.

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
        found = {**self.parameters, "period": self.period, **pendulum_of(self)}
        unit, limit = self.parameters["amplitude"].unit, self.quality_factor_limit
        shares: dict[str, Estimate] = {}
        for each in self.quality_factors:
            where = compact(each.amplitude_rad, unit)
            found[f"Q({where})"] = each.quality_factor
            shares |= {f"share of {name} at {where}": of for name, of in each.losses.items()}
        found |= {name: each for name, each in self.damping().items() if name != "amplitude_rad"}
        return found | {"Q": self["Q"]} | ({} if limit is None else {"Q limit": limit}) | shares

    def save(self, folder: str | Path, *, figures: bool = True, force: bool = False) -> Path:
        """Write ``fit.json`` and, with the readings, ``turning_points.csv`` and ``fit.svg``.

        Returns the folder, which is made where it does not exist. Files of these names that
        pendpipe did not make are replaced only with `force`. A fit takes milliseconds and its
        figure half a second: ``figures=False`` writes the data alone.
        """
        target = Path(folder)
        with writing(force=force):
            write_json(target / "fit.json", self.to_dict())
            if self.points is not None and self.drawn_by is not None:
                write_turning_points(target / "turning_points.csv", self.points)
                if figures:
                    self.drawn_by().write(self.plot(), target / "fit")
        return target

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``fit.json``."""
        limit = self.quality_factor_limit or Estimate(math.nan, math.nan, "", (math.nan, math.nan))
        return dict(
            plain(
                {
                    "schema_version": 1,
                    **fields_of(self),
                    "backbone": self.backbone,
                    "period_check": self.period_check,
                    "period": self.period,
                    "quality_factors": self.quality_factors,
                    "damping": self.damping(),
                    "quality_factor_limit": limit,
                    "covariance": {"order": PARAMETERS, "matrix": self.covariance},
                }
            )
        )

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> FitResult:
        """Rebuild a result from the content of ``fit.json``."""
        found = _fields_in(cls, content)
        shown, known = content.get("backbone"), content["covariance"]
        places = [PARAMETERS.index(name) for name in known["order"]]
        covariance = np.zeros((len(PARAMETERS), len(PARAMETERS)))
        covariance[np.ix_(places, places)] = np.array(known["matrix"], dtype=np.float64)
        found |= {
            "parameters": {name: _read(each) for name, each in content["parameters"].items()},
            "shown": shown and Backbone.from_json(shown),
            "covariance": covariance,
        }
        return cls(**found)


def _fields_in(kind: Any, content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that a dataclass has in JSON (`files.fields_of`)."""
    found: dict[str, Any] = {}
    for each in fields(kind):
        there = each.metadata.get("json", each.name)
        if there == "":
            part: Any = each.default_factory
            found[each.name] = part(**_fields_in(part, content))
        elif content.get(there) is not None:
            found[each.name] = _read(content[there])
    return found


def _read(entry: Any) -> Any:
    """Return an estimate or a check, told by its keys, a tuple, or what else an entry is."""
    if isinstance(entry, dict) and "sd" in entry:
        return Estimate.from_json(entry)
    if isinstance(entry, dict) and "seen_sd" in entry:
        return Check(**entry)
    return tuple(map(_read, entry)) if isinstance(entry, list) else entry


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
    form: Form,
    agreement: Agreement,
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
    form, agreement
        As far as `law` and `goodness` do not tell them.
    **rest
        The other fields of `FitResult`.
    """
    dress, parameters = units(points.unit), {}
    for index, name in enumerate(PARAMETERS):
        number, sd = float(value[index]), math.sqrt(max(float(covariance[index, index]), 0.0))
        half = math.sqrt(CHI2_95) * sd
        interval = intervals[index] if name in "abc" else (number - half, number + half)
        at_bound = name in "abc" and index not in held and number <= 0.0
        parameters[name] = Estimate(number, sd, dress[name], interval, at_bound)
    checks = check_decrement(points, law)
    if rest["method"] == "waveform" and goodness.p_value >= REFUTED:
        # Turning points that contradict a law whose residual is white are off themselves.
        white = f"all readings leave only noise (p = {goodness.p_value:.2g})"
        checks = tuple(
            each._replace(overruled=white if each.contradicts else "") for each in checks
        )
    p_values = (*goodness.p_values, *(each.p_value for each in checks if not each.overruled))
    held_parts: Any = {name: Estimate(fixed[name], 0.0, "") for name in PARTS if name in fixed}
    result = FitResult(
        parameters=parameters,
        covariance=covariance,
        form=replace(
            form,
            restoring=law.restoring,
            drag=law.drag,
            hysteretic_share=law.share,
            **held_parts,
        ),
        agreement=replace(
            agreement,
            noise_rms_rad=goodness.noise_rms,
            chi2_per_dof=goodness.chi2_per_dof,
            fit_p_value=combined(p_values),
            bent=goodness.bent,
            decrement_check=checks,
        ),
        **rest,
    )
    result = judged(result, points, law, misfit=goodness.misfit)
    return replace(result, warnings=(*points.notes, *_warnings(result, goodness.misfit), *said))


def _warnings(result: FitResult, misfit: float) -> list[str]:
    """What the reader of these numbers should know, a clause each."""
    a, b, c = (result.parameters[name] for name in ("a", "b", "c"))
    y0 = result.parameters["amplitude"].value
    rate = a.value * y0 + b.value + c.value / y0
    matrix = result.covariance_of("a", "b")
    mixed = matrix[0, 1] < -_MIXED * a.sd * b.sd if a.sd > 0.0 and b.sd > 0.0 else False
    slow = result.chi2_per_dof <= 0.9 * misfit
    seen = "the half cycles scatter, in the square," if slow else "chi^2 of the readings is"
    unit = result.parameters["amplitude"].unit
    warnings = (
        *(
            (True, f"{check.sentence(unit)}: overruled, since {check.overruled}")
            for check in result.decrement_check
            if check.overruled
        ),
        *(
            (estimate.at_bound, f"{name} lies at its bound 0; its interval is one-sided")
            for name, estimate in result.parameters.items()
        ),
        (
            not b.value > 0.0,
            "quality_factor_limit has no finite value, since b = 0",
        ),
        (
            misfit > 1.0,
            f"{seen} {misfit:.3g} times what the noise explains: period and Q are those of the"
            " turning points, and a, b, c carry what the law is off by; see pendpipe diagnose",
        ),
        (
            result.baseline == "eq8" and mixed and a.sd * y0 > _UNCLEAR * rate,
            "a can't be separated from b here: the recording has too few large amplitudes (a tail);"
            " a, b, c of a tail depend on where it begins",
        ),
    )
    return [warning for is_so, warning in warnings if is_so]


def with_clock(result: FitResult, clock_ppm: float) -> FitResult:
    """Add to the errors what a clock that may be off by `clock_ppm` parts in a million adds.

    Every time is stretched alike: the frequency, and the rates b (1/s), a and c, by the same part.
    """
    powers = dict.fromkeys(("frequency", "a", "b", "c"), 1.0)
    return _stretched(result, powers, 1e-6 * clock_ppm)


def with_scale(result: FitResult, scale_percent: float) -> FitResult:
    """Add to the errors what a scale of the readings adds that may be off by some percent.

    Volts per radian, or a camera's length: the amplitude, the offset and c grow with it, a falls;
    and with sin x the frequency of small swings moves by A^2/8 of it.
    """
    powers = {"amplitude": 1.0, "offset": 1.0, "c": 1.0, "a": -1.0}
    if result.restoring == "sine":
        powers["frequency"] = mean_square(result) / 8.0
    return _stretched(result, powers, 0.01 * scale_percent)


def _stretched(result: FitResult, powers: Mapping[str, float], part: float) -> FitResult:
    """Add the error of one factor, known to a part, of which the parameters are powers."""
    order = PARAMETERS
    slope = np.array([powers.get(name, 0.0) * result.value(name) for name in order])
    covariance = result.covariance + part**2 * np.outer(slope, slope)
    parameters = dict(result.parameters)
    for name, power in powers.items():
        old = parameters[name]
        sd = math.hypot(old.sd, part * power * old.value)
        found = scaled(old, sd / old.sd if old.sd > 0.0 else 1.0, name)
        parameters[name] = replace(found, sd=sd)
    shown, power = result.lawless, powers.get("frequency", 0.0)
    if shown is not None:
        small = shown.small_period
        wider = replace(small, sd=math.hypot(small.sd, part * power * small.value))
        shown = replace(shown, small_period=wider)
    return replace(result, parameters=parameters, covariance=covariance, shown=shown)


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
        raise InputError(path, f"this is not a fit ({fault})", "run pendpipe fit") from None
