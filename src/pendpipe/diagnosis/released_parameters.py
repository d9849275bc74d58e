"""Held parameters that may be wrong: fitting them separates this from missing physics."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.eq8 import PLACES, SHARE, B
from pendpipe.dynamics.eq8_model import HYSTERETIC, VISCOUS
from pendpipe.effects.effect import Effect

if TYPE_CHECKING:
    from pendpipe.diagnosis.refine import Fit

_PART: Final = {"quality_factor_hysteretic": HYSTERETIC, "quality_factor_viscous": VISCOUS}


class ReleasedParameter(Effect):
    """A baseline parameter given by ``--fix``, released and fitted.

    Parameters
    ----------
    fixed
        Its name: a, b, c, frequency, amplitude, offset or quality_factor_...
    """

    kind = "parameter"
    prior = 12.0
    parameters = ()
    discriminating_test = "measure that parameter by itself"

    def __init__(self, fixed: str) -> None:
        self.fixed = fixed
        self.index = PLACES.get(fixed)
        self.frees = _PART.get(fixed)  # type: ignore[misc]
        self.identifier = f"parameter-{fixed}"  # type: ignore[misc]
        self.name = f"another value of {fixed.replace('_', ' ')}"  # type: ignore[misc]
        self.equation = rf"\text{{{fixed.replace('_', ' ')}}} \ne \text{{given}}"  # type: ignore[misc]

    @property
    def count(self) -> int:
        """Zero: it is one of the baseline's values."""
        return 0

    def without(self, held: Iterable[int]) -> tuple[int, ...]:
        """Return the indices that stay held (the model itself handles held parts of b)."""
        return tuple(index for index in held if index != self.index)

    def sensitivity(self, fit: Fit) -> FloatArray:
        """Derivative of the whitened readings by the parameter, shape (n + 1,)."""
        if self.index is not None:
            return fit.jacobian[:, self.index]
        value, parts = fit.value, fit.model.held_parts()
        others = [part for part in parts if part != self.frees]
        if not others and value[B] > parts[str(self.frees)]:
            # b is fitted with the other part already: only the share is new.
            return fit.jacobian[:, SHARE]
        share = float(value[SHARE])
        by_part = (1.0 - share if self.frees == HYSTERETIC else -share) / float(value[B])
        along = by_part - fit.model.share_by_b(value)
        return fit.jacobian[:, B] + along * fit.jacobian[:, SHARE]
