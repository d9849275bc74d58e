"""The report tells of a scored challenge where there is one, the bad with the good."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from markupsafe import Markup

from pendpipe.report.page import Room, proof, render

SVG = '<?xml version="1.0"?><svg viewBox="0 0 9 9"><path id="p" d="M 0 0 L 9 9"/></svg>'


@pytest.fixture
def scored(tmp_path: Path) -> Path:
    """A scored set: one promise kept, one not, one that could not be judged."""
    row = {
        "item": "item-0003",
        "hidden": "jitter",
        "law": "gaussian",
        "delta_chi2": 51.2,
        "oracle_detected": True,
        "answer": "",
        "statement": "Eq. 8 is enough.",
    }
    scores = {
        "set": {
            "set": "proof",
            "count": 600,
            "seed": 12345,
            "sealed_at": "T1",
            "answered_at": "T2",
            "answered_by": "0123abcd",
            "opened_at": "T3",
            "truth_sha256": "ab12",
            "answers_sha256": "cd34",
        },
        "promises": [
            {"promise": f"promise {n}", "measured": f"{n} %", "kept": kept}
            for n, kept in enumerate([True, False, None])
        ],
        "families": {"null": 204, "single": 198},
        "unsolved": [],
        "missed": [row],
        "causes": {
            "confident": {
                "promise": "promise 1",
                "rows": [
                    {
                        "hidden": "unnamed-damping",
                        "law": "kink",
                        "answer": "damping-step",
                        "count": 3,
                        "of": 7,
                        "largest": 90.0,
                    }
                ],
                "reasons": [{"of": "outside", "cause": "kink", "why": "Time & amplitude."}],
            },
            "calibration": {
                "promise": "promise 2",
                "rows": [],
                "reasons": [],
                "bins": [
                    {
                        "edges": [0.9, 1.0],
                        "met": 0.59,
                        "of": 123,
                        "overconfident": True,
                        "culprits": [
                            {
                                "hidden": "jitter",
                                "law": "gaussian",
                                "answer": "glitches",
                                "count": 2,
                            }
                        ],
                    }
                ],
            },
        },
        "six_cases": [
            {**row, "item": "item-0007", "law": "<b>", "figure": "case-1.svg", "same_answer": True}
        ],
    }
    (tmp_path / "scores.json").write_text(json.dumps(scores))
    (tmp_path / "figures").mkdir()
    for name in ("power", "case-1"):
        (tmp_path / "figures" / f"{name}.svg").write_text(SVG)
    return tmp_path


def shown(example: Any, folder: Path | None) -> str:
    return render({}, example.content, {}, example.folder, example.folder / "figures", folder)


def test_a_scored_set_is_shown_with_hashes_and_misses(example: Any, scored: Path) -> None:
    text = shown(example, scored)
    section = text[text.index('<section id="proof"') :]
    section = section[: section.index("</section>")]
    for word in (
        "600 recordings",
        "ab12",
        "cd34",
        "12345",
        "0123abcd",
        "204 null, 198 single",
        "make proof",
        "item-0003: jitter (gaussian), Δχ² = 51; the oracle detected it",
        "unnamed-damping (kink), answer damping-step: 3 of 7",
        "Time &amp; amplitude.",
        "stated 0.9 to 1.0, came true in 59 % of 123",
        "jitter (gaussian) → glitches 2",
        "&lt;b&gt;",
        "kept",
        "not kept",
        "not judged",
    ):
        assert word in section
    assert section.count("<svg") == 2
    assert '<a href="#proof">' in text


def test_without_a_scored_set_nothing_is_said(example: Any, tmp_path: Path) -> None:
    for folder in (None, tmp_path / "nothing"):
        assert 'href="#proof"' not in shown(example, folder)
        assert 'id="proof"' not in shown(example, folder)


def test_a_figure_beyond_the_budget_is_left_out(scored: Path) -> None:
    ample = Room(10_000)
    whole, poor = proof(scored, ample), proof(scored, Room(100))
    assert whole is not None
    assert poor is not None
    assert [type(figure["svg"]) for figure in whole["figures"]] == [Markup]
    assert [type(svg) for svg in whole["cases"]] == [Markup]
    assert ample.left < 10_000 - 100
    assert poor["figures"] == []
    assert poor["cases"] == [None]
