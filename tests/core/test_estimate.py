"""A number with its error comes back from a result file as it went in."""

import json
import math
from dataclasses import asdict

import pytest

from pendpipe.estimate import Estimate, over
from pendpipe.files import finite


@pytest.mark.parametrize("form", [Estimate.as_json, asdict], ids=["as_json", "asdict"])
@pytest.mark.parametrize(
    ("interval", "kept"),
    [((2.0, 5.0), (2.0, 5.0)), ((2.0, math.inf), (2.0, math.nan)), (None, (1.04, 4.96))],
)
def test_an_open_interval_keeps_its_end(form, interval, kept) -> None:  # type: ignore[no-untyped-def]
    """A quality factor whose loss may be zero has a lower end only: no negative Q is believed."""
    written = Estimate(3.0, 1.0, "s", interval, at_bound=True)
    back = Estimate.from_json(json.loads(json.dumps(finite(form(written)))))
    assert (back.value, back.sd, back.unit, back.at_bound) == (3.0, 1.0, "s", True)
    assert back.bounds95 == pytest.approx(kept, abs=1e-3, nan_ok=True)


def test_what_could_not_be_estimated_is_nan() -> None:
    back = Estimate.from_json(finite(Estimate(math.nan, math.nan, "").as_json()))
    assert math.isnan(back.value)
    assert math.isnan(back.sd)
    assert str(back) == "–"


@pytest.mark.parametrize(
    ("low", "high", "quotient"),
    [(1.0, 4.0, (2.0, 8.0)), (1.0, math.inf, (0.0, 8.0)), (0.0, 4.0, (2.0, math.inf))],
)
def test_a_quotient_lies_between_those_by_the_ends(
    low: float, high: float, quotient: tuple[float, float]
) -> None:
    """Q of a rate: no loss can't be told from a Q without end, an endless loss has Q 0."""
    found = over(8.0, Estimate(2.0, 0.5, "1/s", (low, high)))
    assert (found.value, found.sd) == (4.0, 1.0)
    assert found.bounds95 == quotient
