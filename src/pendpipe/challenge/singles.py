"""Recordings with nothing hidden, and with one effect."""

from __future__ import annotations

from typing import Any

import numpy as np

from pendpipe.challenge.bench import Bench
from pendpipe.challenge.item import Item, effect_truth, judge, oracle_truth, truth_of
from pendpipe.challenge.registry import ONLY_VISCOUS, hide
from pendpipe.challenge.scenario import Scenario, draw_scenario
from pendpipe.challenge.sizing import Sized, size

TRIES = 40


def make_null(
    random: np.random.Generator, *, oracle: bool = False, scenario: Scenario | None = None,
    **scenario_options: Any,
) -> Item:  # fmt: skip
    """A recording of Eq. 8 and nothing more, of any amplitude, Q, noise colour and stop.

    Parameters
    ----------
    random
        Everything is drawn from it.
    oracle
        Whether the oracle judges it too (a second or two).
    scenario, scenario_options
        A given pendulum, or options of `scenario.draw_scenario` (``stop=True``, ``bits=12``,
        ``amplitude_rad=0.05``, ``colour=False``).
    """
    scenario = scenario or draw_scenario(random, **scenario_options)
    codes = scenario.record(random)
    bench = Bench(scenario)
    truth = truth_of("null", scenario, [], bench)
    if oracle:
        truth["oracle"] = oracle_truth(judge(bench, bench.truth, scenario, codes), "")
    return Item(scenario, codes, truth)


def make_single(
    random: np.random.Generator, effect: str, delta_chi2: float, *,
    own_form: bool | None = None, oracle: bool = True, **scenario_options: Any,
) -> Item:  # fmt: skip
    """A recording with one effect of the catalogue at a wanted oracle's Delta chi^2.

    ``coulomb-friction`` and ``quadratic-drag`` are made for the ``viscous`` baseline (see
    ``truth["baseline"]``). ``dropped-samples``, ``coarse-quantisation`` and
    ``coloured-noise`` have no strength: their Delta chi^2 is what it is.

    Raises
    ------
    ValueError
        When no drawn pendulum could show the effect at that size.
    """
    sized = draw_sized(random, effect, delta_chi2, own_form=own_form, **scenario_options)
    codes = sized.scenario.record(random)
    truth = truth_of("single", sized.without, [effect_truth(sized)], sized.bench)
    if oracle:
        verdict = judge(sized.bench, sized.point, sized.scenario, codes)
        truth["oracle"] = oracle_truth(verdict, effect)
    return Item(sized.scenario, codes, truth)


def draw_sized(
    random: np.random.Generator, effect: str, delta_chi2: float, *,
    own_form: bool | None = None, **scenario_options: Any,
) -> Sized:  # fmt: skip
    """Draw pendulums until one can show the effect at the wanted size."""
    options = (
        scenario_options
        if effect not in ONLY_VISCOUS
        else {**scenario_options, "stop": scenario_options.get("stop", False)}
    )
    for turn in range(TRIES):
        drawn = draw_scenario(random, **(options if turn < TRIES // 3 else easier(options)))
        sized = size(hide(random, effect, drawn, own_form=own_form), delta_chi2)
        if sized is not None:
            return sized
    raise ValueError(f"{effect} can't be made at Delta chi^2 {delta_chi2}")


def easier(options: dict[str, Any]) -> dict[str, Any]:
    """Fine steps and a wide swing: what hard effects need to be seen at all."""
    return {"bits": 16, "stop": False, **options}
