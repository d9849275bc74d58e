"""Refit the leading effects side by side, rank them by their evidence, and give probabilities."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import Final

import numpy as np
from scipy.special import chdtrc, chdtri

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import (
    OFF_HARMONIC,
    Chance,
    Detection,
    Lead,
)
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.projection import finer_shape
from pendpipe.diagnosis.refine import (
    ROUNDS,
    SETTLED,
    Evaluation,
    Fit,
    fitted,
    pulled,
    remainder_of,
    searching,
)
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.values import last_in
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.dynamics.eq8 import OFFSET, OMEGA, SHARE, TIME
from pendpipe.dynamics.eq8_model import values_of
from pendpipe.effects import Effect
from pendpipe.effects.curves import Curve
from pendpipe.effects.model import Model
from pendpipe.estimate import Estimate
from pendpipe.score import CLASS, NEAR, REACH, Trials, shares, within_reach
from pendpipe.solve import Search

_SHAPE_CHARGE: Final = 2.0
"""Charge for a fitted shape (Akaike)."""
_FORM_SD: Final = 3.0
"""Standard deviation of a difference of evidence due to the exact form of a law, for small gains;
for large ones it is `MISSHAPEN` times the gain."""
MISSHAPEN: Final = 0.03
"""Part of a gain by which a real law differs from the catalogue's form of it (a flexure's sinh from
a cubic term, a drag C_D(Re) from a power), or from a curve that is straight between knots."""
_PROBABILITY_FORM: Final = (4.5, 0.01)
"""The same two numbers for probabilities, calibrated on opened challenges: scans and optima add
scatter to small gains, and most laws differ less from their forms than the worst."""
SIZE_CHARGE: Final = 6.0
"""Charge for a further size, for gains too large for p-values."""
NO_SCAN: Final = Chance(Trials(1.0, 0.0), {})
"""Of a curve, which has no shapes to scan."""
_FAR_BEHIND: Final = (100.0, 1e-4)
"""Difference of chi^2, and part of the gain, from which a prior can't make an effect more likely
than a better one: with 1e-4, the size of a law would be off by a hundredth."""


@dataclass(frozen=True)
class Scale:
    """What a difference of chi^2 is worth: against the noise, or against what is left.

    Where the best model leaves only noise, chi^2 counts as it is. Where it leaves more, the rest
    is an unknown function of m numbers of unknown size, the likelihood of which is
    (sum of squares)^(-m/2): then m ln(1 + (chi^2 - least)/(m unit)) counts, with
    m unit = excess + m.

    Parameters
    ----------
    least
        chi^2 of the best model.
    unit
        The chi^2 that small differences are counted in.
    numbers
        The independent numbers m of what it leaves; inf where that is noise alone.
    """

    least: float
    unit: float = 1.0
    numbers: float = math.inf

    @classmethod
    def of(cls, best: Fit, data: Data, noise: Noise) -> Scale:
        """Return the scale that a set's best model gives."""
        rest = remainder_of(best, data, noise)
        if not rest.systematic:
            return cls(best.chi2)
        return cls(best.chi2, 1.0 + rest.excess / rest.numbers, rest.numbers)

    @property
    def clean(self) -> bool:
        """Whether the best model leaves noise alone."""
        return math.isinf(self.numbers)

    def lost(self, chi2: float) -> float:
        """Return what a model is worse than the best."""
        behind = (chi2 - self.least) / self.unit
        if self.clean or behind <= 0.0:
            return behind
        return self.numbers * math.log1p(behind / self.numbers)

    def within(self, lost: float) -> float:
        """Return the chi^2 of a model that is worse than the best by `lost`."""
        if not self.clean:
            lost = self.numbers * math.expm1(min(lost / self.numbers, 50.0))
        return self.least + self.unit * lost

    def worth(self, before: float, after: float) -> float:
        """Return what a fall of chi^2 is worth."""
        return self.lost(before) - self.lost(after)


