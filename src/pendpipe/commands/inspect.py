"""Print what a recording holds: format, channels, rate, gaps, markers, clipping, step."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from pendpipe.arguments import FILE, print_answer, read_options, shared

if TYPE_CHECKING:
    from pendpipe.formats import Inspection


ARGUMENTS: Final = FILE | shared("--json")


def run(arguments: argparse.Namespace) -> None:
    """Inspect and print."""
    from pendpipe.formats import inspect

    found = inspect(arguments.file, read_options(arguments))
    print_answer(arguments, found.as_json(), "\n".join(_lines(arguments.file, found)))


def _lines(file: str, found: Inspection) -> Iterator[str]:
    """Print it in words, a fact a line; what is uncertain first."""
    for guess in found.weak_guesses:
        yield f"a guess: {guess}"
    yield file
    yield f"  format      {found.format}"
    for number, (name, unit) in enumerate(found.channels, start=1):
        yield f"  channel {number:<3} {name}" + (f" [{unit}]" if unit else "")
    even = "evenly spaced" if found.uniform else "not evenly spaced (median interval)"
    if found.chosen:
        yield f"  read        {found.chosen}, in {found.unit or 'no known unit'}"
        yield f"  hangs at    {found.level:.6g} {found.unit}".rstrip()
    yield f"  samples     {found.samples} at {found.sample_rate_hz:.6g} Hz, {even}"
    yield f"  span        {found.duration_s:.6g} s"
    step = "none found" if found.resolution is None else f"{found.resolution:.6g} {found.unit}"
    yield f"  step        {step}"
    yield f"  clipped     {found.clipped_samples} sample(s)"
    for gap in found.gaps:
        yield f"  gap         {gap.missing_s:.6g} s after sample {gap.after_sample}"
    for mark in found.markers:
        yield f"  marker      {mark.time_s:.6g} s (sample {mark.sample}) {mark.comment}".rstrip()
    for warning in found.warnings:
        yield f"  note        {warning}"
