"""Everything that was found, a line each: what stands behind the dozen lines of the answer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pendpipe.diagnosis.cycles import SmallSwings
from pendpipe.diagnosis.remainder import Remainder
from pendpipe.diagnosis.result import BASELINES, FittedModel, FoundEffect
from pendpipe.diagnosis.summary import COLOURED_NOISE, class_of, factor, percent, printed
from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.quantities import compact

DOUBTFUL: Final = 0.05
"""Probability up to which a name only describes and is not to be quoted."""
_CONFIRMED: Final = 0.01
"""p-value of a second test below which it confirms."""
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
    effects: Sequence[FoundEffect],
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
    """Write the lines: whether the baseline holds, each effect, and what is left.

    Parameters
    ----------
    baseline
        ``"eq8"`` or ``"viscous"``.
    before
        The baseline.
    effects
        What was found.
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
    model = _capital(BASELINES.get(baseline, baseline))
    left, noise_is = compact(before.residual_rms_rad, unit), compact(noise_rms, unit)
    times = factor(before.residual_rms_rad / noise_rms)
    lines = [
        f"{model} does not describe this recording ({printed(p_value)}): the residual is"
        f" {left} rms, {times} times the noise of {noise_is}.",
        *map(_effect, effects),
        _rest(unexplained, level, remainder),
        *([swings.sentence(unit)] if swings is not None else []),
    ]
    noise = [each.location.summary for each in effects if each.identifier == COLOURED_NOISE]
    if len(noise) == len(effects):
        wanders = any("the zero wanders" in note for note in notes)
        what = "the motion of this recording, whose zero wanders" if wanders else "this recording"
        agrees = f"the residual of {left} rms agrees with the noise ({noise_is})"
        if rounded and before.residual_rms_rad < noise_rms:
            agrees = f"it leaves {left} rms, less than the rounding adds ({noise_is})"
        nothing = (
            f"{model} describes {what}: {agrees}, and no effect of the catalogue"
            f" improves the fit more than chance would ({printed(unexplained)})."
        )
        lines = [nothing, *(f"{_capital(said)}." for said in noise)]
    return "\n".join([*lines, *([f"Note: {'; '.join(notes)}."] if notes else [])])


def _effect(effect: FoundEffect) -> str:
    """What one effect is, how sure that is, where it shows, and what would decide."""
    known = {each.identifier: {p.name for p in each.parameters} for each in CATALOGUE}
    # What a test has counted, its location says.
    wanted = known.get(effect.identifier, set(effect.parameters))
    members = class_of(effect)
    parts = [
        ", ".join(f"{name} {percent(p)}" for p, name in members)
        + (" (not told apart)" if len(members) > 1 else ""),
        *(
            f"{name} = {each}"
            for name, each in effect.parameters.items()
            if name in wanted and each.sd > 0.0
        ),
        effect.location.summary,
    ]
    if effect.confirmed is not None:
        sure = "confirmed" if effect.confirmed.p_value < _CONFIRMED else "not confirmed"
        parts.append(f"{sure} without the fit: {effect.confirmed.summary}")
    decide = f"decide by: {effect.discriminating_test}"
    text = f"{_capital('; '.join(part for part in (*parts, decide) if part))}"
    return text if text.endswith("?") else f"{text}."


def _rest(unexplained: float, level: float, remainder: Remainder | None) -> str:
    """What is left, and what that means for probabilities and errors."""
    if remainder is None or not remainder.systematic:
        if unexplained > level:
            return f"The remaining residual is consistent with noise ({printed(unexplained)})."
        return f"A small misfit remains unexplained ({printed(unexplained)})."
    shares = sorted(remainder.shares.items(), key=lambda item: -item[1])
    where = ", ".join(f"{percent(share)} {_PARTS[name]}" for name, share in shares if share > 0.05)
    return (
        f"The remaining residual is still {factor(remainder.over_noise)} times the noise"
        f" ({where}), so the model is incomplete: the errors given here allow for that, and the"
        " probabilities are lowered accordingly."
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
