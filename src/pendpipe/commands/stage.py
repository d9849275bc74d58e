"""Do one stage for a chunk of a campaign's records: what a job of the workflow calls.

It reads archives of the stages before and leaves one of its own, FILE. A record that is done, with
the same settings, code and inputs, is taken over from an earlier archive; where none differs, the
stage was asked for once more, and all are done. What a record's stage prints goes to its logs; what
an instrument's record was made from is said to the user as well.
"""

import traceback
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pendpipe.arguments import Arguments, command, load, tell
from pendpipe.configuration.load import Campaign, Record
from pendpipe.errors import refuse_if
from pendpipe.files import damage_of, sha256
from pendpipe.options import flags
from pendpipe.provenance import code_version
from pendpipe.stages.archive import archives, made_in, pack, unpack
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
        folder = Path(place)
        for path in arguments.reading:
            unpack(path, folder, lambda name: "/logs/" not in name)
        given = _files(folder)
        wanted = {each.record: _made(campaign, stage, each, folder) for each in records}
        own, done = made_in(out), dict[str, Path]()
        if any(own.get(name) != made for name, made in wanted.items()):
            for path in archives(campaign.folder, stage.name):
                earlier = made_in(path)
                done |= {n: path for n, made in wanted.items() if earlier.get(n) == made}
        for path in set(done.values()):
            records_in = {name for name, used in done.items() if used == path}
            unpack(path, folder, partial(_is_of, records_in))
        statuses = [
            _of_record(campaign, stage, record, folder, str(arguments.campaign))
            for record in records
            # (A recording of an instrument is decoded anew, from raw files that may be others.)
            if record.record not in done or record.source.startswith("dataq:")
        ]
        if not any(statuses):
            pack(out, folder, _files(folder) - given, wanted)
    return max(statuses, default=0)


def _is_of(records: set[str], name: str) -> bool:
    return name.partition("/")[0] in records


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
    """Do the stage for one record; return the command's status."""
    home = folder / record.record
    log = home / stage.files[1]
    status = _logged(log, stage.call(campaign, record, home, configuration))
    lines = [line for line in log.read_text(encoding="utf-8").splitlines() if line.strip()]
    if status:
        tell("\n".join([*lines[:-1], f"{record.record}: {(lines or [f'status {status}'])[-1]}"]))
    for line in lines if not status else ():
        if line.startswith("pendpipe: "):
            tell(line)
        elif line.startswith(f"{record.record}: "):
            print(line)
    return status


def _logged(log: Path, words: list[str]) -> int:
    """Run a command; what it prints goes to the log, the traceback of a fault too."""
    from pendpipe.commands.main import main

    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("w", encoding="utf-8") as out, redirect_stdout(out), redirect_stderr(out):
        try:
            return main(words)
        except Exception:
            traceback.print_exc()
            return 1
