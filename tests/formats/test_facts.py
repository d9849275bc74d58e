"""What is known of a file is a table: each fact stated, shown or guessed, with its option."""

import json
from datetime import datetime, timedelta
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from benchmarks.facts import DRAWN, counted
from scipy.stats import binom

from pendpipe.analysis.readings import motion_of
from pendpipe.facts import KINDS, Fact
from pendpipe.formats import ReadOptions, inspect, read

from .cases import swing
from .test_dialects import motion

TIME, ANGLE = swing(2000)
SAMPLES = sorted((Path(__file__).parent / "facts").glob("*/*.json"))


@pytest.mark.parametrize("expected", SAMPLES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_sample_shows_its_fact(expected: Path) -> None:
    """Value, and how it is known; or none, where there is nothing of the kind."""
    kind, recording = expected.parent.name.replace("_", " "), read(expected.with_suffix(""))
    # A fit asks for the constant, no reader.
    fact = (motion_of(recording) if kind == "sensor constant" else recording).fact(kind)
    found = fact and {"value": fact.value, "how": fact.how, "error_rate": fact.error_rate}
    assert found == json.loads(expected.read_text())


def test_each_kind_of_fact_has_samples_and_each_that_a_test_shows_a_rate() -> None:
    assert KINDS.keys() == {path.parent.name.replace("_", " ") for path in SAMPLES}
    assert DRAWN.keys() == {kind for kind, known in KINDS.items() if known.wrong is not None}


@pytest.mark.slow
@pytest.mark.parametrize("kind", DRAWN)
def test_a_fact_that_is_shown_is_as_seldom_wrong_as_is_stated(kind: str) -> None:
    """More are wrong less than one time in 10,000; `python -m benchmarks.facts` draws more."""
    shown, wrong = counted(kind, 100)
    assert wrong <= binom.ppf(0.9999, 100, KINDS[kind].wrong)
    assert shown or kind in ("lost readings", "saturation")  # of which sound swings show none


@pytest.mark.parametrize("seed", [4, 23, 36, 49, 105])
def test_positions_along_a_straight_line_are_on_no_circle(seed: int) -> None:
    """Of thousands of rows on a tilted line some circle has a centre that is well known."""
    fact, right = DRAWN["pivot"](np.random.default_rng((660, seed)))
    assert fact is None or right


def written(path: Path, header: str, *columns: Any) -> Path:
    rows = "\n".join(
        ",".join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)
    )
    path.write_text(f"{header}\n{rows}\n")
    return path


@pytest.mark.parametrize(
    ("header", "scale", "options", "kind", "value", "how"),
    [
        ("t (s),theta (rad)", 1.0, {}, "unit", "rad", "stated"),
        ("t (s),theta", 1.0, {}, "unit", "rad", "shown"),
        ("t (s),theta", 1.0, {"unit": "rad"}, "unit", "rad", "stated"),
        ("t (s),x", 1e-3, {}, "unit", "1", "guessed"),
        ("t (s),theta", 1.0, {}, "unit of time", "s", "stated"),
        ("t,theta", 1.0, {}, "unit of time", "s", "shown"),
        ("t,theta", 1.0, {"unit": "ms:rad"}, "unit of time", "ms", "stated"),
        ("t,theta", 1.0, {}, "time column", "t", "stated"),
        ("k,theta", 1.0, {}, "time column", "k", "shown"),
        ("t,theta", 1.0, {}, "reading", "'theta'", "stated"),
        ("t,theta", 1.0, {"column": "2"}, "reading", "theta", "stated"),
        ("t,theta", 1.0, {"sample_rate": 50.0}, "clock", "50 Hz", "stated"),
    ],
)
def test_a_fact_is_stated_shown_or_guessed(
    tmp_path: Path,
    header: str,
    scale: float,
    options: dict[str, Any],
    kind: str,
    value: str,
    how: str,
) -> None:
    path = written(tmp_path / "a.csv", header, TIME, scale * ANGLE)
    fact = read(path, ReadOptions(**options)).fact(kind)
    assert fact is not None
    assert (fact.value, fact.how) == (value, how)
    assert fact.option.startswith("--")
    assert (fact.error_rate is not None) == (how == "shown")


