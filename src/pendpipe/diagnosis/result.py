"""The results of a test and of a diagnosis, and their form on disk (``diagnosis.json``)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

from pendpipe.analysis.fit.result import FitResult, drawer_of
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.summary import BASELINES, COLOURED_NOISE, LEVEL, Summary, html_of, summarise
from pendpipe.dynamics.eq8 import Restoring
from pendpipe.estimate import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pendpipe.diagnosis.cycles import SmallSwings
    from pendpipe.diagnosis.held_out import HeldOut
    from pendpipe.diagnosis.hypothesis import Hypothesis
    from pendpipe.diagnosis.remainder import Remainder

FILE_NAME: Final = "diagnosis.json"


def swinging(baseline: str, restoring: str, drag_form: str) -> str:
    """Return a baseline with its forms, in words."""
    forms = {"sin x": restoring == "sine", "v|v|": drag_form == "speed"}
    with_them = " and ".join(name for name, has in forms.items() if has)
    return BASELINES.get(baseline, baseline) + (f" with {with_them}" if with_them else "")


Verdict = Literal["consistent", "missing-physics", "not-analysable"]


def verdict_of(missing: Iterable[FoundEffect], p_value: float, level: float) -> Verdict:
    """Return what is said of a recording: it is consistent where chance explains the residual.

    Coloured noise is reported, and is nothing that a model lacks.
    """
    lacks = any(effect.identifier != COLOURED_NOISE for effect in missing)
    return "missing-physics" if lacks or p_value < level else "consistent"


_DENSITIES: Final = ("log_density_before", "log_density_after", "gain", "gain_sd")


@dataclass(frozen=True)
class FittedModel:
    """A model's parameters, and how well it describes the readings.

    `quality_factors` are Q by amplitude; its numbers are averages over the descriptions that share
    the probability (`quoted`).
    """

    parameters: Mapping[str, Estimate]
    residual_rms_rad: float
    chi2_per_dof: float
    noise_rms_rad: float = 0.0
    fit_p_value: float | None = None
    """Of the one test of fit, where the model is the one that ``fit`` prints."""
    quality_factors: Mapping[float, Estimate] = field(default_factory=dict)
    period_span_s: tuple[float, float] | None = None
    """Within which the period of small swings drifts, of which the frequency is the mean."""

    @classmethod
    def of_fit(cls, fit: FitResult) -> FittedModel:
        """Take the numbers, the residual and the noise of a fit, all of its readings."""
        left = fit.residual_rms_rad, fit.chi2_per_dof, fit.noise_rms_rad
        return cls(fit.parameters, *left, fit.fit_p_value)

    def as_json(self) -> dict[str, Any]:
        """Return the contract's form."""
        return {
            "parameters": {name: each.as_json() for name, each in self.parameters.items()},
            "residual_rms_rad": self.residual_rms_rad,
            "chi2_per_dof": self.chi2_per_dof,
            "noise_rms_rad": self.noise_rms_rad,
            "fit_p_value": self.fit_p_value,
            "period_span_s": self.period_span_s,
            "quality_factors": [
                {"amplitude_rad": amplitude, **each.as_json()}
                for amplitude, each in self.quality_factors.items()
            ],
        }


