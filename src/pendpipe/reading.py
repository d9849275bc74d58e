"""Read a file of any format, or describe it: what the front door and the commands call."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pendpipe.options import A_GUESS, Option, VoltsPerRadian, checked

if TYPE_CHECKING:
    from pendpipe.formats import Inspection, ReadOptions
    from pendpipe.recording import Recording


@checked
def read(
    path: str | Path,
    *,
    channel: Annotated[
        str | int | None,
        Option("number (from 1) or name of the channel, see inspect", "CHANNEL", heading=A_GUESS),
    ] = None,
    column: Annotated[
        str | int | None,
        Option(
            "number (from 1) or name of the column; X,Y for a position seen from the pivot;"
            " TIME:COLUMN names both",
            "COLUMN",
            heading=A_GUESS,
        ),
    ] = None,
    unit: Annotated[
        str | None,
        Option(
            "unit of the readings: rad, deg, V, mm, counts, ...; ms:deg sets time and reading",
            "UNIT",
            heading=A_GUESS,
        ),
    ] = None,
    sample_rate: Annotated[
        float | None,
        Option("samples per second, instead of the time column", "HZ", heading=A_GUESS),
    ] = None,
    decimal: Annotated[
        str | None, Option("decimal sign, '.' or ','", "SIGN", heading=A_GUESS)
    ] = None,
    delimiter: Annotated[
        str | None, Option("separator of the cells: a sign, tab or space", "SIGN", heading=A_GUESS)
    ] = None,
    volts_per_radian: VoltsPerRadian = None,
    start: Annotated[
        float | None, Option("first time to read, s, by the file's clock", "S", heading=A_GUESS)
    ] = None,
    stop: Annotated[
        float | None, Option("last time to read, s, by the file's clock", "S", heading=A_GUESS)
    ] = None,
) -> "Recording":
    """Read a recording from a file in any supported format.

    The layout is guessed, and each guess stands in the recording's `notes`. The options
    replace a wrong guess; they are those of the commands (``pendpipe inspect --help``).

    Parameters
    ----------
    path
        CSV in most dialects, WinDaq, MATLAB, Excel, ...
    {options}

    Raises
    ------
    InputError
        If the file can't be read: the file and line, what is wrong, what to do.

    Examples
    --------
    >>> recording = read("examples/string-pendulum.csv")
    >>> recording
    Recording(3600 samples of angle_rad, 0 to 119.967 s)
    >>> len(read("examples/string-pendulum.csv", start=10, stop=60))
    1501
    """
    from pendpipe.formats import read as read_file

    return read_file(
        path,
        _read_options(
            channel=channel,
            column=column,
            unit=unit,
            sample_rate=sample_rate,
            decimal=decimal,
            delimiter=delimiter,
            volts_per_radian=volts_per_radian,
            start=start,
            stop=stop,
        ),
    )


def inspect(path: str | Path, **options: Any) -> "Inspection":
    """Describe a file: format, channels, rate, gaps, clipping, and what was guessed.

    Parameters
    ----------
    path
        As for `read`.
    **options
        As for `read`.

    Examples
    --------
    >>> found = inspect("examples/string-pendulum.csv")
    >>> round(found.sample_rate_hz, 3), found.unit
    (30.0, 'rad')
    """
    from pendpipe.formats import inspect as inspect_file

    return inspect_file(path, _read_options(**options))


def _read_options(
    start: float | None = None, stop: float | None = None, **given: Any
) -> "ReadOptions":
    """Turn the overrides into the readers' options; numbers of columns are words there."""
    from pendpipe.formats import ReadOptions

    given |= {
        key: str(given[key]) for key in ("channel", "column") if isinstance(given.get(key), int)
    }
    return ReadOptions(start_s=start, stop_s=stop, **given)