def off_harmonics(fit: Fit, effect: Effect) -> bool:
    """Whether an effect is a line off the motion's harmonics: no misfit of the motion makes one."""
    off = from_harmonic(fit, effect)
    return off is not None and off.value > OFF_HARMONIC


def near_harmonic_by_chance(fit: Fit, effect: Effect) -> float:
    """Return the probability that a line is by chance as near a harmonic; 1 for what is no line.

    Of a line anywhere, twice the distance in units of the motion's frequency, with its error. Any
    law of the motion makes lines at the harmonics. So does any periodic error of the sensor at
    their aliases, and an error of every second reading at those of half the sampling rate.
    """
    rate = 1.0 / fit.at.span.interval_s
    found = [from_harmonic(fit, effect, about) for about in (0.0, 0.5 * rate, rate)]
    off = [each.value + each.sd for each in found if each is not None]
    if not off:
        return 1.0
    return min(max(2.0 * off[0], 1e-9), 2.0 * len(off) * max(min(off), 1e-9), 1.0)


def from_harmonic(fit: Fit, effect: Effect, about_hz: float = 0.0) -> Estimate | None:
    """Return the distance of a line from the nearest harmonic about a frequency, over the motion's.

    None for what is no line.
    """
    tone = last_in(fit, effect, "Hz") if effect.spectral else None
    if tone is None:
        return None
    motion = 0.5 * float(fit.value[OMEGA]) / math.pi
    off = abs(math.remainder(tone.value - about_hz, motion))
    return Estimate(off / motion, tone.sd / motion, "")


@dataclass(frozen=True)
class Rival:
    """A refitted effect.

    Parameters
    ----------
    effect, fit
        The effect, and the model with it.
    gain
        Delta chi^2 over the model without it.
    worth
        What that gain is worth (`Scale`).
    evidence
        `worth` less the charge: chi^2 of one degree of freedom that is as improbable by chance,
        the trials of the effect's own scan included, with its prior.
    """

    effect: Effect
    fit: Fit
    gain: float
    worth: float
    evidence: float

    def __post_init__(self) -> None:
        """Of what its evidence needed, keep what another needs."""
        self.fit.evaluation.rest()

    @classmethod
    def of(cls, effect: Effect, fit: Fit, before: float, scale: Scale, chance: Chance) -> Rival:
        """Return the rival whose fit lowers chi^2 from `before`."""
        worth = scale.worth(before, fit.chi2)
        found = evidence(effect, fit, worth, chance, scale.unit)
        return cls(effect, fit, before - fit.chi2, worth, found)

    def again(self, fit: Fit, before: float, scale: Scale) -> Rival:
        """Return it with another fit, and the same charge for its scan.

        A curve has no scan; it is charged for the coefficients that it needs now.
        """
        if self.drawn:
            return Rival.of(self.effect, fit, before, scale, NO_SCAN)
        worth = scale.worth(before, fit.chi2)
        return Rival(self.effect, fit, before - fit.chi2, worth, worth - self.charge)

    @property
    def charge(self) -> float:
        """What is charged for its scan, its shapes and its sizes, less its prior."""
        return self.worth - self.evidence

    @property
    def identifier(self) -> str:
        """The effect's identifier."""
        return self.effect.identifier

    @property
    def name(self) -> str:
        """The effect's name in words."""
        return self.effect.name

    @property
    def prior(self) -> float:
        """Twice the log of its prior probability ratio, with that of its size."""
        return _prior(self.effect, self.fit)

    @property
    def drawn(self) -> bool:
        """Whether it is an unnamed curve."""
        return self.effect.kind == "unnamed"


def form_spread(best: Rival) -> float:
    """Return the standard deviation of a difference of evidence from the best's.

    Real laws differ slightly from the catalogue's forms, and curves have knots.
    """
    return math.hypot(_FORM_SD, MISSHAPEN * max(best.worth, 0.0))


def class_width(best: Rival) -> float:
    """Return the difference of evidence within which the record can't distinguish an effect."""
    return CLASS * form_spread(best) / _FORM_SD


