"""The caliper run: the rod is moved by known lengths while the sensor's volts are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pendpipe.acquisition.simulated import acquire_simulated
from pendpipe.arrays import FloatArray
from pendpipe.configuration.load import Campaign
from pendpipe.errors import InputError
from pendpipe.files import replaced
from pendpipe.simulation.record import SensorVolts, generator

RATE_HZ = 200.0
SETTLING = 0.1
"""Part of each dwell that is left out at either end, where the caliper is moved."""


def run_caliper(campaign: Campaign, table: Path) -> None:
    """Make the table of a caliper run, or copy the one that the configuration names.

    Columns ``displacement_m``, ``volts``, ``volts_sd``: the caliper's reading, the mean of
    the samples at that position, and the mean's standard deviation.
    """
    settings = campaign.configuration
    assert settings.calibration is not None
    if settings.calibration.source != "simulated":
        _copy(Path(settings.calibration.source), table)
        return
    run, truth = settings.calibration, settings.simulated
    if truth is None:
        raise InputError("calibration", "a simulated run needs the section simulated", "add it")
    random = generator(campaign, "caliper run")
    displacement = np.linspace(-run.travel_m, run.travel_m, run.points)
    reading = displacement + run.displacement_sd_m * random.standard_normal(run.points)
    dwell_s = run.samples / RATE_HZ / (1.0 - 2.0 * SETTLING)

    def held(time_s: FloatArray) -> FloatArray:
        """The rod's angle while the caliper holds one position after the other."""
        position = np.floor(time_s / dwell_s).astype(np.int64)
        return np.asarray(displacement[np.clip(position, 0, run.points - 1)] / run.arm_m)

    noise = np.random.default_rng([settings.seed, run.points])
    recording = acquire_simulated(
        truth.device.kind,
        SensorVolts(held, truth.sensor, noise),
        rate_hz=RATE_HZ,
        duration_s=run.points * dwell_s,
        clock_scale=truth.device.clock_scale,
    )
    dwells = recording.time_s / dwell_s
    steps, settled = np.floor(dwells), np.abs(dwells % 1.0 - 0.5) < 0.5 - SETTLING
    with replaced(table) as stream:
        stream.write(f"# arm_m: {run.arm_m!r}\ndisplacement_m,volts,volts_sd\n")
        for index, length in enumerate(reading.tolist()):
            volts = recording.values[settled & (steps == index)]
            spread = float(np.std(volts, ddof=1) / np.sqrt(len(volts)))
            stream.write(f"{length!r},{float(np.mean(volts))!r},{spread!r}\n")


def _copy(source: Path, table: Path) -> None:
    """Keep the user's own table beside the results that were made with it."""
    try:
        content = source.read_bytes()
    except OSError:
        raise InputError(
            source, "the calibration's table can't be read", "check the path"
        ) from None
    with replaced(table, "wb") as stream:
        stream.write(content)
