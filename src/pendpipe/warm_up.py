"""Compile what is compiled: ``python -m pendpipe.warm_up``.

numba keeps compiled functions on disk, so only the first call on a machine waits for the
compiler. The set-up makes that call, lest the first jobs of a campaign all do it at once.
"""

from __future__ import annotations

import sys

import numpy as np


def warm_up() -> None:
    """Sample, measure and fit a short decay, by every way that uses compiled code."""
    from pendpipe.analysis.fit import fit_recording
    from pendpipe.dynamics import Eq8, Release, sample, turning_points
    from pendpipe.recording import Recording

    model = Eq8(2.0 * np.pi, quadratic=0.02, hysteretic=0.01, viscous=0.01, coulomb=1e-5)
    release = Release(-0.3, 0.1)
    turning_points(model, release, count=10)
    time = np.arange(2000) / 50.0
    for method in ("clock", "map"):
        angle = sample(model, release, time, method=method)
    noise = 1e-4 * np.random.default_rng(1).standard_normal(len(time))
    recording = Recording(time, angle + noise, "angle_rad")
    fit_recording(recording, method="turning-points")
    fit_recording(recording, method="waveform")


if __name__ == "__main__":
    print("compiling (once on a machine, a minute or two)", file=sys.stderr)
    warm_up()