def of_one_class(best: Rival, rival: Rival) -> bool:
    """Whether the record can't distinguish two effects, or only their priors differ.

    Each additional value is charged 2 (Akaike).
    """
    within = class_width(best)
    more = max(best.effect.count - rival.effect.count, 0)
    by_record = best.worth - rival.worth - _SHAPE_CHARGE * more < within
    return by_record or best.evidence - rival.evidence < within


def equivalent(p_value: float, score: float) -> float:
    """Return chi^2 of one degree of freedom with that p-value; `score` where p underflows."""
    if p_value <= _UNDERFLOW:
        return score
    return float(chdtri(1, p_value))


def evidence(effect: Effect, fit: Fit, gain: float, chance: Chance, unit: float = 1.0) -> float:
    """Convert a worth to evidence, comparable between effects with more or fewer free values.

    Parameters
    ----------
    effect, fit
        The effect, and the model with it.
    gain
        What its Delta chi^2 is worth.
    chance
        The trials of its own scan.
    unit
        The chi^2 that counts as 1.
    """
    superfluous, sizes = _needed_sizes(fit, effect, unit)
    gain -= superfluous
    if gain <= 0.0:
        # A negative gain stays negative: a rival that is refitted with another noise
        # (`Rival.again`) must not be credited with it.
        return gain
    if effect.parameter_free:
        # The size is predicted: a free one would be charged.
        gain += max(math.log(gain) - 0.45, 0.0)
    local = float(chdtrc(sizes, gain))
    # A form that has no scan is found by that of its effect.
    scanned = chance.own.get(effect.identifier, Trials(1.0, 0.0))
    trials = chance.own.get(effect.key, scanned)
    if local > _UNDERFLOW:
        worth = equivalent(trials.global_p_value(local), gain)
    else:
        # Too large for p-values: subtract the charges for trials and further sizes.
        worth = gain - 2.0 * math.log(trials.number_at(-0.5 * gain)) - SIZE_CHARGE * (sizes - 1)
    fitted = len(effect.parameters) - effect.sizes if effect.parameters else 0
    return worth - _SHAPE_CHARGE * max(fitted, 0) + _prior(effect, fit)


def _prior(effect: Effect, fit: Fit) -> float:
    position = next((position for other, position in fit.model.places() if other is effect), None)
    if position is None:
        # A released parameter has no position among the model's effects.
        return effect.prior
    span = fit.at.span
    if effect.local:
        last = position.stop - 1
        told = float(np.linalg.norm(fit.beside(fit.jacobian[:, [last]], [last])))
        span = span._replace(instant_sd_s=1.0 / max(told, 1e-300))
    return effect.prior - effect.prior_penalty(fit.value[position], span)


def _needed_sizes(fit: Fit, effect: Effect, unit: float) -> tuple[float, int]:
    """Return the gain of coefficients that are not needed, and how many are needed.

    All sizes of a named effect are needed. A curve is charged for the coefficients that stand
    out, tested in order of how well the record resolves them.
    """
    if not isinstance(effect, Curve):
        return 0.0, effect.sizes
    position = next(position for other, position in fit.model.places() if other is effect)
    own = range(position.start, position.stop)
    left = fit.beside(fit.jacobian[:, position], own)
    squares = (np.linalg.qr(left, mode="r") @ fit.value[position]) ** 2 / unit
    superfluous = squares < SIZE_CHARGE
    return float(squares[superfluous].sum()), max(int(np.count_nonzero(~superfluous)), 1)


def ranked(rivals: Sequence[Rival]) -> list[Rival]:
    """Sort by evidence, with named effects before curves that the record can't distinguish.

    A curve can follow any law, and one in time anything: curves of the motion or the sensor
    precede it.
    """
    best = max(rivals, key=lambda rival: rival.evidence)
    within = class_width(best)

    def order(rival: Rival) -> tuple[int, float, float]:
        if best.evidence - rival.evidence >= within:
            return 3, 0.0, -rival.evidence
        freedom = int(rival.drawn) + int(rival.effect.in_time)
        return freedom, -rival.prior if rival.drawn else 0.0, -rival.evidence

    return sorted(rivals, key=order)


