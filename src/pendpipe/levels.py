"""The error rates of all tests, declared once, and the standard deviations that they ask for.

A threshold of so many standard deviations stands for a number of trials: it is what the largest of
them exceeds by chance no more often than the level says (`deviations`).
"""

from statistics import NormalDist
from typing import Final

FALSE_ALARM: Final = 0.01
"""How often a recording, or a campaign, that lacks nothing may be reported, over all questions."""
REFUTED: Final = 1e-3
"""How often a recording of the fitted law may be refuted, over all questions of the test of fit:
a tenth of `FALSE_ALARM`, since a fit that is refuted sends its reader to the diagnosis."""


def deviations(trials: float, level: float = FALSE_ALARM) -> float:
    """Standard deviations that the largest of so many normal numbers exceeds at a level.

    Either sign counts.

    >>> round(deviations(1, 0.05), 2), round(deviations(1000), 2)
    (1.96, 4.42)
    """
    return -NormalDist().inv_cdf(0.5 * level / trials)
