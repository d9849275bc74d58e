"""Fits through all records whose errors are partly shared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pendpipe.analysis.distributions import chi_square_p_value
from pendpipe.analysis.viscous import SharedErrors, ViscousLosses, shared_effects
from pendpipe.arrays import FloatArray
from pendpipe.estimate import Estimate


@dataclass(frozen=True)
class SharedEstimate:
    """A number made from all records, its error split by where it comes from.

    Parameters
    ----------
    estimate
        Value with the total error.
    sd_own
        From the records' own errors.
    sd_common
        From all that the records share.
    shared
        The parts of `sd_common` by source, with their signs.
    chi2, degrees_of_freedom, p_value
        Of the records about it, with the shared errors in the covariance.
    """

    estimate: Estimate
    sd_own: float
    sd_common: float
    shared: dict[str, float]
    chi2: float
    degrees_of_freedom: int
    p_value: float


class Line(NamedTuple):
    """Points through which a line from the origin is drawn, each of shape (n,)."""

    regressor: FloatArray
    response: FloatArray
    sd: FloatArray

    def slope(self) -> float:
        """The slope of weighted least squares."""
        x, y = self.regressor / self.sd, self.response / self.sd
        return float(np.sum(x * y) / np.sum(x * x))


def fit_line(
    losses: ViscousLosses, errors: SharedErrors, line_of: Callable[[ViscousLosses], Line]
) -> SharedEstimate:
    """Fit the slope with the records' own weights; follow the shared errors into it."""
    line = line_of(losses)
    value = line.slope()
    effects = shared_effects(lambda moved: line_of(moved).slope(), losses, errors)
    shared = {source: float(effect) for source, effect in effects.items()}
    sd_own = float(np.sum((line.regressor / line.sd) ** 2) ** -0.5)
    sd_common = float(np.sqrt(sum(effect**2 for effect in shared.values())))

    def residual(moved: ViscousLosses) -> FloatArray:
        return line_of(moved).response - value * line_of(moved).regressor

    spread = shared_effects(residual, losses, errors)
    # The records are judged about their own best line, found with the same covariance.
    chi2 = chi_square(residual(losses), line.sd, spread, line.regressor)
    dof = len(line.sd) - 1
    return SharedEstimate(
        estimate=Estimate(value, float(np.hypot(sd_own, sd_common)), ""),
        sd_own=sd_own,
        sd_common=sd_common,
        shared=shared,
        chi2=chi2,
        degrees_of_freedom=dof,
        p_value=chi_square_p_value(chi2, dof),
    )


def chi_square(
    residual: FloatArray,
    sd: FloatArray,
    effects: dict[str, FloatArray],
    regressor: FloatArray | None = None,
) -> float:
    """chi^2 with the shared effects in the covariance, at the best slope if there is one."""
    covariance = np.diag(sd**2) + sum(np.outer(effect, effect) for effect in effects.values())
    factor = np.linalg.cholesky(covariance)
    white = np.linalg.solve(factor, residual)
    if regressor is not None:
        direction = np.linalg.solve(factor, regressor)
        white = white - direction * (direction @ white) / (direction @ direction)
    return float(white @ white)
