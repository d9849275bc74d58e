"""However a logger stamps its rows, they are read at the times at which they were taken."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from pendpipe.formats import read

from .decays import Floats, swing

TIME_S, ANGLE_RAD = swing(6000, 50.0, 0.5)
RANDOM = np.random.default_rng(5)


def clock(seconds: Floats, form: str) -> list[str]:
    """Times of day by the form's h, m and s."""
    return [form.format(h=int(t // 3600), m=int(t // 60) % 60, s=t % 60) for t in seconds]


def arrival(time: Floats) -> Floats:
    late: Floats = np.maximum.accumulate(time + RANDOM.exponential(0.1, len(time)))
    return late + 1e-6 * np.arange(len(time))


def torn(time: Floats) -> Floats:
    """A clock that counts the full second a row too late."""
    stamps = time.copy()
    stamps[49:-50:50] += 0.89
    return stamps


def slowing(time: Floats) -> Floats:
    return np.where(time < 100.0, np.floor(10.0 * time + 1e-9) / 10.0, time)


class Form(NamedTuple):
    """Stamps in the column `name`; how near to the truth they are read; what is said."""

    stamps: Callable[[Floats], list[str]]
    name: str = "t (s)"
    within_s: float = 0.002
    said: str = ""


FORMS = {
    "rounded": Form(lambda t: [f"{x:.1f}" for x in t], within_s=0.05, said="counted at 50 Hz"),
    "cut": Form(lambda t: [f"{np.floor(10 * x + 1e-9) / 10:.1f}" for x in t], within_s=0.05),
    "of three digits": Form(lambda t: [f"{x:.2E}" for x in t], within_s=0.5, said="rounded"),
    "of whole seconds": Form(lambda t: [f"{int(x + 1e-9)}" for x in t], within_s=0.5),
    "slower behind 100 s": Form(lambda t: [f"{x:.2f}" for x in slowing(t)], within_s=0.1),
    "a block of eight rows": Form(lambda t: [f"{x:.3f}" for x in np.repeat(t[7::8], 8)]),
    "newest first": Form(lambda t: [f"{x:.3f}" for x in t], said="newest row"),
    "a counter of 16 bits": Form(
        lambda t: [f"{(round(1e3 * x) + 40_000) % 2**16}" for x in t], "millis"
    ),
    "a counter of 32 bits": Form(
        lambda t: [f"{(round(1e6 * x) - 9_000_000) % 2**32}" for x in t], "micros"
    ),
    "milliseconds since 1970": Form(
        lambda t: [f"{1_700_000_000_000 + round(1e3 * x)}" for x in t], "TM", said="since 1970"
    ),
    "minutes beyond sixty": Form(lambda t: clock(3540 + t, "{m:02d}:{s:06.3f}"), "time"),
    "times beyond midnight": Form(
        lambda t: clock((86_370 + t) % 86_400, "{h:02d}:{m:02d}:{s:06.3f}"), "time"
    ),
    "dates beyond midnight": Form(
        lambda t: [
            f"2024-02-{28 + int(x >= 86_400)}T{of_day}"
            for x, of_day in zip(
                86_370 + t, clock((86_370 + t) % 86_400, "{h:02d}:{m:02d}:{s:06.3f}"), strict=True
            )
        ],
        "time",
    ),
    "points in the time of day": Form(
        lambda t: clock(54_540 + t, "10/01/2025 {h:02d}.{m:02d}.{s:06.3f}"), "time"
    ),
    "of arrival": Form(
        lambda t: [f"{x:.6f}" for x in arrival(t)], within_s=0.25, said="as of arrival"
    ),
    "one in fifty torn": Form(lambda t: [f"{x:.3f}" for x in torn(t)], said="interpolated"),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_rows_are_read_at_their_times(tmp_path: Path, form: str) -> None:
    stamps, name, within_s, said = FORMS[form]
    # Times of whole milliseconds, at which every stamp above is what the logger would write.
    rows = [f"{a},{x:.5f}\n" for a, x in zip(stamps(TIME_S), ANGLE_RAD, strict=True)]
    rows = rows[::-1] if form == "newest first" else rows
    path = tmp_path / "a.csv"
    path.write_text(f"{name},theta (rad)\n" + "".join(rows))
    recording = read(path)
    time_s = recording.time_s - recording.time_s[0]
    assert len(recording) == len(TIME_S)
    np.testing.assert_allclose(time_s, TIME_S, atol=within_s)
    np.testing.assert_allclose(recording.values, ANGLE_RAD, atol=1e-5)
    assert said in " ".join((*recording.notes, *recording.weak_guesses))


def test_true_stamps_of_uneven_rows_stay(tmp_path: Path) -> None:
    kept = np.sort(RANDOM.choice(len(TIME_S), 2800, replace=False))
    lines = zip(TIME_S[kept], ANGLE_RAD[kept], strict=True)
    path = tmp_path / "a.csv"
    path.write_text("t (s),theta (rad)\n" + "".join(f"{t:.3f},{x:.5f}\n" for t, x in lines))
    np.testing.assert_allclose(read(path).time_s, TIME_S[kept], atol=1e-9)
