"""A parameter that was held, and may be wrong: told from missing physics by being fitted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pendpipe.effects.baseline import OFFSET, OMEGA, START, A, B, C
from pendpipe.effects.effect import Effect

_INDEX: Final[Mapping[str, int]] = {
    "a": A, "b": B, "c": C, "frequency": OMEGA, "amplitude": START, "offset": OFFSET,
    "quality_factor_hysteretic": B, "quality_factor_viscous": B,
}  # fmt: skip


class FreedParameter(Effect):
    """A baseline parameter given by ``--fix``, set free.

    Parameters
    ----------
    fixed
        Its name (contract: a, b, c, frequency, amplitude, offset, quality_factor_...).
    """

    kind = "parameter"
    prior = 12.0
    parameters = ()
    deciding = "measure that parameter by itself"

    def __init__(self, fixed: str) -> None:
        self.fixed = fixed
        self.index = _INDEX[fixed]
        self.identifier = f"parameter-{fixed}"  # type: ignore[misc]
        self.name = f"another value of {fixed.replace('_', ' ')}"  # type: ignore[misc]
        self.equation = rf"\text{{{fixed.replace('_', ' ')}}} \ne \text{{given}}"  # type: ignore[misc]

    @property
    def count(self) -> int:
        """It has no values of its own: it is one of the baseline's."""
        return 0


def freed_parameters(fixed: Mapping[str, float]) -> list[FreedParameter]:
    """One for each parameter that is held."""
    return [FreedParameter(name) for name in fixed]
