"""A sensor's calibration as it is kept: the line, its points, and the test of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.estimate import Estimate, number


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
        Test against a curve; ``None`` with fewer than five points or four angles.
    """

    volts_per_radian: Estimate
    offset: Estimate
    covariance: float
    angle_rad: FloatArray
    volts: FloatArray
    volts_sd: FloatArray
    angle_sd_rad: FloatArray
    residual_sd_volts: float
    chi2_p_value: float
    linearity: Linearity | None

    @property
    def residual_volts(self) -> FloatArray:
        """Volts above the line, shape (n,)."""
        return self.volts - self.offset.value - self.volts_per_radian.value * self.angle_rad

    def as_json(self) -> dict[str, Any]:
        """Return the form in which it is kept on disk; `from_json` reads it."""
        columns = zip(
            self.angle_rad.tolist(),
            self.volts.tolist(),
            self.volts_sd.tolist(),
            self.angle_sd_rad.tolist(),
            strict=True,
        )
        names = ("angle_rad", "volts", "volts_sd", "angle_sd_rad")
        curve = self.linearity
        return {
            "schema_version": 1,
            "volts_per_radian": self.volts_per_radian.as_json(),
            "offset_volts": self.offset.as_json(),
            "covariance": self.covariance,
            "residual_sd_volts": self.residual_sd_volts,
            "chi2_p_value": self.chi2_p_value,
            "linear": None
            if curve is None
            else {
                "p_value": curve.p_value,
                "largest_deviation": curve.largest_deviation,
                "quadratic": curve.quadratic.as_json(),
                "cubic": curve.cubic.as_json(),
            },
            "points": [dict(zip(names, row, strict=True)) for row in columns],
        }

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> Calibration:
        """Read what `as_json` has written (null stands for NaN)."""
        points = content["points"]
        curve = content["linear"]
        return cls(
            volts_per_radian=Estimate.from_json(content["volts_per_radian"]),
            offset=Estimate.from_json(content["offset_volts"]),
            covariance=number(content["covariance"]),
            angle_rad=np.array([number(point["angle_rad"]) for point in points]),
            volts=np.array([number(point["volts"]) for point in points]),
            volts_sd=np.array([number(point["volts_sd"]) for point in points]),
            angle_sd_rad=np.array([number(point["angle_sd_rad"]) for point in points]),
            residual_sd_volts=number(content["residual_sd_volts"]),
            chi2_p_value=number(content["chi2_p_value"]),
            linearity=None
            if curve is None
            else Linearity(
                Estimate.from_json(curve["quadratic"]),
                Estimate.from_json(curve["cubic"]),
                number(curve["p_value"]),
                number(curve["largest_deviation"]),
            ),
        )
