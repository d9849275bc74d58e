"""A step that rules: the readings' errors follow their place between two codes."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.forensics.codes import read_codes
from pendpipe.diagnose.forensics.finding import Finding, nothing
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.result import Location
from pendpipe.estimate import Estimate

_WELL_BELOW: Final = 0.25
"""Noise before rounding, in steps, above which the step does not rule."""
_WHOLE: Final = 1e-9
"""Part of the converter's step by which a spacing of whole bits may seem to be off."""
_RANDOM: Final = 20.0
"""Amplitude in steps above which rounding errors are as good as random."""


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test whether the errors follow the angle's place between two codes.

    Rounding an angle x with noise s to steps q shifts the mean reading by

        (q/pi) sum over m of (-1)^m exp(-2 (pi m s/q)^2) sin(2 pi m x/q)/m,

    which is nothing from s = q/2 on. The size of its first term is measured by the errors'
    inner product with it, and held against what a noise of a quarter step would leave: the
    null is any noise above that. Where the amplitude stays above twenty steps the errors are
    pseudo-random, do the fit no harm, and are a property of the record.

    Where the codes that come are several of the converter's steps apart, its lowest bits do not
    move, or something before it has a coarser step, and nothing need be measured.
    """
    if samples.promised_step is not None:
        return _dead_bits(data, fit, samples)
    coded = None if data.time_noise else read_codes(data, fit, samples)
    if coded is None or len(coded.code) < 60:
        return nothing("coarse-quantisation")
    wave = -np.sin(2.0 * math.pi * coded.position)
    wave = wave - wave.mean()
    error = coded.error - coded.error.mean()
    size = float(wave @ error) / float(wave @ wave)
    sd = math.sqrt(float(np.mean(error**2)) / float(wave @ wave))
    allowed = math.exp(-2.0 * (math.pi * _WELL_BELOW) ** 2) / math.pi
    p_value = 0.5 * math.erfc((size - allowed) / sd / math.sqrt(2.0))
    step, end = coded.lattice.step, float(fit.at.sampled.amplitude[-1])
    amplitude = fit.at.sampled.amplitude
    return Finding(
        "coarse-quantisation",
        p_value,
        max(size / sd, 0.0) ** 2,
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
        kind="fault" if end < _RANDOM * step else "property",
    )


def _dead_bits(data: Data, fit: Fit, samples: Samples) -> Finding:
    """Codes that all lie on a coarser lattice; by chance one more would be with 1/times.

    With a noise of more than half the converter's step every code is as likely as its
    neighbours, so that each reading tells ln(times) of likelihood. A lattice's place is read
    off the codes themselves, and its spacing too where that is no whole number.
    """
    assert samples.step is not None
    assert samples.promised_step is not None
    times = samples.step / samples.promised_step
    whole = abs(times - round(times)) < _WHOLE
    free = len(np.unique(samples.values)) - (1 if whole else 2)
    amplitude = fit.at.sampled.amplitude
    steps = f"the step is {samples.step:.3g} {data.unit}, where the converter's bits promise"
    steps += f" {samples.promised_step:.3g}"
    parameters = {
        "step": Estimate(samples.step, 0.0, data.unit),
        "promised": Estimate(samples.promised_step, 0.0, data.unit),
    }
    if whole:
        parameters["dead_bits"] = Estimate(math.log2(times), 0.0, "")
    return Finding(
        "coarse-quantisation",
        times**-free,
        2.0 * data.used * math.log(times),
        parameters,
        Location(
            (float(data.time_s[0]), float(data.time_s[-1])),
            (float(amplitude.min()), float(amplitude.max())),
        ),
        summary=f"only one code in {times:.0f} comes: {steps}"
        if whole
        else f"the codes that come are {times:.4g} apart, rounded to whole ones: {steps}",
        also=("missing-codes",) if whole and round(times) == 2 else (),
    )
