"""What an option is: a keyword of a verb of the front door, and an argument of its command.

An option is declared once, where the verb takes it: its name, type and default as those of any
parameter, and by an `Option` in its annotation what the type does not say. The verb's documentation
and its check of what is given (`checked`) and its command's arguments (`flags_of`) follow from
there. What commands alone have in common stands in `SHARED`.
"""

import argparse
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Final,
    Literal,
    NamedTuple,
    TypeAlias,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
)

from pendpipe.errors import InputError, nearest, refuse_if

if TYPE_CHECKING:
    from pendpipe.estimate import Estimate

Flags = dict[str, dict[str, Any]]
"""Arguments of a command by their names, each with its options; see `arguments.Command.declare`."""
ALTERNATIVES: Final = "alternatives"
INPUT: Final[dict[str, Any]] = {"file": "input"}
OUTPUT: Final[dict[str, Any]] = {"file": "output"}
OUTPUTS: Final[dict[str, Any]] = {"file": "outputs"}
"""What an argument names: a file that is read; one that is written, and looked at before any work;
a folder, or a file, that the command looks at itself. The last two give a command ``--force``."""
_TRUE: Final = {"action": "store_true"}


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
            return f"{value!r:.40} is not a {'whole ' * self.whole}number"
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
    """What the type of a keyword does not say.

    Parameters
    ----------
    help
        What it is for.
    unit
        Unit of its value, or what stands for it in the help.
    kind
        How the command line reads it, where the keyword's type does not say.
    flag
        Its name on the command line, where that is not the keyword's.
    heading
        What it stands under in the help of a command.
    """

    help: str
    unit: str | None = None
    kind: Callable[[str], Any] | None = None
    flag: str | None = None
    heading: str | None = None


A_GUESS: Final = "where a guess is wrong"
"""Heading of what replaces the guesses of a file's reader."""
SENSOR: Final = "the sensor's constant, V/rad"
Restoring: TypeAlias = Annotated[
    Literal["auto", "linear", "sine"] | None,
    Option(
        "the restoring torque: linear (a torsion wheel, a spring), sine (a pendulum), or auto"
        " (the recording decides)"
    ),
]
Baseline: TypeAlias = Annotated[
    Literal["eq8", "viscous"],
    Option("the null model: eq8 (Eq. 8, the default) or viscous (Eq. 3, a = c = 0)"),
]
Fixed: TypeAlias = Annotated[
    Mapping[str, float] | None,
    Option(
        "hold a parameter, to test a prediction (a, b, c, frequency, amplitude, offset,"
        " quality_factor_hysteretic, quality_factor_viscous)",
        "NAME=VALUE",
        flag="--fix",
    ),
]
Length: TypeAlias = Annotated[
    "float | Estimate | None",
    Option(
        "length of a simple pendulum, m, as 0.600 or 0.600(1): gives g, and makes positions angles",
        "M",
        measured_number,
        flag="--length",
    ),
]
VoltsPerRadian: TypeAlias = Annotated[float | None, Option(SENSOR, "V", heading=A_GUESS)]
"""Options that several verbs have."""


class Keyword(NamedTuple):
    """An option as a verb declares it."""

    name: str
    type: Any
    default: Any
    option: Option

    @property
    def flag(self) -> str:
        """Its name on the command line."""
        return self.option.flag or f"--{self.name.replace('_', '-')}"

    @property
    def types(self) -> tuple[Any, ...]:
        """The types of which it may have one."""
        return get_args(self.type) if get_origin(self.type) in (Union, UnionType) else (self.type,)

    @property
    def choices(self) -> tuple[str, ...]:
        """The values that it may have, where they can be listed."""
        return next((get_args(each) for each in self.types if get_origin(each) is Literal), ())

    @property
    def words(self) -> str:
        """What it is for, and the number that it has by default."""
        number = isinstance(self.default, int | float) and bool not in self.types
        return self.option.help + (f" ({self.default:g})" if number else "")

    def argument(self) -> dict[str, Any]:
        """Return it as `arguments.Command` takes it."""
        if bool in self.types:
            return {"help": self.words, "dest": self.name} | _TRUE
        many = any(get_origin(each) in (Sequence, Mapping) for each in self.types)
        given = {
            "dest": self.name,
            "metavar": self.option.unit,
            "type": self.option.kind or (float if float in self.types else None),
            "choices": self.choices or None,
            "default": [] if many else self.default,
            "action": "append" if many else None,
            "heading": self.option.heading,
        }
        return {"help": self.words + "; repeatable" * many} | {
            key: value for key, value in given.items() if value is not None
        }

    def check(self, value: Any) -> None:
        """Refuse a value that it may not have; None is no value."""
        if value is None:
            return
        if self.choices and value not in self.choices:
            listed = " or ".join(map(repr, self.choices))
            remedy = nearest(str(value), self.choices, f"give {listed}")
            raise InputError(self.name, f"{value!r} is not a valid choice", remedy)
        if isinstance(self.option.kind, Number):
            problem = self.option.kind.problem(value)
            refuse_if(problem, self.name, problem, "give another number")

    def documentation(self) -> str:
        """Return its entry of a docstring's parameters."""
        sentence = f"{self.words[0].upper()}{self.words[1:]}."
        return f"{self.name}\n{textwrap.indent(textwrap.fill(sentence, 92), '    ')}"


