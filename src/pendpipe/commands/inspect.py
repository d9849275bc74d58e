"""Print what a recording holds: format, channels, rate, gaps, markers, clipping, step."""

from typing import Final

from pendpipe.arguments import FILE, Arguments, print_answer, read_options, shared
from pendpipe.formats import Inspection, inspect
from pendpipe.quantities import after_number

ARGUMENTS: Final = (
    FILE
    | shared("--json")
    | {"--why": {"action": "store_true", "help": "print how the file was understood"}}
)


def run(arguments: Arguments) -> None:
    """Inspect and print."""
    found = inspect(arguments.file, read_options(arguments))
    lines = [arguments.file, *("  " + line for line in found.why)]
    text = lines if arguments.why else _lines(arguments.file, found)
    print_answer(arguments, found.as_json(), "\n".join(text))


def _lines(file: str, found: Inspection) -> list[str]:
    """Print it in words, a fact a line; what is uncertain first."""
    even = "evenly spaced" if found.uniform else "not evenly spaced (median interval)"
    read = [
        ("read", f"{found.chosen}, in{after_number(found.unit) or ' no known unit'}"),
        ("hangs at", f"{found.level:.6g}{after_number(found.unit)}"),
    ]
    facts = [
        ("format", found.format),
        *([("kind", f"{found.kind}: no free decay")] if found.kind != "motion" else []),
        *(
            (
                f"channel {number}",
                name + f" [{unit}]" * bool(unit) + f" (--column {place})" * (place != number),
            )
            for number, ((name, unit), place) in enumerate(
                zip(found.channels, found.columns, strict=True), start=1
            )
        ),
        *(read if found.chosen else []),
        ("samples", f"{found.samples} at {found.sample_rate_hz:.6g} Hz, {even}"),
        ("span", f"{found.duration_s:.6g} s"),
        (
            "step",
            f"{found.resolution:.6g}{after_number(found.unit)}"
            if found.resolution
            else "none found",
        ),
        ("clipped", f"{found.clipped_samples} sample(s)"),
        *(("gap", f"{gap.missing_s:.6g} s after sample {gap.after_sample}") for gap in found.gaps),
        *(
            ("marker", f"{mark.time_s:.6g} s (sample {mark.sample}) {mark.comment}")
            for mark in found.markers
        ),
        *(("note", warning) for warning in found.warnings),
    ]
    guesses = [f"a guess: {guess}" for guess in found.weak_guesses]
    return [*guesses, file, *(f"  {name:<12}{text}".rstrip() for name, text in facts)]
