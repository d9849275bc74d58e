"""Chunks change no result, and a killed chunk repeats nothing that was finished.

    python -m benchmarks.chunks [--records 8] [--kills 10] [--seed 1]

First a campaign with its diagnoses runs twice, in chunks and with ``batch: 1``; all files but the
logs and what the chunks themselves say are compared byte for byte. Then a run of each stage in
turn is killed -9, with all its processes, in the middle of its chunk; the same command follows.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from benchmarks.scale import ROOT, write_campaign
from pendpipe.commands.doctor import TEMPORARY
from pendpipe.configuration.load import load_campaign, read_configuration
from pendpipe.files import sha256
from pendpipe.manifest import read_manifest
from pendpipe.stages.chunks import FOLDER, STAGES, chunks_of
from pendpipe.version import __version__

OF_NO_RECORD: Final = (FOLDER, "logs")


def freeze() -> None:
    """Copy the code: what is edited or installed meanwhile changes nothing here."""
    for name in ("src", "workflow", "profiles"):
        shutil.copytree(ROOT / name, name)
    Path("src/pendpipe/_version.py").write_text(f'version = "{__version__}"\n', "utf-8")


def start(*words: str) -> subprocess.Popen[bytes]:
    """Start a campaign as the leader of a group."""
    return subprocess.Popen(
        [sys.executable, "-m", "pendpipe", "campaign", "--cores", "2", *words],
        env=os.environ | {"PYTHONPATH": str(Path("src").absolute())},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def run(*words: str) -> None:
    """Run a campaign to its end."""
    if status := start(*words).wait():
        raise SystemExit(f"pendpipe campaign {' '.join(words)} ended with status {status}")


def sums(results: Path) -> dict[str, str]:
    """The hash of each result."""
    return {
        path.relative_to(results).as_posix(): sha256(path)
        for path in sorted(results.rglob("*"))
        if path.is_file()
        and not set(path.parts) & set(OF_NO_RECORD)
        and not TEMPORARY.fullmatch(path.name)
    }


def differing(one: dict[str, str], other: dict[str, str]) -> list[str]:
    """The names of the results that are not the same."""
    return sorted(name for name in one | other if one.get(name) != other.get(name))


def finished(results: Path, stage: str, records: list[str]) -> dict[str, int]:
    """The file of each record whose stage is done, as the system numbers it."""
    return {
        name: (results / name / STAGES[stage].output).stat().st_ino
        for name in records
        if read_manifest(results / name, stage).key
    }


def kill_in_a_chunk(stage: str, records: list[str], undisturbed: dict[str, str], after: int) -> str:
    """Kill a run when so many records of a chunk are done, run again, and return a row."""
    results = Path("results")
    shutil.rmtree(results)
    target = ["--", str(results / FOLDER / f"{stage}-all.json")]
    process = start(*target)
    while len(finished(results, stage, records)) < after and process.poll() is None:
        time.sleep(0.01)
    alive = process.poll() is None
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = finished(results, stage, records)
    run("--", "--unlock")
    run(*target)
    now = finished(results, stage, records)
    again = [name for name, number in before.items() if now[name] != number]
    made = sums(results)
    wrong = differing(made, {name: undisturbed.get(name, "") for name in made})
    cells = (stage, "yes" if alive else "no", f"{len(before)} of {len(records)}", str(len(again)))
    return f"| {' | '.join(cells)} | {'the same' if not wrong else ', '.join(wrong)} |"


def main() -> int:
    """Compare, kill, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=8)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    draw, bad = random.Random(arguments.seed), 0
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        freeze()
        write_campaign(Path(), arguments.records, diagnosed=True)
        run()
        together = sums(Path("results"))
        shutil.move("results", "together")
        with Path("config/config.yaml").open("a", encoding="utf-8") as configuration:
            configuration.write("batch: 1\n")
        run()
        wrong = differing(together, sums(Path("results")))
        campaign = load_campaign(read_configuration("config/config.yaml"), "config/config.yaml")
        bad += bool(wrong)
        print(
            f"{len(together)} results of {arguments.records} records in one chunk and in"
            f" {len(chunks_of(campaign))}: {', '.join(wrong) or 'all the same'}",
            flush=True,
        )
        path = Path("config/config.yaml")
        path.write_text(path.read_text(encoding="utf-8").replace("batch: 1", "batch: 128"), "utf-8")
        print("\n| killed in | while it ran | done before | done again | results |", flush=True)
        print("|---|---|---|---|---|", flush=True)
        records = [record.record for record in campaign.records]
        for number in range(arguments.kills):
            stage = list(STAGES)[number % len(STAGES)]
            after = draw.randrange(1, arguments.records)
            row = kill_in_a_chunk(stage, records, together, after)
            bad += not row.endswith("| 0 | the same |")
            print(row, flush=True)
        os.chdir(ROOT)
    return int(bool(bad))


if __name__ == "__main__":
    raise SystemExit(main())
