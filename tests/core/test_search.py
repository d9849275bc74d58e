"""The descent over hypotheses, on a line of scores."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

from hypothesis import given, strategies as st

from pendpipe.search import descend


@dataclass(frozen=True)
class Place:
    """A place on a line of scores."""

    scores: tuple[int, ...]
    key: int
    lower: float = 0.0
    words: str = ""


def at(place: Place, step: int) -> Iterator[Place]:
    """The place some steps on, if there is one."""
    if 0 <= (key := place.key + step) < len(place.scores):
        yield Place(place.scores, key, place.scores[place.key] - place.scores[key], str(key))


UP, DOWN = (partial(at, step=step) for step in (1, -1))


@given(st.lists(st.integers(0, 9), min_size=1).map(tuple), st.data())
def test_a_descent_falls_with_each_step_and_ends_where_no_neighbour_is_lower(
    scores: tuple[int, ...], data: st.DataObject
) -> None:
    start, visited = data.draw(st.integers(0, len(scores) - 1)), list[str]()
    end = descend(Place(scores, start), [UP, DOWN], progress=visited.append)
    fallen = [scores[place] for place in (start, *map(int, visited))]
    assert all(after < before for before, after in pairwise(fallen))
    assert all(near.lower <= 0.0 for kind in (UP, DOWN) for near in kind(end))


def test_a_descent_returns_nowhere() -> None:
    """A hypothesis that was seen is none of its neighbours, whatever its score is now."""
    seen: set[Hashable] = {1}
    assert descend(Place((9, 1, 8), 0), [UP], seen=seen).key == 0
    assert seen == {0, 1}
