"""What a refitted effect is worth beside others, and how sure that makes its name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.distributions import chi2_beyond, chi2_of_one
from pendpipe.arrays import FloatArray
from pendpipe.diagnose.chance import Chance, Trials
from pendpipe.diagnose.detect import Lead
from pendpipe.diagnose.refine import Fit
from pendpipe.effects import Effect
from pendpipe.effects.curves import Curve

CLASS: Final = 6.0
"""Twice the logarithm of the likelihood within which effects are of one class."""
_SHAPE: Final = 2.0
"""What a fitted shape takes off a gain: that much chance makes of it (Akaike)."""
_FORM: Final = 3.0
"""Standard deviation of a difference of evidence for what a law's own form is worth, where
little is gained: it grows with the gain by `MISSHAPEN`."""
MISSHAPEN: Final = 0.03
"""Part of a gain that a real law leaves to the catalogue's form of it (a flexure's sinh to a cubic
term, a drag that follows C_D(Re) to a power), or to a curve that is straight between knots."""
_UNSURE: Final = (4.5, 0.01)
"""What `_FORM` and `MISSHAPEN` are to classes, to probabilities: with these, stated ones came
true on opened challenges. Scans and optima add to the spread where little is gained, and most
laws leave less of a large gain than the worst do."""
SIZE: Final = 6.0
"""What a further size takes off a gain too large for p-values."""
NO_SCAN: Final = Chance(Trials(1.0, 0.0), {})
"""A curve has no shapes to try."""
_FAR: Final = 100.0
"""In chi^2: what is known beforehand makes nobody who is so far behind the more probable."""


@dataclass(frozen=True)
class Rival:
    """An effect, refitted.

    Parameters
    ----------
    lead
        What it was found by.
    fit
        The extended model's.
    gain
        Delta chi^2 over the model before it.
    evidence
        chi^2 of one degree of freedom that is as improbable by chance, the effect's own
        scan counted.
    left
        chi^2 a reading that the best of its rivals left: `evidence` counts `gain` over it.
    """

    lead: Lead
    fit: Fit
    gain: float
    evidence: float
    left: float = 1.0

    def reaching(self, fit: Fit, gain: float) -> Rival:
        """Return it refitted where nothing but noise is left, its scan charged as before.

        A curve has no scan; it is charged for the mixtures that it needs now.
        """
        if isinstance(self.lead.effect, Curve):
            return Rival(self.lead, fit, gain, evidence(self.lead, fit, gain, NO_SCAN))
        charged = self.gain / self.left - self.evidence
        return Rival(self.lead, fit, gain, gain - charged)

    @property
    def identifier(self) -> str:
        """The effect's identifier."""
        return self.lead.effect.identifier

    @property
    def name(self) -> str:
        """The effect's name in words."""
        return self.lead.effect.name

    @property
    def prior(self) -> float:
        """Twice the logarithm of how much likelier it is beforehand, its size included."""
        return _prior(self.lead.effect, self.fit)

    @property
    def drawn(self) -> bool:
        """Whether it is a curve without a name."""
        return self.lead.effect.kind == "unnamed"


def form_spread(best: Rival) -> float:
    """Standard deviation of a difference of evidence from the best's.

    The catalogue's forms are not quite those of real laws, and curves have knots.
    """
    return math.hypot(_FORM, MISSHAPEN * max(best.gain, 0.0))


def class_width(best: Rival) -> float:
    """How far behind the best's evidence one may be that the record cannot tell from it."""
    return CLASS * form_spread(best) / _FORM


def of_one_class(best: Rival, rival: Rival) -> bool:
    """Whether the record cannot tell two effects apart, or only what is known beforehand can.

    A value that one has more takes 2 off its gain (Akaike).
    """
    within = class_width(best)
    more = max(best.lead.effect.count - rival.lead.effect.count, 0)
    by_record = best.gain - rival.gain - _SHAPE * more < within
    return by_record or best.evidence - rival.evidence < within


def equivalent(p_value: float, score: float) -> float:
    """chi^2 of one degree of freedom with that p-value; `score` where p underflows."""
    if p_value <= 1e-290:
        return score
    return chi2_of_one(p_value)


