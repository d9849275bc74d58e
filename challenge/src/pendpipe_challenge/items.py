"""Make the items of a set: each a recording, what is true of it, and the oracle's figures.

random = np.random.default_rng(1)
item = make_single(random, "cubic-stiffness", 100.0)
write_recording("recording.csv", item.scenario, item.codes)
item.truth["effects"][0]["delta_chi2"], item.truth["oracle"]["class"]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe_challenge.bench import Bench, Point
from pendpipe_challenge.catalogue import EFFECTS, MEASUREMENT, ONLY_VISCOUS, hide, kind_of
from pendpipe_challenge.hidden import OUTSIDE, Hidden
from pendpipe_challenge.oracle import Oracle, Verdict, refitted, shift_score
from pendpipe_challenge.scenario import Scenario, draw_scenario
from pendpipe_challenge.sizing import Sized, size


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


def about(bench: Bench, point: Point) -> Oracle:
    """The oracle about the baseline's best point, kept with the bench."""
    scenario = bench.scenario
    level = point.level_rad * scenario.chain.nominal_volts_per_radian
    there = replace(scenario, motion=point.motion, chain=scenario.chain.changed(offset_volts=level))
    return Oracle(Bench(there, bench.kept))


def judge(bench: Bench, point: Point, scenario: Scenario, codes: IntArray) -> Verdict:
    """The oracle's verdict on the recorded codes."""
    angle = scenario.chain.step_rad * codes.astype(np.float64)
    oracle = about(bench, point)
    residual = oracle.bench.residual(angle)
    more = {"dropped-samples": shift_score(bench, angle, residual)}
    if more["dropped-samples"] == 0.0:
        more |= refitted(oracle, angle, residual)
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


def truth_of(
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


def oracle_truth(verdict: Verdict, effect: str) -> dict[str, Any]:
    """The oracle's figures; the ten best scores are kept."""
    best = sorted(verdict.scores, key=lambda name: -verdict.scores[name])[:10]
    return {
        "threshold": verdict.threshold,
        "detected": verdict.detected,
        "largest_score": verdict.scores[best[0]],
        "score_of_effect": verdict.scores.get(effect),
        "named": verdict.ranking[0],
        "top3": list(verdict.ranking[:3]),
        "class": list(verdict.members),
        "scores": {name: verdict.scores[name] for name in best},
    }


TRIES = 40


def make_null(
    random: np.random.Generator,
    *,
    oracle: bool = False,
    scenario: Scenario | None = None,
    **scenario_options: Any,
) -> Item:
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
    random: np.random.Generator,
    effect: str,
    delta_chi2: float,
    *,
    own_form: bool | None = None,
    oracle: bool = True,
    **scenario_options: Any,
) -> Item:
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
    random: np.random.Generator,
    effect: str,
    delta_chi2: float,
    *,
    own_form: bool | None = None,
    **scenario_options: Any,
) -> Sized:
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


OWN_LEVEL = 13.0
"""Where the oracle counts one of two known effects as found: 1 % for an effect without scan."""


def make_pair(
    random: np.random.Generator,
    first: str,
    second: str,
    delta_chi2: tuple[float, float],
    *,
    cancelling: bool = False,
    marginal: bool = False,
    own_form: bool | None = None,
    oracle: bool = True,
    **scenario_options: Any,
) -> Item:
    """Hide two effects at once.

    ``marginal_delta_chi2`` of each is what is left of it when the other one is known.

    Parameters
    ----------
    delta_chi2
        Of each alone.
    cancelling
        Give the second effect the sign that hides the first, where it has a sign.
    marginal
        Size each by its marginal Delta chi^2 instead (approximately).
    own_form
        Ask for laws that are (or are not) the catalogue's own.
    """
    for _ in range(TRIES):
        found = _draw(random, first, second, delta_chi2, own_form, easier(scenario_options))
        if found is None:
            continue
        prepared, a, b, inner = found
        cosine = inner / np.sqrt(a.delta_chi2 * b.delta_chi2)
        if marginal:
            share = 1.0 - min(cosine**2, 0.999)
            more = size(a.hidden, delta_chi2[0] / share)
            other = size(b.hidden, delta_chi2[1] / share)
            if more is None or other is None:
                continue
            a, b = more, other
        strength = -b.strength if cancelling and inner > 0 else b.strength
        scenario = b.hidden.build(a.hidden.build(prepared, a.strength), strength)
        bench = a.bench if a.bench.count <= b.bench.count else b.bench
        point, _, total = bench.refit(scenario.reading_rad(np.random.default_rng(0)))
        if not np.isfinite(total):
            continue
        codes = scenario.record(random)
        effects = [effect_truth(a), effect_truth(b)]
        effects[1]["parameters"] = b.hidden.truth(strength)
        for entry in effects:
            entry["marginal_delta_chi2"] = entry["delta_chi2"] * (1.0 - cosine**2)
        truth = truth_of("combination", bench.scenario, effects, bench)
        truth |= {"cosine": cosine, "total_delta_chi2": total, "cancelling": cancelling}
        if oracle:
            truth["oracle"] = oracle_truth(judge(bench, point, scenario, codes), first)
            both = _found(bench, point, scenario.chain.step_rad * codes.astype(np.float64), a, b)
            truth["oracle"]["found_each"] = both
        return Item(scenario, codes, truth)
    raise ValueError(f"{first} with {second} can't be made at {delta_chi2}")