def probabilities(rivals: Sequence[Rival], none: float) -> FloatArray:
    """Return the probability of each rival, and last that of "none of these" (evidence `none`).

    Real laws differ slightly from the catalogue's forms, so that differences of evidence are
    uncertain: log odds are averaged over this uncertainty (MacKay's approximation).
    """
    leader = max(rivals, key=lambda rival: rival.evidence)
    spread = math.hypot(_PROBABILITY_FORM[0], _PROBABILITY_FORM[1] * max(leader.worth, 0.0))
    shrunk = 1.0 / math.sqrt(1.0 + math.pi / 8.0 * (0.5 * spread) ** 2)
    prior = np.array([rival.prior for rival in rivals])
    likelihood = np.array([rival.evidence for rival in rivals]) - prior
    best = float(likelihood.max())
    # A released parameter has the baseline's own form, which has no such uncertainty.
    own_form = np.array([rival.effect.kind == "parameter" for rival in rivals])
    worth = np.where(own_form, 1.0, shrunk) * (likelihood - best)
    logs = _in_order(0.5 * (worth + prior), rivals)
    return shares(np.append(logs, 0.5 * (none - best)))


def _in_order(logs: FloatArray, rivals: Sequence[Rival]) -> FloatArray:
    """Limit each log probability to that of effects with far better evidence.

    For large gains the uncertainty of the forms leaves little weight to differences of evidence,
    and the prior could raise an effect that the readings reject above one that they support.
    Curves, which can follow any law, limit only curves.
    """
    evidence = np.array([rival.evidence for rival in rivals])
    drawn = np.array([rival.drawn for rival in rivals])
    far = max(_FAR_BEHIND[0], _FAR_BEHIND[1] * max(rival.worth for rival in rivals))
    lowered = []
    for log, rival in zip(logs, rivals, strict=True):
        better = (evidence > rival.evidence + far) & (rival.drawn | ~drawn)
        lowered.append(np.min(logs[better], initial=log))
    return np.array(lowered)


_BEHIND_CURVE: Final = 0.6
"""Part of a curve's gain by which a refit may end behind it, beyond `NEAR`, and matter: a name has
far fewer values."""
_BEHIND_NAMED: Final = 0.1
"""The same behind a named effect."""
_FIRST_ROUNDS: Final = 4
"""Rounds after which the refits are compared."""
_ROUNDS_OF_A_START: Final = 2
"""Rounds of a start before it is judged: its numbers are right to a hundredth."""
_STALLED_GAIN: Final = 0.3
"""Fall of chi^2 in two rounds below which a refit stops (a winner is refined again)."""
_LARGEST_DISPLACEMENT: Final = 0.5
"""Largest displacement that an effect may add to the reading, over the first amplitude."""
_UNDERFLOW: Final = 1e-290
"""p-value below which the next digits are lost: the least number is 2e-308."""
_MOST_REFITTED: Final = 9
"""Effects that are refitted side by side: a choice, of time."""
_REACH_AT_BOUND: Final = 0.6
"""`REACH` where a value at its bound lowers the scores."""


def refit_leads(
    base: Fit,
    data: Data,
    noise: Noise,
    detection: Detection,
    *,
    held: Sequence[int],
    phase_lost: bool,
    most: int = _MOST_REFITTED,
) -> list[Rival]:
    """Refit the leading effects nonlinearly, and return them ranked, the best first."""
    lost = phase_lost and base.model.restoring == "linear" and data.unit == "rad"
    as_pendulum = replace(base.model, restoring="sine") if lost else base.model
    begun = (_begun(base, as_pendulum, data, noise, lead, held) for lead in detection.leads)
    leads = _worth_refitting(detection.leads, phase_lost, most, wide=bool(pulled(base)))
    # A gain that was had is more than a score: both are refitted.
    leads += filter(None, begun)
    fits = side_by_side(base, data, noise, leads, held, phase_lost=phase_lost)
    if not fits:
        return []
    scale = Scale.of(min((fit for _, fit in fits), key=lambda fit: fit.chi2), data, noise)
    rivals = ranked([Rival.of(*each, base.chi2, scale, detection.chance) for each in fits])
    return rivals if scale.clean else _names_first(rivals)


