"""Do one stage for a chunk of a campaign's records: what a job of the workflow calls.

A record whose stage is done, with the same settings, code and inputs, is left as it is. One
record's fault is its own: the others are done, and the command then ends with its status. What a
record's stage prints goes to RESULTS/<record>/logs/<stage>.log. What an instrument's record was
made from, now recorded or kept from before, is said to the user as well.
"""

import traceback
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

from pendpipe.arguments import Arguments, command, load, tell
from pendpipe.configuration.load import Campaign, Record
from pendpipe.errors import refuse_if
from pendpipe.files import make_folder
from pendpipe.manifest import disown, handed_on, read_manifest, set_aside_damaged
from pendpipe.options import flags
from pendpipe.stages.chunks import (
    STAGES,
    Stage,
    call,
    chunks_of,
    key,
    write_chunk,
)


@command(
    {
        "stage": {"choices": tuple(STAGES), "help": "what to do"},
        "--chunk": {"required": True, "metavar": "NAME", "help": "which records"},
        "--out": {"required": True, "type": Path, "metavar": "JSON", "help": "what was done"},
        **flags("--campaign", required=True),
    }
)
def run(arguments: Arguments) -> int:
    """Do what is left to do."""
    campaign = load(arguments.campaign)
    stage = STAGES[arguments.stage]
    records = chunks_of(campaign).get(arguments.chunk, ())
    refuse_if(not records, f"--chunk {arguments.chunk}", "there is no such chunk", "see snakemake")
    status = 0
    for record in records:
        status = max(status, _of_record(campaign, stage, record, str(arguments.campaign)))
    if status == 0:
        write_chunk(campaign, stage, records, arguments.out)
    return status


def _of_record(campaign: Campaign, stage: Stage, record: Record, configuration: str) -> int:
    """Do the stage for one record unless it is done; return the command's status."""
    home = campaign.folder / record.record
    wanted = key(campaign, stage, record)
    done = read_manifest(home, stage.name)
    if done.key == wanted and stage.name not in handed_on()["anew"] and not done.damages():
        return 0
    # Before the command looks at its outputs: a torn file is nobody's.
    disown(set_aside_damaged(done))
    log = home / "logs" / f"{stage.name.replace('-', '_')}.log"
    status = _logged(log, call(campaign, stage, record, configuration))
    lines = [line for line in log.read_text(encoding="utf-8").splitlines() if line.strip()]
    if status:
        tell(f"{record.record}: {lines[-1] if lines else f'status {status}'}")
        return status
    for line in lines:
        if line.startswith("pendpipe: "):
            tell(line)
        elif line.startswith(f"{record.record}: "):
            print(line)
    replace(read_manifest(home, stage.name), key=wanted).write()
    return 0


def _logged(log: Path, words: list[str]) -> int:
    """Run a command; what it prints goes to the log, the traceback of a fault too."""
    from pendpipe.commands.main import main

    make_folder(log.parent)
    with log.open("w", encoding="utf-8") as out, redirect_stdout(out), redirect_stderr(out):
        try:
            return main(words)
        except Exception:
            traceback.print_exc()
            return 1
