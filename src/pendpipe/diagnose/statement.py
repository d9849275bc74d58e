"""The answer as one paragraph of plain English."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from pendpipe.diagnose.held_out import HeldOut
from pendpipe.diagnose.remainder import Remainder
from pendpipe.diagnose.result import FittedModel, FoundEffect
from pendpipe.diagnose.small_swings import SmallSwings
from pendpipe.estimate import Estimate

_SURE: Final = 0.5
"""Probability below which a name is said with a perhaps."""
_SMALLEST: Final = 1e-12
"""p-values below it rest on tails that nobody has tested."""
_NAMES = {"eq8": "Eq. 8", "viscous": "the viscous model (Eq. 3)"}


def statement(
    baseline: str,
    before: FittedModel,
    after: FittedModel,
    effects: Sequence[FoundEffect],
    held: HeldOut | None,
    noise_rms: float,
    unexplained: float,
    level: float,
    *,
    unit: str = "rad",
    remainder: Remainder | None = None,
    swings: SmallSwings | None = None,
    notes: Sequence[str] = (),
) -> str:
    """Say where it differs, what was left out, how much better the fit is, what is open."""
    model = _NAMES.get(baseline, baseline)
    stamps = [f"Of the record itself: {'; '.join(notes)}."] if notes else []
    if not effects:
        nothing = (
            f"{model} describes the recording: what it leaves"
            f" ({before.residual_rms_rad:.3g} {unit}) is noise ({noise_rms:.3g} {unit}), and"
            f" nothing in the catalogue does better than chance (global {_chance(unexplained)})."
        )
        return " ".join([nothing, *stamps])
    said = [
        f"{model} leaves {before.residual_rms_rad:.3g} {unit} where the noise is"
        f" {noise_rms:.3g} {unit}.",
        *(_effect(effect) for effect in effects),
        _improvement(len(effects), before, after, held, unit),
    ]
    moved = _moved(before.parameters, after.parameters)
    if moved:
        said.append(f"The omission had falsified {moved}.")
    said.append(_open(unexplained, level, remainder))
    if swings is not None:
        said.append(swings.sentence(unit))
    return " ".join([*said, *stamps])


def _improvement(
    number: int, before: FittedModel, after: FittedModel, held: HeldOut | None, unit: str
) -> str:
    text = (
        f"With {'it' if number == 1 else 'them'} the residual falls to"
        f" {after.residual_rms_rad:.3g} {unit} (chi^2 per degree of freedom"
        f" {before.chi2_per_dof:.4g} to {after.chi2_per_dof:.4g})"
    )
    if held is None:
        return text + "."
    by = f"{abs(held.gain):.4g} +- {held.gain_sd:.2g} in log density"
    if held.gain < 0.0:
        return (
            f"{text}, but blocks held out are predicted worse by {by}: the extended model does"
            " not stand this test."
        )
    return f"{text}, and blocks held out are predicted better by {by}."


def _open(unexplained: float, level: float, remainder: Remainder | None) -> str:
    """What is still open, and what that makes of names and errors."""
    if remainder is None or not remainder.systematic:
        if unexplained > level:
            return f"Nothing else stands out (global {_chance(unexplained)})."
        return f"Something is left that has not been explained (global {_chance(unexplained)})."
    places = {
        "level": "in the level",
        "amplitude": "in the amplitude of the motion",
        "phase": "in its phase",
        "harmonics": "in its higher harmonics",
        "between": "between the harmonics",
    }
    shares = sorted(remainder.shares.items(), key=lambda item: -item[1])
    where = ", ".join(f"{share:.0%} {places[name]}" for name, share in shares if share > 0.05)
    return (
        f"What is left is {remainder.over_noise:.3g} times the noise and has not been explained"
        f" (global {_chance(unexplained)}; {where}): it is systematic, so that all errors given"
        f" are {remainder.error_scale:.3g} times those of noise alone, and no name is believed more"
        " than the part of the misfit that it explains."
    )


def _chance(p_value: float) -> str:
    """A p-value in words that a computer's smallest number doesn't spoil."""
    return f"p = {p_value:.2g}" if p_value >= _SMALLEST else f"p < {_SMALLEST:.0e}"


def _effect(effect: FoundEffect) -> str:
    """One sentence on one effect."""
    where = f", {effect.location.summary}" if effect.location.summary else ""
    if effect.kind == "unnamed":
        return (
            f"Left out is something that no entry of the catalogue explains: {effect.name}{where}."
        )
    numbers = ", ".join(_number(name, each) for name, each in effect.parameters.items())
    kind = {"dynamics": "physics", "measurement": "the measurement", "parameter": "a parameter"}
    lead = "Left out is" if effect.probability > _SURE else "Left out is perhaps"
    text = f"{lead} {effect.name} ({kind.get(effect.kind, effect.kind)}"
    text += f"; {numbers})" if numbers else ")"
    text += f"{where} (Delta chi^2 = {effect.delta_chi2:.4g}, {_chance(effect.p_value)})"
    if effect.indistinguishable:
        others = ", ".join(name for name, _ in effect.indistinguishable)
        text += f"; this recording cannot tell it from {others}: {effect.discriminating_test}"
    return text if text.endswith("?") else text + "."


def _number(name: str, each: Estimate) -> str:
    unit = f" {each.unit}" if each.unit else ""
    return f"{name} = {each.value:.4g} +- {each.sd:.2g}{unit}"


def _moved(before: Mapping[str, Estimate], after: Mapping[str, Estimate]) -> str:
    """Baseline parameters that changed by more than three of their standard deviations."""
    found = []
    for name, new in after.items():
        old = before[name]
        if name == "phase" or not new.sd > 0.0:
            continue
        off = abs(old.value - new.value) / new.sd
        if off > 3.0:
            found.append(f"{name} ({old.value:.5g} for {new.value:.5g} {new.unit}, {off:.3g} sd)")
    return ", ".join(found)
