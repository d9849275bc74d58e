"""The options: each is declared once, here, with its name, type, unit, default and what it does.

An option of a verb of `pendpipe.api` is a key of a `TypedDict`, which the verb names as its
``**options``. From there come its signature, its documentation, its defaults and the check of what
is given (`takes`), and the arguments of its command (`flags_of`). What commands alone have in
common stands in `SHARED`.
"""

import argparse
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, wraps
from pathlib import Path
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Final,
    Literal,
    NamedTuple,
    TypedDict,
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
"""Arguments of a command by their names, each with its options; see `arguments.declare`."""
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
    """What the type of a verb's keyword does not say.

    Parameters
    ----------
    help
        What it is for.
    unit
        Unit of its value, or what stands for it in the help.
    kind
        How the command line reads it, where the keyword's type does not say.
    default
        Where it is not given.
    flag
        Its name on the command line, where that is not the keyword's.
    heading
        What it stands under in the help of a command.
    """

    help: str
    unit: str | None = None
    kind: Callable[[str], Any] | None = None
    default: Any = None
    flag: str | None = None
    heading: str | None = None


_guess = partial(Option, heading="where a guess is wrong")
SENSOR: Final = "the sensor's constant, V/rad"


class Reading(TypedDict, total=False):
    """What replaces a reader's guesses."""

    channel: Annotated[
        str | int | None,
        _guess("number (from 1) or name of the channel, see inspect", "CHANNEL"),
    ]
    column: Annotated[
        str | int | None,
        _guess(
            "number (from 1) or name of the column; X,Y for a position seen from the pivot;"
            " TIME:COLUMN names both",
            "COLUMN",
        ),
    ]
    unit: Annotated[
        str | None,
        _guess("of the readings: rad, deg, V, mm, counts, ...; of both: ms:deg", "UNIT"),
    ]
    sample_rate: Annotated[
        float | None, _guess("samples a second, instead of the time column", "HZ")
    ]
    decimal: Annotated[str | None, _guess("decimal sign, '.' or ','", "SIGN")]
    delimiter: Annotated[str | None, _guess("sign between cells, or tab, space", "SIGN")]
    volts_per_radian: Annotated[float | None, _guess(SENSOR, "V")]
    start: Annotated[float | None, _guess("first time to read, s, by the file's clock", "S")]
    stop: Annotated[float | None, _guess("last time to read, s, by the file's clock", "S")]


class Modelling(TypedDict, total=False):
    """The null model of a fit or a diagnosis."""

    restoring: Annotated[
        Literal["auto", "linear", "sine"] | None,
        Option(
            "the restoring torque: linear (a torsion wheel, a spring), sine (a pendulum), or auto,"
            " what the recording asks for",
            default="auto",
        ),
    ]
    baseline: Annotated[
        Literal["eq8", "viscous"],
        Option(
            "the null model: eq8 (Eq. 8, the default) or viscous (Eq. 3, a = c = 0)", default="eq8"
        ),
    ]
    fixed: Annotated[
        Mapping[str, float] | None,
        Option(
            "hold a parameter, as for a prediction (a, b, c, frequency, amplitude, offset,"
            " quality_factor_hysteretic, quality_factor_viscous)",
            "NAME=VALUE",
            flag="--fix",
        ),
    ]
    volts_per_radian: Annotated[float | None, _guess(SENSOR, "V")]


class Fitting(Modelling, total=False):
    """The options of `pendpipe.api.fit`."""

    method: Annotated[
        Literal["auto", "waveform", "turning-points"] | None,
        Option("waveform or turning-points to have only that one", default="auto"),
    ]
    clock_ppm: Annotated[
        float | None,
        Option(
            "what the clock may be off by, parts per million: it enters the errors", "PPM", POSITIVE
        ),
    ]
    scale_percent: Annotated[
        float | None,
        Option(
            "what V/rad, or a camera's scale, may be off by, in percent: in the errors of a, c and"
            " the amplitude",
            "P",
            Number(0, 100),
        ),
    ]
    length_m: Annotated[
        float | None,
        Option(
            "length of a simple pendulum, m, as 0.600 or 0.600(1): gives g, and angles of"
            " positions",
            "M",
            measured_number,
            flag="--length",
        ),
    ]
    period: Annotated[
        "float | Estimate | None",
        Option(
            "period of small swings, s, as 1.42 or 1.42(1), where amplitudes alone are given",
            "S",
            measured_number,
            heading=ALTERNATIVES,
        ),
    ]


class Diagnosing(Modelling, total=False):
    """The options of `pendpipe.api.diagnose`."""

    level: Annotated[
        float,
        Option(
            "false-alarm probability for a recording that lacks nothing",
            "P",
            Number(0, 1),
            default=0.01,
        ),
    ]
    seed: Annotated[int, Option("of the random draws", "N", NATURAL, default=0)]
    together: Annotated[bool, Option("several recordings are of one pendulum", default=False)]
    own: Annotated[
        Sequence[str],
        Option(
            "of several recordings: what each has of its own (a, b, c, frequency)",
            "NAME",
            default=(),
        ),
    ]
    same_sensor: Annotated[
        bool,
        Option("of several recordings: the sensor's errors are shared as well", default=False),
    ]


class Simulating(TypedDict, total=False):
    """The options of `pendpipe.api.simulate`."""

    seed: Annotated[int | None, Option("seed of the noise, instead of the model's", "N", NATURAL)]


