"""A step that rules: the readings' errors follow their place between two codes."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.forensics.codes import read_codes
from pendpipe.diagnose.forensics.finding import Finding, Location, nothing
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit
from pendpipe.estimate import Estimate

_DITHERED: Final = 0.5
"""Noise before rounding, in steps, from which the errors know nothing of the codes."""


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test whether the errors follow the angle's place between two codes.

    Rounding an angle x with noise s to steps q shifts the mean reading by

        (q/pi) sum over m of (-1)^m exp(-2 (pi m s/q)^2) sin(2 pi m x/q)/m,

    which is nothing from s = q/2 on. The score is the errors' inner product with its first
    term, of the sign that rounding has; white noise, or a step that noise dithers, gives a
    standard normal number.
    """
    coded = None if data.time_noise else read_codes(data, fit, samples)
    if coded is None or len(coded.code) < 60:
        return nothing("coarse-quantisation")
    wave = -np.sin(2.0 * math.pi * coded.position)
    wave = wave - wave.mean()
    error = coded.error - coded.error.mean()
    size = float(wave @ error) / float(wave @ wave)
    sd = math.sqrt(float(np.mean(error**2)) / float(wave @ wave))
    score = size / sd
    p_value = 0.5 * math.erfc(score / math.sqrt(2.0))
    if coded.ratio >= _DITHERED:
        p_value = max(p_value, 0.5 * math.erfc(2.0 / math.sqrt(2.0)))
    step, end = coded.lattice.step, float(fit.at.sampled.amplitude[-1])
    amplitude = fit.at.sampled.amplitude
    return Finding(
        "coarse-quantisation", p_value, max(score, 0.0) ** 2,
        {
            "step": Estimate(step, 0.0, data.unit),
            "noise_over_step": Estimate(coded.ratio, 0.2 * coded.ratio, ""),
            "bias_over_step": Estimate(size, sd, ""),
        },
        Location(
            (float(data.time_s[0]), float(data.time_s[-1])),
            (float(amplitude.min()), float(amplitude.max())),
        ),
        summary=f"the step of {step:.3g} {data.unit} is {1.0 / coded.ratio:.2g} times the noise, so"
        f" that errors follow the codes; the amplitude ends at {end / step:.2g} steps",
    )  # fmt: skip
