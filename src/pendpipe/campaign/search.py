"""What a campaign's model lacks: its catalogue is scanned and refitted; records far off go.

The neighbours of a set of causes (`pendpipe.search`): with one more, without one or with another in
its place, without the record that is farthest off, or with larger errors of all records. They are
compared by one score: -2 ln L, with a price for each cause (`Found.price`), for each record that is
left out (`FAR_SIGMA`), and for larger errors.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.special import logsumexp, ndtr

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Design
from pendpipe.campaign.effects import WRONG
from pendpipe.campaign.fit import Candidate, JointFit, Measured, candidates, joint_fit, only
from pendpipe.campaign.seen import (
    FAR_SIGMA,
    Far,
    farthest,
    has_shape,
    is_orderly,
    off,
    scatter,
    wider,
    without,
)
from pendpipe.estimate import Estimate, chi_square_p_value
from pendpipe.levels import FALSE_ALARM
from pendpipe.score import (
    CHOICE,
    CLASS,
    price_of_another,
    shares,
    trials_of,
    unit_rows,
    within_reach,
)
from pendpipe.search import descend

MOST_EFFECTS: Final = 3
"""Effects that are added: of three dozen records more are not told apart."""
MOST_LEFT_OUT: Final = 3
"""Records that are left out: of three dozen more are no exceptions."""
NOTHING_MISSING: Final = 0.5
"""Probability beforehand that nothing is missing; the effects share the rest alike."""
_DRAWS: Final = 10_000
"""Campaigns drawn for the null, of which the number of trials is known to a per cent."""
_SEED: Final = 24
"""Of the draws, so that one campaign has one answer."""
_VISIBLE: Final = 1e-6
"""Part of a pattern that must remain beside what the unknowns follow, above its rounding."""


@dataclass(frozen=True, eq=False)
class Found:
    """One effect that the model lacks, with the rivals that the data cannot tell from it."""

    leader: JointFit
    """The campaign's fit with it."""
    rivals: tuple[tuple[JointFit, float], ...]
    """The fits with each of the rest of the class in its place, and their probabilities."""
    probability: float
    nothing: float
    """Probability that no effect is missing."""
    p_value: float
    delta_chi2: float
    excluded: dict[str, float]
    """Rise of chi^2 above the best rival, by identifier, of those outside the class."""
    price: float
    """What -2 ln L must fall by for it: for its size, and for being one of many."""


@dataclass(frozen=True)
class CampaignSearch:
    """A set of causes, and of records that are left out; at last the answer.

    Parameters
    ----------
    whole
        The joint fit without causes, of all records with the stated errors.
    baseline, improved
        Those without and with what was found, of the records that were kept.
    p_value
        Global: of the largest score over the catalogue, or of chi^2 as a whole.
    missing
        Whether something is missing.
    found
        In the order in which they were added; empty also where nothing named explains a misfit.
    left_out
        Records that disagree with all others, and explain a misfit better than any effect.
    scatter
        By what factor the records scatter beyond the stated errors, where that explains a misfit:
        `improved`, and what was found, then have errors as large.
    widened
        -2 ln L over the chi^2 of `improved` where errors are larger, with the price of these.
    scattered
        Probability of the scatter, beside what else explains the misfit.
    suspect
        A record that would explain it about as well as what was found.
    lower, words
        By how much its score is lower than that of the set it was made from, and what was done.
    """

    whole: JointFit
    baseline: JointFit
    improved: JointFit
    p_value: float
    missing: bool
    found: tuple[Found, ...] = ()
    left_out: tuple[Far, ...] = ()
    scatter: Estimate | None = None
    widened: float = 0.0
    scattered: float = 0.0
    suspect: Far | None = None
    lower: float = 0.0
    words: str = ""

    @property
    def unexplained(self) -> float:
        """Probability that chance leaves as much as what was found leaves."""
        return chi_square_p_value(self.improved.chi2, self.improved.degrees_of_freedom)

    @property
    def described(self) -> bool:
        """Whether the model, with all that was found, leaves no more than noise."""
        return not (self.missing and self.unexplained < FALSE_ALARM)

    @property
    def score(self) -> float:
        """-2 ln L, with the prices of causes, of records left out, and of larger errors."""
        names = len(self.found) + bool(self.left_out)  # records may well be foreign for one reason
        prices = [price_of_another(number) - CHOICE for number in range(names)]
        prices += [one.price for one in self.found] + [FAR_SIGMA**2 for _ in self.left_out]
        return self.improved.chi2 + self.widened + sum(prices)

    @property
    def key(self) -> tuple[frozenset[Any], frozenset[str], bool]:
        """Its causes, what is left out, and whether errors are larger."""
        records = frozenset(far.record for far in self.left_out)
        causes = frozenset((one.effect.identifier, one.shape) for one in self.improved.added)
        return causes, records, self.scatter is not None

    @cached_property
    def scan(self) -> "_Scan":
        """Scores of what it does not have."""
        return _scan(self.improved)


