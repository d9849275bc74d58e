"""Coarse quantisation: the errors depend on the angle's position between two codes."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.codes import read_codes
from pendpipe.diagnosis.forensics.finding import Finding, nothing
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Location
from pendpipe.estimate import Estimate

_HARMLESS_NOISE: Final = 0.25
"""Noise before rounding, in steps, above which rounding is harmless."""
_WHOLE_WITHIN: Final = 1e-9
"""Tolerance of a spacing of whole bits, over the converter's step."""
_RANDOM_AMPLITUDE: Final = 20.0
"""Amplitude in steps above which rounding errors are effectively random."""


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test whether the errors depend on the angle's position between two codes.

    Rounding an angle x with noise s to steps q shifts the mean reading by

        (q/pi) sum over m of (-1)^m exp(-2 (pi m s/q)^2) sin(2 pi m x/q)/m,

    which vanishes from s = q/2 on. The size of its first term is the errors' inner product with
    it; the null is any noise above a quarter step. If the amplitude stays above twenty steps, the
    errors are pseudo-random and do no harm: a property of the record.

    If the observed codes are several of the converter's steps apart, its lowest bits are dead or
    an earlier stage has a coarser step, and no estimate is needed.
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
    allowed = math.exp(-2.0 * (math.pi * _HARMLESS_NOISE) ** 2) / math.pi
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
        f" that errors depend on the codes; the final amplitude is {end / step:.2g} steps",
        kind="fault" if end < _RANDOM_AMPLITUDE * step else "property",
    )


def _dead_bits(data: Data, fit: Fit, samples: Samples) -> Finding:
    """Report codes that all lie on a coarser lattice; by chance each would with 1/times.

    With noise above half the converter's step every code is as probable as its neighbours, so
    that each reading contributes ln(times) to the log-likelihood. The lattice's origin is
    estimated from the codes, and so is its spacing if that is not a whole number.
    """
    assert samples.step is not None
    assert samples.promised_step is not None
    times = samples.step / samples.promised_step
    whole = abs(times - round(times)) < _WHOLE_WITHIN
    free = len(np.unique(samples.values)) - (1 if whole else 2)
    amplitude = fit.at.sampled.amplitude
    steps = f"the step is {samples.step:.3g} {data.unit}, but the converter's bits give"
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
        summary=f"only one code in {times:.0f} occurs: {steps}"
        if whole
        else f"the codes that occur are {times:.4g} apart, rounded to whole ones: {steps}",
        also=("missing-codes",) if whole and round(times) == 2 else (),
    )