def test_each_fact_is_in_the_json_and_in_the_answer_to_why(tmp_path: Path, answer_of: Any) -> None:
    path = written(tmp_path / "a.csv", "t,x", TIME, 1e-3 * ANGLE)
    told = json.loads(answer_of(["inspect", "--json", str(path)]).out)
    facts = [Fact(**{k: v for k, v in fact.items() if k != "error_rate"}) for fact in told["facts"]]
    assert tuple(facts) == inspect(path).facts == read(path).facts
    assert {fact.kind for fact in facts} <= KINDS.keys()
    printed = answer_of(["inspect", "--why", str(path)]).out
    assert all(f"  {fact.row}\n" in printed for fact in facts)
    assert told["weak_guesses"] == [fact.words for fact in facts if fact.how == "guessed"]


@pytest.mark.parametrize(
    ("header", "columns", "said"),
    [
        ("time (s),theta", [np.mod(TIME + 86390.0, 86400.0)], "begins again at 0 after 86400"),
        ("dt (ms),theta", [np.full(2000, 20.0)], "added up"),
        ("s,ns,theta", [np.floor(TIME), 1e9 * np.mod(TIME, 1.0)], "'s' and 'ns' joined"),
    ],
)
def test_a_clock_that_is_made_of_what_the_file_has_is_a_fact(
    tmp_path: Path, header: str, columns: list[Any], said: str
) -> None:
    rows = "".join(
        ",".join(f"{value:.6f}" for value in row) + "\n"
        for row in zip(*columns, ANGLE, strict=True)
    )
    (tmp_path / "a.csv").write_text(f"{header}\n{rows}")
    recording = read(tmp_path / "a.csv")
    fact = recording.fact("clock")
    assert fact is not None
    assert fact.how == "shown"
    assert said in fact.said
    np.testing.assert_allclose(np.diff(recording.time_s), 0.02, atol=1e-6)


@pytest.mark.parametrize("period_s", [0.03, 1.0, 15.0])
@pytest.mark.parametrize("unit_s", [1.0, 1e-3, 1e-6])
def test_seconds_are_shown_where_no_other_unit_gives_a_swing(
    tmp_path: Path, period_s: float, unit_s: float
) -> None:
    """A swing lasts 0.02 to 100 s; a clock that ticks in milliseconds is guessed."""
    time = 0.8 * period_s * np.arange(1000) / 50.0
    x = np.exp(-0.002 * np.arange(1000)) * np.cos(2.0 * np.pi * time / period_s)
    path = written(tmp_path / "a.csv", "t,x", time / unit_s, x)
    fact = read(path).fact("unit of time")
    assert fact is not None
    assert fact.how == ("shown" if unit_s == 1.0 else "guessed")


@pytest.mark.parametrize(
    ("first", "turn"),
    [
        ("2025-10-26T02:59:40+02:00", "2025-10-26T02:00:00+01:00"),
        ("2025-03-30T01:59:40+0100", "2025-03-30T03:00:00+0200"),
        ("2025-11-02 01:59:40-04:00", "2025-11-02 01:00:00-05:00"),
        ("1969-12-31T23:59:40Z", "1970-01-01T00:00:00Z"),
    ],
)
def test_a_clock_goes_on_over_the_end_of_summer_time_and_over_1970(
    tmp_path: Path, first: str, turn: str
) -> None:
    """The rows are 20 ms apart, before the turn and behind it."""
    zones = first[19:], turn[19:]
    stamps = []
    for n in range(2000):
        base = datetime.fromisoformat((first if n < 1000 else turn)[:19])
        late = timedelta(seconds=n / 50.0 if n < 1000 else n / 50.0 - 20.0)
        stamps.append((base + late).isoformat(timespec="milliseconds") + zones[n >= 1000])
    rows = "".join(f"{stamp},{x:.5f}\n" for stamp, x in zip(stamps, ANGLE, strict=True))
    (tmp_path / "a.csv").write_text("time,theta (rad)\n" + rows)
    np.testing.assert_allclose(np.diff(read(tmp_path / "a.csv").time_s), 0.02, atol=1e-6)