def local_scores(fit: JointFit, tried: Sequence[Candidate]) -> tuple[FloatArray, FloatArray]:
    """Score of each candidate on a fit's residuals, and the correlations of the scores.

    Each score is the residual's part along the candidate's pattern, after what the fit's own
    unknowns can follow; standard normal where nothing is missing. Candidates that the fit
    follows wholly score 0.

    Returns
    -------
    scores, correlations
        Shapes (n,) and (n, n).
    """
    basis, _ = np.linalg.qr(fit.tangent)
    rows = np.stack([fit.derivative(one) for one in tried])
    units, _ = unit_rows(rows, basis, _VISIBLE)
    return -(units @ fit.residuals), units @ units.T


def _one_sided(tried: Sequence[Candidate]) -> BoolArray:
    """Which candidates' sizes can only be positive."""
    return np.array([one.effect.parameter.low >= 0.0 for one in tried])


def _local_p(scores: FloatArray, tried: Sequence[Candidate]) -> FloatArray:
    """Probability of each score by chance; only positive scores count where the size must be."""
    return np.where(_one_sided(tried), ndtr(-scores), 2.0 * ndtr(-np.abs(scores)))


def global_p_value(
    scores: FloatArray, correlations: FloatArray, tried: Sequence[Candidate]
) -> float:
    """Probability that chance has so small a local p-value anywhere in the catalogue.

    The trials are counted on drawn, correlated scores.
    """
    drawn = np.random.default_rng(_SEED).multivariate_normal(
        np.zeros(len(scores)), correlations, _DRAWS, check_valid="ignore", method="eigh"
    )
    trials = trials_of(np.min(_local_p(drawn, tried), axis=-1), growth=0.0)
    return trials.global_p_value(float(np.min(_local_p(scores, tried))))


def search(
    design: Any, data: Measured, level: float = FALSE_ALARM, base: JointFit | None = None
) -> CampaignSearch:
    """Look for what the model lacks, and for records that disagree with all others.

    What leaves more than noise names nothing.

    Parameters
    ----------
    design, data
        As for `joint_fit`.
    level
        False-alarm probability for a campaign that lacks nothing: half of it goes to the
        catalogue's scan, half to chi^2 as a whole.
    base
        The fit without effects, where it is there already.
    """
    base = base or joint_fit(design, data)
    whole = chi_square_p_value(base.chi2, base.degrees_of_freedom)
    p_value = min(1.0, 2.0 * min(_scan(base).p_value, whole))
    begun = CampaignSearch(base, base, base, p_value, p_value < level)
    if not begun.missing:
        return begun
    additions, simpler = (partial(some, level=level) for some in (_additions, _simpler))
    answer = descend(begun, [additions, simpler, _scattered])
    return _weighed(answer, level) if answer.described else _undescribed(answer)


def _with(
    state: CampaignSearch,
    found: Sequence[Found],
    left_out: Sequence[Far],
    words: str,
    *,
    scattered: bool | None = None,
) -> CampaignSearch:
    """Fit a neighbour, and compare it.

    Causes make records scatter too, so that the scatter is taken anew beside them.
    """
    names = [far.record for far in left_out]
    kept = np.array([run.record not in names for run in state.whole.design.runs])
    design, data = only(state.whole.design, state.whole.data, kept)
    added = [one.leader.added[-1] for one in found]
    # What another record has bent is no place to begin.
    start = state.baseline.unknowns if tuple(left_out) == state.left_out else None
    factor, widened = None, 0.0
    stated = improved = joint_fit(design, data, added, start)
    if state.scatter is not None if scattered is None else scattered:
        factor, fall = scatter(stated)
        data = wider(data, factor.value)
        improved = joint_fit(design, data, added, start)
        widened = stated.chi2 - fall - improved.chi2 + CLASS
    made = replace(
        state,
        baseline=joint_fit(design, data, (), start) if added else improved,
        improved=improved,
        found=tuple(found),
        left_out=tuple(left_out),
        scatter=factor,
        widened=widened,
        words=words,
    )
    return replace(made, lower=state.score - made.score)


