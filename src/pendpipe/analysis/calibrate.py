"""The sensor's constant: a straight line of volts against angle, and whether it is one.

Both the volts and the angles may have errors (a caliper reads to a hundredth of a
millimetre). The line is the one of maximum likelihood, found as in D. York et al.,
Am. J. Phys. 72 (2004) 367, for errors that are independent of each other; without errors
in the angle it is ordinary (weighted) least squares.
"""

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.special import fdtrc, stdtrit

from pendpipe.analysis.noise import quantisation_rms
from pendpipe.analysis.readings import decimal_step
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.estimate import Z95, Estimate, chi_square_p_value
from pendpipe.files import fields_of, plain, read_text
from pendpipe.levels import FALSE_ALARM

ANGLES: Final = ("angle_rad", "angle_deg", "displacement_m")
_OF_A_CUBIC: Final = 4
"""Angles, which tell what is bent about a line by a square and a cube."""
_LARGEST: Final = 1e6
"""No angle, displacement or voltage of a sensor is as large: what claims to be is a slip."""


def read_caliper_table(
    path: str | Path,
    *,
    arm_m: float | None = None,
    arm_sd_m: float = 0.0,
    displacement_sd_m: float = 0.0,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> dict[str, Any]:
    """Read a calibration's table.

    Parameters
    ----------
    path
        A CSV with a header: ``volts``, one of ``angle_rad``, ``angle_deg``,
        ``displacement_m``, optionally ``volts_sd`` and ``angle_sd_rad``.
    arm_m, arm_sd_m
        From the axis to where the caliper touches: angle = displacement/arm.
    displacement_sd_m
        Standard deviation of a displacement, where the table gives none of the angle.
    delimiter, decimal
        Where the guess is wrong: tab, semicolon and comma are tried in this order, and
        the decimal mark is a point, or a comma where cells can be read with it only.

    Returns
    -------
    dict
        The arguments of `calibrate`.

    Raises
    ------
    InputError
        On a missing column or arm, or text in a number: file, line, what, remedy.
    """
    place = Path(path)
    columns = _columns(place, delimiter, decimal)
    name = next(name for name in ANGLES if name in columns)
    angle, angle_sd, scale_sd = columns[name], 0.0, 0.0
    if name == "angle_deg":
        angle = np.deg2rad(angle)
    elif name == "displacement_m":
        if arm_m is None or not 0.0 < arm_m < np.inf:
            raise InputError(
                place, "displacements need the arm on which they were measured", "give --arm-m 0.3"
            )
        angle, angle_sd, scale_sd = angle / arm_m, displacement_sd_m / arm_m, arm_sd_m / arm_m
    return {
        "angle_rad": angle,
        "volts": columns["volts"],
        "volts_sd": columns.get("volts_sd"),
        "angle_sd_rad": columns.get("angle_sd_rad", angle_sd),
        "relative_scale_sd": scale_sd,
        "place": str(path),
    }


def _columns(place: Path, delimiter: str | None, decimal: str | None) -> dict[str, FloatArray]:
    """Read the named columns of numbers; columns that this module does not use may be text."""
    text = read_text(place, "check the path", absent="table")
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    refuse_if(not lines, place, "the file is empty", "give a table with a header")
    mark = delimiter or next((sign for sign in "\t;," if sign in lines[0][1]), ",")
    names = [name.strip().strip('"') for name in lines[0][1].split(mark)]
    for needed in (("volts",), ANGLES):
        refuse_if(
            sum(name in names for name in needed) != 1,
            f"{place}, line {lines[0][0]}",
            f"exactly one column {' or '.join(needed)} is needed (found {', '.join(names)})",
            "rename the columns",
        )
    wanted = [name for name in (*ANGLES, "volts", "volts_sd", "angle_sd_rad") if name in names]
    rows = [(number, next(csv.reader([line], delimiter=mark))) for number, line in lines[1:]]
    return {
        name: np.array([_number(place, row, names.index(name), name, decimal) for row in rows])
        for name in wanted
    }


def _number(
    place: Path, row: tuple[int, list[str]], index: int, name: str, decimal: str | None
) -> float:
    """Read one cell."""
    number, cells = row
    where = f"{place}, line {number}"
    refuse_if(index >= len(cells), where, f"{name} is missing", "complete or drop the row")
    text = cells[index].strip()
    if decimal == "," or (decimal is None and "." not in text):
        text = text.replace(",", ".")
    try:
        value = float(text)
    except ValueError:
        raise InputError(
            where, f"{name} '{text}' is not a number", "correct or drop the row"
        ) from None
    # (Nor is NaN below it.)
    refuse_if(not abs(value) < _LARGEST, where, f"{name} is {text}", "correct or drop the row")
    return value


@dataclass(frozen=True)
class Linearity:
    """What a quadratic and a cubic term would add to the line.

    Parameters
    ----------
    quadratic, cubic
        The two terms, fitted together with the line, in V/rad^2 and V/rad^3.
    p_value
        Probability of so large an improvement by chance: chi^2 with two degrees of
        freedom where the errors are known, F where they come from the residuals.
    largest_deviation
        Of that curve from the line at the points, relative to the line's own span.
    """

    quadratic: Estimate
    cubic: Estimate
    p_value: float
    largest_deviation: float


@dataclass(frozen=True)
class Calibration:
    """A sensor's straight line, ``volts = offset + volts_per_radian * angle``.

    Parameters
    ----------
    volts_per_radian, offset
        The line, in V/rad and V.
    covariance
        Of the two, V^2/rad; without the arm's part, which is the constant's only.
    angle_rad, volts, volts_sd, angle_sd_rad
        The points, shape (n,); the standard deviations that were used for each.
    residual_sd_volts
        Scatter of the volts about the line.
    chi2_p_value
        Lack of fit: probability of a larger chi^2. NaN where the errors come from the
        residuals, since these then can't judge them.
    linearity
        Test against a curve; ``None`` with fewer than six points (five where their errors are
        given), or four angles.
    """

    volts_per_radian: Estimate
    offset: Estimate = field(metadata={"json": "offset_volts"})
    covariance: float
    angle_rad: FloatArray
    volts: FloatArray
    volts_sd: FloatArray
    angle_sd_rad: FloatArray
    residual_sd_volts: float
    chi2_p_value: float
    linearity: Linearity | None = field(metadata={"json": "linear"})

    def as_json(self) -> dict[str, Any]:
        """Return the form in which it is kept on disk."""
        found, names = fields_of(self), ("angle_rad", "volts", "volts_sd", "angle_sd_rad")
        rows = zip(*(found.pop(name) for name in names), strict=True)
        points = [dict(zip(names, row, strict=True)) for row in rows]
        return dict(plain({"schema_version": 1, **found, "points": points}))

    def __str__(self) -> str:
        """Say the result in a few lines."""
        constant, offset = self.volts_per_radian, self.offset
        low, high = self.angle_rad.min(), self.angle_rad.max()
        misfit = self.chi2_p_value
        linear = "linearity        not tested: it takes six points, or five with errors"
        if curve := self.linearity:
            verdict = (
                "no curvature seen"
                if curve.p_value >= FALSE_ALARM
                else "the sensor is not linear here"
            )
            linear = (
                f"linearity        p = {curve.p_value:.3g} ({verdict}; cubic departs from the line"
                f" by at most {100 * curve.largest_deviation:.2g} % of its span)"
            )
        lines = (
            f"volts_per_radian {constant.value:.7g} ± {constant.sd:.2g} V/rad",
            f"offset           {offset.value:.5g} ± {offset.sd:.2g} V",
            f"points           {len(self.volts)}, from {low:.4g} to {high:.4g} rad",
            f"residual sd      {self.residual_sd_volts:.3g} V",
            *([f"lack of fit      p = {misfit:.3g}"] if np.isfinite(misfit) else []),
            linear,
        )
        return "\n".join(lines)


FEWEST_POINTS = 3
"""Points of a line: one more than its two numbers."""
_ROUNDS = 100
"""Times that the weights follow the slope, at most."""


def calibrate(
    angle_rad: FloatArray,
    volts: FloatArray,
    *,
    volts_sd: FloatArray | None = None,
    angle_sd_rad: FloatArray | float = 0.0,
    relative_scale_sd: float = 0.0,
    place: str = "calibration",
) -> Calibration:
    """Fit the sensor's line.

    Parameters
    ----------
    angle_rad, volts
        The points, shape (n,), n >= 3.
    volts_sd
        Standard deviations of the volts, shape (n,). Without them the errors' common
        size is taken from the residuals, and `angle_sd_rad` serves as weights only.
    angle_sd_rad
        Standard deviations of the angles, shape (n,) or a number.
    relative_scale_sd
        Relative standard deviation that all angles share (the caliper's arm); it widens
        the constant's error and no other.
    place
        The file, for messages.

    Raises
    ------
    InputError
        With too few points, identical angles, or errors that are not positive.
    """
    count = len(angle_rad)
    angle_sd = np.broadcast_to(np.asarray(angle_sd_rad, dtype=np.float64), (count,))
    _check(place, angle_rad, volts, volts_sd, angle_sd)
    known = volts_sd is not None
    spread = volts_sd if volts_sd is not None else np.full(count, 0.0 if angle_sd.any() else 1.0)
    slope, offset, weights, placed, covariance = _line(angle_rad, volts, spread, angle_sd)
    residual = volts - offset - slope * angle_rad
    chi2 = float(np.sum(weights * residual**2))
    scale = 1.0 if known else chi2 / (count - 2)
    reach = Z95 if known else float(stdtrit(count - 2, 0.975))
    variances = scale * covariance
    slope_sd = float(np.hypot(np.sqrt(variances[1, 1]), relative_scale_sd * slope))
    return Calibration(
        volts_per_radian=_within(slope, slope_sd, "V/rad", reach),
        offset=_within(offset, float(np.sqrt(variances[0, 0])), "V", reach),
        covariance=float(variances[0, 1]),
        angle_rad=angle_rad,
        volts=volts,
        volts_sd=spread if known else np.sqrt(scale) * spread,
        angle_sd_rad=angle_sd if known or not angle_sd.any() else np.sqrt(scale) * angle_sd,
        residual_sd_volts=float(np.sqrt(np.sum(residual**2) / (count - 2))),
        chi2_p_value=chi_square_p_value(chi2, count - 2) if known else float("nan"),
        # What is left of one degree of freedom says nothing of its own size.
        linearity=_linearity(
            placed, residual, weights, slope, quantisation_rms(decimal_step(volts)), known=known
        )
        if count >= (5 if known else 6) and len(np.unique(angle_rad)) >= _OF_A_CUBIC
        else None,
    )


def _line(
    angle: FloatArray, volts: FloatArray, volts_sd: FloatArray, angle_sd: FloatArray
) -> tuple[float, float, FloatArray, FloatArray, FloatArray]:
    """York's iteration.

    Slope, offset, weights in 1/V^2, the angles at which the points belong on the line,
    covariance of (offset, slope).
    """
    slope = float(np.polyfit(angle, volts, 1)[0])
    for _ in range(_ROUNDS):
        weights = 1.0 / (volts_sd**2 + (slope * angle_sd) ** 2)
        centre = np.average(angle, weights=weights), np.average(volts, weights=weights)
        u, v = angle - centre[0], volts - centre[1]
        # Where the point would lie on the line, as an angle from the centre.
        adjusted = weights * (u * volts_sd**2 + slope * v * angle_sd**2)
        previous = slope
        slope = float(np.sum(weights * adjusted * v) / np.sum(weights * adjusted * u))
        if abs(slope - previous) <= 1e-15 * abs(slope):
            break
    placed = centre[0] + adjusted
    mean = float(np.average(placed, weights=weights))
    slope_variance = 1.0 / float(np.sum(weights * (placed - mean) ** 2))
    offset_variance = 1.0 / float(np.sum(weights)) + mean**2 * slope_variance
    mixed = -mean * slope_variance
    covariance = np.array([[offset_variance, mixed], [mixed, slope_variance]])
    return slope, float(centre[1] - slope * centre[0]), weights, placed, covariance


def _linearity(
    angle: FloatArray,
    residual: FloatArray,
    weights: FloatArray,
    slope: float,
    rounding: float,
    *,
    known: bool,
) -> Linearity:
    """Fit a cubic to the residuals of the line; test its two additional terms.

    The angles are those placed on the line: the measured ones share their errors with
    the residuals and would show a curve of their own.
    """
    count = len(angle)
    largest = float(np.max(np.abs(angle)))
    powers = np.vander(angle / largest, 4, increasing=True) * np.sqrt(weights)[:, np.newaxis]
    target = np.sqrt(weights) * residual
    coefficients = np.linalg.lstsq(powers, target, rcond=None)[0]
    chi2_curve = float(np.sum((target - powers @ coefficients) ** 2))
    improvement = float(np.sum(target**2)) - chi2_curve
    least = rounding**2 * float(np.mean(weights))
    scale = 1.0 if known else max(chi2_curve / (count - 4), least)
    # One point far beyond the others leaves no inverse: they have one angle beside it.
    sds = np.sqrt(scale * np.diag(np.linalg.pinv(powers.T @ powers)))
    # An exact line leaves residuals of rounding only, in which there is nothing to test.
    exact = np.max(np.abs(residual)) <= 1e-13 * abs(slope) * largest
    if known:
        p_value = chi_square_p_value(improvement, 2)
    else:
        p_value = 1.0 if exact else float(fdtrc(2, count - 4, improvement / 2 / scale))
    curve = powers @ coefficients / np.sqrt(weights)
    return Linearity(
        quadratic=Estimate(
            float(coefficients[2] / largest**2), float(sds[2] / largest**2), "V/rad^2"
        ),
        cubic=Estimate(float(coefficients[3] / largest**3), float(sds[3] / largest**3), "V/rad^3"),
        p_value=p_value,
        largest_deviation=float(np.max(np.abs(curve)) / (abs(slope) * np.ptp(angle))),
    )


def _check(
    place: str,
    angle: FloatArray,
    volts: FloatArray,
    volts_sd: FloatArray | None,
    angle_sd: FloatArray,
) -> None:
    """Refuse points through which no line can be drawn."""
    refuse_if(
        len(angle) < FEWEST_POINTS,
        place,
        f"{len(angle)} point(s) are too few for a line",
        f"give {FEWEST_POINTS} or more",
    )
    finite = np.isfinite(angle).all() and np.isfinite(volts).all()
    refuse_if(not finite, place, "a value is NaN or infinite", "drop the row")
    # Angles made from lengths may differ by rounding only.
    same = np.ptp(angle) <= 1e-12 * np.max(np.abs(angle))
    refuse_if(same, place, "all the angles are the same", "move the sensor between readings")
    refuse_if(
        np.ptp(volts) == 0.0, place, "all the volts are the same", "check the sensor's connection"
    )
    spread = np.zeros_like(angle) if volts_sd is None else volts_sd
    usable = (spread >= 0.0) & (angle_sd >= 0.0) & np.isfinite(spread + angle_sd)
    refuse_if(
        not usable.all(), place, "a standard deviation is negative or not finite", "correct it"
    )
    # Without any, all weigh the same; with some, a point without would outweigh the rest.
    refuse_if(
        (volts_sd is not None or angle_sd.any()) and np.any((spread == 0.0) & (angle_sd == 0.0)),
        place,
        "a point has no error, neither in volts nor in angle",
        "give its volts_sd",
    )


def _within(value: float, sd: float, unit: str, reach: float) -> Estimate:
    return Estimate(value, sd, unit, (value - reach * sd, value + reach * sd))