def keywords(verb: Callable[..., Any]) -> list[Keyword]:
    """List the options that a verb takes."""
    return [
        Keyword(name, get_args(each.annotation)[0], each.default, get_args(each.annotation)[1])
        for name, each in inspect.signature(inspect.unwrap(verb)).parameters.items()
        if get_origin(each.annotation) is Annotated
    ]


_Verb = TypeVar("_Verb", bound=Callable[..., Any])


def checked(verb: _Verb) -> _Verb:
    """Check the options of a verb, and list them in its docstring where ``{options}`` stands.

    A value that is not allowed raises an `InputError` with the keyword as place.
    """
    options = {each.name: each for each in keywords(verb)}
    listed = "\n".join(each.documentation() for each in options.values())
    plain = inspect.signature(verb)

    @wraps(verb)
    def run(*positional: Any, **given: Any) -> Any:
        for name in options.keys() & given.keys():
            options[name].check(given[name])
        return verb(*positional, **given)

    run.__doc__ = (verb.__doc__ or "").replace("    {options}", textwrap.indent(listed, "    "))
    shown = {
        name: getattr(each.type, "__forward_arg__", each.type) for name, each in options.items()
    }
    run.__signature__ = plain.replace(  # type: ignore[attr-defined]
        parameters=[
            each.replace(annotation=shown.get(name, each.annotation))
            for name, each in plain.parameters.items()
        ]
    )
    return cast("_Verb", run)


SHARED: Final[Flags] = {
    "--verbose": {"help": "all findings, how the file was read, and harmless notes"} | _TRUE,
    "-v": {"help": "the same", "dest": "verbose"} | _TRUE,
    "--json": {"help": "print one JSON object"} | _TRUE,
    "--calibration": {
        "help": "the sensor's calibration, from pendpipe calibrate",
        "metavar": "JSON",
        "type": Path,
    }
    | INPUT,
    "--turning-points": {
        "help": "turning points of an earlier stage, with their cuts",
        "metavar": "CSV",
        "type": Path,
    }
    | INPUT,
    "--campaign": {"help": "a campaign's configuration", "metavar": "CONFIG", "type": Path} | INPUT,
    "--comparison": {
        "help": "comparison.json, from pendpipe compare",
        "metavar": "FILE",
        "type": Path,
    }
    | INPUT,
    "--record": {"help": "the campaign's name for this record", "metavar": "NAME"},
    "--refused": {
        "help": "if the record can't be used, write the reason here and end with 0, not 2",
        "metavar": "FILE",
        "type": Path,
    }
    | OUTPUT,
}
"""What several commands have in common and no verb has."""


def flags(*names: str, **more: Any) -> Flags:
    """Look up shared options by their flags; `more` is this command's own of argparse."""
    return {name: SHARED[name] | more for name in names}


def flags_of(verb: Callable[..., Any]) -> Flags:
    """Return a verb's options as arguments of its command."""
    return {each.flag: each.argument() for each in keywords(verb)}


def given(arguments: argparse.Namespace, verb: Callable[..., Any]) -> dict[str, Any]:
    """Return what a call of the command gives for a verb's options."""
    return {each.name: getattr(arguments, each.name) for each in keywords(verb)}


def under(heading: str, arguments: Flags) -> Flags:
    """Put arguments under a heading of the help."""
    return {name: options | {"heading": heading} for name, options in arguments.items()}