def _additions(state: CampaignSearch, level: float) -> Iterator[CampaignSearch]:
    """Add the cause that explains most, or leave out the record that is farthest off.

    A cause that bends to a foreign record makes others far.
    """
    most = 1 if state.scatter else MOST_EFFECTS
    if len(state.found) < most and (one := _leading(state.improved, state.scan, level)):
        yield _with(state, (*state.found, one), state.left_out, f"adding {_name(one)}")
    if state.scatter or len(state.left_out) == MOST_LEFT_OUT:
        return
    if len(state.improved.design.runs) <= MOST_LEFT_OUT:
        return
    # A mode that one record sees is that record, beside the other causes.
    coarse = tuple(one for one in state.found if not one.leader.last.finer)
    for far in {farthest(state.improved), farthest(state.baseline)} - {None}:
        assert far is not None
        for found in dict.fromkeys((state.found, coarse, ())):
            yield _with(state, found, (*state.left_out, far), f"without {off(far)}")


def _simpler(state: CampaignSearch, level: float) -> Iterator[CampaignSearch]:
    """Drop a cause, or put another in its place; take a record back.

    The order in which causes were added is none of nature's.
    """
    for own in state.found:
        others = [one for one in state.found if one is not own]
        fewer = _with(state, others, state.left_out, f"{_name(own)} is no longer needed")
        yield fewer
        if others and (one := _leading(fewer.improved, fewer.scan, level)):
            yield _with(state, [*others, one], state.left_out, f"{_name(one)} for {_name(own)}")
    for far in state.left_out:
        kept = [each for each in state.left_out if each is not far]
        yield _with(state, state.found, kept, f"{far.record} is no longer far")


def _scattered(state: CampaignSearch) -> Iterator[CampaignSearch]:
    """Take larger errors of all records, unless what is left has an order.

    A number for all in the place of causes and records.
    """
    # The errors of a table of numbers are their scatter.
    if state.scatter or not isinstance(state.whole.design, Design):
        return
    if state.described and not state.left_out:
        return
    for left_out in dict.fromkeys(((), state.left_out)):
        for found in ((), *((one,) for one in state.found)):
            made = _with(state, found, left_out, "all errors are larger", scattered=True)
            assert made.scatter is not None
            if made.scatter.value > WRONG or is_orderly(made.improved) or has_shape(made.baseline):
                continue
            yield replace(made, scattered=1.0 / (1.0 + math.exp(-0.5 * made.lower)))


def _undescribed(answer: CampaignSearch) -> CampaignSearch:
    """Name nothing; records are left out still if they explain more than what is left."""
    whole, improved = answer.whole, answer.improved
    left = improved.chi2 - improved.degrees_of_freedom
    if answer.left_out and not has_shape(whole) and whole.chi2 - answer.baseline.chi2 > left:
        return replace(answer, improved=answer.baseline, found=())
    return CampaignSearch(whole, whole, whole, answer.p_value, missing=True)


def _weighed(answer: CampaignSearch, level: float) -> CampaignSearch:
    """Weigh each cause beside all others."""
    again, best = list[Found](), answer.improved
    for own in answer.found:
        cause = own.leader.added[-1]
        others = tuple(each for each in best.added if each != cause)
        fit = joint_fit(best.design, best.data, others, answer.baseline.unknowns)
        one = _leading(fit, _scan(fit), level)
        if one is None or one.leader.added[-1] != cause:
            # As it was found, but of the records and beside the causes that are there now.
            leader = joint_fit(fit.design, fit.data, (*others, cause), fit.unknowns)
            one = replace(own, leader=leader)
        again.append(one)
    improved = again[-1].leader if again else answer.improved
    far = farthest(answer.baseline) if again else None
    if far and without(answer.baseline, far.record).chi2 > improved.chi2 + CLASS:
        far = None
    return replace(answer, improved=improved, found=tuple(again), suspect=far)


class _Scan(NamedTuple):
    """The candidates that a fit does not have, their scores, and the chance of the largest."""

    tried: list[Candidate]
    scores: FloatArray
    p_value: float


def _scan(fit: JointFit) -> _Scan:
    taken = {one.effect.identifier for one in fit.added}
    tried = [one for one in candidates(fit.design) if one.effect.identifier not in taken]
    scores, correlations = local_scores(fit, tried)
    return _Scan(tried, scores, global_p_value(scores, correlations, tried))


def _name(one: Found) -> str:
    return one.leader.last.name


