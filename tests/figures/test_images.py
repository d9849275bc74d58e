"""Figures against images that were looked at (`pytest --mpl-generate-path=tests/figures/baseline`).

They change where a figure does: look at the new image before it is committed.
"""

from typing import Any

import pytest
from matplotlib.figure import Figure

from pendpipe.figures.campaign import (
    draw_fig03,
    draw_fig04,
    draw_fig05,
    draw_fig06,
    draw_fig09,
    draw_fig10,
)
from pendpipe.figures.decays import draw_decay, draw_fig08, read_decay

looked_at = pytest.mark.mpl_image_compare(
    style="default", tolerance=1, savefig_kwargs={"dpi": 50}, baseline_dir="baseline"
)


@looked_at
@pytest.mark.parametrize(
    "draw", [draw_fig04, draw_fig05, draw_fig06, draw_fig09, draw_fig10], ids=lambda f: f.__name__
)
def test_of_the_campaign(example: Any, draw: Any) -> Figure:
    return draw(example.content)


@looked_at
def test_of_the_sensor(example: Any) -> Figure:
    return draw_fig03(example.content["calibration"])


@looked_at
@pytest.mark.parametrize("draw", [draw_decay, draw_fig08], ids=lambda f: f.__name__)
def test_of_a_decay(example: Any, draw: Any) -> Figure:
    (entry,) = (each for each in example.content["records"] if each["record"] == "water-low-7")
    return draw(read_decay(example.folder, entry))