def _draw(
    random: np.random.Generator,
    first: str,
    second: str,
    wanted: tuple[float, float],
    own_form: bool | None,
    options: dict[str, Any],
) -> tuple[Scenario, Sized, Sized, float] | None:
    """Size each alone on the same pendulum.

    Returns
    -------
    prepared, first, second, product
        What both need, each at its strength, and the inner product of what they leave.
    """
    drawn: Scenario = draw_scenario(random, **options)
    one = hide(random, first, drawn, own_form=own_form)
    two = hide(random, second, one.prepared, own_form=own_form)
    # What the second needs (a release from rest, say) holds for the first as well.
    one = replace(one, prepared=two.prepared)
    if one.moves and two.moves:
        return None
    # An effect whose strength is the amplitude itself decides where the other one is sized.
    a = None if two.moves else size(one, wanted[0])
    b = size(replace(two, prepared=a.without) if a and one.moves else two, wanted[1])
    if two.moves and b is not None:
        a = size(replace(one, prepared=b.without), wanted[0])
    if a is None or b is None:
        return None
    count = min(len(a.residual), len(b.residual))
    return two.prepared, a, b, float(a.residual[:count] @ b.residual[:count])


def _found(bench: Bench, point: Point, angle: FloatArray, a: Sized, b: Sized) -> list[bool]:
    """Whether each is significant when the other one is fitted too."""
    noisy = bench.whiten((angle - bench.reading(point))[bench.kept])
    answers = []
    for own, other in ((a.residual, b.residual), (b.residual, a.residual)):
        own, other = own[: bench.count], other[: bench.count]
        size_other = float(other @ other)
        left = own - other * (float(own @ other) / size_other if size_other > 0.0 else 0.0)
        length = float(np.linalg.norm(left))
        score = float(left @ noisy / length) ** 2 if length > 0.0 else 0.0
        answers.append(score > OWN_LEVEL)
    return answers


def make_outside(
    random: np.random.Generator,
    name: str,
    delta_chi2: float,
    *,
    oracle: bool = True,
    **scenario_options: Any,
) -> Item:
    """Hide what the catalogue does not have, sized by what its best entry leaves of it.

    Parameters
    ----------
    name
        A key of `hidden.OUTSIDE` (``magnet-near-centre``, ``rough-spot``, ...).
    delta_chi2
        Delta chi^2 that no single entry of the catalogue can take up
        (``left_by_catalogue``); ``delta_chi2`` of the truth is the whole effect's.
    """
    for _ in range(TRIES):
        hidden = hide(random, name, draw_scenario(random, **easier(scenario_options)))
        found = _size_by_rest(hidden, delta_chi2)
        if found is None:
            continue
        sized, rest, mimic = found
        codes = sized.scenario.record(random)
        entry = effect_truth(sized) | {"left_by_catalogue": rest, "best_mimic": mimic}
        truth = truth_of("outside", sized.without, [entry], sized.bench)
        if oracle:
            verdict = judge(sized.bench, sized.point, sized.scenario, codes)
            truth["oracle"] = oracle_truth(verdict, hidden.effect)
        return Item(sized.scenario, codes, truth)
    raise ValueError(f"{name} can't be made at {delta_chi2}")


def outside_names() -> tuple[str, ...]:
    """What `make_outside` can hide."""
    return tuple(OUTSIDE)


def _size_by_rest(hidden: Hidden, wanted: float) -> tuple[Sized, float, str] | None:
    """Size by what the best catalogue entry leaves of a noise-free reading."""
    whole = 2.0 * wanted
    for _ in range(5):
        sized = size(hidden, whole)
        if sized is None:
            return None
        scores = about(sized.bench, sized.point).clean_scores(sized.residual)
        mimic = max(scores, key=lambda name: scores[name])
        rest = sized.delta_chi2 - scores[mimic]
        if abs(rest / wanted - 1.0) < 0.15:
            return sized, rest, mimic
        whole *= float(np.clip(wanted / max(rest, 1e-3), 0.02, 30.0))
        if whole > 1e6:
            return None
    return None