def _leading(fit: JointFit, scan: _Scan, level: float) -> Found | None:
    """Return the effect that explains most of what a fit leaves, with its class, if one alarms."""
    if scan.p_value >= 0.5 * level:
        return None
    rivals = refit(fit, scan.tried, scan.scores)
    effects = len({one.effect.identifier for one in scan.tried})
    members, nothing, evidence = class_of(rivals, fit, effects)
    leader, probability = members[0]
    best = min(rival.chi2 for rival in rivals)
    inside = {each.last.identifier for each, _ in members}
    above = [
        (one.effect.identifier, float(fit.chi2 - score**2 - best))
        for one, score in zip(scan.tried, scan.scores, strict=True)
    ]
    above += [(rival.last.identifier, rival.chi2 - best) for rival in rivals]
    excluded = {name: rise for name, rise in above if name not in inside}
    chance, gain = min(1.0, 2.0 * scan.p_value), fit.chi2 - leader.chi2
    price = evidence - leader.chi2
    return Found(leader, tuple(members[1:]), probability, nothing, chance, gain, excluded, price)


def refit(fit: JointFit, tried: Sequence[Candidate], scores: FloatArray) -> list[JointFit]:
    """Refit with each candidate whose linear gain is within reach of the best one's."""
    gains = np.where(_one_sided(tried), np.maximum(scores, 0.0), scores) ** 2
    reached = within_reach(gains)
    near = [
        number
        for number, one in enumerate(tried)
        if reached[number] and gains[number] >= _best_shape(tried, gains, one)
    ]
    found = [
        joint_fit(fit.design, fit.data, (*fit.added, tried[number]), fit.unknowns)
        for number in near
    ]
    least = fit.chi2 - 0.5 * max((fit.chi2 - each.chi2 for each in found), default=0.0)
    return [_finer(each) if each.last.finer and each.chi2 <= least else each for each in found]


def _best_shape(tried: Sequence[Candidate], gains: FloatArray, one: Candidate) -> float:
    """The gain that a shape of an effect must have: that of the best, where it is made finer."""
    alike = [each.effect is one.effect for each in tried]
    return float(gains[alike].max()) if one.effect.finer else 0.0


def _finer(fit: JointFit) -> JointFit:
    """Fit the shape of the last effect too (Gauss-Newton), as long as chi^2 falls."""
    (*others, last), width = fit.added, len(fit.added[-1].shape)
    for _ in range(_MOST_STEPS):
        step = -np.linalg.lstsq(fit.tangent, fit.residuals)[0][-width:]
        step *= _LONGEST / max(_LONGEST, float(np.max(np.abs(step))))
        last = last._replace(shape=tuple((last.shape * np.exp(step)).tolist()))
        other = joint_fit(fit.design, fit.data, (*others, last), fit.unknowns)
        if other.chi2 > fit.chi2 - 1e-3:
            break
        fit = other
    return fit


_LONGEST: Final = 0.3
"""Step of the logarithm of a shape: from one damping ratio that is tried to the next is 1.1."""
_MOST_STEPS: Final = 12


def class_of(
    rivals: Sequence[JointFit], before: JointFit, effects: int
) -> tuple[list[tuple[JointFit, float]], float, float]:
    """The rivals that the data cannot tell apart, the probability of nothing, and their -2 ln L.

    The most probable first, with probabilities. One shape of an effect stands for it. Nothing is a
    rival too (`NOTHING_MISSING`, the rest shared by all `effects` that were tried). What is left
    to 1 is "none of these": it is likely where even the best of them leaves more chi^2 than chance
    would.
    """
    best = min(rival.chi2 for rival in rivals)
    inside: dict[str, JointFit] = {}
    for rival in sorted(rivals, key=lambda rival: rival.chi2):
        if rival.chi2 <= best + CLASS:
            inside.setdefault(rival.last.identifier, rival)
    members = sorted(inside.values(), key=lambda rival: -rival.log_evidence)
    each = math.log((1.0 - NOTHING_MISSING) / effects)
    logs = np.array([rival.log_evidence + each for rival in members])
    none = math.log(NOTHING_MISSING) - 0.5 * before.chi2
    left = chi_square_p_value(best, members[0].degrees_of_freedom)
    *named_ones, nothing = (left / (left + FALSE_ALARM) * shares(np.append(logs, none))).tolist()
    evidence = 2.0 * (math.log(NOTHING_MISSING) - float(logsumexp(logs)))
    return list(zip(members, named_ones, strict=True)), nothing, evidence
