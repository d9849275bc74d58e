"""The families of a set: how many items of each, and what each hides."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pendpipe.challenge.items import (
    Item,
    make_null,
    make_outside,
    make_pair,
    make_single,
    outside_names,
)
from pendpipe.challenge.registry import EFFECTS, MEASUREMENT

SIZES: Final = (4.0, 9.0, 16.0, 25.0, 50.0, 100.0, 400.0, 2500.0)
SHARES: Final = {
    "null": 0.34, "single": 0.33, "combination": 0.08, "tie": 0.05, "outside": 0.10,
    "withheld": 0.05, "real": 0.05,
}  # fmt: skip
"""Of a set; what rounding leaves goes to the nulls."""
WITHOUT_STRENGTH: Final = frozenset({"dropped-samples", "coarse-quantisation", "coloured-noise"})
PAIRS: Final = (
    ("cubic-stiffness", "tone-pickup", False), ("circular-error", "glitches", False),
    ("equilibrium-step", "sensor-quadratic", False), ("history-force", "clock-drift", False),
    ("frequency-step", "offset-drift", False), ("release-transient", "sensor-cubic", False),
    ("second-mode", "jitter", False), ("impulse", "cubic-damping", False),
    ("cubic-stiffness", "frequency-drift", True), ("sensor-cubic", "cubic-damping", True),
    ("damping-drift", "gain-drift", True), ("plane-coupling", "frequency-step", True),
)  # fmt: skip
"""First, second, whether the second is to hide the first."""
PAIR_SIZES: Final = ((50.0, 50.0), (400.0, 25.0), (400.0, 400.0))
TIES: Final = (
    "equilibrium-creep", "offset-drift", "periodic-drive", "tone-pickup", "clock-drift",
    "frequency-drift", "damping-drift", "power-law-damping",
)  # fmt: skip
"""Effects that one record can hardly tell from a rival."""


def plan(count: int, random: np.random.Generator, *, real: int = 0) -> list[dict[str, Any]]:
    """What each item of a set hides, in an order that says nothing.

    Parameters
    ----------
    count
        Items of the set.
    random
        Shuffles, and deals the instrument's share of the singles.
    real
        How many real recordings with a concealed change can be made here.
    """
    number = {name: int(share * count) for name, share in SHARES.items()}
    number["real"] = min(number["real"], real)
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
    recipes += [{"family": "real", "number": i} for i in range(number["real"])]
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
    family: str, effects: list[str], sizes: list[float], recipe: dict[str, Any],
    random: np.random.Generator,
) -> Item:  # fmt: skip
    if family == "combination":
        return make_pair(
            random, effects[0], effects[1], (sizes[0], sizes[1]), cancelling=recipe["cancelling"]
        )
    if family == "outside":
        return make_outside(random, effects[0], sizes[0])
    return make_single(random, effects[0], sizes[0], own_form=recipe.get("own_form"))
