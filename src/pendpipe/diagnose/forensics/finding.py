"""What a test of the measurement says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnose.result import Location
from pendpipe.estimate import Estimate


@dataclass(frozen=True)
class Finding:
    """The outcome of one test, whether it found anything or not.

    Parameters
    ----------
    identifier
        Of the effect.
    p_value
        How often chance alone does as well in this test, its own look-elsewhere included;
        uniform under the null, or larger.
    delta_chi2
        Twice the gain in log-likelihood.
    parameters
        What was measured.
    location
        Where.
    mask
        Readings to leave out, shape (n,); None for none.
    variance
        Factor by which each reading's variance is larger, shape (n,); None for 1.
    time_s
        Better times of the readings, shape (n,); None where the stamps are as good.
    summary
        One clause of English.
    kind
        ``"fault"``: counts as missing physics where it is significant. ``"property"``: said
        and repaired, and nothing that a model could have left out (a gap in the stamps).
    also
        Identifiers of what would have given the very same codes.
    """

    identifier: str
    p_value: float
    delta_chi2: float = 0.0
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    location: Location = field(default_factory=Location)
    mask: BoolArray | None = None
    variance: FloatArray | None = None
    time_s: FloatArray | None = None
    summary: str = ""
    kind: Literal["fault", "property"] = "fault"
    also: tuple[str, ...] = ()


def nothing(identifier: str) -> Finding:
    """Where a test can't be made, or has nothing to look at."""
    return Finding(identifier, 1.0, summary="nothing to be seen")
