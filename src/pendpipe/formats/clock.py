"""Times of day and dates, as programs and people write them."""

import datetime as dt
import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray

_DATE: Final = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}")
_WORDED: Final = re.compile(
    r"(?=.*\d:\d\d)(?i:.*(?<![a-z])(jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)).{4,40}"
)
"""``01-May-2025 12:00:00.5``, ``Thu May  1 12:00:00 2025``: months as words."""
_CLOCK: Final = re.compile(
    r"(?:0 days? )?"
    r"(?:(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})[T ,]+|(\d{1,2})[-/.](\d{1,2})[-/.](\d{4}|\d\d)[T ,]+)?"
    r"(?!\d+\.\d+\s*(?:[a-z+-]|$))"  # 12.50 is a number
    # Points part hours from minutes where they part these from seconds: 38:05.6 has no hours.
    r"(?:(\d{1,3})(?::(?=\d+:)|\.(?=\d+\.)))?(\d{1,2})[:.](\d{1,2}(?:[.,:]\d+)?)"
    r"\s*(am|pm)?\s*(?:z|utc|([+-]\d{2}):?(\d{2}))?",
    re.I,
)


_MONTHS: Final = 12
"""What is more is a day."""
_FIRST_DAY: Final = -24107
"""1 January 1904, counted from 1970: earlier days are the zeros of spreadsheets."""


def is_clock(cell: str) -> bool:
    """Say whether a cell is a date or a time of day."""
    return any(each.fullmatch(cell.lstrip("'")) for each in (_DATE, _CLOCK, _WORDED))


def column_of_clock_times(cells: Sequence[str]) -> FloatArray | None:
    """Turn ``12:34:56.7``, ``0:05.2`` or ``2024-05-01T12:34:56`` into seconds.

    Times of day that pass midnight go on, and minutes that pass the hour; dates are counted
    from 1 January 1970. Of two parts the last is seconds. A day and month that could be either
    are taken as month/day with slashes, as day.month else: it matters at midnight only.

    Returns
    -------
    seconds
        NaN in cells that are no times; ``None`` if fewer than nine in ten are.
    """
    texts = [cell.strip().lstrip("'") for cell in cells]
    if not texts or sum(map(is_clock, texts[:200])) < 0.9 * len(texts[:200]):
        return None
    if any(_WORDED.fullmatch(text) for text in texts[:20]):
        import pandas as pd

        found = pd.to_datetime(pd.Series(texts), format="mixed", errors="coerce", utc=True)
        worded = found.astype("int64").to_numpy(np.float64)
        scale = 1e9 if "ns" in str(found.dtype) else 1e6
        return np.where(found.notna(), worded / scale, np.nan)
    matches = [_CLOCK.fullmatch(text) for text in texts]
    slashed = {match.groups()[:6]: "/" in match[0] for match in matches if match is not None}
    try:
        days = {date: _days(date, slashes) for date, slashes in slashed.items()}
    except ValueError:  # there is no such day
        return None
    if not days or min(days.values()) < _FIRST_DAY or matches.count(None) > 0.1 * len(matches):
        return None
    seconds, ahead = np.full(len(cells), np.nan), np.zeros(len(cells))
    for row, match in ((row, match) for row, match in enumerate(matches) if match is not None):
        date, (hour, minute, second, half, *zone) = match.groups()[:6], match.groups()[6:]
        hours = int(hour or 0)
        hours = hours % 12 + 12 * (half.lower() == "pm") if half else hours
        of_day = 3600 * hours + 60 * int(minute) + float(re.sub("[,:]", ".", second))
        east, west = (int(part or 0) for part in zone)
        ahead[row] = 60 * (60 * east + (west if east >= 0 else -west))
        seconds[row] = 86400.0 * days[date] + of_day
    known = np.flatnonzero(np.isfinite(seconds))
    # Where summer time ends the clock is set back, and is less ahead of Greenwich.
    seconds -= ahead - ahead[known[0]]
    if not any(map(any, days)):
        some, hour = seconds[known], any(match and match[7] for match in matches)
        turn = 86400.0 if hour else 3600.0
        seconds[known] -= turn * np.cumsum(np.rint(np.diff(some, prepend=some[0]) / turn))
    return seconds


def _days(date: tuple[str | None, ...], slashed: bool) -> int:
    """Count the days since 1970; 0 without a date."""
    parts = [int(part or 0) for part in date]
    if not any(date):
        return 0
    year, month, day = parts[:3] if date[0] else parts[:2:-1]
    if not date[0] and (month > _MONTHS or (slashed and day <= _MONTHS)):
        day, month = month, day
    return dt.date(year + 2000 * (year < 100), month, day).toordinal() - 719163
