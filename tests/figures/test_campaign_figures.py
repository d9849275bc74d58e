"""The figures of a campaign draw its numbers, and the physics shows in them."""

from typing import Any

import numpy as np
import pytest

from pendpipe.figures.campaign import (
    draw_fig04,
    draw_fig05,
    draw_fig06,
    draw_fig09,
    draw_fig10,
)
from pendpipe.figures.data import NothingToDrawError

WATER, AIR = 15, 12


def points(axes: Any) -> np.ndarray:
    """All points with error bars, shape (n, 2)."""
    return np.concatenate([np.column_stack(c[0].get_data()) for c in axes.containers])


def curves(axes: Any, minimum: int = 30) -> list[np.ndarray]:
    """The drawn curves of many points, each of shape (n, 2)."""
    lines = [np.column_stack(line.get_data()) for line in axes.lines]
    return [line for line in lines if len(line) >= minimum]


def test_figure_4_line_is_k_f_squared(example: Any) -> None:
    upper, lower = draw_fig04(example.content).axes[:2]
    drawn = points(upper)
    assert len(drawn) == AIR
    (x0, x1), (y0, y1) = upper.lines[0].get_data()
    assert (x0, y0) == (0.0, 0.0)
    assert y1 / x1 == pytest.approx(example.content["hysteretic_coefficient"]["value"])
    assert np.max(np.abs(points(lower)[:, 1])) < 1.0
    assert "Hz²" in lower.get_xlabel()


def test_figure_6_history_term_lowers_q_tenfold_and_more(example: Any) -> None:
    axes = draw_fig06(example.content).axes[0]
    for steady, full in np.array(curves(axes)).reshape(2, 2, -1, 2):
        # 1 + a/delta is between 9 and 36 here; a decimal logarithm is drawn.
        assert np.all((steady - full)[:, 1] > 0.95)
        assert np.all((steady - full)[:, 1] < 1.6)
    assert len(points(axes)) == WATER


def test_figure_9_shows_the_drag_factor_below_the_theory(example: Any) -> None:
    upper, lower = draw_fig09(example.content).axes
    assert len(points(upper)) == len(points(lower)) == WATER
    ratio = points(lower)
    high = ratio[ratio[:, 0] > 0.8, 1]
    # In the high branch water does nearly all the damping: 1/1.117 is the ratio.
    assert high == pytest.approx(1 / 1.117, rel=0.02)


@pytest.mark.parametrize("draw", [draw_fig05, draw_fig06, draw_fig09, draw_fig10])
def test_without_theory_curves_there_is_nothing_to_draw(draw: Any, example: Any) -> None:
    with pytest.raises(NothingToDrawError):
        draw({**example.content, "curves": {}})


def test_refused_records_are_not_drawn(example: Any) -> None:
    records = [dict(entry) for entry in example.content["records"]]
    records[0] = {"record": "water-high-1", "refused": "no decay"}
    axes = draw_fig09({**example.content, "records": records}).axes[0]
    assert len(points(axes)) == WATER - 1
