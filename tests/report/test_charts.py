"""Waveforms: what is packed is what was recorded, and the band invents no beats."""

import numpy as np
import pytest

from pendpipe.recording import Recording
from pendpipe.report.charts import extremes, line, pack, unpack


def test_counts_of_a_converter_survive_the_packing_to_the_bit() -> None:
    random = np.random.default_rng(2)
    counts = random.integers(-32_768, 32_768, 5000)
    counts[:2] = -32_768, 32_767
    step = 20.0 / 2**16
    time = np.cumsum(random.uniform(0.5, 1.5, 5000)) / 60.0
    packed = pack(Recording(time, step * counts, "volts", resolution=step), 1.0)
    values = packed["origin"] + packed["step"] * unpack(packed["counts"], "<i2")
    assert np.array_equal(np.rint(values / step), counts)
    times = packed["begin"] + packed["tick"] * unpack(packed["times"], "<i4")
    assert times == pytest.approx(time, abs=1e-8 * (time[-1] - time[0]))


def test_readings_without_a_step_keep_sixteen_bits() -> None:
    angle = np.random.default_rng(3).normal(size=1000)
    packed = pack(Recording(np.arange(1000.0), angle, "angle_rad"), 1e3)
    values = packed["origin"] + packed["step"] * unpack(packed["counts"], "<i2")
    assert values == pytest.approx(1e3 * angle, abs=1e3 * np.ptp(angle) / 2**16)


@pytest.mark.parametrize(("periods_a_bucket", "falls"), [(1.0, True), (0.8, False)])
def test_the_band_of_a_pure_decay_falls_as_the_decay(periods_a_bucket: float, falls: bool) -> None:
    """Buckets of 1.6 s on a swing of 2 s would show notches that look like beats."""
    time = np.linspace(0.0, 400.0, 40_001)
    swing = np.exp(-0.004 * time) * np.cos(np.pi * time)
    _, _, high = extremes(time, swing, int(200 / periods_a_bucket))
    assert bool(np.all(np.diff(high) < 0.0)) is falls


def test_a_gap_interrupts_the_line() -> None:
    path = line(np.arange(5.0), np.array([1.0, 2.0, np.nan, 3.0, 4.0]))
    assert path == "M0.0,1.0L1.0,2.0M3.0,3.0L4.0,4.0"
