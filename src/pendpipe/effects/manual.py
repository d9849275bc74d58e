"""The catalogue's page in the docs, made from the effects' own declarations."""

from __future__ import annotations

import inspect
import math

from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.effects.effect import Effect, Parameter

_OPENING = """# What may have been left out

Made by `pendpipe effects`; each entry is one function in `src/pendpipe/effects/catalogue/`, from
which the simulation (`[[effects]]` in a model file), the diagnosis and this page are all taken.

`x` is the angle from the equilibrium, `r` its amplitude, `psi` the phase (x = r cos psi), `y`
the reading or an amplitude, `omega` that of Eq. 8. Times are in s from the turning point the
motion starts from (dynamics) or from the first reading (measurement); instants called `time`
are those of the record. The symbol of an acceleration that is added is +=.

**Adding one**: write a function like `cubic_stiffness` (its declaration with an `example`, and
the acceleration, kick, reading or delay that it makes) into a module of that package, or into a
new one: it is found there. The tests of every effect then run on its example; add one of its own
signature to `tests/effects/`, and run `pendpipe effects > docs/effects.md`.
"""

_HEADINGS = {
    "dynamics": "## Dynamics: the motion itself",
    "measurement": "## Measurement: the motion is as the baseline has it, the reading is not",
}


def page() -> str:
    """Return docs/effects.md."""
    parts = [_OPENING]
    for kind, heading in _HEADINGS.items():
        effects = [effect for effect in CATALOGUE if effect.kind == kind]
        listed = ", ".join(f"[`{effect.identifier}`](#{effect.identifier})" for effect in effects)
        parts += [heading, listed, *(_entry(effect) for effect in effects)]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _entry(effect: Effect) -> str:
    test = effect.discriminating_test
    text = inspect.cleandoc(type(effect).__doc__ or "")
    lines = [
        f"### {effect.identifier}",
        "",
        f"*{effect.name[0].upper()}{effect.name[1:]}.* {text}",
        "",
        f"$${effect.equation}$$",
        "",
        *_table(effect),
        *_remarks(effect),
        "",
        f"What decides: {test}{'' if test.endswith('?') else '.'}",
    ]
    return "\n".join(lines)


def _table(effect: Effect) -> list[str]:
    if not effect.parameters:
        return ["No free parameter: it is there, or it is not."]
    example = effect.example[effect.parameter_free :] or (None,) * len(effect.parameters)
    rows = [_row(*pair) for pair in zip(effect.parameters, example, strict=True)]
    return ["| parameter | unit | from | to | example |", "|---|---|---|---|---|", *rows]


def _row(parameter: Parameter, example: float | None) -> str:
    name = f"`{parameter.name}`"
    if parameter.default is not None and math.isfinite(parameter.default):
        name += f" ({parameter.default:g} unless given)"
    unit = parameter.unit_in("rad") or "none"
    shown = "" if example is None else f"{example:g}"
    bounds = f"{_bound(parameter.low)} | {_bound(parameter.high)}"
    return f"| {name} | {unit} | {bounds} | {shown} |"


def _bound(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else ""


def _remarks(effect: Effect) -> list[str]:
    remarks = []
    if effect.inside:
        remarks.append(f"Part of the baseline {', '.join(f'`{name}`' for name in effect.inside)}.")
    if effect.needs:
        names = ", ".join(f"`{name}`" for name in effect.needs)
        remarks.append(f"Nothing without the baseline's {names}.")
    if not effect.has_signature:
        remarks.append("Found by a test of its own, as it leaves no set trace in the readings.")
    if effect.angular:
        remarks.append("For angles only.")
    return ["", " ".join(remarks)] if remarks else []
