"""A record that can't be used leaves one line, and is no obstacle to the others.

Snakemake wants every declared output of a job. A refused record therefore gets a stub in
the place of each: whole, valid, and holding nothing but the reason. The stages after it
see ``refused.json``, write their stubs and go on.
"""

import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

from pendpipe.errors import DamagedError, InputError, UnwritableError
from pendpipe.files import (
    MADE_BY,
    MARK,
    read_json,
    without_folders,
    write_json,
    write_whole,
    writing,
)

ORDER: Final = ("acquire", "calibrate", "turning-points", "fit", "diagnose")
"""The stages that run once a record, in the order of the data."""


def run_stage(
    stage: str,
    record: str | None,
    work: Callable[[], None],
    *,
    outputs: Sequence[Path],
    refused: Path | None,
    inputs: Iterable[Path | str | None] = (),
    sources: Iterable[Path] = (),
) -> None:
    """Run one stage of one record; if the record can't be used, refuse it.

    Parameters
    ----------
    stage
        What runs, one of `ORDER`.
    record
        The campaign's record; ``None`` outside a campaign.
    work
        Does it, and writes all of `outputs`.
    outputs
        The files that it leaves of every record.
    refused
        Where a refusal is written; ``None`` lets the error end the program (status 2).
    inputs, sources
        The results and the user's files that are read, which nothing replaces.

    Raises
    ------
    DamagedError
        If a result that is read is not what its stage wrote. That refuses no record.
    UnwritableError
        If there is no room for the outputs, say. Nor does that.
    """
    with writing(inputs=filter(None, (*inputs, *sources))):
        if refused is None:
            work()
            return
        if earlier := reason_of(refused, before=stage):
            _write_stubs(outputs, earlier)
            print(f"pendpipe: {record} was refused before: {earlier}", file=sys.stderr)
            return
        refused.unlink(missing_ok=True)
        try:
            work()
        except (DamagedError, UnwritableError):
            raise
        except InputError as error:
            reason = within_results(error, refused, sources)
            content = {"schema_version": 1, "record": record, "stage": stage, "reason": reason}
            write_json(refused, content)
            _write_stubs(outputs, reason)
            print(f"pendpipe: {record} is refused: {error}", file=sys.stderr)


def within_results(error: InputError, refused: Path | None, sources: Iterable[Path] = ()) -> str:
    """The text of an error in the results: a campaign's own files appear as ``record/name``.

    Results name no path of the machine they were made on: other files appear by name alone.
    """
    if refused is None:
        return str(error)
    text = str(error).replace(f"{refused.parent.parent}/", "")
    for path in sources:
        # In one line as in the message: a folder's name may hold anything.
        text = text.replace(" ".join(str(path).split()), path.name)
    return without_folders(text)


def reason_of(refused: Path, *, before: str | None = None) -> str | None:
    """Why a record was refused (by a stage before `before`); ``None`` if it was not."""
    if not refused.exists():
        return None
    content: dict[str, Any] = read_json(refused)
    if before is not None and ORDER.index(content["stage"]) >= ORDER.index(before):
        return None
    return str(content["reason"])


def is_stub(path: str | Path) -> bool:
    """Whether this stands in the place of a refused record's result."""
    with Path(path).open("rb") as stream:
        head = stream.read(300)
    return head.startswith(b"# refused: ") or b'"refused":' in head


def _write_stubs(outputs: Sequence[Path], reason: str) -> None:
    """Write what a refused record has in the place of its results."""
    for path in outputs:
        if path.suffix == ".json":
            write_json(path, {"schema_version": 1, "refused": reason})
        else:
            write_whole(path, f"# refused: {reason}\n# {MARK}: {MADE_BY}\n")