@dataclass(frozen=True)
class Location:
    """Where an effect shows: time, amplitude, phase of the cycle, frequency, harmonic, code.

    Parameters
    ----------
    time_s, amplitude_rad, phase_rad
        Intervals that hold nine tenths of what the effect explains. The phase is 0 at a turning
        point on the positive side. None where the effect shows everywhere.
    frequency_hz, harmonics
        Frequencies, and multiples of the motion's frequency.
    adc_codes
        Codes of the converter.
    mains
        Which harmonic of 50 or 60 Hz a line may be, and by what rate it is folded.
    summary
        One clause.
    """

    time_s: tuple[float, float] | None = None
    amplitude_rad: tuple[float, float] | None = None
    phase_rad: tuple[float, float] | None = None
    frequency_hz: tuple[float, ...] = ()
    harmonics: tuple[int, ...] = ()
    adc_codes: tuple[int, ...] = ()
    summary: str = ""
    mains: str = ""

    @classmethod
    def over(
        cls,
        time_s: FloatArray,
        amplitude: FloatArray,
        phase_rad: tuple[float, float] | None = None,
        frequency_hz: tuple[float, ...] = (),
        adc_codes: tuple[int, ...] = (),
    ) -> Location:
        """Return all of some readings, by their times and the motion's amplitudes then."""
        amplitudes = float(amplitude.min()), float(amplitude.max())
        times = float(time_s[0]), float(time_s[-1])
        return cls(times, amplitudes, phase_rad, frequency_hz, adc_codes=adc_codes)

    def as_json(self) -> dict[str, Any]:
        """Return the contract's form."""
        intervals = {
            "time_s": self.time_s,
            "amplitude_rad": self.amplitude_rad,
            "phase_rad": self.phase_rad,
        }
        return {
            "summary": self.summary,
            **{name: ends and [float(end) for end in ends] for name, ends in intervals.items()},
            "frequency_hz": list(self.frequency_hz),
            "harmonics": list(self.harmonics),
            "adc_codes": list(self.adc_codes),
            "mains": self.mains,
        }


class Confirmation(NamedTuple):
    """A second test of a finding, which does not use the model.

    Parameters
    ----------
    summary
        One clause.
    p_value
        Probability that chance does as well.
    """

    summary: str
    p_value: float


@dataclass(frozen=True, eq=False)
class Finding:
    """What one test of the measurement found; it equals no other.

    Parameters
    ----------
    identifier
        Of the effect.
    p_value
        Probability that chance alone does as well in this test, its own trials included;
        uniform for the null, or larger. Once found: of all tests together.
    delta_chi2
        Twice the gain in log-likelihood.
    parameters
        Measured quantities.
    location
        Where it shows.
    mask
        Readings to leave out, shape (n,); None for none.
    taken
        What is to be taken off the readings, shape (n,); None for nothing.
    time_s
        Better times of the readings, shape (n,); None if the time stamps are as good.
    price
        By how much chi^2 must fall with better readings or times.
    summary
        What is said: one clause.
    kind
        ``"fault"``: reported as an effect if it is significant. ``"note"``: corrected and said.
        ``"property"``: of the record, which does no harm.
    also
        Identifiers of effects that would give exactly the same codes.
    confirmed
        What a second test found that does not use the model.
    margin
        Twice the log-likelihood by which it exceeds what looks most like it.
    after
        The number of effects that were added before it.
    """

    identifier: str
    p_value: float
    delta_chi2: float = 0.0
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    location: Location = field(default_factory=Location)
    mask: BoolArray | None = None
    taken: FloatArray | None = None
    time_s: FloatArray | None = None
    price: float = 0.0
    summary: str = ""
    kind: Literal["fault", "note", "property"] = "fault"
    also: tuple[str, ...] = ()
    confirmed: Confirmation | None = None
    margin: float = math.inf
    after: int = 0


