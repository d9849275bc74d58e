"""Do one stage for a chunk of a campaign's records: what a job of the workflow calls.

It reads archives of the stages before and leaves one of its own, FILE. A record that is done, with
the same settings, code and inputs, is taken over from an earlier archive; where none differs, the
stage was asked for once more, and all are done. What a record's stage prints goes to the log of the
job; what an instrument's record was made from is said to the user as well.
"""

import io
import traceback
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pendpipe.arguments import Arguments, command, load, tell
from pendpipe.configuration.load import Campaign, Record
from pendpipe.errors import refuse_if
from pendpipe.files import damage_of, sha256
from pendpipe.options import flags
from pendpipe.provenance import code_version
from pendpipe.stages.archive import archives, made_in, pack, take_over, unpack
from pendpipe.stages.chunks import STAGES, Stage, chunks_of, settings


@command(
    {
        "stage": {"choices": tuple(STAGES), "help": "what to do"},
        "--chunk": {"required": True, "metavar": "NAME", "help": "which records"},
        "--reading": {
            "type": Path,
            "nargs": "*",
            "default": [],
            "metavar": "FILE",
            "help": "what the stages before have left",
        },
        "--out": {"required": True, "type": Path, "metavar": "FILE", "help": "what it leaves"},
        **flags("--campaign", required=True),
    }
)
def run(arguments: Arguments) -> int:
    """Do what is left to do."""
    campaign = load(arguments.campaign)
    stage, out = STAGES[arguments.stage], arguments.out
    records = chunks_of(campaign).get(arguments.chunk, ())
    refuse_if(not records, f"--chunk {arguments.chunk}", "there is no such chunk", "see snakemake")
    if out.is_file() and (damage := damage_of(out)):
        tell(f"pendpipe: {out}: {damage.problem}; {damage.set_aside()}")
    with TemporaryDirectory(prefix="pendpipe-") as place:
        folder, done = Path(place), set[str]()
        for path in arguments.reading:
            unpack(path, folder)
        given = _files(folder)
        wanted = {each.record: _made(campaign, stage, each, folder) for each in records}
        for path in archives(campaign.folder, stage.name) if made_in(out) != wanted else ():
            done |= take_over(path, folder, wanted)
        statuses = [
            _of_record(campaign, stage, record, folder, str(arguments.campaign))
            for record in records
            # (A recording of an instrument is decoded anew, from raw files that may be others.)
            if record.record not in done or record.source.startswith("dataq:")
        ]
        if not any(statuses):
            pack(out, folder, _files(folder) - given, wanted)
    return max(statuses, default=0)


def _files(folder: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if path.is_file()}


def _made(campaign: Campaign, stage: Stage, record: Record, folder: Path) -> dict[str, Any]:
    """All that a record's stage depends on: settings, code, and the hashes of what it reads."""
    home = folder / record.record
    read = {name: home / name for name in (*stage.inputs, "refused.json")}
    if stage.name == "calibrate" and campaign.sensor:
        read["sensor.json"] = campaign.sensor
    return {
        "settings": settings(campaign, stage, record, sha256),
        "code": code_version(),
        "read": {name: found for name, path in read.items() if (found := sha256(path))},
    }


def _of_record(
    campaign: Campaign, stage: Stage, record: Record, folder: Path, configuration: str
) -> int:
    """Do the stage for one record; return the command's status.

    What it prints goes to the log of the job under the record's name, the traceback of a fault too.
    """
    from pendpipe.commands.main import main

    name, said = record.record, io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        try:
            status = main(stage.call(campaign, record, folder / name, configuration))
        except Exception:
            traceback.print_exc()
            status = 1
    for line in filter(str.strip, said.getvalue().replace(f"{folder}/", "").splitlines()):
        tell(f"{name}: {line.removeprefix(f'{name}: ')}")
        if line.startswith(f"{name}: ") and not status:
            print(line)
    return status
