"""Real recordings with a concealed change: each recording meets each change."""

from pathlib import Path

import numpy as np
import pytest

from pendpipe_challenge import recordings
from pendpipe_challenge.recordings import CHANGES, make_real


@pytest.mark.parametrize("there", [3, 7, 8])
def test_each_round_conceals_every_change_in_every_recording(
    there: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [f"decay-{k}.csv" for k in range(there)]
    monkeypatch.setattr(recordings, "SOURCES", tuple((name, 0.0) for name in names))
    time = np.arange(400) / 20.0
    for name in names:
        angle = 0.2 * np.exp(-0.02 * time) * np.cos(5.0 * time) + 1e-4 * np.sin(97.0 * time)
        rows = "\n".join(f"{t:.9g},{v:.9g}" for t, v in zip(time, angle, strict=True))
        (tmp_path / name).write_text(f"time_s,angle_rad\n{rows}\n")
    random = np.random.default_rng(3)
    made = [make_real(tmp_path, k, random).truth for k in range(there * len(CHANGES))]
    pairs = {(truth["source"], truth["effects"][0]["effect"]) for truth in made}
    assert len(pairs) == there * len(CHANGES)