@dataclass(frozen=True, repr=False)
class FoundEffect:
    """One effect that the baseline lacks.

    Parameters
    ----------
    identifier, name, kind, equation
        As the catalogue declares them.
    parameters
        Its own, in the extended model.
    delta_chi2
        By how much chi^2 rises without it.
    p_value
        Global, when it was found.
    probability
        Of this effect, among its class and "none of these".
    indistinguishable
        The rest of its class: identifier and probability.
    discriminating_test
        The one further measurement that would decide.
    location
        Where it shows.
    curve
        Where it, or a rival of a probability of a fifth or more, is a curve without a name: the
        curve with its band, its name, and a clause that says where it is how large.
    confirmed
        What a second test found that does not use the model.
    presumed
        Whether the baseline has it: it is fitted, and not missing.
    """

    identifier: str
    name: str
    kind: str
    equation: str
    parameters: Mapping[str, Estimate]
    delta_chi2: float
    p_value: float
    probability: float
    indistinguishable: tuple[tuple[str, float], ...]
    discriminating_test: str
    location: Location
    curve: Mapping[str, Any] | None = None
    confirmed: Confirmation | None = None
    presumed: bool = False

    def __repr__(self) -> str:
        return f"FoundEffect({self.identifier}, probability {self.probability:.2f})"

    def as_json(self) -> dict[str, Any]:
        """Return the contract's form."""
        found: dict[str, Any] = {
            "id": self.identifier,
            "name": self.name,
            "kind": self.kind,
            "presumed": self.presumed,
            "equation": self.equation,
            "parameters": {name: each.as_json() for name, each in self.parameters.items()},
            "delta_chi2": self.delta_chi2,
            "p_value_global": self.p_value,
            "probability": self.probability,
            "indistinguishable_from": [
                {"id": identifier, "probability": probability}
                for identifier, probability in self.indistinguishable
            ],
            "deciding_measurement": self.discriminating_test,
            "location": self.location.as_json(),
        }
        if self.curve is not None:
            found["curve"] = dict(self.curve)
        if self.confirmed is not None:
            found["confirmed"] = self.confirmed._asdict()
        return found


