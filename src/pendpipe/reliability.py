"""Whether stated probabilities and intervals come true, where the truth is known."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from pendpipe.errors import refuse_if
from pendpipe.estimate import Z95, Estimate

if TYPE_CHECKING:
    import pandas as pd

    from pendpipe.diagnosis.result import Diagnosis

Truth: TypeAlias = Mapping[str, Mapping[str, float]]
"""By identifier each effect that is there, with those of its numbers that are known."""
BINS: Final = 10
CURVE: Final = "unnamed-"
"""How the identifier of a curve without a name begins, which claims no effect of the catalogue."""


@dataclass(frozen=True)
class Reliability:
    """How often what was stated is true.

    Parameters
    ----------
    names
        A row for each name that an answer lists, probable or not: ``answer`` (its place among the
        answers), ``id``, ``probability`` and ``true``.
    sizes
        A row for each number of a name that is true, where the truth is known: ``answer``, ``id``,
        ``parameter``, ``pull`` ((truth - value) over the standard error on the truth's side, a
        95 % interval being 3.92 of them wide) and ``held`` (by the 95 % interval).
    """

    names: pd.DataFrame
    sizes: pd.DataFrame

    @property
    def bins(self) -> pd.DataFrame:
        """Ten bins of probability: ``count``, mean ``stated``, ``came_true`` and its interval.

        The interval of 95 %, ``low95`` to ``high95``, is Clopper's and Pearson's.
        """
        import pandas as pd
        from scipy.stats import binomtest

        place = np.minimum(BINS * self.names["probability"], BINS - 1).astype(int)
        rows = []
        for number in range(BINS):
            rows_of = self.names[place == number]
            if rows_of.empty:
                continue
            hits, count = int(rows_of["true"].sum()), len(rows_of)
            ends = binomtest(hits, count).proportion_ci()
            stated = rows_of["probability"].mean()
            rows.append((number / BINS, count, stated, hits / count, ends.low, ends.high))
        columns = ["from", "count", "stated", "came_true", "low95", "high95"]
        return pd.DataFrame(rows, columns=columns).set_index("from")

    @property
    def error(self) -> float:
        """Mean distance of what came true from what was stated: sum over bins of n |gap| / N."""
        found = self.bins
        gap = (found["stated"] - found["came_true"]).abs()
        return float((gap * found["count"]).sum() / len(self.names)) if len(found) else np.nan

    @property
    def names_p_value(self) -> float:
        """Of probabilities that are right: Spiegelhalter's test of the Brier score, two-sided.

        z = sum (o - p)(1 - 2 p) / sqrt(sum (1 - 2 p)^2 p (1 - p)), over names of probability p of
        which o = 1 are true and o = 0 are not (Statistics in Medicine 5, 421, 1986). Names of one
        class exclude each other; the test takes them as independent.
        """
        from scipy.special import erfc

        p, true = self.names["probability"].to_numpy(), self.names["true"].to_numpy(np.float64)
        weight = 1.0 - 2.0 * p
        spread = np.sqrt(np.sum(weight**2 * p * (1.0 - p)))
        off = np.sum((true - p) * weight)
        return float(erfc(abs(off) / spread / np.sqrt(2.0))) if spread else float(not off)

    @property
    def sizes_p_value(self) -> float:
        """Of pulls of a normal distribution: Kolmogorov and Smirnov's test of the P-P plot."""
        from scipy.stats import kstest

        return float(kstest(self.sizes["pull"], "norm").pvalue) if len(self.sizes) else np.nan

    def __str__(self) -> str:
        if self.names.empty:
            return "no name is claimed"
        lines = ["stated          names  came true (95 %)"]
        for low, count, stated, true, low95, high95 in self.bins.itertuples():
            span = f"{low:.1f} to {low + 1 / BINS:.1f}, {stated:.2f}"
            lines.append(f"{span:16}{count:5}  {true:.2f} ({low95:.2f} to {high95:.2f})")
        lines.append(f"mean distance {self.error:.3f}; p = {self.names_p_value:.2g}")
        held, count = int(self.sizes["held"].sum()), len(self.sizes)
        if count:
            lines.append(
                f"95 % intervals hold {held} of {count} numbers ({100 * held / count:.0f} %);"
                f" the median pull is {np.median(np.abs(self.sizes['pull'])):.2f} (0.67),"
                f" p = {self.sizes_p_value:.2g}"
            )
        return "\n".join(lines)


def judge(answers: Iterable[Diagnosis | Mapping[str, Any]], truths: Iterable[Truth]) -> Reliability:
    """Compare diagnoses with what was simulated: whether a stated 90 % is right in 90 %.

    Every name that an answer lists counts with its own probability, the lesser ones too; what the
    baseline has by presumption and curves without a name claim nothing, and are left out. Names of
    one class that are all true claim the same, with the sum of their probabilities.

    Parameters
    ----------
    answers
        Of `diagnose`, or what ``diagnosis.json`` holds.
    truths
        Of each answer the effects that are there, by identifier, each with its numbers as the
        answer names them (``{"cubic-stiffness": {"k3": 0.12}}``); ``{}`` where nothing is hidden.

    Raises
    ------
    InputError
        If there are not as many truths as answers, or a number has another name in the answer.

    Examples
    --------
    >>> import pendpipe as pp
    >>> listed = [{"id": "tone-pickup", "probability": 0.7, "parameters": {}, "presumed": False,
    ...            "indistinguishable_from": [{"id": "second-mode", "probability": 0.2}]}]
    >>> found = pp.judge([{"effects": listed}] * 10, [{"tone-pickup": {}}] * 7 + [{}] * 3)
    >>> print(found)
    stated          names  came true (95 %)
    0.2 to 0.3, 0.20   10  0.00 (0.00 to 0.31)
    0.7 to 0.8, 0.70   10  0.70 (0.35 to 0.93)
    mean distance 0.100; p = 0.21
    """
    import pandas as pd

    found, wanted = list(answers), list(truths)
    refuse_if(
        len(found) != len(wanted),
        "truths",
        f"{len(wanted)} truths for {len(found)} answers",
        "give one for each, {} where nothing is hidden",
    )
    names, sizes = [], []
    for number, (answer, truth) in enumerate(zip(found, wanted, strict=True)):
        content = answer if isinstance(answer, Mapping) else answer.to_dict()
        for effect in content["effects"]:
            if effect["presumed"]:
                continue
            members = (effect, *effect["indistinguishable_from"])
            claimed = {each["id"]: each["probability"] for each in members}
            right = [name for name in claimed if name in truth]
            if len(right) > 1:
                claimed[right[0]] = sum(claimed.pop(name) for name in right)
            for name, probability in claimed.items():
                if not name.startswith(CURVE):
                    names.append((number, name, probability, name in truth))
            for name, true in truth.get(effect["id"], {}).items():
                known = effect["parameters"]
                place = f"truths[{number}][{effect['id']!r}]"
                refuse_if(
                    name not in known, place, f"it has no {name}", f"name one of {list(known)}"
                )
                value = known[name]["value"]
                low, high = Estimate.from_json(known[name]).bounds95
                half = high - value if true > value else value - low
                off = float(true - value)
                # An interval may end at its value.
                pull = Z95 * off / half if half else math.copysign(math.inf, off)
                sizes.append((number, effect["id"], name, pull, bool(low <= true <= high)))
    return Reliability(
        pd.DataFrame(names, columns=["answer", "id", "probability", "true"]),
        pd.DataFrame(sizes, columns=["answer", "id", "parameter", "pull", "held"]),
    )