def evidence(lead: Lead, fit: Fit, gain: float, chance: Chance) -> float:
    """What a gain is worth, beside effects with more or fewer free values and shapes.

    Parameters
    ----------
    lead, fit
        The effect, and the model with it.
    gain
        Delta chi^2, over what is left where that is much.
    chance
        What its own scan amounts to.
    """
    needless, sizes = _needed_sizes(fit, lead.effect)
    gain -= needless
    if gain <= 0.0:
        # What makes a model worse is worth that much less than nothing: a rival that comes back
        # under another noise (`Rival.reaching`) must not be credited with it.
        return gain
    effect = lead.effect
    if effect.parameter_free:
        # Its size is predicted: a free one would have had to be found.
        gain += max(math.log(gain) - 0.45, 0.0)
    local = float(chi2_beyond(gain, sizes))
    trials = chance.own.get(effect.key, Trials(1.0, 0.0))
    if local > 1e-290:
        worth = equivalent(trials.global_p_value(local), gain)
    else:
        # Too large for p-values: what trials and further sizes take off a large gain.
        worth = gain - 2.0 * math.log(trials.number_at(-0.5 * gain)) - SIZE * (sizes - 1)
    fitted = len(effect.parameters) - effect.sizes if effect.parameters else 0
    return worth - _SHAPE * max(fitted, 0) + _prior(effect, fit)


def _prior(effect: Effect, fit: Fit) -> float:
    place = next((place for other, place in fit.model.places() if other is effect), None)
    # A held parameter that is freed is no part of the model's effects.
    unlikely = 0.0 if place is None else effect.prior_penalty(fit.value[place], fit.at.span)
    return effect.prior - unlikely


def _needed_sizes(fit: Fit, effect: Effect) -> tuple[float, int]:
    """How much of a gain needless sizes make up, and how many of an effect's are needed.

    All are, but of a curve's mixtures: a curve is charged for those that stand out, the
    first (which the record sees best) being taken by itself before the second, and so on.
    """
    if not isinstance(effect, Curve):
        return 0.0, effect.sizes
    place = next(place for other, place in fit.model.places() if other is effect)
    others = [index for index in fit.free if not place.start <= index < place.stop]
    own, rest = fit.jacobian[:, place], fit.jacobian[:, others]
    basis = np.linalg.qr(rest / np.maximum(np.linalg.norm(rest, axis=0), 1e-300))[0]
    left = own - basis @ (basis.T @ own)
    squares = (np.linalg.qr(left)[1] @ fit.value[place]) ** 2
    needless = squares < SIZE
    return float(squares[needless].sum()), max(int(np.count_nonzero(~needless)), 1)


def ranked(rivals: Sequence[Rival]) -> list[Rival]:
    """Sort by evidence, names before curves that the record cannot tell from them.

    Curves follow any law; and those in time follow anything, so that a curve of the motion or
    the sensor goes before them.
    """
    best = max(rivals, key=lambda rival: rival.evidence)
    within = class_width(best)

    def order(rival: Rival) -> tuple[int, float, float]:
        if best.evidence - rival.evidence >= within:
            return 3, 0.0, -rival.evidence
        freedom = int(rival.drawn) + int(rival.lead.effect.in_time)
        return freedom, -rival.prior if rival.drawn else 0.0, -rival.evidence

    return sorted(rivals, key=order)


def probabilities(rivals: Sequence[Rival], none: float) -> FloatArray:
    """Probability of each rival, with `none` the evidence that it is none of these.

    Real laws differ a little from the catalogue's forms, so that differences of evidence
    are uncertain; log odds are averaged over that (MacKay's approximation).
    """
    leader = max(rivals, key=lambda rival: rival.evidence)
    spread = math.hypot(_UNSURE[0], _UNSURE[1] * max(leader.gain, 0.0))
    shrunk = 1.0 / math.sqrt(1.0 + math.pi / 8.0 * (0.5 * spread) ** 2)
    prior = np.array([rival.prior for rival in rivals])
    likelihood = np.array([rival.evidence for rival in rivals]) - prior
    best = float(likelihood.max())
    # A parameter's law is the baseline's own: what it leaves is not a matter of its form.
    own_form = np.array([rival.lead.effect.kind == "parameter" for rival in rivals])
    worth = np.where(own_form, 1.0, shrunk) * (likelihood - best)
    logs = _in_order(0.5 * (worth + prior), rivals)
    logs = np.append(logs, 0.5 * (none - best))
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())


def _in_order(logs: FloatArray, rivals: Sequence[Rival]) -> FloatArray:
    """Log probabilities, none above that of a name whose evidence is far better.

    Where a gain is large, its differences are worth so little that what is known beforehand
    would raise whom the readings reject above whom they do not. Curves, which follow any law,
    keep down none but curves.
    """
    evidence = np.array([rival.evidence for rival in rivals])
    drawn = np.array([rival.drawn for rival in rivals])
    lowered = []
    for log, rival in zip(logs, rivals, strict=True):
        better = (evidence > rival.evidence + _FAR) & (rival.drawn | ~drawn)
        lowered.append(np.min(logs[better], initial=log))
    return np.array(lowered)