@dataclass(frozen=True, repr=False)
class Diagnosis:
    """Where model and recording differ, and what is missing. It prints as a dozen lines.

    Parameters
    ----------
    baseline_name, baseline, improved
        The model that was asked for, and the one with the effects that were found.
    noise_rms_rad
        Of one reading, never below step/sqrt(12).
    verdict, p_value
        Global: of the largest score over the whole catalogue.
    effects
        What the baseline has, and the missing in the order in which they were added.
    held_out
        None where nothing was added.
    unexplained_rms_rad, unexplained_p_value
        What the improved model leaves.
    remainder
        The same in parts: its size over the noise, and where it lies.
    small_swings
        How the frequency differs from the improved model's at the smallest amplitudes, if it does.
    details
        All that was found, one paragraph: what the summary leaves out too.
    name
        Of the recording.
    fit
        The fit that the diagnosis began with.
    scanned
        What was looked for, with its p-value on the baseline's residual.
    search
        The fits and readings behind it, for the figures.
    alone, recordings
        Of several recordings: each one's own diagnosis, and what is said of it.
    drawn_by
        Imports what draws it (`pendpipe.api`): a result knows no figures.
    restoring, drag_form
        The baseline's torque, and the form of drag that the readings prefer.
    level
        The p-value from which chance explains a misfit.
    """

    baseline_name: str
    baseline: FittedModel
    improved: FittedModel
    noise_rms_rad: float
    verdict: Verdict
    p_value: float
    effects: tuple[FoundEffect, ...]
    held_out: HeldOut | None
    unexplained_rms_rad: float
    unexplained_p_value: float
    details: str
    warnings: tuple[str, ...] = ()
    figures: tuple[str, ...] = ()
    remainder: Remainder | None = None
    small_swings: SmallSwings | None = None
    restoring: Restoring = "linear"
    drag_form: str = "energy"
    provenance: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    fit: FitResult | None = field(default=None, repr=False, compare=False)
    scanned: tuple[tuple[str, float], ...] = ()
    search: Hypothesis | None = field(default=None, repr=False, compare=False)
    alone: tuple[Diagnosis, ...] = field(default=(), repr=False, compare=False)
    recordings: tuple[dict[str, Any], ...] = ()
    level: float = LEVEL
    drawn_by: Callable[[], Any] | None = field(default=None, repr=False, compare=False)

    @property
    def missing(self) -> tuple[FoundEffect, ...]:
        """The effects that the baseline lacks."""
        return tuple(each for each in self.effects if not each.presumed)

    @property
    def summary(self) -> Summary:
        """The answer: what is printed, as fields."""
        return summarise(self)

    @property
    def statement(self) -> str:
        """The answer as it is printed: a dozen lines at most."""
        return "\n".join(self.summary.lines())

    def __str__(self) -> str:
        return "\n".join(self.summary.lines(self.name))

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return html_of(self.summary, self.name)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``diagnosis.json``."""
        held = self.held_out
        densities = (
            (None, None, 0.0, 0.0)
            if held is None
            else (held.before, held.after, held.gain, held.gain_sd)
        )
        return {
            "schema_version": 1,
            "baseline": {"name": self.baseline_name, **self.baseline.as_json()},
            "restoring": self.restoring,
            "drag_form": self.drag_form,
            "noise_rms_rad": self.noise_rms_rad,
            "verdict": self.verdict,
            "p_value": self.p_value,
            "effects": [effect.as_json() for effect in self.effects],
            "improved": self.improved.as_json(),
            "held_out": dict(zip(_DENSITIES, densities, strict=True)),
            "prediction": None if held is None else held.as_json(),
            "unexplained": {
                "residual_rms_rad": self.unexplained_rms_rad,
                "p_value": self.unexplained_p_value,
            },
            "remainder": None if self.remainder is None else self.remainder.as_json(),
            "small_amplitudes": None if self.small_swings is None else self.small_swings.as_json(),
            "statement": self.statement,
            "summary": self.summary.as_json(),
            "details": self.details,
            "excluded": [
                {"id": identifier, "p_value": p_value}
                for identifier, p_value in self.scanned
                if identifier not in {each.identifier for each in self.effects}
            ],
            "figures": list(self.figures),
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
            **({"recordings": list(self.recordings)} if self.recordings else {}),
        }

    def save(
        self, folder: str | Path, *, figures: bool = True, force: bool = False
    ) -> dict[str, Any]:
        """Write ``diagnosis.json`` and the figures.

        Parameters
        ----------
        folder
            Made if it is not there.
        figures
            Whether to draw them; those of several recordings together are not.
        force
            Replace files of these names that pendpipe did not make.

        Returns
        -------
        dict
            What ``diagnosis.json`` holds.

        Raises
        ------
        InputError
            If the folder can't be written, or holds a file that pendpipe did not make.
        """
        from pendpipe.files import write_json, writing

        target, whole = Path(folder), self
        with writing(force=force):
            if figures and self.drawn_by and not self.alone:
                drawn = self.drawn_by().draw_diagnosis(self, target)
                whole = replace(self, figures=tuple(path.name for path in drawn))
            content = whole.to_dict()
            write_json(target / FILE_NAME, content)
        return content

    def plot(self) -> Figure:
        """Draw the decay with both models, and what each of them leaves.

        Returns
        -------
        matplotlib.figure.Figure
        """
        figure: Figure = drawer_of(self.drawn_by).plot(self)
        return figure


def not_analysable(
    baseline: str, reason: str, provenance: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return ``diagnosis.json`` of a recording that can't be analysed.

    It has every key of a real diagnosis, so that a program need not ask which are there;
    numbers that do not exist are None.

    Parameters
    ----------
    baseline
        The model that was asked for.
    reason
        Why the recording can't be analysed, one line.
    provenance
        Goes into the result.
    """
    nothing: dict[str, Any] = {"parameters": {}, "residual_rms_rad": None, "chi2_per_dof": None}
    nothing |= {"noise_rms_rad": None, "fit_p_value": None}
    nothing |= {"period_span_s": None, "quality_factors": []}
    return {
        "schema_version": 1,
        "baseline": {"name": baseline, **nothing},
        "restoring": None,
        "drag_form": None,
        "noise_rms_rad": None,
        "verdict": "not-analysable",
        "reason": reason,
        "p_value": None,
        "effects": [],
        "improved": dict(nothing),
        "held_out": dict.fromkeys(_DENSITIES),
        "unexplained": {"residual_rms_rad": None, "p_value": None},
        "statement": f"This recording can't be analysed: {reason}.",
        "summary": Summary(f"not analysable: {reason}").as_json(),
        "details": "",
        "excluded": [],
        "figures": [],
        "warnings": [],
        "provenance": dict(provenance or {}),
    }
