"""Fits of one recording and of many: taken in order, shown, and handed on."""

from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from pandas import DataFrame

import pendpipe as pp
from pendpipe.analysis.fit.result import FitResult
from pendpipe.arrays import FloatArray
from pendpipe.figures.style import ShownFigure
from pendpipe.process import _AHEAD


def decay(number: int) -> pp.Recording:
    """A decay of some 70 swings whose damping rate names it."""
    time_s = np.arange(2048) / 30.0
    noise = 1e-4 * np.random.default_rng(number).standard_normal(len(time_s))
    swing = 0.1 * np.exp(-0.004 * number * time_s) * np.cos(6.0 * time_s)
    return pp.Recording(time_s=time_s, angle_rad=swing + noise)


REST = pp.Recording(time_s=np.arange(500) / 30.0, angle_rad=np.zeros(500))


@pytest.mark.parametrize("processes", [1, 2])
def test_fits_come_in_the_order_of_the_recordings_and_an_error_in_its_place(
    processes: int,
) -> None:
    given = [decay(1), "no such file.csv", decay(2), REST, decay(3)]
    results = list(pp.fit_many(given, processes=processes))
    for recording, result in zip(given, results, strict=True):
        if isinstance(recording, pp.Recording) and recording is not REST:
            assert not isinstance(result, pp.InputError)
            assert result.to_dict() == pp.fit(recording).to_dict()
    assert isinstance(results[1], pp.InputError)
    assert results[1].place == "no such file.csv"
    assert isinstance(results[3], pp.InputError)
    assert results[3].place.startswith("recording 4")


@pytest.mark.parametrize("processes", [1, 2])
def test_recordings_are_read_as_their_fits_are_taken(processes: int) -> None:
    """A generator of any length: what is in memory depends on the processes alone."""
    read = 0

    def recordings() -> Iterator[pp.Recording]:
        nonlocal read
        for _ in range(10**6):
            read += 1
            yield decay(1)

    fits = pp.fit_many(recordings(), processes=processes)
    for taken, _ in enumerate(islice(fits, 6), start=1):
        assert read <= taken + _AHEAD * processes
    assert isinstance(fits, Iterator)
    fits.close()  # type: ignore[attr-defined]


def test_options_are_those_of_a_fit_and_a_bar_counts(capsys: pytest.CaptureFixture[str]) -> None:
    (held,) = pp.fit_many([decay(2)], processes=1, fixed={"c": 0.0})
    assert not isinstance(held, pp.InputError)
    assert held["c"].value == 0.0
    assert not capsys.readouterr().err, "no terminal, no bar"
    list(pp.fit_many([decay(1)] * 2, processes=1, progress=True))
    assert "2/2" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "value"), [("processes", 0), ("name", "mine")])
def test_what_makes_no_sense_is_refused_before_a_recording_is_read(
    option: str, value: object
) -> None:
    def unread() -> Iterator[pp.Recording]:
        raise AssertionError
        yield

    with pytest.raises(pp.InputError, match=option):
        pp.fit_many(unread(), **{option: value})  # type: ignore[arg-type]


TIME = np.arange(0.0, 60.0, 0.02)
NOISE = 1e-4


def angle(time_s: FloatArray) -> FloatArray:
    return np.asarray(0.2 * np.exp(-0.02 * time_s) * np.cos(5.0 * time_s + 1.0))


@pytest.fixture(scope="module")
def fit() -> FitResult:
    noise = NOISE * np.random.default_rng(3).standard_normal(len(TIME))
    return pp.fit(TIME, angle(TIME) + noise, restoring="linear")


def test_arrays_degrees_and_a_dataframe_give_the_same_fit(fit: FitResult) -> None:
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
