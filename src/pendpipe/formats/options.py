"""Overrides for a file where a reader's guess is wrong."""

from __future__ import annotations

from dataclasses import dataclass

from pendpipe.errors import InputError


@dataclass(frozen=True)
class ReadOptions:
    """Overrides of a reader's guesses; ``None`` everywhere means: guess, and report the guess.

    Parameters
    ----------
    channel
        One of the channels that ``pendpipe inspect`` lists, by name or by number from 1
        (a table's time column is no channel).
    column
        A column of a table by its name or its number from 1: ``"theta"`` or ``"3"``. A
        pair ``"x,y"`` is a position seen from the pivot. Before a colon stands the time
        column: ``"t:theta"``, ``"1:x,y"``.
    unit
        The unit of the readings (``rad``, ``mrad``, ``deg``, ``V``, ``mV``, ``m``, ``cm``,
        ``mm``, ``rad/s``, ...). Before a colon stands the unit of the time column:
        ``"ms:deg"``, ``"us:"``.
    sample_rate
        Samples a second; times are then counted from the first row, and a time column is
        not used.
    decimal
        ``"."`` or ``","``.
    delimiter
        What stands between the cells: a character, or ``tab``, ``space``, ``comma``,
        ``semicolon``.
    volts_per_radian
        The sensor's constant, kept in the recording's metadata.
    start_s, stop_s
        The part of the recording to read, on the file's own clock, seconds.
    """

    channel: str | None = None
    column: str | None = None
    unit: str | None = None
    sample_rate: float | None = None
    decimal: str | None = None
    delimiter: str | None = None
    volts_per_radian: float | None = None
    start_s: float | None = None
    stop_s: float | None = None

    def __post_init__(self) -> None:
        for option, value in (
            ("--sample-rate", self.sample_rate),
            ("--volts-per-radian", self.volts_per_radian),
        ):
            if value is not None and not (value == value and abs(value) not in (0.0, float("inf"))):
                raise InputError(option, f"{value} can't be used", "give a finite number, not 0")
        if self.sample_rate is not None and self.sample_rate < 0:
            raise InputError("--sample-rate", "it is negative", "give samples a second")
        if self.start_s is not None and self.stop_s is not None and self.stop_s <= self.start_s:
            raise InputError("--stop", "it does not lie after --start", "swap the two")

    @property
    def time_column(self) -> str | None:
        """What stands before the colon of `column`."""
        return _before(self.column)

    @property
    def reading_column(self) -> str | None:
        """What stands after the colon of `column`, or all of it."""
        return _after(self.column)

    @property
    def time_unit(self) -> str | None:
        """What stands before the colon of `unit`."""
        return _before(self.unit)

    @property
    def reading_unit(self) -> str | None:
        """What stands after the colon of `unit`, or all of it."""
        return _after(self.unit)


def _before(text: str | None) -> str | None:
    return text.split(":", 1)[0].strip() or None if text and ":" in text else None


def _after(text: str | None) -> str | None:
    return text.rsplit(":", 1)[-1].strip() or None if text else None
