"""The options that several commands, or a command and a verb of `pendpipe.api`, have in common.

Each is declared once, here: name, type, unit, default and what it does. The command line takes its
arguments from this table (`flags`), the verbs check their keywords by it (`check`) and take the
words of their documentation from it (`documented`), as the reference of the commands does.
"""

from __future__ import annotations

import argparse
import math
import re
import textwrap
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeVar

from pendpipe.errors import InputError, nearest, refuse_if

Flags = dict[str, dict[str, Any]]
"""Arguments of a command by their names, each with its options; see `arguments.declare`."""
ALTERNATIVES: Final = "alternatives"
INPUT: Final[dict[str, Any]] = {"file": "input"}
OUTPUT: Final[dict[str, Any]] = {"file": "output"}
OUTPUTS: Final[dict[str, Any]] = {"file": "outputs"}
"""What an argument names: a file that is read; one that is written, and looked at before any work;
a folder, or a file, that the command looks at itself. The last two give a command ``--force``."""


@dataclass(frozen=True)
class Number:
    """A type of argparse: a number between two limits, themselves left out, or a whole number.

    Parameters
    ----------
    low, high
        The limits.
    whole
        Whether it is a whole number from `low` on.
    """

    low: float = -math.inf
    high: float = math.inf
    whole: bool = False

    def problem(self, value: Any) -> str:
        """Say what is wrong with a value; nothing where it is one of these numbers."""
        if not isinstance(value, int if self.whole else int | float) or isinstance(value, bool):
            return f"{value!r:.40} is no {'whole ' * self.whole}number"
        if self.whole:
            return "" if value >= self.low else f"it must not be negative (it is {value})"
        if self.low < value < self.high:
            return ""
        limits = f"lie between {self.low:g} and {self.high:g}"
        return f"it must {limits if self.high < math.inf else 'be positive'} (it is {value:g})"

    def __call__(self, text: str) -> float:
        """Read it, as a type of argparse."""
        try:
            value: Any = int(text) if self.whole else float(text)
        except ValueError:
            value = text
        if problem := self.problem(value):
            raise argparse.ArgumentTypeError(problem)
        return value  # type: ignore[no-any-return]


NATURAL: Final = Number(0, whole=True)
POSITIVE: Final = Number(0)


def measured_number(text: str) -> Any:
    """Read a number with its error, as a type of argparse: 0.600(1)."""
    from pendpipe.estimate import measured

    try:
        return measured(text)
    except ValueError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None


@dataclass(frozen=True)
class Option:
    """An option.

    Parameters
    ----------
    help
        What it is for.
    unit
        Unit of its value, or what stands for it in the help.
    kind
        Its type, as argparse has it.
    choices
        The values that it may have.
    default
        Where it is not given.
    keyword
        Its name in Python, where that is not the flag's.
    more
        Further options of argparse, and of `arguments.declare`.
    """

    help: str
    unit: str | None = None
    kind: Callable[[str], Any] | None = None
    choices: tuple[str, ...] = ()
    default: Any = None
    keyword: str | None = None
    more: dict[str, Any] = field(default_factory=dict)

    def flag(self, **more: Any) -> dict[str, Any]:
        """Return it as argparse takes it."""
        given = {
            "metavar": self.unit,
            "type": self.kind,
            "choices": self.choices or None,
            "default": self.default,
        }
        return (
            {"help": self.help + "; repeatable" * (self.more == _MANY)}
            | {key: value for key, value in given.items() if value is not None}
            | self.more
            | more
        )


