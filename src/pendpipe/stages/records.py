"""One table of a campaign's records: period, Q, losses, verdict or refusal, one row per record.

The ending of each FILE says its form: .parquet keeps numbers as they are, .csv is for spreadsheets.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendpipe.arguments import Arguments, command, load
from pendpipe.cells import csv_text
from pendpipe.configuration.load import Campaign
from pendpipe.errors import refuse_if
from pendpipe.files import MADE_BY, MARK, read_json, write_whole
from pendpipe.options import OUTPUT, flags
from pendpipe.report.class_table import Fitted, record as row_of
from pendpipe.stages.archive import gathered
from pendpipe.stages.results import RecordResult, read_results

if TYPE_CHECKING:
    import pyarrow as pa

_OF_THE_TABLE: Final = ("record", "fluid", "branch", "pendulum")
_WORDS: Final = (*_OF_THE_TABLE, "light", "verdict", "refusal", "unit")
_NUMBERS: Final = (
    *("T0_s", "T0_sd_s", "Q", "Q_sd", "amplitude"),
    *("a", "a_sd", "b", "b_sd", "c", "c_sd"),
)
COLUMNS: Final = (*_WORDS[:4], *_NUMBERS, *_WORDS[4:])
"""T0_s is the period of small swings, Q that at `amplitude`, in `unit` (rad or m); a is in
1/(unit s), b in 1/s, c in unit/s. Empty: there is no such number."""


@command(
    flags("--campaign", required=True)
    | {
        "--out": {
            "type": Path,
            "nargs": "+",
            "required": True,
            "metavar": "FILE",
            "help": "the table: .parquet, .csv, or both",
        }
        | OUTPUT
    }
)
def run(arguments: Arguments) -> None:
    """Write the table in each form that is asked for."""
    for out in arguments.out:
        known = out.suffix in (".parquet", ".csv")
        refuse_if(not known, out, "its format is unknown", "end its name in .parquet or .csv")
    campaign = load(arguments.campaign)
    names = ("fit.json", "calibration.json", "diagnosis/diagnosis.json")
    with gathered(campaign.folder, *names) as folder:
        table = records_table(campaign, folder)
    for out in arguments.out:
        write_whole(out, _in_form(table, out.suffix))


def records_table(campaign: Campaign, folder: Path) -> pa.Table:
    """Return the table of `COLUMNS`, in the order of the campaign's own table."""
    import pyarrow as pa

    rows = [_row(campaign, folder, result) for result in read_results(campaign, folder)]
    kinds = [(name, pa.string() if name in _WORDS else pa.float64()) for name in COLUMNS]
    schema = pa.schema(kinds, metadata={MARK: MADE_BY})
    return pa.Table.from_pylist(rows, schema=schema)


def _row(campaign: Campaign, folder: Path, result: RecordResult) -> dict[str, Any]:
    """The numbers of a fit; of a law that contradicts the decay only what needs no law."""
    record, fit = result.record, result.fit
    row: dict[str, Any] = {name: getattr(record, name) or None for name in _OF_THE_TABLE}
    row["refusal"] = result.refused
    if campaign.configuration.diagnose.enabled:
        diagnosis = read_json(folder / record.record / "diagnosis" / "diagnosis.json")
        row["verdict"] = diagnosis["verdict"]
    if fit is not None:
        row |= row_of(Fitted(record.record, fit)) | {"unit": fit["amplitude"].unit}
    return {name: row.get(name) for name in COLUMNS}


def _in_form(table: pa.Table, form: str) -> bytes | str:
    if form == ".csv":
        return csv_text(COLUMNS, (row.values() for row in table.to_pylist()))
    from pyarrow import parquet

    stream = io.BytesIO()
    parquet.write_table(table, stream)
    return stream.getvalue()