def _names_first(rivals: list[Rival]) -> list[Rival]:
    """Rank names that explain most of a misfit before curves, which may follow the rest.

    Where even the best leaves a misfit, names and curves will be needed together, and a curve that
    was drawn first would hide the names. What is not needed beside the curve is dropped again.
    Among names that the record can't distinguish the prior decides; then a law that acts throughout
    comes before an event, which takes a part of any misfit.
    """
    half = 0.5 * max(rival.gain for rival in rivals)
    best = max(rivals, key=lambda rival: -math.inf if rival.drawn else rival.evidence)
    near = best.evidence - class_width(best)

    def order(rival: Rival) -> tuple[bool, float, bool, float]:
        prior = rival.prior if rival.evidence > near else -math.inf
        return rival.drawn or rival.gain < half, -prior, rival.effect.local, -rival.evidence

    return sorted(rivals, key=order)


def _worth_refitting(found: Sequence[Lead], phase_lost: bool, most: int, wide: bool) -> list[Lead]:
    """Return the leads that may win, or be in the winner's class.

    There are more (`wide`) where the base has a value at its bound: the score keeps it there,
    while a refit may release it and gain far more.
    """
    leads = sorted(found, key=lambda lead: -_rank(lead))
    if not leads:
        return []
    part = 0.9 if phase_lost else _REACH_AT_BOUND if wide else REACH
    reached = within_reach(np.array(list(map(_rank, leads))), part)
    near = list(compress(leads, reached))
    # Several forms of one effect count as one. Curves lead in many misfits; but for a lost phase
    # they don't count beside names.
    told = [lead for lead in near if phase_lost or lead.effect.kind != "unnamed"]
    first = list(dict.fromkeys(lead.effect.identifier for lead in told))
    first = first[: most + 2 if phase_lost else most]
    near = [lead for lead in near if lead not in told or lead.effect.identifier in first]
    # Always refitted: parameters that the user holds (few), and where the phase is lost bearing
    # friction and drag, which every pendulum has.
    asked = [
        lead
        for lead in leads
        if isinstance(lead.effect, ReleasedParameter) or (phase_lost and lead.effect.expected)
    ]
    return [*near, *(lead for lead in asked if lead not in near)]


def _rank(lead: Lead) -> float:
    """Return what a score is worth with the noise as it is, as the refits are ranked later."""
    local = float(chdtrc(max(lead.effect.sizes, 1), max(lead.score, 0.0)))
    return equivalent(local, lead.score) + lead.effect.prior


def side_by_side(
    base: Fit,
    data: Data,
    noise: Noise,
    leads: Sequence[Lead],
    held: Sequence[int],
    *,
    phase_lost: bool,
) -> list[tuple[Effect, Fit]]:
    """Refit each lead; those of which that fails, or that nobody believes, are left out.

    Where the phase is lost all refits run to their end: an effect that explains a quarter may
    come first, and gains still grow while a scale is far off.
    """
    # The winner is refined again when the noise is estimated from its residual.
    little = SETTLED if phase_lost or data.time_noise else _STALLED_GAIN
    refits = [_started(base, data, noise, lead, held, little) for lead in leads]
    useful = math.inf if phase_lost else _limit(base, data, noise, leads, refits)
    return [
        (lead.effect, fit)
        for lead, refit in zip(leads, refits, strict=True)
        if refit and (fit := _finished(refit, useful)) and believable(base, fit, lead.effect)
    ]


