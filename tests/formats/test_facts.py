"""What is known of a file is a table: each fact stated, shown or guessed, with its option."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendpipe.facts import KINDS, Fact
from pendpipe.formats import ReadOptions, inspect, read

from .cases import swing

TIME, ANGLE = swing(2000)


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
    facts = [Fact(**fact) for fact in told["facts"]]
    assert tuple(facts) == inspect(path).facts == read(path).facts
    assert {fact.kind for fact in facts} <= KINDS.keys()
    printed = answer_of(["inspect", "--why", str(path)]).out
    assert all(f"  {fact.row}\n" in printed for fact in facts)
    assert told["weak_guesses"] == [fact.words for fact in facts if fact.how == "guessed"]


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
