"""Dialects: each knows its own files, by samples; those of another package are found."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from pendpipe.errors import InputError
from pendpipe.formats import dialects, inspect, read
from pendpipe.formats.plugin import HEAD, Dialect, text_dialect

TIME_S = np.arange(200) / 20.0
ANGLE_RAD = 0.2 * np.exp(-0.1 * TIME_S) * np.cos(5.0 * TIME_S)
ROWS = "".join(f"{t:.2f}:{x:.6f}\n" for t, x in zip(TIME_S, ANGLE_RAD, strict=True))


def _lines(lines: list[str]) -> list[str]:
    return ["t (s),theta (rad)", *(line.replace(":", ",") for line in lines[1:])]


COLONS = text_dialect("table of colons", re.compile("COLONS\n").match, _lines)


def _fails(head: bytes) -> bool:
    raise ValueError("no head for this")


BROKEN = Dialect("broken reader", _fails, COLONS.read)


@dataclass(order=True)
class Entry:
    """An entry point of a package that is installed."""

    name: str

    def load(self) -> object:
        if self.name == "UNIMPORTABLE":
            raise ImportError("no module named 'nothing'")
        return {"COLONS": COLONS, "BROKEN": BROKEN}[self.name]


@pytest.fixture
def plugins(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Entry]]:
    entries: list[Entry] = []
    monkeypatch.setattr(dialects, "entry_points", lambda **_: entries)
    dialects.dialects.cache_clear()
    yield entries
    dialects.dialects.cache_clear()


def test_another_package_adds_a_dialect(tmp_path: Path, plugins: list[Entry]) -> None:
    path = tmp_path / "a.txt"
    path.write_text("COLONS\n" + ROWS)
    plugins.append(Entry("COLONS"))
    recording = read(path)
    np.testing.assert_allclose(recording.values, ANGLE_RAD, atol=1e-6)
    assert recording.unit == "rad"


def test_without_it_the_file_is_refused(tmp_path: Path, plugins: list[Entry]) -> None:
    path = tmp_path / "a.txt"
    path.write_text("COLONS\n" + ROWS)
    with pytest.raises(InputError):
        read(path)


@pytest.mark.parametrize("name", ["BROKEN", "ABSENT", "UNIMPORTABLE"])
def test_a_plugin_that_fails_is_named_and_passed_over(
    tmp_path: Path, plugins: list[Entry], name: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t (s),theta (rad)\n" + ROWS.replace(":", ","))
    plugins.append(Entry(name))
    recording = read(path)
    np.testing.assert_allclose(recording.values, ANGLE_RAD, atol=1e-6)
    (note,) = (note for note in recording.notes if "passed over" in note)
    said = name.replace("BROKEN", "broken reader")
    assert said in note
    assert "\n" not in note
    path.write_bytes(b"\0\1\2" * 900)
    with pytest.raises(InputError, match=f"no reader knows this file.*'{said}' is passed over"):
        read(path)


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
    mine = [dialect.name for dialect in dialects.dialects()[0] if dialect.is_mine(head)]
    assert len(mine) == (sample.parent.name != "plain_table")
