"""What tests and searches find: effects and faults, with where they show and how sure they are."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

from pendpipe.analysis.fit.result import FitResult
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.estimate import Estimate
from pendpipe.files import fields_of

if TYPE_CHECKING:
    from pendpipe.diagnosis.cycles import SmallSwings


COLOURED_NOISE: Final = "coloured-noise"
"""What is reported of the noise, and is nothing that a model lacks."""
CANDIDATE: Final = 0.2
"""Probability from which an effect is a candidate."""
WANDERING_ZERO: Final = "wandering-zero"
"""What is noted of noise that is slower than the motion."""
Verdict = Literal["consistent", "missing-physics", "not-analysable"]


def verdict_of(missing: Iterable[FoundEffect], p_value: float, level: float) -> Verdict:
    """Return what is said of a recording: it is consistent where chance explains the residual.

    Coloured noise is reported, and is nothing that a model lacks.
    """
    lacks = any(effect.identifier != COLOURED_NOISE for effect in missing)
    return "missing-physics" if lacks or p_value < level else "consistent"


@dataclass(frozen=True)
class FittedModel:
    """A model's parameters, and how well it describes the readings.

    `quality_factors` are Q by amplitude; its numbers are averages over the descriptions that share
    the probability (`quoted`).
    """

    name: str = field(metadata={"json": None})
    """Of the baseline."""

    parameters: Mapping[str, Estimate]
    residual_rms_rad: float
    chi2_per_dof: float
    noise_rms_rad: float = 0.0
    fit_p_value: float | None = None
    """Of the one test of fit, where the model is the one that ``fit`` prints."""
    quality_factors: Mapping[float, Estimate] = field(default_factory=dict)
    period_span_s: tuple[float, float] | None = None
    """Within which the period of small swings drifts, of which the frequency is the mean."""
    small_swings: SmallSwings | None = field(default=None, metadata={"json": None})
    """How the frequency differs from the model's at the smallest amplitudes, if it does."""

    @classmethod
    def of_fit(cls, fit: FitResult) -> FittedModel:
        """Take the numbers, the residual and the noise of a fit, all of its readings."""
        left = fit.residual_rms_rad, fit.chi2_per_dof, fit.noise_rms_rad
        return cls(fit.baseline, fit.parameters, *left, fit.fit_p_value)

    def as_json(self) -> dict[str, Any]:
        """Return the contract's form."""
        by_amplitude = self.quality_factors.items()
        listed = [{"amplitude_rad": y, **each.as_json()} for y, each in by_amplitude]
        return {**fields_of(self), "quality_factors": listed}


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
    recording
        The name of the one of several where it is.
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
    recording: str = field(default="", metadata={"json": None})

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


class Mate(NamedTuple):
    """An effect of a class beside the one that was added."""

    id: str
    probability: float


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

    identifier: str = field(metadata={"json": "id"})
    name: str
    kind: str
    equation: str
    parameters: Mapping[str, Estimate]
    delta_chi2: float
    p_value: float = field(metadata={"json": "p_value_global"})
    probability: float
    indistinguishable: tuple[Mate, ...] = field(metadata={"json": "indistinguishable_from"})
    discriminating_test: str = field(metadata={"json": "deciding_measurement"})
    location: Location
    curve: Mapping[str, Any] | None = None
    confirmed: Confirmation | None = None
    presumed: bool = False

    def __repr__(self) -> str:
        return f"FoundEffect({self.identifier}, probability {self.probability:.2f})"
