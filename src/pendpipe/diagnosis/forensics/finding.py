"""The result of a test of the measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.result import Confirmation, Location
from pendpipe.estimate import Estimate


@dataclass(frozen=True)
class Finding:
    """The result of one test, whether it found anything or not.

    Parameters
    ----------
    identifier
        Of the effect.
    p_value
        Probability that chance alone does as well in this test, its own trials included;
        uniform for the null, or larger.
    delta_chi2
        Twice the gain in log-likelihood.
    parameters
        Measured quantities.
    location
        Where it shows.
    mask
        Readings to leave out, shape (n,); None for none.
    time_s
        Better times of the readings, shape (n,); None if the time stamps are as good.
    summary
        One clause.
    kind
        ``"fault"``: reported as an effect if it is significant. ``"property"``: reported as a
        property of the record that does no harm.
    also
        Identifiers of effects that would give exactly the same codes.
    confirmed
        What a second test found that does not use the model.
    """

    identifier: str
    p_value: float
    delta_chi2: float = 0.0
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    location: Location = field(default_factory=Location)
    mask: BoolArray | None = None
    time_s: FloatArray | None = None
    summary: str = ""
    kind: Literal["fault", "property"] = "fault"
    also: tuple[str, ...] = ()
    confirmed: Confirmation | None = None


def nothing(identifier: str) -> Finding:
    """Return the result of a test that can't be made."""
    return Finding(identifier, 1.0, summary="not tested")