def useful_chi2(best: float, gain: float, *, drawn: bool) -> float:
    """Return the largest chi^2 at which a rival still matters.

    Parameters
    ----------
    best, gain
        The best chi^2, and its gain over the model without the effect.
    drawn
        Whether the best is a curve.
    """
    return best + NEAR + (_BEHIND_CURVE if drawn else _BEHIND_NAMED) * max(gain, 0.0)


def believable(base: Fit, fit: Fit, effect: Effect) -> bool:
    """Whether the displacements that an effect adds are smaller than the motion itself.

    A second tone that is as large as the motion and has nearly its frequency describes a change
    of phase, not a second mode. A jump may have any size.
    """
    own = fit.value[len(base.value) + effect.parameter_free :]
    span = base.at.span
    moved = 0.0 if effect.local else effect.displacement(own, span.duration_s)
    return effect.believable(own) and moved < _LARGEST_DISPLACEMENT * span.first_amplitude


def _limit(
    base: Fit,
    data: Data,
    noise: Noise,
    leads: Sequence[Lead],
    refits: Sequence[Search[Evaluation] | None],
) -> float:
    """Return the largest useful chi^2, from the best credible refit so far."""
    found = [
        (fitted(refit), lead.effect.kind == "unnamed")
        for lead, refit in zip(leads, refits, strict=True)
        if refit and believable(base, fitted(refit), lead.effect)
    ]
    if not found:
        return math.inf
    best = min((fit for fit, _ in found), key=lambda fit: fit.chi2)
    scale = Scale.of(best, data, noise)
    if not scale.clean:
        return scale.within(NEAR)
    return min(useful_chi2(fit.chi2, base.chi2 - fit.chi2, drawn=drawn) for fit, drawn in found)


def _started(
    base: Fit, data: Data, noise: Noise, lead: Lead, held: Sequence[int], little: float
) -> Search[Evaluation] | None:
    """Start a lead's refit: its first rounds."""
    effect = lead.effect
    if isinstance(effect, ReleasedParameter):
        held = effect.without(held)
    if lead.begun:
        model, start = lead.begun
    else:
        # An effect without a free size is there; of others none is, at first.
        sizes = np.ones(1) if effect.parameter_free else np.zeros(min(effect.sizes, effect.count))
        own = finer_shape(base, noise, effect, lead.shape)
        model, start = base.model.adding(effect), np.concatenate([base.value, sizes, own])
    try:
        refit = searching(model, data, noise, start, held=held, little=little)
        refit.go(_FIRST_ROUNDS)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
    return refit


def _begun(
    base: Fit, model: Model, data: Data, noise: Noise, lead: Lead, held: Sequence[int]
) -> Lead | None:
    """Return the lead of the form that begins at what it makes of the readings, if it explains.

    What the model's other effects add to these is taken off. `model` is that of the fit; where
    this has lost the phase of angles, which tells nothing of the torque, that of a pendulum.
    """
    effect = lead.effect
    if type(effect).restart is Effect.restart or data.unit != "rad" or base.at.parts:
        return None
    angle = base.at.sampled.angle
    left = np.where(data.weight > 0.0, data.residual(base.at.reading), 0.0)
    about_s = float(base.value[TIME])
    pendulum = model.pendulum(base.value)
    found = effect.restart(data.time_s, left + angle, pendulum, about_s)
    if found is None:
        return None
    own = values_of(found.law, found.release, float(base.value[OFFSET]))
    start = np.concatenate([own, base.value[len(own) :], found.values])
    kept = [SHARE, *held]
    start[kept] = base.value[kept]
    try:
        model = model.adding(found.effect)
        search = searching(model, data, noise, start, held=held)
        search.go(_ROUNDS_OF_A_START)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
    gain = base.chi2 - search.here.chi2
    if gain <= 0.0:
        return None
    return lead._replace(effect=found.effect, score=gain, begun=(model, search.here.value))


def _finished(refit: Search[Evaluation], useful: float) -> Fit | None:
    try:
        refit.go(ROUNDS - _FIRST_ROUNDS, useful)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
    return fitted(refit)
