"""Hundreds of dialects: each is read right, or refused, or its first line says what is a guess."""

from collections import Counter
from pathlib import Path
from random import Random

import numpy as np
import pytest

from pendpipe.errors import InputError
from pendpipe.formats import read

from .dialects import Sample, draw

SEED, FILES = 20261122, 150


def outcome(path: Path, sample: Sample) -> tuple[str, str]:
    """Read one file: right, guess (called one, where it is wrong or may be), refused, or wrong."""
    path.write_bytes(sample.text)
    try:
        recording = read(path)
    except InputError as fault:
        return "refused", fault.problem
    said = " / ".join(recording.weak_guesses)
    faults = []
    time = recording.time_s - recording.time_s[0]
    if len(time) < 0.98 * len(sample.time_s):
        return "wrong", f"{len(time)} of {len(sample.time_s)} rows"
    span = sample.time_s[-1] - sample.time_s[0]
    if abs(time[-1] / span - 1.0) > 0.01 and "--unit" not in said:
        faults.append(f"span {time[-1]:.4g} s, not {span:.4g}")
    scale = span / time[-1] if time[-1] > 0 else 1.0
    usable = recording.usable
    truth = np.interp(scale * time[usable], sample.time_s - sample.time_s[0], sample.values)
    values = recording.values[usable]
    near = float(np.corrcoef(values, truth)[0, 1])
    ratio = float(np.std(values) / np.std(truth))
    if abs(near) < 0.95:
        if "--column" not in said:
            faults.append(f"another column (correlation {near:.2f}): {recording.notes}")
    elif not (recording.unit == sample.unit and abs(ratio - 1.0) < 0.05) and "--unit" not in said:
        faults.append(f"unit {recording.unit}, not {sample.unit}, {ratio:.4g} times")
    if faults:
        return "wrong", "; ".join(faults)
    own = recording.unit in ("1", "counts") and not sample.stated
    exact = near > 0.95 and (own or (recording.unit == sample.unit and abs(ratio - 1.0) < 0.05))
    exact &= abs(time[-1] / span - 1.0) < 0.01
    return ("right", "") if exact else ("guess", said)


@pytest.mark.parametrize("seed", [SEED])
def test_no_dialect_is_read_wrong_in_silence(tmp_path: Path, seed: int) -> None:
    random = Random(seed)
    counts: Counter[str] = Counter()
    wrong, surprising = [], []
    for number in range(FILES):
        sample = draw(random)
        found, said = outcome(tmp_path / "recording.txt", sample)
        counts[found] += 1
        if found == "wrong":
            wrong.append(f"{number}: {sample.story}: {said}")
        elif found != "right" and sample.stated and sample.timed:
            surprising.append(f"{number}: {found}: {sample.story}: {said}")
    print(counts, *wrong, "-- not read although the header gives all:", *surprising, sep="\n")
    assert not wrong
    # What the header gives is no guess.
    assert len(surprising) <= 0.02 * FILES
    # A quarter of the dialects give no unit: these are read in their own.
    assert counts["right"] >= 0.8 * FILES
