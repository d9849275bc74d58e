"""A number with its error comes back from a result file as it went in."""

import json
import math
from dataclasses import asdict

import numpy as np
import pytest

from pendpipe.estimate import Estimate, averaged, over
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


def test_two_descriptions_share_a_quantity_as_draws_from_both_would() -> None:
    """Value, error and interval are those of a sample, nine tenths of it from the first."""
    one, other = Estimate(1.0, 0.1, "s"), Estimate(2.0, 0.3, "s")
    draw = np.random.default_rng(1)
    drawn = np.concatenate([draw.normal(1.0, 0.1, 900_000), draw.normal(2.0, 0.3, 100_000)])
    found = averaged([one, other], [0.45, 0.05])
    assert found.value == pytest.approx(drawn.mean(), abs=2e-3)
    assert found.sd == pytest.approx(drawn.std(), rel=5e-3)
    assert found.bounds95 == pytest.approx(np.quantile(drawn, [0.025, 0.975]), abs=1e-2)
    assert averaged([one], [0.3]) is one


def test_the_average_of_what_cannot_be_negative_is_not() -> None:
    """Two descriptions without dry friction, one with little: no interval begins below zero."""
    none, little = Estimate(0.0, 1e-3, "", (0.0, 2e-3), True), Estimate(1e-3, 1e-3, "", (0.0, 3e-3))
    found = averaged([none, none, little], [0.4, 0.4, 0.2])
    assert found.bounds95[0] == 0.0
    assert found.or_limit().startswith("<")
    assert found.value < found.bounds95[1] < 3e-3
    assert not found.at_bound
    assert averaged([none, none], [0.5, 0.5]).at_bound
