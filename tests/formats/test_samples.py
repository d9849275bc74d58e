"""Each sample file reads as the expectation beside it says: a folder a dialect."""

import json
from pathlib import Path

import pytest

from pendpipe.formats import inspect, read
from pendpipe.formats.dialects import dialects
from pendpipe.formats.plugin import HEAD

HERE = Path(__file__).parent
EXPECTED = [path for path in sorted(HERE.glob("*/*.json")) if path.with_suffix("").exists()]


@pytest.mark.parametrize("expected", EXPECTED, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_sample_file_reads_as_expected(expected: Path) -> None:
    path, says = expected.with_suffix(""), json.loads(expected.read_text())
    recording, found = read(path), inspect(path)
    assert (found.chosen, found.unit) == (says["chosen"], says["unit"])
    assert (found.samples, found.uniform) == (says["samples"], True)
    assert found.sample_rate_hz == pytest.approx(says["sample_rate_hz"], rel=1e-3)
    size = abs(recording.values).max()
    assert recording.values[0] == pytest.approx(says["first"], abs=2e-3 * size)
    assert recording.values[-1] == pytest.approx(says["last"], abs=2e-3 * size)
    assert recording.unit_is_stated is says.get("unit_is_stated", True)


@pytest.mark.parametrize("sample", EXPECTED, ids=lambda path: path.stem)
def test_no_file_is_claimed_by_two_dialects(sample: Path) -> None:
    """A plain table by none."""
    head = sample.with_suffix("").read_bytes()[:HEAD]
    mine = [dialect.name for dialect in dialects()[0] if dialect.is_mine(head)]
    assert len(mine) == (sample.parent.name != "plain_table")