class Acquiring(TypedDict, total=False):
    """The options of `pendpipe.api.acquire`."""

    model: Annotated[
        str | None,
        Option("the instrument: di154rs, di2108, ...; it is asked when not given", "MODEL"),
    ]
    rate_hz: Annotated[float, Option("scans a second", "HZ", default=60.0, flag="--rate")]
    duration_s: Annotated[float, Option("length, s", "S", default=60.0, flag="--duration")]
    range_volts: Annotated[float | None, Option("the signal stays within +-V", "V")]
    reconnect_s: Annotated[
        float,
        Option(
            "how long a device that was unplugged is waited for, s",
            "S",
            default=30.0,
            flag="--reconnect",
        ),
    ]
    clock_scale: Annotated[
        float, Option("simulated seconds in a real one", "FACTOR", POSITIVE, default=1.0)
    ]
    volts_per_radian: Annotated[float | None, Option(SENSOR, "V")]


class Keyword(NamedTuple):
    """A key of one of these: its name, its type, and what it is declared to be."""

    name: str
    type: Any
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
        number = isinstance(self.option.default, int | float) and bool not in self.types
        return self.option.help + (f" ({self.option.default:g})" if number else "")

    def argument(self) -> dict[str, Any]:
        """Return it as `arguments.declare` takes it."""
        if bool in self.types:
            return {"help": self.words, "dest": self.name} | _TRUE
        many = any(get_origin(each) in (Sequence, Mapping) for each in self.types)
        given = {
            "dest": self.name,
            "metavar": self.option.unit,
            "type": self.option.kind or (float if float in self.types else None),
            "choices": self.choices or None,
            "default": [] if many else self.option.default,
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

    def parameter(self) -> inspect.Parameter:
        """Return it as a parameter of a signature."""
        return inspect.Parameter(
            self.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=self.option.default,
            annotation=getattr(self.type, "__forward_arg__", self.type),
        )

    def documentation(self) -> str:
        """Return its entry of a docstring's parameters."""
        sentence = f"{self.words[0].upper()}{self.words[1:]}."
        return f"{self.name}\n{textwrap.indent(textwrap.fill(sentence, 92), '    ')}"


def keywords(options: type) -> list[Keyword]:
    """List what a verb's options declare."""
    return [Keyword(name, *get_args(each)) for name, each in options.__annotations__.items()]


_Verb = TypeVar("_Verb", bound=Callable[..., Any])


def takes(options: type) -> Callable[[_Verb], _Verb]:
    """Let a verb take options: it gets all of them, checked, with their defaults.

    Its docstring has them where ``{options}`` stands. A value that is not allowed raises an
    `InputError` with the keyword as place.
    """
    declared = keywords(options)
    listed = textwrap.indent("\n".join(each.documentation() for each in declared), "    ")

    def completed(verb: _Verb) -> _Verb:
        plain = inspect.signature(verb)
        own = [each for each in plain.parameters.values() if each.kind is not each.VAR_KEYWORD]
        every = [each.parameter() for each in declared] + own
        whole = plain.replace(parameters=sorted(every, key=lambda each: each.kind))

        @wraps(verb)
        def checked(*positional: Any, **given: Any) -> Any:
            call = whole.bind(*positional, **given)
            call.apply_defaults()
            for each in declared:
                each.check(call.arguments[each.name])
            return verb(*call.args, **call.kwargs)

        checked.__signature__ = whole  # type: ignore[attr-defined]
        checked.__doc__ = (verb.__doc__ or "").replace("    {options}", listed)
        return cast("_Verb", checked)

    return completed


SHARED: Final[Flags] = {
    "--verbose": {"help": "all that was found, how it was read, and harmless notes"} | _TRUE,
    "-v": {"help": "the same", "dest": "verbose"} | _TRUE,
    "--json": {"help": "print one JSON object"} | _TRUE,
    "--calibration": {
        "help": "the sensor's, from pendpipe calibrate",
        "metavar": "JSON",
        "type": Path,
    }
    | INPUT,
    "--turning-points": {
        "help": "of an earlier stage, with their cuts",
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
        "help": "write here why the record can't be used, and end with 0, instead of ending with 2",
        "metavar": "FILE",
        "type": Path,
    }
    | OUTPUT,
}
"""What several commands have in common and no verb has."""


def flags(*names: str, **more: Any) -> Flags:
    """Look up shared options by their flags; `more` is this command's own of argparse."""
    return {name: SHARED[name] | more for name in names}


def flags_of(options: type) -> Flags:
    """Return a verb's options as arguments of its command."""
    return {each.flag: each.argument() for each in keywords(options)}


def given(arguments: argparse.Namespace, options: type) -> dict[str, Any]:
    """Return what a call of the command gives for a verb's options."""
    return {each.name: getattr(arguments, each.name) for each in keywords(options)}


def under(heading: str, arguments: Flags) -> Flags:
    """Put arguments under a heading of the help."""
    return {name: options | {"heading": heading} for name, options in arguments.items()}


_RECORDING: Final = {
    "metavar": "FILE",
    "help": "a recording in any supported format; - is standard input",
}
FILE: Final[Flags] = {"file": _RECORDING | INPUT} | flags_of(Reading)
FILES: Final[Flags] = {"files": _RECORDING | {"nargs": "+"} | INPUT} | flags_of(Reading)
"""The argument of a command that reads a recording, or several, with the overrides."""
