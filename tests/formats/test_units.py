"""Units of angles and of clocks, each by what it is."""

import math
from pathlib import Path

import numpy as np
import pytest

from pendpipe import read

TIME_S = np.arange(400) / 50.0
ANGLE_RAD = 0.1 * np.exp(-0.02 * TIME_S) * np.cos(2.0 * np.pi * 0.7 * TIME_S)


def written(folder: Path, time: np.ndarray, angle: np.ndarray, header: str) -> Path:
    path = folder / "swing.csv"
    rows = "\n".join(f"{t!r},{x!r}" for t, x in zip(time.tolist(), angle.tolist(), strict=True))
    path.write_text(f"{header}\n{rows}\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("unit", "turn"),
    [("deg", 360.0), ("gon", 400.0), ("rev", 1.0), ("rad", 2.0 * math.pi), ("arcmin", 21600.0)],
)
def test_a_turn_is_two_pi_in_every_unit(tmp_path: Path, unit: str, turn: float) -> None:
    angle = ANGLE_RAD * turn / (2.0 * math.pi)
    found = read(written(tmp_path, TIME_S, angle, f"time (s),angle ({unit})"))
    assert found.unit == "rad"
    np.testing.assert_allclose(found.values, ANGLE_RAD, rtol=1e-12)


@pytest.mark.parametrize("per_second", [1, 10**3, 10**6, 10**9])
def test_a_clock_that_counts_from_a_date_is_read_in_its_own_unit(
    tmp_path: Path, per_second: int
) -> None:
    """Seconds, milliseconds, microseconds or nanoseconds since 1970: known by their size."""
    ticks = (
        1_700_000_000 * per_second + np.round(TIME_S * 1000).astype(np.int64) * per_second // 1000
    )
    time = ticks if per_second > 1 else 1_700_000_000.0 + TIME_S
    found = read(written(tmp_path, time, ANGLE_RAD, "timestamp,angle_rad"))
    assert found.time_s[-1] - found.time_s[0] == pytest.approx(TIME_S[-1], abs=1e-5)
