"""What a campaign's model lacks: its catalogue is scanned and refitted; records far off go."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.special import ndtr

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Design
from pendpipe.campaign.effects import WRONG
from pendpipe.campaign.fit import Candidate, JointFit, Measured, candidates, joint_fit
from pendpipe.campaign.seen import (
    FAR_SIGMA,
    Far,
    farthest,
    has_shape,
    is_orderly,
    scatter,
    wider,
    without,
)
from pendpipe.estimate import Estimate, chi_square_p_value
from pendpipe.levels import FALSE_ALARM
from pendpipe.score import CLASS, trials_of, unit_rows

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
_REACH: Final = 30.0
"""Candidates whose linear gain in chi^2 is this far behind the best are not refitted: the
effects change the records by a fifth at most, where the linear gain is good to a fifth."""


@dataclass(frozen=True)
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
    """The answer, before it is put into words.

    Parameters
    ----------
    baseline, improved
        The joint fits without and with what was found, of the records that were kept.
    p_value
        Global: of the largest score over the catalogue, or of chi^2 as a whole.
    found
        In the order in which they were added; empty also where nothing named explains a misfit.
    missing
        Whether something is missing.
    left_out
        Records that disagree with all others, and explain a misfit better than any effect.
    suspect
        A record that would explain it about as well as what was found.
    whole
        The answer with all records, where some were left out.
    scattered
        Probability of that, beside what else explains the misfit.
    scatter
        By what factor the records scatter beyond the stated errors, where that explains a misfit:
        `improved`, and what was found, then have errors as large.
    """

    baseline: JointFit
    improved: JointFit
    p_value: float
    found: tuple[Found, ...]
    missing: bool
    left_out: tuple[Far, ...] = ()
    suspect: Far | None = None
    whole: "CampaignSearch | None" = None
    scatter: Estimate | None = None
    scattered: float = 0.0

    @property
    def unexplained(self) -> float:
        """Probability that chance leaves as much as what was found leaves."""
        return chi_square_p_value(self.improved.chi2, self.improved.degrees_of_freedom)

    @property
    def described(self) -> bool:
        """Whether the model, with all that was found, leaves no more than noise."""
        return not (self.missing and self.unexplained < FALSE_ALARM)

    @property
    def price(self) -> float:
        """-2 ln L, with what causes and records that are left out must lower it by."""
        far = len(self.left_out) * FAR_SIGMA**2
        return self.improved.chi2 + sum(one.price for one in self.found) + far


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

    Where records are left out, or more is left than noise, larger errors of all records are a
    rival, at the scatter that they have (`scatter`): a number for all in the place of causes
    (`_price`) and records (`FAR_SIGMA`). What leaves more than noise names nothing.

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
    answer = _among_records(base, level)
    # The errors of a table of numbers are their scatter.
    if (answer.described and not answer.left_out) or not isinstance(base.design, Design):
        return answer
    best, price = answer, answer.price
    for kept in (base, answer.baseline)[: 1 + bool(answer.left_out)]:
        lost = kept is not base
        other, other_price = _scattered(kept, level)
        other_price += lost * len(answer.left_out) * FAR_SIGMA**2
        if other and other_price < price:
            best, price = other, other_price
            if lost:
                best = replace(other, left_out=answer.left_out, whole=answer.whole)
    if best is not answer:
        share = 1.0 / (1.0 + math.exp(0.5 * (price - answer.price)))
        best = replace(best, p_value=answer.p_value, scattered=share)
    return best if best.described else _undescribed(base, answer)


def _among_records(base: JointFit, level: float) -> CampaignSearch:
    """Search, and leave out the records that disagree.

    A record that lies beyond `FAR_SIGMA` whatever was found, or explains the misfit better than
    what was found, is left out, and the search is made again.
    """
    whole = answer = _search(base, level)
    left_out: list[Far] = []
    while answer.missing and len(answer.baseline.design.runs) > MOST_LEFT_OUT:
        unexplained = farthest(answer.improved)
        suspects = [far for far in (unexplained, farthest(answer.baseline)) if far]
        if not suspects:
            break
        # A cause that bends to a foreign record makes others far.
        each = {far: without(answer.baseline, far.record) for far in suspects}
        suspect, fewer = min(each.items(), key=lambda item: item[1].chi2)
        better, needed = answer.improved.chi2 - fewer.chi2, CLASS
        others = [one for one in answer.improved.added if not one.effect.finer]
        # A mode that one record sees is that record, beside the other causes.
        if len(others) < len(answer.improved.added):
            alone = without(answer.baseline, suspect.record, others)
            better, needed = answer.improved.chi2 - alone.chi2, -CLASS
        if unexplained is None and better < needed:
            answer = replace(answer, suspect=suspect if better > -CLASS else None)
            break
        if len(left_out) == MOST_LEFT_OUT:
            break
        left_out.append(suspect)
        answer = _search(fewer, level)
    answer = _beside_each_other(answer, level)
    if not left_out:
        return answer
    return replace(
        answer, p_value=whole.p_value, missing=True, left_out=tuple(left_out), whole=whole
    )


def _scattered(base: JointFit, level: float) -> tuple[CampaignSearch | None, float]:
    """Search with errors as large as the records scatter, unless what is left has an order.

    Causes make records scatter too, so that the scatter is taken anew beside them.

    Returns
    -------
    answer, price
        And -2 ln L over that of the stated errors, with what it must be lowered by.
    """
    fit, found = base, list[CampaignSearch]()
    if has_shape(base):
        return None, math.inf
    for _ in range(MOST_EFFECTS):
        factor, fall = scatter(fit)
        if factor.value > WRONG:
            return None, math.inf
        wide = wider(base.data, factor.value)
        answer = _among_records(joint_fit(base.design, wide, (), base.unknowns), level)
        now = answer.improved
        stated = wider(now.data, 1.0 / factor.value)
        fit = joint_fit(now.design, stated, now.added, now.unknowns)
        before = [(each.improved.added, each.left_out) for each in found[-1:]]
        found.append(answer)
        if before == [(now.added, answer.left_out)]:
            break
    price = answer.price - now.chi2 + fit.chi2 - fall + CLASS
    if answer.left_out or len(answer.found) > 1 or is_orderly(now) or not answer.described:
        return None, price
    return replace(answer, missing=True, scatter=factor), price


def _undescribed(base: JointFit, answer: CampaignSearch) -> CampaignSearch:
    """Name nothing; records are left out still if they explain more than what is left."""
    left = answer.improved.chi2 - answer.improved.degrees_of_freedom
    if answer.left_out and not has_shape(base) and base.chi2 - answer.baseline.chi2 > left:
        return replace(answer, improved=answer.baseline, found=(), suspect=None)
    return CampaignSearch(base, base, answer.p_value, (), True)


def _search(baseline: JointFit, level: float) -> CampaignSearch:
    """Add effects as long as the scan of the catalogue alarms."""
    everything = candidates(baseline.design)
    fit, found, first = baseline, list[Found](), 1.0
    for number in range(MOST_EFFECTS):
        scan = _scan(fit, everything)
        if not number:
            whole = chi_square_p_value(fit.chi2, fit.degrees_of_freedom)
            first = min(1.0, 2.0 * min(scan.p_value, whole))
        if scan.p_value >= 0.5 * level or (one := _found(fit, scan)) is None:
            break
        found.append(one)
        fit = one.leader
    return CampaignSearch(baseline, fit, first, tuple(found), first < level)


class _Scan(NamedTuple):
    """The candidates that a fit does not have, their scores, and the chance of the largest."""

    tried: list[Candidate]
    scores: FloatArray
    p_value: float


def _scan(fit: JointFit, everything: Sequence[Candidate]) -> _Scan:
    taken = {one.effect.identifier for one in fit.added}
    tried = [one for one in everything if one.effect.identifier not in taken]
    scores, correlations = local_scores(fit, tried)
    return _Scan(tried, scores, global_p_value(scores, correlations, tried))


def _found(fit: JointFit, scan: _Scan) -> Found | None:
    """Return the effect that explains most of what a fit leaves, with its class."""
    rivals = refit(fit, scan.tried, scan.scores)
    effects = len({one.effect.identifier for one in scan.tried})
    members, nothing = class_of(rivals, fit, effects)
    leader, probability = members[0]
    gain = fit.chi2 - leader.chi2
    if gain < 1.0 or nothing > sum(share for _, share in members):
        return None
    best, inside = (
        min(rival.chi2 for rival in rivals),
        {each.last.identifier for each, _ in members},
    )
    above = [
        (one.effect.identifier, float(fit.chi2 - score**2 - best))
        for one, score in zip(scan.tried, scan.scores, strict=True)
    ]
    above += [(rival.last.identifier, rival.chi2 - best) for rival in rivals]
    excluded = {name: rise for name, rise in above if name not in inside}
    chance = min(1.0, 2.0 * scan.p_value)
    price = 2.0 * math.log(effects / (1.0 - NOTHING_MISSING))
    price -= leader.chi2 + 2.0 * leader.log_evidence
    return Found(leader, tuple(members[1:]), probability, nothing, chance, gain, excluded, price)


def _beside_each_other(answer: CampaignSearch, level: float) -> CampaignSearch:
    """Weigh each effect beside all others; drop what is not needed, take what is better.

    The order in which effects were added is none of nature's.
    """
    last = answer.improved
    everything = candidates(last.design)
    added, start = list(last.added), last.unknowns[: len(last.design.nuisances)]
    for _ in range(2 * MOST_EFFECTS if len(added) > 1 else 0):
        again = list[Found]()
        for number, own in enumerate(added):
            others = added[:number] + added[number + 1 :]
            fit = joint_fit(last.design, last.data, others, start)
            scan = _scan(fit, everything)
            one = _found(fit, scan) if scan.p_value < 0.5 * level else None
            if one is None or one.leader.added[-1] != own:
                added[number : number + 1] = [] if one is None else [one.leader.added[-1]]
                break
            again.append(one)
        else:
            fit = again[-1].leader if again else answer.baseline
            return replace(answer, improved=fit, found=tuple(again))
    return answer


def refit(fit: JointFit, tried: Sequence[Candidate], scores: FloatArray) -> list[JointFit]:
    """Refit with each candidate whose linear gain is within reach of the best one's."""
    gains = np.where(_one_sided(tried), np.maximum(scores, 0.0), scores) ** 2
    reach = max(_REACH, 0.25 * float(gains.max()))
    near = [
        number
        for number, one in enumerate(tried)
        if gains[number] >= max(gains.max() - reach, _best_shape(tried, gains, one))
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
) -> tuple[list[tuple[JointFit, float]], float]:
    """The rivals that the data cannot tell apart, and the probability that nothing is missing.

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
    logs = [rival.log_evidence + each for rival in members]
    logs.append(math.log(NOTHING_MISSING) - 0.5 * before.chi2)
    weights = np.exp(np.array(logs) - max(logs))
    left = chi_square_p_value(best, members[0].degrees_of_freedom)
    *named_ones, nothing = (left / (left + FALSE_ALARM) * weights / weights.sum()).tolist()
    return list(zip(members, named_ones, strict=True)), nothing
