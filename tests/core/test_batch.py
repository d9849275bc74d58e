"""Many recordings are fitted side by side as each would be alone, and in their order."""

from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest

import pendpipe as pp
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
