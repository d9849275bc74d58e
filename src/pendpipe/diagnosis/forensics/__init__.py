"""Tests for faults of the measurement without a smooth signature in time.

Every test is a function ``find(data, fit, noise, samples) -> Finding``.
"""

from collections.abc import Callable
from typing import Final

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics import (
    colour,
    converter,
    glitches,
    sampling_times,
)
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Finding

Test = Callable[[Data, Fit, Noise, Samples], Finding]

TESTS: Final[dict[str, Test]] = {
    "time-stamps": sampling_times.find_irregular,
    "clipping": converter.find_clipping,
    "glitches": glitches.find,
    "missing-codes": converter.find_missing_codes,
    "coarse-quantisation": converter.find_coarse_steps,
    "jitter": sampling_times.find_jitter,
    "coloured-noise": colour.find_coloured_noise,
    "broadband-drive": colour.find_random_torque,
}
"""In order: readings masked by one test are not used by those after it."""
