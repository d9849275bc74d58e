"""Make one item: a recording and the truth about it, with the oracle's figures.

    random = np.random.default_rng(1)
    item = make_single(random, "cubic-stiffness", 100.0)
    write_recording("recording.csv", item.scenario, item.codes)
    item.truth["effects"][0]["delta_chi2"], item.truth["oracle"]["class"]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.challenge.bench import Bench, Point
from pendpipe.challenge.hidden import OUTSIDE, Hidden
from pendpipe.challenge.oracle import Oracle, Verdict
from pendpipe.challenge.registry import ONLY_VISCOUS, hide, kind_of
from pendpipe.challenge.scenario import Scenario, draw_scenario
from pendpipe.challenge.shifted import shift_score
from pendpipe.challenge.sizing import Sized, size

TRIES = 40


@dataclass(frozen=True)
class Item:
    """One recording (codes of `scenario`'s converter) and what is true of it.

    Parameters
    ----------
    scenario
        Everything that made it; its chain, interval and count make the file.
    codes
        The converter's codes, shape (samples,).
    truth
        ``family``, ``baseline``, ``effects`` (see `effect_truth`), ``nuisances``,
        ``oracle`` (None where it was not asked).
    """

    scenario: Scenario
    codes: IntArray
    truth: dict[str, Any]

    @property
    def volts(self) -> FloatArray:
        """The readings as the file has them."""
        return np.asarray(self.codes * self.scenario.chain.step_volts)

    @property
    def angle_rad(self) -> FloatArray:
        """The readings by the nominal V/rad."""
        return self.volts / self.scenario.chain.nominal_volts_per_radian


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
    truth = _truth("null", scenario, [], bench)
    if oracle:
        truth["oracle"] = _oracle_truth(_judge(bench, bench.truth, scenario, codes), "")
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
    truth = _truth("single", sized.without, [effect_truth(sized)], sized.bench)
    if oracle:
        verdict = _judge(sized.bench, sized.point, sized.scenario, codes)
        truth["oracle"] = _oracle_truth(verdict, effect)
    return Item(sized.scenario, codes, truth)


def make_pair(
    random: np.random.Generator, first: str, second: str, delta_chi2: tuple[float, float], *,
    cancelling: bool = False, oracle: bool = True, **scenario_options: Any,
) -> Item:  # fmt: skip
    """Two effects at once, each sized alone; ``marginal_delta_chi2`` is what is left of each
    when the other one is known.

    Parameters
    ----------
    cancelling
        Give the second effect the sign that hides the first, where it has a sign.
    """
    for _ in range(TRIES):
        drawn = draw_scenario(random, **_easier(scenario_options))
        one = hide(random, first, drawn)
        two = hide(random, second, one.prepared)
        if two.prepared.baseline != one.prepared.baseline:
            one = replace(one, prepared=two.prepared)
        a = size(replace(one, prepared=two.prepared), delta_chi2[0])
        b = size(two, delta_chi2[1]) if a is not None else None
        if a is None or b is None:
            continue
        count = min(len(a.residual), len(b.residual))
        inner = float(a.residual[:count] @ b.residual[:count])
        strength = -b.strength if cancelling and inner > 0 else b.strength
        scenario = two.build(one.build(two.prepared, a.strength), strength)
        bench = a.bench if a.bench.count <= b.bench.count else b.bench
        point, residual, total = bench.refit(scenario.reading_rad(np.random.default_rng(0)))
        if not np.isfinite(total):
            continue
        codes = scenario.record(random)
        effects = [effect_truth(a), effect_truth(b)]
        effects[1]["parameters"] = two.truth(strength)
        cosine = inner / np.sqrt((a.residual @ a.residual) * (b.residual @ b.residual) + 1e-300)
        for entry in effects:
            entry["marginal_delta_chi2"] = entry["delta_chi2"] * (1.0 - cosine**2)
        truth = _truth("combination", two.prepared, effects, bench)
        truth |= {"cosine": cosine, "total_delta_chi2": total, "cancelling": cancelling}
        if oracle:
            truth["oracle"] = _oracle_truth(_judge(bench, point, scenario, codes), first)
        return Item(scenario, codes, truth)
    raise ValueError(f"{first} with {second} can't be made at {delta_chi2}")


def make_outside(
    random: np.random.Generator, name: str, delta_chi2: float, *, oracle: bool = True,
    **scenario_options: Any,
) -> Item:  # fmt: skip
    """Something that the catalogue does not have, sized by what is left of it after the best
    catalogue entry.

    Parameters
    ----------
    name
        A key of `hidden.OUTSIDE` (``magnet-near-centre``, ``rough-spot``, ...).
    delta_chi2
        Delta chi^2 that no single entry of the catalogue can take up
        (``left_by_catalogue``); ``delta_chi2`` of the truth is the whole effect's.
    """
    for _ in range(TRIES):
        hidden = hide(random, name, draw_scenario(random, **_easier(scenario_options)))
        found = _size_by_rest(hidden, delta_chi2)
        if found is None:
            continue
        sized, rest, mimic = found
        codes = sized.scenario.record(random)
        entry = effect_truth(sized) | {"left_by_catalogue": rest, "best_mimic": mimic}
        truth = _truth("outside", sized.without, [entry], sized.bench)
        if oracle:
            verdict = _judge(sized.bench, sized.point, sized.scenario, codes)
            truth["oracle"] = _oracle_truth(verdict, hidden.effect)
        return Item(sized.scenario, codes, truth)
    raise ValueError(f"{name} can't be made at {delta_chi2}")


def outside_names() -> tuple[str, ...]:
    """What `make_outside` can hide."""
    return tuple(OUTSIDE)


def draw_sized(
    random: np.random.Generator, effect: str, delta_chi2: float, *,
    own_form: bool | None = None, **scenario_options: Any,
) -> Sized:  # fmt: skip
    """Draw pendulums until one can show the effect at the wanted size."""
    options = scenario_options if effect not in ONLY_VISCOUS else {
        **scenario_options, "stop": scenario_options.get("stop", False)
    }
    for turn in range(TRIES):
        drawn = draw_scenario(random, **(options if turn < TRIES // 3 else _easier(options)))
        sized = size(hide(random, effect, drawn, own_form=own_form), delta_chi2)
        if sized is not None:
            return sized
    raise ValueError(f"{effect} can't be made at Delta chi^2 {delta_chi2}")


def _easier(options: dict[str, Any]) -> dict[str, Any]:
    """Fine steps and a wide swing: what hard effects need to be seen at all."""
    return {"bits": 16, "stop": False, **options}


def _size_by_rest(hidden: Hidden, wanted: float) -> tuple[Sized, float, str] | None:
    """Size by what the best catalogue entry leaves of a noise-free reading."""
    whole = 2.0 * wanted
    for _ in range(5):
        sized = size(hidden, whole)
        if sized is None:
            return None
        scores = _about(sized.bench, sized.point).clean_scores(sized.residual)
        mimic = max(scores, key=lambda name: scores[name])
        rest = sized.delta_chi2 - scores[mimic]
        if abs(rest / wanted - 1.0) < 0.15:
            return sized, rest, mimic
        whole *= float(np.clip(wanted / max(rest, 1e-3), 0.02, 30.0))
        if whole > 1e6:
            return None
    return None


def _about(bench: Bench, point: Point) -> Oracle:
    """The oracle about the baseline's best point, kept with the bench."""
    scenario = bench.scenario
    level = point.level_rad * scenario.chain.nominal_volts_per_radian
    there = replace(
        scenario, motion=point.motion, chain=scenario.chain.changed(offset_volts=level)
    )
    return Oracle(Bench(there, bench.kept))


def _judge(bench: Bench, point: Point, scenario: Scenario, codes: IntArray) -> Verdict:
    """The oracle's verdict on the recorded codes."""
    angle = codes * scenario.chain.step_rad
    oracle = _about(bench, point)
    residual = oracle.bench.residual(angle)
    more = {"dropped-samples": shift_score(bench, angle, residual)}
    return oracle.judge(residual, codes, more)


def effect_truth(sized: Sized) -> dict[str, Any]:
    """What is true of one effect."""
    hidden = sized.hidden
    return {
        "effect": hidden.effect,
        "also": list(hidden.also),
        "law": hidden.law,
        "kind": kind_of(hidden.effect),
        "own_form": hidden.own_form,
        "delta_chi2": sized.delta_chi2,
        "parameters": hidden.truth(sized.strength),
    }


def _truth(
    family: str, without: Scenario, effects: list[dict[str, Any]], bench: Bench
) -> dict[str, Any]:
    """The truth in plain numbers."""
    motion, noise, chain = without.motion, without.noise, without.chain
    omega = without.omega
    kept_s = float(without.time_s[bench.kept][-1])
    return {
        "family": family,
        "baseline": without.baseline,
        "effects": effects,
        "nuisances": {
            "frequency_hz": omega / (2 * np.pi),
            "amplitude_rad": float(np.hypot(motion.angle_rad, motion.rate_rad_s / omega)),
            "a": 2.0 / np.pi * omega * motion.value("quadratic"),
            "b": 0.5 * motion.value("gamma") + 2.0 / np.pi * motion.value("hysteretic"),
            "c": 2.0 / np.pi * motion.value("coulomb") / omega,
            "offset_rad": chain.offset_volts / chain.nominal_volts_per_radian,
            "gain": chain.volts_per_radian / chain.nominal_volts_per_radian,
            "white_sd_rad": noise.white_sd,
            "step_rad": chain.step_rad,
            "alpha": noise.alpha,
            "freedom": noise.freedom,
            "samples": without.samples,
            "judged_until_s": kept_s,
            "stops": kept_s < without.span_s - 2.0 * without.interval_s,
        },
        "oracle": None,
    }


def _oracle_truth(verdict: Verdict, effect: str) -> dict[str, Any]:
    """The oracle's figures; the ten best scores are kept."""
    best = sorted(verdict.scores, key=lambda name: -verdict.scores[name])[:10]
    return {
        "threshold": verdict.threshold,
        "threshold_of_effect": verdict.threshold_by_effect.get(effect),
        "detected": verdict.detected,
        "detected_by_effect": verdict.detected_by_effect,
        "largest_score": verdict.scores[best[0]],
        "score_of_effect": verdict.scores.get(effect),
        "named": verdict.ranking[0],
        "top3": list(verdict.ranking[:3]),
        "class": list(verdict.members),
        "scores": {name: verdict.scores[name] for name in best},
    }
