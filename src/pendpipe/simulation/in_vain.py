"""Effects that a model asks for and that could do nothing in it: said, not passed over."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pendpipe.errors import InputError
from pendpipe.simulation.effects import Given

if TYPE_CHECKING:
    from pendpipe.simulation.model import Model


def refuse_in_vain(model: Model, given: Sequence[Given], place: str) -> None:
    """Refuse effects that have nothing to act on, and faults of the instrument given twice.

    Raises
    ------
    InputError
        Which effect, what is missing, what to do.
    """
    seen: set[str] = set()
    for number, one in enumerate(given, start=1):
        name = one.effect.identifier
        where = f"{place}, effects {number} ({name})"
        if not one.effect.has_signature and name in seen:
            raise InputError(where, "it is given before", "write one table of it")
        seen.add(name)
        lacking = _lacking(model, one)
        if lacking is not None:
            raise InputError(where, *lacking)


def _lacking(model: Model, one: Given) -> tuple[str, str] | None:
    """What an effect acts on and a model lacks, and what to do; None where it has it."""
    name, pendulum = one.effect.identifier, model.pendulum
    for need in one.effect.needs:
        if not getattr(pendulum, need):
            return f"it does nothing where the pendulum's {need} is 0", f"give {need}"
    linear = pendulum.quality_factor_hysteretic or pendulum.quality_factor_viscous
    if name == "damping-step" and not (pendulum.a or pendulum.c or linear):
        return "it does nothing where the pendulum has no damping", "give a, c or a quality factor"
    if name == "missing-codes" and model.converter is None:
        return "there are no missing codes without a converter", "add [converter]"
    if name == "coloured-noise" and not _noise(model):
        return "it colours the noise, and there is none", "give noise_rad, or noise_volts"
    if name == "clipping" and not any(
        math.isfinite(one.named()[level]) for level in ("lower_level", "upper_level")
    ):
        return "neither of its levels is given", "give upper_level or lower_level, in rad"
    return None


def _noise(model: Model) -> bool:
    """Whether the readings have any."""
    return model.noise_rad > 0.0 or (model.sensor is not None and model.sensor.noise_volts > 0.0)
