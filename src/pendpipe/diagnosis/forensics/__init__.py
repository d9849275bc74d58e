"""Tests of the measurement: what no smooth signature in time shows.

Each is a function ``find(evidence) -> Finding | None``: None where it is not made.
`diagnosis.faults` asks those that are declared here, applies what pays, and keeps what they note.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from pendpipe.diagnosis.forensics import (
    colour,
    converter,
    glitches,
    sampling_times,
    slips,
    tracking,
)
from pendpipe.diagnosis.forensics.evidence import FEWEST, Evidence
from pendpipe.diagnosis.found import Finding
from pendpipe.diagnosis.refine import CLEAN, GROSS, LARGE_PHASE_ERROR

_IN_PHASE: Final = 0.3
"""Phase error in rad up to which residuals show errors of the times."""
_ON_ITS_TURN: Final = 3.0
"""Phase error in rad up to which the cycles are numbered right: the level hardly depends on it."""


@dataclass(frozen=True)
class Finder:
    """A test of the measurement, and when it is made.

    Parameters
    ----------
    name
        Of what it finds.
    find
        The test.
    most_misfit, most_phase_rad
        The largest chi^2 per reading and phase error of the model with which it can be made.
    last
        Whether it is made with the final model alone: any misfit could look like this.
    repeats
        Whether it is made again with each model once it has found something. What it left out or
        took off is then put back first, and may stay.
    """

    name: str
    find: Callable[[Evidence], Finding | None]
    most_misfit: float = math.inf
    most_phase_rad: float = math.inf
    last: bool = False
    repeats: bool = False

    def may_ask(self, evidence: Evidence) -> bool:
        """Whether a model is good enough for the test."""
        fit = evidence.fit
        used = evidence.data.used
        good = used >= FEWEST and fit.chi2 <= self.most_misfit * used
        return good and fit.max_phase_error_rad <= self.most_phase_rad


def _last(name: str, find: Callable[[Evidence], Finding | None]) -> Finder:
    return Finder(name, find, CLEAN, LARGE_PHASE_ERROR, last=True)


FINDERS: Final = (
    Finder("time-stamps", sampling_times.find_irregular, most_phase_rad=_IN_PHASE),
    Finder("dropped-samples", slips.find_lost, repeats=True),
    Finder("tracking-noise", tracking.find, most_phase_rad=LARGE_PHASE_ERROR, repeats=True),
    Finder("count-slips", slips.find_counts, most_phase_rad=_ON_ITS_TURN),
    Finder("clock-slips", slips.find_clock, most_phase_rad=_IN_PHASE),
    Finder("clipping", converter.find_clipping, GROSS, LARGE_PHASE_ERROR, repeats=True),
    Finder("glitches", glitches.find, repeats=True),
    # Dead bits show in the codes themselves, whatever the model.
    Finder("coarse-quantisation", converter.find_dead_bits, last=True),
    _last("missing-codes", converter.find_missing_codes),
    _last("coarse-quantisation", converter.find_coarse_steps),
    _last("jitter", sampling_times.find_jitter),
    _last("coloured-noise", colour.find_coloured_noise),
    _last("broadband-drive", colour.find_random_torque),
    Finder("changing-noise", colour.note_level, last=True),
    Finder("wandering-zero", colour.note_wander, last=True),
)
"""The tests of the measurement."""
