"""What is known of a recording's file: each fact with its value, and how it is known.

A fact is stated (in the file, or by the user), shown (by a test whose rate of error is known), or
guessed. Readers make facts, `inspect --why` prints their table, and whoever decides by one asks for
its kind: no decision reads the words.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final, Literal, NamedTuple

How = Literal["stated", "shown", "guessed"]


class Kind(NamedTuple):
    """A kind of fact.

    The option that overrides it, the numbers of a fit that it changes, and how often the test that
    shows it is wrong: the upper end of what ``python -m benchmarks.facts`` prints.
    """

    option: str
    changes: tuple[str, ...] = ()
    wrong: float | None = None


KINDS: Final[Mapping[str, Kind]] = {
    "layout": Kind("--delimiter, --decimal", wrong=0.004),
    "rows": Kind("--start, --stop", wrong=0.004),
    "time column": Kind("--column", ("period", "Q"), 0.004),
    "unit of time": Kind("--unit s:", ("period",), 0.02),
    "clock": Kind("--sample-rate", ("period",), 0.004),
    "reading": Kind("--column", ("period", "Q"), 0.03),
    "unit": Kind("--unit", wrong=0.01),
    "sensor constant": Kind("--volts-per-radian"),
    "turns": Kind("--unit", wrong=0.004),
    "pivot": Kind("--column x for the position itself", wrong=0.02),
    "amplitudes": Kind("--column", ("Q",), 0.006),
    "pull": Kind("--column", ("period",), 0.01),
    "drive": Kind("--start, --stop", wrong=0.04),
    "lost readings": Kind("--start, --stop", wrong=0.01),
    "saturation": Kind("--start, --stop", wrong=0.004),
}
"""Every kind, in the order in which a file is understood."""


SWINGS: Final = "swings"
"""The unit of time of a list that counts them: each lasts a period."""


@dataclass(frozen=True)
class Fact:
    """One fact of a file.

    Parameters
    ----------
    kind
        One of `KINDS`.
    value
        What is taken: a unit, the label of a column, a rate.
    how
        ``"stated"``, ``"shown"`` or ``"guessed"``.
    said
        The clause that the user reads; ``""`` of what goes without saying.
    option
        What overrides it; by default that of its kind.

    Examples
    --------
    >>> Fact("unit", "rad", "guessed", "'x' has no unit").words
    "'x' has no unit (--unit)"
    """

    kind: str
    value: str
    how: How
    said: str = ""
    option: str = ""

    def __post_init__(self) -> None:
        if not self.option:
            object.__setattr__(self, "option", KINDS[self.kind].option)

    @property
    def error_rate(self) -> float | None:
        """How often the test that shows it is wrong; ``None`` of what is stated or guessed."""
        return KINDS[self.kind].wrong if self.how == "shown" else None

    @property
    def changes(self) -> tuple[str, ...]:
        """The numbers of a fit that are others where this is wrong; none of what is no guess."""
        return KINDS[self.kind].changes if self.how == "guessed" else ()

    @property
    def words(self) -> str:
        """The clause; behind a guess the option that overrides it."""
        return f"{self.said} ({self.option})" if self.how == "guessed" else self.said

    @property
    def row(self) -> str:
        """The fact as a row of a table."""
        known = self.how if self.error_rate is None else f"{self.how} (p = {self.error_rate:.1g})"
        cells = (
            f"{self.kind:<15}",
            f"{self.value:<24}",
            f"{known:<17}",
            f"{self.option:<13}",
            self.said,
        )
        return "  ".join(cells).rstrip()

    def as_json(self) -> dict[str, Any]:
        """Return the object that ``inspect --json`` prints."""
        return asdict(self) | {"error_rate": self.error_rate}


def guesses(facts: Iterable[Fact]) -> tuple[str, ...]:
    """The clauses of what is guessed, each with the option that overrides it."""
    return tuple(fact.words for fact in facts if fact.how == "guessed")


def remarks(facts: Iterable[Fact]) -> tuple[str, ...]:
    """The clauses of all that is no guess."""
    return tuple(fact.said for fact in facts if fact.how != "guessed" and fact.said)
