"""Compile what is compiled: ``python -m pendpipe.warm_up``, ``python -m pendpipe.warm_up ship``.

The second is what ``pip install`` runs (`setup.py`): it puts the engine's machine code into the
package. The first makes the first call, which compiles what such code is not made for, lest the
first jobs of a campaign all do it at once.
Python's own byte code is written for the same reason: pip does so for what it copies, not
for an editable installation, and where PYTHONDONTWRITEBYTECODE is set nobody else would.
"""

from __future__ import annotations

import compileall
import sys
from pathlib import Path

import numpy as np


def warm_up() -> None:
    """Sample, measure and fit a short decay, by every way that uses compiled code."""
    from pendpipe.analysis.fit import fit_recording
    from pendpipe.analysis.fit.rounding import best_noise
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
    best_noise(noise, 1e-3, 1e-4)  # of coarse readings


def ship() -> None:
    """Put the engine's machine code into the package."""
    from pendpipe.analysis.turning_points import compiled as loops
    from pendpipe.dynamics import compiled as engine

    engine.ship(loops.file_name(), loops.compile_loops)
    engine.ship(engine.file_name(), engine.compile_engine)


if __name__ == "__main__":
    if sys.argv[1:] == ["ship"]:
        ship()
    else:
        compileall.compile_dir(Path(__file__).parent, quiet=2)
        warm_up()
