"""One table of a campaign's records: period, Q, losses, verdict or refusal, a row a record.

The ending of each FILE says its form: .parquet keeps numbers as they are, .csv is for spreadsheets.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendpipe.analysis.fit.result import FitResult
from pendpipe.arguments import Arguments, load
from pendpipe.configuration.load import Campaign
from pendpipe.errors import refuse_if
from pendpipe.estimate import Estimate
from pendpipe.files import MADE_BY, MARK, read_json, write_whole
from pendpipe.manifest import job
from pendpipe.options import OUTPUT, flags
from pendpipe.stages.results import RecordResult, read_results, record_files

if TYPE_CHECKING:
    import pyarrow as pa

_WORDS: Final = ("record", "fluid", "branch", "pendulum", "light", "verdict", "refusal", "unit")
_NUMBERS: Final = (
    *("T0_s", "T0_sd_s", "Q", "Q_sd", "amplitude"),
    *("a", "a_sd", "b", "b_sd", "c", "c_sd"),
)
COLUMNS: Final = (*_WORDS[:4], *_NUMBERS, *_WORDS[4:])
"""T0_s is the period of small swings, Q that at `amplitude`, in `unit` (rad or m); a is in
1/(unit s), b in 1/s, c in unit/s. Empty: there is no such number."""

ARGUMENTS: Final = flags("--campaign", required=True) | {
    "--out": {
        "type": Path,
        "nargs": "+",
        "required": True,
        "metavar": "FILE",
        "help": "the table: .parquet, .csv, or both",
    }
    | OUTPUT
}


def run(arguments: Arguments) -> None:
    """Write the table in each form that is asked for."""
    for out in arguments.out:
        known = out.suffix in (".parquet", ".csv")
        refuse_if(not known, out, "its form is unknown", "end its name in .parquet or .csv")
    campaign = load(arguments.campaign)
    names = ["fit.json", "calibration.json"]
    names += ["diagnosis/diagnosis.json"] if campaign.configuration.diagnose.enabled else []
    inputs = record_files(campaign, *names)
    with job(campaign.folder, "records", inputs=inputs, outputs=arguments.out):
        table = records_table(campaign)
        for out in arguments.out:
            write_whole(out, _parquet(table) if out.suffix == ".parquet" else _csv(table))


def records_table(campaign: Campaign) -> pa.Table:
    """Return the table of `COLUMNS`, in the order of the campaign's own table."""
    import pyarrow as pa

    rows = [_row(campaign, result) for result in read_results(campaign)]
    kinds = [(name, pa.string() if name in _WORDS else pa.float64()) for name in COLUMNS]
    schema = pa.schema(kinds, metadata={MARK: MADE_BY})
    return pa.Table.from_pylist(rows, schema=schema)


def _row(campaign: Campaign, result: RecordResult) -> dict[str, Any]:
    record = result.record
    row: dict[str, Any] = {
        "record": record.record,
        "fluid": record.fluid or None,
        "branch": record.branch or None,
        "pendulum": record.pendulum or None,
        "refusal": result.refused,
    }
    if campaign.configuration.diagnose.enabled:
        diagnosis = read_json(campaign.folder / record.record / "diagnosis" / "diagnosis.json")
        row["verdict"] = diagnosis["verdict"]
    return row if result.fit is None else row | _of_fit(result.fit)


def _of_fit(fit: FitResult) -> dict[str, Any]:
    """The numbers of a fit; of a law that contradicts the decay only what needs no law."""
    row: dict[str, Any] = {"light": fit.light, "unit": fit["amplitude"].unit}
    numbers: dict[str, Estimate] = {"T0": fit.period}
    for each in fit.quality_factors[:1]:
        row["amplitude"], numbers["Q"] = each.amplitude_rad, each.quality_factor
    if fit.light != "red":
        numbers |= {name: fit[name] for name in "abc"}
    for name, estimate in numbers.items():
        end = "_s" if name == "T0" else ""
        row |= {f"{name}{end}": estimate.value, f"{name}_sd{end}": estimate.sd}
    return row


def _parquet(table: pa.Table) -> bytes:
    from pyarrow import parquet

    stream = io.BytesIO()
    parquet.write_table(table, stream)
    return stream.getvalue()


def _csv(table: pa.Table) -> bytes:
    from pyarrow import csv

    stream = io.BytesIO()
    csv.write_csv(table, stream, csv.WriteOptions(quoting_style="needed"))
    return stream.getvalue()
