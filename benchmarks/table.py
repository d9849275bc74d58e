"""Lines of Markdown tables, and shares with their intervals."""

from collections.abc import Iterable

from scipy.stats import binomtest


def share(hits: int, of: int) -> str:
    """How many of how many, and the share in percent with its exact 95 % interval."""
    if not of:
        return "none"
    low, high = binomtest(hits, of).proportion_ci()
    return f"{hits} of {of}: {100 * hits / of:.1f} ({100 * low:.1f} to {100 * high:.1f})"


def table_row(what: object, cells: Iterable[object]) -> str:
    """A row of a table."""
    return f"| {what} | {' | '.join(map(str, cells))} |"


def head(*titles: str) -> str:
    """The first two rows of a table."""
    return f"{table_row(titles[0], titles[1:])}\n{'|---' * len(titles)}|"
