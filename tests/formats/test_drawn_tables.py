"""Tables drawn at random, each with a swing that is known: none is read wrong in silence."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from random import Random

from benchmarks.drawn_tables import draw, judge

SEED, TABLES = 52, 40


def test_drawn_tables_are_read_right_or_refused(tmp_path: Path) -> None:
    random = Random(SEED)
    drawn = [draw(random) for _ in range(TABLES)]
    outcomes = [judge(tmp_path / "table.txt", table) for table in drawn]
    for table, (outcome, said) in zip(drawn, outcomes, strict=True):
        print(outcome, table.story, said)
    counts = Counter(outcome for outcome, _ in outcomes)
    assert counts["wrong"] == 0
    assert counts["right"] >= 0.9 * TABLES
