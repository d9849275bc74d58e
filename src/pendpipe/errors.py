"""User errors: the input or the usage is wrong, not the program.

Every message is one line: where, what is wrong, what to do. The command line prints it
and ends with status 2; a Snakemake stage writes it into ``refused.json`` instead.
"""

from __future__ import annotations

import errno
from collections.abc import Iterable
from pathlib import Path
from typing import Final

OF_DISKS: Final = (
    *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS),
    *(errno.EIO, errno.ESTALE, errno.ENODEV, errno.ENXIO),
)
"""Of errors of the system: a disk that is full, is only read, fails, or has gone."""


class InputError(Exception):
    """The input or the usage is wrong, and the user can correct it.

    Parameters
    ----------
    place
        The file (or port, or option) with the error; a path, or a path with a line or column
        (``"a.csv, line 7"``).
    problem
        What is wrong with it, in a clause that needs no context.
    remedy
        What to do about it.

    Examples
    --------
    >>> str(InputError("a.csv, line 7", "time_s falls from 0.3 to 0.2", "sort the rows by time"))
    'a.csv, line 7: time_s falls from 0.3 to 0.2; sort the rows by time'
    """

    status = 2
    """With which a command ends."""

    def __init__(self, place: str | Path, problem: str, remedy: str) -> None:
        self.place = str(place)
        self.problem = problem
        self.remedy = remedy
        super().__init__(" ".join(f"{self.place}: {problem}; {remedy}".split()))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str]]:
        """Let it come back whole from a worker process."""
        return type(self), (self.place, self.problem, self.remedy)


def refuse_if(
    wrong: object,
    place: str | Path,
    problem: str,
    remedy: str,
    error: type[InputError] = InputError,
) -> None:
    """Refuse the input where something is wrong with it.

    Raises
    ------
    InputError
        Or what `error` names, where `wrong` is true.
    """
    if wrong:
        raise error(place, problem, remedy)


def nearest(name: str, known: Iterable[str], otherwise: str = "") -> str:
    """Suggest the known name that `name` may have meant, for a remedy.

    Where none is near it is `otherwise`, or the list of them all.
    """
    from difflib import get_close_matches

    names = sorted(known)
    begun = [each for each in names if name and each.startswith(name)]
    close = get_close_matches(name, names, n=1) or begun
    if close:
        return f"did you mean '{close[0]}'?"
    return otherwise or f"known are {', '.join(names) or 'none'}"


class NotAnalysableError(InputError):
    """The recording can be read, but holds no free decay that could be analysed."""


class UnwritableError(InputError):
    """A result can't be written: a full disk, say. The record that it belongs to may be sound."""


class DamagedError(InputError):
    """A result is not what its stage wrote; the record that it belongs to may be sound."""