@pytest.mark.parametrize(
    ("turn", "unit", "tick"), [(604800, "s", 1.0), (604800000, "ms", 1e3), (86400, "s", 1.0)]
)
def test_a_clock_of_the_week_or_the_day_begins_again(
    tmp_path: Path, turn: int, unit: str, tick: float
) -> None:
    stamps = np.mod(turn - 20.0 * tick + tick * TIME, turn)
    rows = "".join(f"{t:.2f},{x:.5f}\n" for t, x in zip(stamps, ANGLE, strict=True))
    (tmp_path / "a.csv").write_text(f"clock time ({unit}),theta (rad)\n{rows}")
    np.testing.assert_allclose(np.diff(read(tmp_path / "a.csv").time_s), 0.02, atol=1e-6)


@pytest.mark.parametrize(
    ("rate", "packet", "late"), [(260, 16, 0.01), (100, 7, 0.03), (500, 16, 0.005)]
)
def test_packets_are_put_on_a_line_and_called_a_guess(
    tmp_path: Path, rate: int, packet: int, late: float
) -> None:
    rng = np.random.default_rng(packet)
    time = np.arange(6000) / rate
    x = 0.3 * np.exp(-0.02 * time) * np.cos(2 * np.pi * time / 1.37)
    block = np.arange(6000) // packet
    arrival = (np.arange(block[-1] + 1) + 1) * packet / rate
    arrival = np.maximum.accumulate(arrival + np.abs(rng.normal(0.0, late, len(arrival))))
    # Of three digits some are equal under one stamp, and no copies.
    rows = "".join(f"{t:.3f},{a:.3f}\n" for t, a in zip(arrival[block], x, strict=True))
    (tmp_path / "a.csv").write_text("time (s),theta (rad)\n" + rows)
    recording = read(tmp_path / "a.csv")
    fact = recording.fact("clock")
    assert fact is not None
    assert fact.how == "guessed"
    found = 1.0 / np.mean(np.diff(recording.time_s))
    assert found == pytest.approx(rate, rel=3e-4)
    assert float(fact.value.split()[0]) == pytest.approx(found, rel=1e-5)


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("time_s,angular_velocity_rad_s", "rad/s"),
        ("t,gyro_rad_s", "rad/s"),
        ("time_s,omega_deg_per_s", "rad/s"),
        ("time_s,acc_m_s2", "m/s^2"),
        ("time_s,v_cm_s", "m/s"),
        ("time_s,reading_V", "V"),
    ],
)
def test_a_name_states_a_unit(tmp_path: Path, header: str, unit: str) -> None:
    recording = read(written(tmp_path / "a.csv", header, TIME, ANGLE))
    assert recording.unit == unit
    assert recording.unit_is_stated


@pytest.mark.parametrize(("noise", "steady"), [(0.01, 0.3), (1.0, 0.3), (0.02, 2.5), (0.5, 3.0)])
def test_of_columns_without_names_one_that_swings_clearly_is_read(
    tmp_path: Path, noise: float, steady: float
) -> None:
    """Noise before it, and half the period: the pull along the string."""
    rng = np.random.default_rng(5)
    buzz = noise * (steady * np.sin(40.0 * TIME) + rng.standard_normal(len(TIME)))
    pull = 1e-3 * ANGLE**2 + 1e-5 * rng.standard_normal(len(TIME))
    rows = np.column_stack([TIME, buzz, pull, 20.0 * ANGLE, buzz[::-1]])
    np.savetxt(tmp_path / "a.csv", rows, fmt="%.6f", delimiter=",")
    assert inspect(tmp_path / "a.csv").chosen == "column 4"


@pytest.mark.parametrize("seed", [514, 944, 1224, 1396])
def test_of_columns_without_names_a_drive_is_not_read_however_clearly_it_swings(
    tmp_path: Path, seed: int
) -> None:
    """Its line is narrow, and that of a decay between two rests broad."""
    time, swing, period = motion(Random(seed))
    drive = 0.3 * np.sin(2.0 * np.pi * time / (0.9 * period))
    np.savetxt(tmp_path / "a.csv", np.column_stack([time, swing, drive]), "%.4f", ",")
    assert inspect(tmp_path / "a.csv").chosen == "column 2"


def test_a_rate_that_the_stamps_contradict_is_a_guess(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "t (s),theta (rad)", TIME, ANGLE)
    told = [read(path, ReadOptions(sample_rate=rate)).fact("clock") for rate in (50.0, 96.0)]
    assert [fact.how for fact in told if fact] == ["stated", "guessed"]
