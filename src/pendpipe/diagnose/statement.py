"""The answer as one paragraph of plain English."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pendpipe.diagnose.held_out import HeldOut
from pendpipe.diagnose.result import Judged, Named
from pendpipe.estimate import Estimate

_NAMES = {"eq8": "Eq. 8", "viscous": "the viscous model (Eq. 3)"}


def statement(
    baseline: str, before: Judged, after: Judged, effects: Sequence[Named],
    held: HeldOut | None, noise_rms: float, unexplained: float, level: float,
) -> str:  # fmt: skip
    """Say where it differs, what was left out, how much better the fit is, what is open."""
    model = _NAMES.get(baseline, baseline)
    if not effects:
        return (
            f"{model} describes the recording: what it leaves ({before.residual_rms_rad:.3g} rad)"
            f" is noise ({noise_rms:.3g} rad), and nothing in the catalogue does better than chance"
            f" (global p = {unexplained:.2g})."
        )
    said = [f"{model} leaves {before.residual_rms_rad:.3g} rad where the noise is {noise_rms:.3g}."]
    said += [_effect(effect) for effect in effects]
    said.append(
        f"With {'it' if len(effects) == 1 else 'them'} the residual falls to"
        f" {after.residual_rms_rad:.3g} rad (chi^2 per degree of freedom"
        f" {before.chi2_per_dof:.4g} to {after.chi2_per_dof:.4g})"
        + (
            f", and blocks held out are predicted better by {held.gain:.4g} +- {held.gain_sd:.2g}"
            " in log density."
            if held is not None
            else "."
        )
    )
    moved = _moved(before.parameters, after.parameters)
    if moved:
        said.append(f"The omission had falsified {moved}.")
    said.append(
        f"Nothing else stands out (global p = {unexplained:.2g})."
        if unexplained > level
        else f"Something is left that has not been explained (global p = {unexplained:.2g})."
    )
    return " ".join(said)


def _effect(effect: Named) -> str:
    """One sentence on one effect."""
    where = f", {effect.location.summary}" if effect.location.summary else ""
    if effect.kind == "unnamed":
        return (
            f"Left out is something that no entry of the catalogue explains: {effect.name}{where}."
        )
    numbers = ", ".join(_number(name, each) for name, each in effect.parameters.items())
    kind = {"dynamics": "physics", "measurement": "the measurement", "parameter": "a parameter"}
    text = f"Left out is {effect.name} ({kind.get(effect.kind, effect.kind)}"
    text += f"; {numbers})" if numbers else ")"
    text += f"{where} (Delta chi^2 = {effect.delta_chi2:.4g}, p = {effect.p_value:.2g})"
    if effect.indistinguishable:
        others = ", ".join(name for name, _ in effect.indistinguishable)
        text += f"; this recording cannot tell it from {others}: {effect.deciding}"
    return text + "."


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
