"""Faults of the measurement that have no smooth shape in time, one small file each.

Every module has ``find(data, fit, noise, samples) -> Finding``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.forensics import clipping, glitches, jitter
from pendpipe.diagnose.forensics.finding import Finding, Location
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit

Test = Callable[[Data, Fit, Noise, Samples], Finding]

TESTS: Final[dict[str, Test]] = {
    "glitches": glitches.find,
    "clipping": clipping.find,
    "jitter": jitter.find,
}


def examine(data: Data, fit: Fit, noise: Noise, samples: Samples) -> list[Finding]:
    """Make every test; what is found and what is not."""
    return [find(data, fit, noise, samples) for find in TESTS.values()]


__all__ = ["TESTS", "Finding", "Location", "Test", "examine"]
