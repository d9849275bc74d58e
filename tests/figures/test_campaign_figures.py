"""Figures 3 to 6, 9 and 10 draw the campaign's numbers, and the physics shows in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from pendpipe.figures.campaign import (
    draw_fig03,
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


def test_figure_3_draws_every_position_and_the_fitted_slope(example: Any) -> None:
    figure = draw_fig03(example.content["calibration"])
    upper, lower = figure.axes
    assert len(points(upper)) == len(points(lower)) == 25
    (x0, x1), (y0, y1) = upper.lines[0].get_data()
    slope = (y1 - y0) / ((x1 - x0) * 1e-3)
    assert slope == pytest.approx(example.content["calibration"]["volts_per_radian"]["value"])
    assert lower.get_xlabel() == "Angle (mrad)"
    assert upper.get_ylabel() == "Sensor output (V)"
    assert "(mV)" in lower.get_ylabel()


def test_figure_3_residual_is_data_minus_line(example: Any) -> None:
    calibration = example.content["calibration"]
    raised = {**calibration, "points": [dict(p) for p in calibration["points"]]}
    raised["points"][3]["volts"] += 0.01
    before, after = (points(draw_fig03(c).axes[1])[3, 1] for c in (calibration, raised))
    assert after - before == pytest.approx(10.0)


def test_figure_4_line_is_k_f_squared(example: Any) -> None:
    upper, lower = draw_fig04(example.content).axes[:2]
    drawn = points(upper)
    assert len(drawn) == AIR
    (x0, x1), (y0, y1) = upper.lines[0].get_data()
    assert (x0, y0) == (0.0, 0.0)
    assert y1 / x1 == pytest.approx(example.content["hysteretic_coefficient"]["value"])
    assert np.max(np.abs(points(lower)[:, 1])) < 1.0
    assert "Hz²" in lower.get_xlabel()


def test_figure_5_both_causes_together_exceed_each(example: Any) -> None:
    axes = draw_fig05(example.content).axes[0]
    buoyancy, added, both = curves(axes)[:3]
    assert np.all(both[:, 1] > np.maximum(buoyancy[:, 1], added[:, 1]))
    assert axes.get_ylabel().endswith("(%)")


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


def test_figure_10_leaves_hysteresis_out_in_red_and_overestimates(example: Any) -> None:
    axes = draw_fig10(example.content).axes[0]
    drawn = [line for line in axes.lines if len(line.get_xdata()) >= 30]
    for full, viscous in zip(drawn[0::2], drawn[1::2], strict=True):
        assert np.all(viscous.get_ydata() > full.get_ydata())
        red, green, blue = to_rgb(viscous.get_color())
        assert red > 2 * max(green, blue)
    assert len(points(axes)) == WATER


@pytest.mark.parametrize("draw", [draw_fig05, draw_fig06, draw_fig09, draw_fig10])
def test_without_theory_curves_there_is_nothing_to_draw(draw: Any, example: Any) -> None:
    with pytest.raises(NothingToDrawError):
        draw({**example.content, "curves": {}})


def test_refused_records_are_not_drawn(example: Any) -> None:
    records = [dict(entry) for entry in example.content["records"]]
    records[0] = {"record": "water-high-1", "refused": "no decay"}
    axes = draw_fig09({**example.content, "records": records}).axes[0]
    assert len(points(axes)) == WATER - 1
