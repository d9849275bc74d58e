"""Everything that was found, in a paragraph: what stands behind the dozen lines of the answer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from pendpipe.diagnosis.cycles import SmallSwings
from pendpipe.diagnosis.detect import printed
from pendpipe.diagnosis.held_out import HeldOut
from pendpipe.diagnosis.remainder import Remainder
from pendpipe.diagnosis.result import BASELINES, FittedModel, FoundEffect
from pendpipe.diagnosis.summary import COLOURED_NOISE, name_of
from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.estimate import Estimate
from pendpipe.quantities import compact, listed, with_error

_PROBABLE: Final = 0.5
"""Probability from which an effect is reported without "possibly"."""
DOUBTFUL: Final = 0.05
"""Probability up to which a name only describes and is not to be quoted."""
_CERTAIN: Final = 0.95
"""Probability from which an effect without rivals needs no further measurement."""
_IMPROBABLE: Final = 0.01
"""Probability up to which a rival is called improbable."""
_SIGNIFICANT: Final = 3.0
"""Standard deviations from which a change of a parameter is reported as a bias."""
_KINDS = {
    "dynamics": "from the model of the pendulum",
    "measurement": "from the model of the measurement",
    "unnamed": "from the model, and not in the catalogue",
}
_MEANINGS = {
    "circular-error": "the restoring torque follows sin x, not x",
    "presliding-friction": "the bearing yields elastically before it slides",
    "ac-coupling": "the sensor loses slow signals",
    "jitter": "the sampling times are uncertain",
    "second-mode": "another part of the apparatus oscillates too",
}
"""What the names mean that a newcomer may not know."""
_PARAMETERS = {
    "a": "quadratic damping rate a",
    "b": "linear damping rate b",
    "c": "Coulomb damping rate c",
    "amplitude": "initial amplitude",
    "offset": "offset",
}
_PARTS = {
    "offset": "in the offset",
    "amplitude": "in the amplitude",
    "phase": "in the phase",
    "harmonics": "in the higher harmonics",
    "between": "between the harmonics",
}


def statement(
    baseline: str,
    before: FittedModel,
    after: FittedModel,
    effects: Sequence[FoundEffect],
    held: HeldOut | None,
    noise_rms: float,
    p_value: float,
    unexplained: float,
    level: float,
    *,
    unit: str = "rad",
    remainder: Remainder | None = None,
    swings: SmallSwings | None = None,
    notes: Sequence[str] = (),
    rounded: bool = False,
) -> str:
    """Write the paragraph.

    It answers in this order: does the baseline describe the recording, what is missing and how
    sure is that, what cannot be distinguished from it and what to measure next, how much of the
    misfit it explains, what it changes in period and Q, what is left.

    Parameters
    ----------
    baseline
        ``"eq8"`` or ``"viscous"``.
    before, after
        The baseline and the extended model.
    effects
        What was found.
    held
        How well both models predict cycles that they were not fitted to.
    noise_rms
        Of one reading.
    p_value, unexplained
        Global p-values of the baseline and of what the extended model leaves.
    level
        The significance level.
    unit
        Of the readings.
    remainder, swings
        What the extended model leaves, and the frequency at the smallest amplitudes.
    notes
        Properties of the time stamps, a clause each.
    rounded
        Whether the noise is that of the rounding.
    """
    model = BASELINES.get(baseline, baseline)
    stamps = [f"Note: {'; '.join(notes)}."] if notes else []
    noise = [each.location.summary for each in effects if each.identifier == COLOURED_NOISE]
    if len(noise) == len(effects):
        wanders = any("the zero wanders" in note for note in notes)
        what = "the motion of this recording, whose zero wanders" if wanders else "this recording"
        left, noise_is = (compact(each, unit) for each in (before.residual_rms_rad, noise_rms))
        agrees = f"the residual of {left} rms agrees with the noise ({noise_is})"
        if rounded and before.residual_rms_rad < noise_rms:
            agrees = f"it leaves {left} rms, less than the rounding adds ({noise_is})"
        nothing = (
            f"{_capital(model)} describes {what}: {agrees}, and no effect of the catalogue"
            f" improves the fit more than chance would ({printed(unexplained)})."
        )
        return " ".join([nothing, *(f"{_capital(said)}." for said in noise), *stamps])
    times = before.residual_rms_rad / noise_rms
    many = f"{_factor(times)} times" if times > 1.05 else "as large as"
    # The others only describe.
    named = [each for each in effects if each.kind != "unnamed" and each.probability > DOUBTFUL]
    text = [
        f"{_capital(model)} does not describe this recording ({printed(p_value)}): the residual is"
        f" {compact(before.residual_rms_rad, unit)} rms, {many} the noise of"
        f" {compact(noise_rms, unit)}.",
        *(_effect(effect) for effect in named),
        _nameless([effect for effect in effects if effect not in named], rest=bool(named)),
        _improvement(len(effects), before, after, held, unit),
        _changes(len(effects), before.parameters, after.parameters, held, unit),
        _rest(unexplained, level, remainder),
    ]
    if swings is not None:
        text.append(swings.sentence(unit))
    return " ".join([*(part for part in text if part), *stamps])


_CONFIRMED: Final = 0.01
"""p-value of a second test below which it confirms."""


def _effect(effect: FoundEffect) -> str:
    """What one effect is, how sure that is, where it shows, and what would decide."""
    facts = [f"probability {_percent(effect.probability)}", *_numbers(effect)]
    rivals = effect.indistinguishable
    if effect.kind == "parameter":
        lead = f"Instead of a missing effect, one held parameter is wrong: {effect.name}"
    elif max((p for _, p in rivals), default=0.0) > effect.probability:
        # The most probable stands first, also where another was easier to fit.
        all_ = [(effect.probability, effect.name), *((p, name_of(name)) for name, p in rivals)]
        of = [
            f"{name} ({_percent(p)})" for p, name in sorted(all_, reverse=True) if p > _IMPROBABLE
        ]
        missing = "Missing" if sum(p for p, _ in all_) > _PROBABLE else "Possibly missing"
        text = f"{missing} from the model: {listed(of, 'or')}"
        lead = f"{text}, which this recording alone cannot distinguish"
        facts, rivals = [], ()
    else:
        missing = "Missing" if effect.probability > _PROBABLE else "Possibly missing"
        name = f"{missing} {_KINDS.get(effect.kind, 'from the model')}: {effect.name}"
        meaning = _MEANINGS.get(effect.identifier)
        lead = f"{name}, that is, {meaning}" if meaning else name
    said = [f"{lead} ({'; '.join(facts)})." if facts else f"{lead}."]
    if effect.location.summary:
        said.append(f"{_capital(effect.location.summary)}.")
    if effect.confirmed is not None:
        sure = "Confirmed" if effect.confirmed.p_value < _CONFIRMED else "Not confirmed"
        said.append(f"{sure} without the fit: {effect.confirmed.summary}.")
    said.extend(_rivals(rivals))
    if effect.probability <= _CERTAIN or any(p > _IMPROBABLE for _, p in effect.indistinguishable):
        said.append(_ended(f"What to measure next: {effect.discriminating_test}"))
    return " ".join(said)


def _nameless(effects: Sequence[FoundEffect], *, rest: bool) -> str:
    """What describes the misfit, or the rest of it, without a name to rely on."""
    if not effects:
        return ""
    first = effects[0]
    described = [each.name for each in effects]
    what = "The rest of the misfit" if rest else "The misfit"
    text = f"{what} has no certain cause; it is described best by {listed(described)}"
    if len(effects) == 1 and first.indistinguishable:
        others = [name_of(name) for name, _ in first.indistinguishable]
        text += f", and almost as well by {listed(others, 'or')}"
        if max(p for _, p in first.indistinguishable) > first.probability:
            text = f"{what} has no certain cause; any of these describes it: "
            text += listed([*others, *described], "or")
    return f"{text}. " + _ended(f"What to measure next: {effects[0].discriminating_test}")


def _numbers(effect: FoundEffect) -> list[str]:
    """The parameters that the catalogue knows; what a test has counted, its sentence says."""
    known = {each.identifier: {p.name for p in each.parameters} for each in CATALOGUE}
    wanted = known.get(effect.identifier, set(effect.parameters))
    shown = {name: each for name, each in effect.parameters.items() if name in wanted}
    return [f"{name} = {each}" for name, each in shown.items() if each.sd > 0.0]


def _rivals(rivals: Sequence[tuple[str, float]]) -> list[str]:
    """What else the recording allows, a sentence for the probable and one for the others."""
    probable = [f"{name_of(name)} ({_percent(p)})" for name, p in rivals if p > _IMPROBABLE]
    others = [name_of(name) for name, p in rivals if p <= _IMPROBABLE]
    said = []
    if probable:
        said.append(f"This recording alone cannot distinguish it from {listed(probable, 'or')}.")
    if others:
        less = "is less probable than 1 %" if len(others) == 1 else "each is less probable than 1 %"
        fits = f"{_capital(listed(others, 'or'))} would fit almost as well"
        said.append(f"{fits}, but {less}.")
    return said


def _improvement(
    number: int, before: FittedModel, after: FittedModel, held: HeldOut | None, unit: str
) -> str:
    """How much of the misfit the effects explain, and whether they predict."""
    old, new = before.residual_rms_rad, after.residual_rms_rad
    this = "this" if number == 1 else "these effects"
    text = f"Including {this} reduces the residual from {compact(old, unit)}"
    text += f" to {compact(new, unit)} rms"
    if old > 1.05 * new > 0.0:
        text += f", by a factor of {_factor(old / new)}"
    if held is None or not math.isfinite(held.gain):
        return text + "."
    worse = _fails(held)
    count = held.blocks - held.better if worse else held.better
    text += (
        f". Cycles that were left out of the fit are predicted {'worse' if worse else 'better'} in"
        f" {count} of {held.blocks} parts of the record"
    )
    if worse == (held.rms_after > held.rms_before):
        old, new = held.rms_before, held.rms_after
        text += f" (from {compact(old, unit)} to {compact(new, unit)} rms)"
    return f"{text}: the extended model fails this test." if worse else f"{text}."


def _fails(held: HeldOut | None) -> bool:
    """Whether the extended model predicts cycles that were left out worse."""
    return held is not None and held.gain < 0.0


def _changes(
    number: int,
    before: Mapping[str, Estimate],
    after: Mapping[str, Estimate],
    held: HeldOut | None,
    unit: str,
) -> str:
    """What it changes in the small-angle period, in Q, and in the other parameters.

    What predicts worse says nothing of a bias without it.
    """
    changed, kept, period = [], [], "small-angle period" if unit == "rad" else "period"
    for name, of in ((period, _period), ("Q limit (pi f/b)", _quality_factor)):
        old, new = of(before), of(after)
        if old is None or new is None:
            continue
        if _biased(old, new):
            changed.append(f"the {name} from {_like(old, new)} to {new}")
        else:
            kept.append(f"the {name} at {new}, within its error")
    parts = [f"changes {listed(changed)}"] if changed else []
    parts += [f"leaves {listed(kept)}"] if kept else []
    moved = [
        f"{_PARAMETERS[name]} {_like(before[name], new)} instead of {new}"
        for name, new in after.items()
        if name in _PARAMETERS and _biased(before[name], new)
    ]
    text = f"This {listed(parts)}." if parts else ""
    if moved and not _fails(held):
        without = "it" if number == 1 else "them"
        text += f" Without {without} the fit is biased: {'; '.join(moved)}."
    return text.strip()


def _period(parameters: Mapping[str, Estimate]) -> Estimate | None:
    """The period at small angles, 1/f."""
    frequency = parameters.get("frequency")
    if frequency is None or not frequency.value > 0.0:
        return None
    return Estimate(1.0 / frequency.value, frequency.sd / frequency.value**2, "s")


def _quality_factor(parameters: Mapping[str, Estimate]) -> Estimate | None:
    """The limit of Q that the linear damping rate alone sets; None where b is not resolved."""
    frequency, linear = parameters.get("frequency"), parameters.get("b")
    if frequency is None or linear is None or not linear.value > 2.0 * linear.sd:
        return None
    value = math.pi * frequency.value / linear.value
    return Estimate(value, value * linear.sd / linear.value, "")


def _biased(old: Estimate, new: Estimate) -> bool:
    return new.sd > 0.0 and abs(old.value - new.value) > _SIGNIFICANT * new.sd


def _like(old: Estimate, new: Estimate) -> str:
    """A value with the digits of another's error, without an error of its own."""
    if old.value == 0.0:
        return "0"
    value, _, rest = with_error(old.value, new.sd).strip("(").partition(" ± ")
    return value + rest.partition(")")[2]


def _rest(unexplained: float, level: float, remainder: Remainder | None) -> str:
    """What is left, and what that means for probabilities and errors."""
    if remainder is None or not remainder.systematic:
        if unexplained > level:
            return f"The remaining residual is consistent with noise ({printed(unexplained)})."
        return f"A small misfit remains unexplained ({printed(unexplained)})."
    shares = sorted(remainder.shares.items(), key=lambda item: -item[1])
    where = ", ".join(f"{_percent(share)} {_PARTS[name]}" for name, share in shares if share > 0.05)
    return (
        f"The remaining residual is still {_factor(remainder.over_noise)} times the noise"
        f" ({where}), so the model is incomplete: the errors given here allow for that, and the"
        " probabilities are lowered accordingly."
    )


def _percent(share: float) -> str:
    """A probability in per cent."""
    if share > 0.995:
        return "> 99 %"
    return f"{100.0 * share:.0f} %" if share > _IMPROBABLE else "< 1 %"


def _factor(ratio: float) -> str:
    """A ratio to two digits, without a power of ten."""
    return f"{float(f'{ratio:.2g}'):,.0f}" if ratio > 9.95 else f"{ratio:.2g}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _ended(text: str) -> str:
    return text if text.endswith("?") else f"{text}."
