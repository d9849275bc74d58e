"""The hysteretic and the viscous part of a campaign's losses (Fig. 4, Eq. 17).

In air the loss is hysteretic, ``Q_hys = k f^2``. What a record measures is the rate b, and
``b = pi f/Q = (pi/f) (1/k)``: a straight line in 1/k, whose weights are those of b. (A line
through Q against f^2 would weigh the records by errors that grow with Q itself.)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import refuse_if
from pendpipe.estimate import Z95, Estimate, chi_square_p_value, over, quality_of_rate
from pendpipe.physics import hysteretic_quality_factor


class Line(NamedTuple):
    """Points through which a line from the origin is drawn, each of shape (n,)."""

    regressor: FloatArray
    response: FloatArray
    sd: FloatArray

    def slope(self) -> Estimate:
        """The slope of weighted least squares, with its error."""
        x, y = self.regressor / self.sd, self.response / self.sd
        information = float(x @ x)
        return Estimate(float(x @ y) / information, information**-0.5, "")

    def off(self, slope: float) -> FloatArray:
        """What a slope leaves of the response."""
        return self.response - slope * self.regressor


@dataclass(frozen=True)
class MeasuredRecord:
    """One record's decay, as the fit has left it.

    Parameters
    ----------
    record, fluid, branch
        Its name, what it swung in, and which configuration it belongs to.
    frequency
        f of Eq. 8 in Hz.
    quadratic, linear, coulomb
        a, b, c of Eq. 13: the first-order combinations of Eq. 8's losses, whatever the
        method of the fit. (A b that comes from the decrement of turning points is below
        the hysteretic one by pi^2/(96 Q^2) of it: 0.03 % at Q = 17.5, 0.1 % at 10.)
    moment_of_inertia
        I in kg m^2 with the added mass, where it is known.
    """

    record: str
    fluid: str
    branch: str
    frequency: Estimate
    quadratic: Estimate
    linear: Estimate
    coulomb: Estimate
    moment_of_inertia: Estimate | None = None


@dataclass(frozen=True)
class SeparatedRecord:
    """A record with its linear loss split by Eq. 17.

    Parameters
    ----------
    measured
        What went in.
    quadratic, coulomb
        a and c with the sensor's calibration in their errors.
    quality_factor_limit
        pi f/b.
    quality_factor_hysteretic
        k f^2; its error is that of k.
    viscous_rate
        b - pi/(k f) in 1/s, total error.
    viscous_rate_sd_own
        The part of that error that no other record shares.
    viscous_rate_per_inverse_k
        Change of `viscous_rate` with 1/k, -pi/f: how the error of k enters it.
    quality_factor_viscous
        pi f over the viscous rate; NaN where that is not positive.
    """

    measured: MeasuredRecord
    quadratic: Estimate
    coulomb: Estimate
    quality_factor_limit: Estimate
    quality_factor_hysteretic: Estimate
    viscous_rate: Estimate
    viscous_rate_sd_own: float
    viscous_rate_per_inverse_k: float
    quality_factor_viscous: Estimate


@dataclass(frozen=True)
class Benchmark:
    """The hysteretic loss, from the records in air.

    Parameters
    ----------
    coefficient
        k of ``Q_hys = k f^2`` in s^2.
    inverse, inverse_sd
        1/k in 1/s^2, the quantity that was estimated: its error is Gaussian.
    chi2, degrees_of_freedom, p_value
        Of the records about the line.
    free_exponent
        x of ``Q_hys = K f^x``, fitted freely; 2 for hysteresis, 1 for a constant viscous
        damping coefficient. NaN where the records have one frequency only.
    exponent_p_value
        Probability of so large a gain in chi^2 over x = 2 by chance.
    records
        The names of those that were used.
    """

    coefficient: Estimate
    inverse: float
    inverse_sd: float
    chi2: float
    degrees_of_freedom: int
    p_value: float
    free_exponent: Estimate
    exponent_p_value: float
    records: tuple[str, ...]


def fit_benchmark(records: Sequence[MeasuredRecord]) -> Benchmark:
    """Fit k of ``Q_hys = k f^2`` to the records in air.

    Parameters
    ----------
    records
        Those of the benchmark, one or more; each with a positive error of b.

    Raises
    ------
    InputError
        Without records, or if their losses are not positive.
    """
    refuse_if(
        not records, "air benchmark", "no record in air can be used", "add records with fluid air"
    )
    frequency, frequency_sd, rate, rate_sd = np.array(
        [
            (each.frequency.value, each.frequency.sd, each.linear.value, each.linear.sd)
            for each in records
        ]
    ).T
    sd = np.hypot(rate_sd, rate / frequency * frequency_sd)
    for record, usable in zip(records, np.isfinite(sd) & (sd > 0.0), strict=True):
        name = f"record {record.record}"
        refuse_if(not usable, name, "b has no usable error", "look at its fit")
    line = Line(np.pi / frequency, rate, sd)
    inverse = line.slope()
    refuse_if(
        not inverse.value > 0.0,
        "air benchmark",
        "the losses in air are not positive",
        "check the fits",
    )
    chi2 = float(np.sum((line.off(inverse.value) / sd) ** 2))
    exponent, chi2_free = _free_exponent(frequency, rate, sd, inverse.value)
    return Benchmark(
        coefficient=over(1.0, inverse, "s^2"),
        inverse=inverse.value,
        inverse_sd=inverse.sd,
        chi2=chi2,
        degrees_of_freedom=len(records) - 1,
        p_value=chi_square_p_value(chi2, len(records) - 1),
        free_exponent=exponent,
        exponent_p_value=chi_square_p_value(chi2 - chi2_free, 1),
        records=tuple(record.record for record in records),
    )


def separate(
    records: Sequence[MeasuredRecord],
    benchmark: Benchmark,
    *,
    calibration_relative_sd: float = 0.0,
) -> list[SeparatedRecord]:
    """Split every record's linear loss into hysteretic and viscous (Eq. 17).

    Parameters
    ----------
    records
        All records, in water and in air.
    benchmark
        k, whose error all records share.
    calibration_relative_sd
        Relative standard deviation of the sensor's V/rad, common to all records. With an
        angle that is volts over V/rad, a goes as V/rad and c as its inverse; b, and with it
        every quality factor, does not change.
    """
    return [_separate_one(record, benchmark, calibration_relative_sd) for record in records]


def _separate_one(
    record: MeasuredRecord, benchmark: Benchmark, calibration_sd: float
) -> SeparatedRecord:
    """Eq. 17 in rates: ``b_v = b - pi/(k f)``."""
    frequency, linear = record.frequency.value, record.linear
    slope = -np.pi / frequency
    viscous = linear.value + slope * benchmark.inverse
    own_variance = linear.sd**2 + (slope * benchmark.inverse / frequency * record.frequency.sd) ** 2
    common_variance = (slope * benchmark.inverse_sd) ** 2
    # Where 1/k was made from this record among others, their errors are correlated, and what
    # is left of b scatters by less than its own error (least squares' residual).
    sign = -1.0 if record.record in benchmark.records else 1.0
    total_variance = max(own_variance + sign * common_variance, 0.0)
    rate = Estimate(float(viscous), float(np.sqrt(total_variance)), "1/s")
    hysteretic = float(hysteretic_quality_factor(frequency, benchmark.coefficient.value))
    low, high = benchmark.coefficient.interval95 or (np.nan, np.nan)
    return SeparatedRecord(
        measured=record,
        quadratic=_widened(record.quadratic, calibration_sd),
        coulomb=_widened(record.coulomb, calibration_sd),
        quality_factor_limit=quality_of_rate(frequency, linear),
        quality_factor_hysteretic=Estimate(
            hysteretic,
            hysteretic * benchmark.coefficient.sd / benchmark.coefficient.value,
            "",
            (low * frequency**2, high * frequency**2),
        ),
        viscous_rate=rate,
        viscous_rate_sd_own=float(np.sqrt(own_variance)),
        viscous_rate_per_inverse_k=float(slope),
        quality_factor_viscous=quality_of_rate(frequency, rate),
    )


def _free_exponent(
    frequency: FloatArray, rate: FloatArray, sd: FloatArray, inverse: float
) -> tuple[Estimate, float]:
    """Fit ``b = (pi/f0) h (f/f0)^(1-x)``; x with its error, and chi^2."""
    if len(frequency) < 2 or np.ptp(frequency) <= 1e-9 * np.max(frequency):
        return Estimate(float("nan"), float("nan"), ""), float("nan")
    from scipy.optimize import curve_fit

    # About the weighted mean of ln f the two parameters hardly correlate.
    logarithm = np.log(frequency)
    logarithm = logarithm - np.average(logarithm, weights=(rate / sd) ** 2)

    def law(at: FloatArray, scale: float, exponent: float) -> FloatArray:
        return np.asarray(scale * np.exp((1.0 - exponent) * at))

    start = float(np.pi * inverse * np.mean(1.0 / frequency)), 2.0
    found, covariance = curve_fit(
        law, logarithm, rate, start, sd, absolute_sigma=True, ftol=1e-14, xtol=1e-14, gtol=0.0
    )
    chi2 = float(np.sum(((rate - law(logarithm, *found)) / sd) ** 2))
    return Estimate(float(found[1]), float(np.sqrt(covariance[1, 1])), ""), chi2


def _widened(estimate: Estimate, relative_sd: float) -> Estimate:
    """Add a relative error to an estimate's own, and to each side of its interval."""
    added = relative_sd * abs(estimate.value)
    interval = estimate.interval95
    if interval is not None:
        half = Z95 * added
        below, above = estimate.value - interval[0], interval[1] - estimate.value
        interval = (
            estimate.value - float(np.hypot(below, half)),
            estimate.value + float(np.hypot(above, half)),
        )
    return replace(estimate, sd=float(np.hypot(estimate.sd, added)), interval95=interval)
