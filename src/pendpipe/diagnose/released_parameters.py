"""A parameter that was held, and may be wrong: told from missing physics by being fitted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.refine import Fit
from pendpipe.effects.baseline import (
    HYSTERETIC,
    OFFSET,
    OMEGA,
    SHARE,
    START,
    VISCOUS,
    A,
    B,
    C,
    share_by_b,
)
from pendpipe.effects.effect import Effect

_INDEX: Final[Mapping[str, int]] = {
    "a": A,
    "b": B,
    "c": C,
    "frequency": OMEGA,
    "amplitude": START,
    "offset": OFFSET,
}
_PART: Final = {"quality_factor_hysteretic": HYSTERETIC, "quality_factor_viscous": VISCOUS}


class ReleasedParameter(Effect):
    """A baseline parameter given by ``--fix``, set free.

    Parameters
    ----------
    fixed
        Its name (contract: a, b, c, frequency, amplitude, offset, quality_factor_...).
    """

    kind = "parameter"
    prior = 12.0
    parameters = ()
    discriminating_test = "measure that parameter by itself"

    def __init__(self, fixed: str) -> None:
        self.fixed = fixed
        self.index = _INDEX.get(fixed)
        self.frees = _PART.get(fixed)  # type: ignore[misc]
        self.identifier = f"parameter-{fixed}"  # type: ignore[misc]
        self.name = f"another value of {fixed.replace('_', ' ')}"  # type: ignore[misc]
        self.equation = rf"\text{{{fixed.replace('_', ' ')}}} \ne \text{{given}}"  # type: ignore[misc]

    @property
    def count(self) -> int:
        """It has no values of its own: it is one of the baseline's."""
        return 0

    def without(self, held: Iterable[int]) -> list[int]:
        """Of held indices, those that are held still (held parts of b are the model's matter)."""
        return [index for index in held if index != self.index]

    def sensitivity(self, fit: Fit) -> FloatArray:
        """What a little more of it does to the whitened readings, shape (n + 1,)."""
        if self.index is not None:
            return fit.jacobian[:, self.index]
        value, parts = fit.value, fit.model.held_parts()
        others = [part for part in parts if part != self.frees]
        if not others and value[B] > parts[str(self.frees)]:
            # b is fitted, along with the other part: only how it divides is new.
            return fit.jacobian[:, SHARE]
        share = float(value[SHARE])
        by_part = (1.0 - share if self.frees == HYSTERETIC else -share) / float(value[B])
        along = by_part - share_by_b(value, parts)
        return fit.jacobian[:, B] + along * fit.jacobian[:, SHARE]


def released_parameters(fixed: Mapping[str, float]) -> list[ReleasedParameter]:
    """One for each parameter that is held."""
    return [ReleasedParameter(name) for name in fixed]
