"""A record that can't be used: said in one line, and no obstacle to the others.

Snakemake wants every declared output of a job. A refused record therefore gets a stub in
the place of each: whole, valid, and holding nothing but the reason. The stages after it
see ``refused.json``, write their stubs and go on.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from pendpipe.errors import InputError
from pendpipe.files import read_json, replaced, write_json

ORDER: Final = ("acquire", "calibrate", "turning-points", "fit", "diagnose")
"""The stages that run once a record, in the order of the data."""


def run_stage(
    stage: str,
    record: str,
    work: Callable[[], None],
    *,
    outputs: Sequence[Path],
    refused: Path | None,
) -> int:
    """Run one stage of one record; on the record's own fault refuse it.

    Parameters
    ----------
    stage, record
        What runs, for whom; `stage` is one of `ORDER`.
    work
        Does it, and writes all of `outputs`.
    outputs
        The files that the stage declares.
    refused
        Where a refusal is written; ``None`` lets the fault end the program (status 2).
    """
    if refused is None:
        work()
        return 0
    earlier = reason_of(refused, before=stage)
    if earlier is not None:
        _write_stubs(outputs, earlier)
        print(f"pendpipe: {record} was refused before: {earlier}", file=sys.stderr)
        return 0
    refused.unlink(missing_ok=True)
    try:
        work()
    except InputError as fault:
        reason = within_results(fault, refused)
        write_json(
            refused, {"schema_version": 1, "record": record, "stage": stage, "reason": reason}
        )
        _write_stubs(outputs, reason)
        print(f"pendpipe: {record} is refused: {fault}", file=sys.stderr)
    return 0


def within_results(fault: InputError, refused: Path | None) -> str:
    """What is written of a fault: a campaign's own files go by ``record/name``.

    Results name no path of the machine they were made on.
    """
    return str(fault) if refused is None else str(fault).replace(f"{refused.parent.parent}/", "")


def reason_of(refused: Path, *, before: str | None = None) -> str | None:
    """Why a record was refused (by a stage before `before`); ``None`` if it was not."""
    if not refused.exists():
        return None
    content: dict[str, Any] = read_json(refused)
    if before is not None and ORDER.index(content["stage"]) >= ORDER.index(before):
        return None
    return str(content["reason"])


def _write_stubs(outputs: Sequence[Path], reason: str) -> None:
    """Write what a refused record has in the place of its results."""
    for path in outputs:
        if path.suffix == ".json":
            write_json(path, {"schema_version": 1, "refused": reason})
        else:
            with replaced(path) as stream:
                stream.write(f"# refused: {reason}\n")