SIZES: Final = (4.0, 9.0, 16.0, 25.0, 50.0, 100.0, 400.0, 2500.0)
SHARES: Final = {
    "null": 0.34,
    "single": 0.33,
    "combination": 0.08,
    "tie": 0.05,
    "outside": 0.12,
    "withheld": 0.08,
}
"""Of a set; what rounding leaves goes to the nulls."""
WITHOUT_STRENGTH: Final = frozenset({"dropped-samples", "coarse-quantisation", "coloured-noise"})
PAIRS: Final = (
    ("cubic-stiffness", "tone-pickup", False),
    ("circular-error", "glitches", False),
    ("equilibrium-step", "sensor-quadratic", False),
    ("history-force", "clock-drift", False),
    ("frequency-step", "offset-drift", False),
    ("release-transient", "sensor-cubic", False),
    ("second-mode", "jitter", False),
    ("impulse", "cubic-damping", False),
    ("cubic-stiffness", "frequency-drift", True),
    ("sensor-cubic", "cubic-damping", True),
    ("damping-drift", "gain-drift", True),
    ("plane-coupling", "frequency-step", True),
)
"""First, second, whether the second is to hide the first."""
PAIR_SIZES: Final = ((50.0, 50.0), (400.0, 25.0), (400.0, 400.0))
TIES: Final = (
    "equilibrium-creep",
    "offset-drift",
    "periodic-drive",
    "tone-pickup",
    "clock-drift",
    "frequency-drift",
    "damping-drift",
    "power-law-damping",
)
"""Effects that one record can hardly tell from a rival."""


def plan(count: int, random: np.random.Generator) -> list[dict[str, Any]]:
    """What each item of a set hides, in an order that gives nothing away.

    Parameters
    ----------
    count
        Items of the set.
    random
        Shuffles, and deals the instrument's share of the singles.
    """
    number = {name: int(share * count) for name, share in SHARES.items()}
    number["null"] += count - sum(number.values())
    recipes: list[dict[str, Any]] = [{"family": "null"} for _ in range(number["null"])]
    recipes += _singles(number["single"], random)
    for i in range(number["combination"]):
        first, second, cancelling = PAIRS[i % len(PAIRS)]
        recipes.append(
            {
                "family": "combination",
                "effects": [first, second],
                "cancelling": cancelling,
                "delta_chi2": list(PAIR_SIZES[(i // len(PAIRS) + i) % len(PAIR_SIZES)]),
            }
        )
    for i in range(number["tie"]):
        size = (50.0, 100.0, 400.0)[i % 3]
        recipes.append({"family": "tie", "effects": [TIES[i % len(TIES)]], "delta_chi2": [size]})
    names = outside_names()
    for i in range(number["outside"]):
        size = (25.0, 100.0, 100.0, 400.0)[(i // len(names)) % 4]
        recipes.append(
            {"family": "outside", "effects": [names[i % len(names)]], "delta_chi2": [size]}
        )
    for i in range(number["withheld"]):
        effect = ("circular-error", "coulomb-friction", "quadratic-drag")[i % 3]
        recipes.append({"family": "withheld", "effects": [effect], "delta_chi2": [1e4]})
    random.shuffle(recipes)
    return recipes


def _singles(count: int, random: np.random.Generator) -> list[dict[str, Any]]:
    """Two in five singles are faults of the instrument; sizes go round."""
    usual = [e for e in EFFECTS if e not in ("coloured-noise",)]
    faults = [e for e in usual if e in MEASUREMENT]
    physics = [e for e in usual if e not in MEASUREMENT]
    random.shuffle(faults)
    random.shuffle(physics)
    found = []
    for i in range(count):
        fault = i % 5 < 2
        pool = faults if fault else physics
        at = 2 * (i // 5) + i % 5 if fault else 3 * (i // 5) + i % 5 - 2
        effect = pool[at % len(pool)]
        # Each effect meets the sizes in turn, beginning anywhere.
        size = SIZES[(at // len(pool) * 3 + at) % len(SIZES)]
        own = None if at % 2 else False
        found.append(
            {"family": "single", "effects": [effect], "delta_chi2": [size], "own_form": own}
        )
    return found


def make_item(recipe: dict[str, Any], random: np.random.Generator) -> Item:
    """Make a synthetic item; a size that nothing drawn can show is made smaller, or larger.

    A fault of whole codes may be nothing, or more than was asked.
    """
    family = recipe["family"]
    if family == "null":
        return make_null(random, oracle=True)
    effects, sizes = recipe["effects"], recipe["delta_chi2"]
    for factor in (1.0, 0.25, 0.06, 0.02, 4.0, 16.0, 64.0):
        try:
            item = _made(family, effects, [factor * size for size in sizes], recipe, random)
        except ValueError:
            continue
        item.truth["family"] = family
        item.truth["wanted_delta_chi2"] = sizes
        return item
    raise ValueError(f"no pendulum can show {effects} ({family})")


def _made(
    family: str,
    effects: list[str],
    sizes: list[float],
    recipe: dict[str, Any],
    random: np.random.Generator,
) -> Item:
    if family == "combination":
        return make_pair(
            random, effects[0], effects[1], (sizes[0], sizes[1]), cancelling=recipe["cancelling"]
        )
    if family == "outside":
        return make_outside(random, effects[0], sizes[0])
    return make_single(random, effects[0], sizes[0], own_form=recipe.get("own_form"))
