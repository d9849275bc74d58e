"""What the user asks of channels and ranges, and what the box has."""

from __future__ import annotations

from collections.abc import Sequence

from pendpipe.acquire.drivers.base import Identity
from pendpipe.errors import InputError


def choose_channels(port: str, model: str, channels: Sequence[int], last: int) -> tuple[int, ...]:
    """Put the channels in the order of the scan.

    Raises
    ------
    InputError
        On a channel that the box does not have, or none.
    """
    chosen = tuple(sorted(set(channels)))
    if not chosen or chosen[0] < 1 or chosen[-1] > last:
        listed = ", ".join(map(str, channels)) or "none"
        raise InputError(port, f"the {model} has no channel {listed}", f"choose from 1 to {last}")
    return chosen


def choose_range(
    port: str, model: str, ranges: Sequence[float], wanted: float | None, usual: float
) -> float:
    """Return the smallest full scale that holds plus and minus `wanted` volts.

    Raises
    ------
    InputError
        If none does.
    """
    if wanted is None:
        return usual
    enough = [high for high in ranges if high >= wanted > 0]
    if not enough:
        raise InputError(
            port,
            f"the {model} has no range of +-{wanted:g} V",
            f"choose from {', '.join(f'{high:g}' for high in sorted(ranges))}",
        )
    return min(enough)


def refuse_another(port: str, found: Identity, model: str) -> Identity:
    """Return the identity of the model expected.

    Raises
    ------
    InputError
        If it is another's.
    """
    # How the hyphens of a name are written ("2108P", "2108-P") is not documented.
    if _letters(found.model) != _letters(model):
        raise InputError(port, f"this is a {found.model}, no {model}", "give its --model")
    return found


def _letters(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())
