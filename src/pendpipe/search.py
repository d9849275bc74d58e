"""One search, for what a record lacks and for what a campaign lacks: a descent over hypotheses."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Protocol, TypeVar


class State(Protocol):
    """A hypothesis, by how much its score is lower than that of the one it was made from, and why.

    The score is twice the negative log-likelihood, with the prices of all that was chosen.
    """

    @property
    def lower(self) -> float:
        """By how much."""

    @property
    def words(self) -> str:
        """Why: what was done."""

    @property
    def key(self) -> Hashable:
        """What tells it from others."""


_S = TypeVar("_S", bound=State)


def _as_it_is(state: _S) -> _S:
    return state


def descend(
    state: _S,
    kinds: Sequence[Callable[[_S], Iterable[_S]]],
    settle: Callable[[_S], _S] = _as_it_is,
    progress: Callable[[str], object] = bool,
    seen: set[Hashable] | None = None,
) -> _S:
    """Go to the best neighbour of a lower score, until there is none that was not seen.

    Parameters
    ----------
    state
        Where it begins, in order.
    kinds
        Neighbours of each kind, cheap ones first: the first kind that has a better one is taken.
    settle
        Brings a hypothesis that is taken into order, before its neighbours are asked.
    progress
        Is told of each step.
    seen
        Keys of hypotheses that it does not return to; those it visits are added.
    """
    seen = set() if seen is None else seen
    while True:
        seen.add(state.key)
        for some in kinds:
            new = (each for each in some(state) if each.key not in seen)
            best = max(new, key=lambda each: each.lower, default=None)
            if best is not None and best.lower > 0.0:
                progress(best.words)
                state = settle(best)
                break
        else:
            return state
