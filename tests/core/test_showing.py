"""How results are shown and handed on: in notebooks, on axes, as arrays."""

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from pandas import DataFrame

import pendpipe as pp
from pendpipe.analysis.fit.result import FitResult
from pendpipe.arrays import FloatArray
from pendpipe.figures.style import ShownFigure

TIME = np.arange(0.0, 60.0, 0.02)
NOISE = 1e-4


def angle(time_s: FloatArray) -> FloatArray:
    return np.asarray(0.2 * np.exp(-0.02 * time_s) * np.cos(5.0 * time_s + 1.0))


@pytest.fixture(scope="module")
def fit() -> FitResult:
    noise = NOISE * np.random.default_rng(3).standard_normal(len(TIME))
    return pp.fit(TIME, angle(TIME) + noise, restoring="linear")


def test_arrays_degrees_and_a_dataframe_give_the_same_fit(fit: FitResult) -> None:
    assert fit.decay is not None
    values = fit.decay.values
    table = DataFrame({"time_s": fit.decay.time_s, "angle_rad": values})
    for source in (pp.Recording(time_s=fit.decay.time_s, angle_deg=np.degrees(values)), table):
        again = pp.fit(source, restoring="linear")
        assert again["b"].value == pytest.approx(fit["b"].value, rel=1e-6)
    with pytest.raises(pp.InputError, match="give columns time_s and one of"):
        pp.fit(table.rename(columns={"angle_rad": "x"}))


def test_the_prediction_is_the_motion_and_the_residual_the_noise(fit: FitResult) -> None:
    assert np.max(np.abs(fit.predict(TIME) - angle(TIME))) < 0.3 * NOISE
    assert np.std(fit.residual) == pytest.approx(NOISE, rel=0.05)
    # Times in any order.
    some = np.array([10.0, 2.0])
    assert fit.predict(some) == pytest.approx(angle(some), abs=NOISE)
    again = FitResult.from_json(fit.to_dict())
    with pytest.raises(pp.InputError, match="fit the recording anew"):
        again.predict([1.0])


def test_pictures_show_themselves_and_are_drawn_on_axes_of_others(fit: FitResult) -> None:
    picture = fit.plot()
    assert isinstance(picture, ShownFigure)
    assert picture._repr_png_().startswith(b"\x89PNG")
    own = Figure()
    axes = own.subplots()
    assert fit.plot(ax=axes) is own
    assert axes.get_xlabel() == "Time (s)"
    html = fit._repr_html_()
    assert "<table>" in html
    assert "Q = " in html


@pytest.mark.parametrize(
    ("option", "value"), [("method", "wavefrom"), ("restoring", "sin"), ("baseline", "eq9")]
)
def test_an_option_that_is_none_is_refused(option: str, value: str) -> None:
    asked: dict[str, Any] = {option: value}
    with pytest.raises(pp.InputError, match=f"{value}' is not a valid choice"):
        pp.fit(TIME, angle(TIME), **asked)


def test_the_help_begins_with_the_five_verbs() -> None:
    first = str(pp.__doc__).split(">>>", maxsplit=1)[0]
    assert all(f"`{verb}`" in first for verb in ("read", "fit", "diagnose", "simulate", "acquire"))