_TRUE: Final = {"action": "store_true"}
_MANY: Final = {"action": "append"}
_RECORDING: Final = {
    "metavar": "FILE",
    "help": "a recording in any supported format; - is standard input",
}
READING: Final = {
    "--channel": Option("number (from 1) or name of the channel, see inspect", "CHANNEL"),
    "--column": Option(
        "number (from 1) or name of the column; X,Y for a position seen from the pivot;"
        " TIME:COLUMN names both",
        "COLUMN",
    ),
    "--unit": Option("of the readings: rad, deg, V, mm, counts, ...; of both: ms:deg", "UNIT"),
    "--sample-rate": Option("samples a second, instead of the time column", "HZ", float),
    "--decimal": Option("decimal sign, '.' or ','", "SIGN"),
    "--delimiter": Option("sign between cells, or tab, space", "SIGN"),
    "--volts-per-radian": Option("the sensor's constant, V/rad", "V", float),
    "--start": Option(
        "first time to read, s, by the file's clock", "S", float, more={"dest": "start_s"}
    ),
    "--stop": Option(
        "last time to read, s, by the file's clock", "S", float, more={"dest": "stop_s"}
    ),
}
"""Overrides of a reader's guesses, one a field of `pendpipe.formats.ReadOptions`."""
OPTIONS: Final = READING | {
    "--verbose": Option("all that was found, how it was read, and harmless notes", more=_TRUE),
    "-v": Option("the same", keyword="verbose", more=_TRUE | {"dest": "verbose"}),
    "--json": Option("print one JSON object", more=_TRUE),
    "--calibration": Option("the sensor's, from pendpipe calibrate", "JSON", Path, more=INPUT),
    "--turning-points": Option(
        "of an earlier stage, with their cuts", "CSV", Path, keyword="points", more=INPUT
    ),
    "--method": Option(
        "waveform or turning-points to have only that one",
        choices=("auto", "waveform", "turning-points"),
        default="auto",
    ),
    "--baseline": Option(
        "the null model: eq8 (Eq. 8, the default) or viscous (Eq. 3, a = c = 0)",
        choices=("eq8", "viscous"),
        default="eq8",
    ),
    "--restoring": Option(
        "the restoring torque: linear (a torsion wheel, a spring), sine (a pendulum), or auto, what"
        " the recording asks for",
        choices=("auto", "linear", "sine"),
        default="auto",
    ),
    "--fix": Option(
        "hold a parameter, as for a prediction (a, b, c, frequency, amplitude, offset,"
        " quality_factor_hysteretic, quality_factor_viscous)",
        "NAME=VALUE",
        default=[],
        keyword="fixed",
        more=_MANY,
    ),
    "--length": Option(
        "length of a simple pendulum, m, as 0.600 or 0.600(1): gives g, and angles of positions",
        "M",
        measured_number,
        keyword="length_m",
    ),
    "--period": Option(
        "period of small swings, s, as 1.42 or 1.42(1), where amplitudes alone are given",
        "S",
        measured_number,
    ),
    "--frequency": Option("its inverse, Hz", "HZ", measured_number),
    "--clock-ppm": Option(
        "what the clock may be off by, parts per million: it enters the errors", "PPM", POSITIVE
    ),
    "--scale-percent": Option(
        "what V/rad, or a camera's scale, may be off by, in percent: in the errors of a, c and the"
        " amplitude",
        "P",
        Number(0, 100),
    ),
    "--level": Option(
        "false-alarm probability for a recording that lacks nothing (0.01)",
        "P",
        Number(0, 1),
        default=0.01,
    ),
    "--seed": Option("of the random draws", "N", NATURAL),
    "--own": Option(
        "of several recordings: what each has of its own (a, b, c, frequency)",
        "NAME",
        default=[],
        more=_MANY,
    ),
    "--same-sensor": Option(
        "of several recordings: the sensor's errors are shared as well", more=_TRUE
    ),
    "--together": Option("several recordings are of one pendulum", more=_TRUE),
    "--model": Option("the instrument: di154rs, di2108, ...; it is asked when not given", "MODEL"),
    "--rate": Option("scans a second (60)", "HZ", float, default=60.0, keyword="rate_hz"),
    "--duration": Option("length, s (60)", "S", float, default=60.0, keyword="duration_s"),
    "--range-volts": Option("the signal stays within +-V", "V", float),
    "--reconnect": Option(
        "how long a device that was unplugged is waited for, s (30)",
        "S",
        float,
        default=30.0,
        keyword="reconnect_s",
    ),
    "--clock-scale": Option("simulated seconds in a real one (1)", "FACTOR", POSITIVE, default=1.0),
    "--campaign": Option("a campaign's configuration", "CONFIG", Path, more=INPUT),
    "--comparison": Option("comparison.json, from pendpipe compare", "FILE", Path, more=INPUT),
    "--record": Option("the campaign's name for this record", "NAME"),
    "--refused": Option(
        "write here why the record can't be used, and end with 0, instead of ending with 2",
        "FILE",
        Path,
        more=OUTPUT,
    ),
}
_KEYWORDS: Final = {
    option.keyword or flag.lstrip("-").replace("-", "_"): option for flag, option in OPTIONS.items()
}


def flags(*names: str, **more: Any) -> Flags:
    """Look up options by their flags; `more` is this command's own of argparse."""
    return {name: OPTIONS[name].flag(**more) for name in names}


def under(heading: str, arguments: Flags) -> Flags:
    """Put arguments under a heading of the help."""
    return {name: options | {"heading": heading} for name, options in arguments.items()}


_WRONG_GUESS: Final = under("where a guess is wrong", flags(*READING))
FILE: Final[Flags] = {"file": _RECORDING | INPUT} | _WRONG_GUESS
FILES: Final[Flags] = {"files": _RECORDING | {"nargs": "+"} | INPUT} | _WRONG_GUESS
"""The argument of a command that reads a recording, or several, with the overrides."""


def check(**given: Any) -> None:
    """Refuse keywords of a verb that the table does not allow; None is no value.

    Raises
    ------
    InputError
        With the keyword as place.
    """
    for name, value in given.items():
        option = _KEYWORDS[name]
        if value is None:
            continue
        if option.choices and value not in option.choices:
            listed = " or ".join(map(repr, option.choices))
            remedy = nearest(str(value), option.choices, f"give {listed}")
            raise InputError(name, f"{value!r} is not a valid choice", remedy)
        if isinstance(option.kind, Number):
            problem = option.kind.problem(value)
            refuse_if(problem, name, problem, "give another number")


_Verb = TypeVar("_Verb", bound=Callable[..., Any])
_PLACE: Final = re.compile(r"^( *)\{(\w+)\}$", re.MULTILINE)


def documented(verb: _Verb) -> _Verb:
    """Put the table's words where a docstring has a keyword in braces on a line of its own."""

    def words(found: re.Match[str]) -> str:
        text = _KEYWORDS[found[2]].help
        inner = f"{found[1]}    "
        sentence = f"{text[0].upper()}{text[1:]}."
        lines = textwrap.wrap(sentence, 100, initial_indent=inner, subsequent_indent=inner)
        return "\n".join([f"{found[1]}{found[2]}", *lines])

    verb.__doc__ = _PLACE.sub(words, verb.__doc__ or "")
    return verb
