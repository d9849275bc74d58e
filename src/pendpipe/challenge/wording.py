"""Scores in words."""

from __future__ import annotations

from typing import Any

Score = dict[str, Any]


def percent(score: Score | None) -> str:
    """A rate as hits of count, with its 95 % interval."""
    if not score or score.get("rate") is None:
        return "none to judge"
    low, high = score["interval95"]
    return (
        f"{100 * score['rate']:.1f} % ({score['hits']} of {score['of']};"
        f" {100 * low:.1f} to {100 * high:.1f} %)"
    )


def cell(text: str) -> str:
    """Text for a cell of a Markdown table."""
    return text.replace("|", r"\|")


def number(value: float | None, form: str = ".2f") -> str:
    """A number or a dash."""
    return "-" if value is None else format(value, form)


def with_interval(value: float | None, score: Score, form: str = ".2f") -> str:
    """A number with its 95 % interval."""
    if value is None:
        return "too few items"
    low, high = score["interval95"]
    return f"{number(value, form)} ({number(low, form)} to {number(high, form)})"
