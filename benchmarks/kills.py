"""Kill and damage a small campaign: the next run ends as an undisturbed one.

    python -m benchmarks.kills                      every part; goes on where it was stopped
    python -m benchmarks.kills group job --number 10    ten cases of these parts

Each case runs three records (two of a simulated instrument, one file) in a project of its own,
disturbs the run, does what ``pendpipe doctor`` says about a lock, runs the same command again and
compares every file of the results, byte for byte, with an undisturbed run. One project suffers
five kills before it may end; after each, what is sound by the digest in it is compared. A
result of a finished run that is torn, emptied or altered must be named and set aside as well. Left
out are logs, which carry dates, and temporary files that a killed process left.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import IO, Any, Final

from benchmarks.journal import KEPT, ROOT, answers, code, commit, judge_parser
from benchmarks.scale import write_decay
from benchmarks.table import head, table_row
from pendpipe.commands.doctor import TEMPORARY
from pendpipe.files import SET_ASIDE, sha256

SOURCES: Final = (
    *("src/pendpipe/stages/*.py", "src/pendpipe/commands/stage.py"),
    *("src/pendpipe/commands/doctor.py", "src/pendpipe/files.py"),
    *("workflow/rules/*.smk", "workflow/Snakefile", "profiles/*/*", "./Snakefile"),
    "benchmarks/kills.py",
)
"""What a case tries: other code of the campaign makes other numbers, but guards nothing."""
CONFIGURATION: Final = """
title: Tiny
records: records.tsv
results: results
simulated:
  release:
    water: {angle_rad: 0.068, samples: 2048, duration_s: 60.0}
    air: {angle_rad: 0.25, samples: 2048, duration_s: 200.0}
typical_record: high
"""
RECORDS: Final = (
    "record\tsource\tfluid\tbranch\tgeometry\ttemperature_c\n"
    "high\tsimulated\twater\thigh\thigh-4\t20.0\n"
    "air\tsimulated\tair\tair\tair-07\t20.0\n"
    "file\tdecay.csv\n"
)
KILLS: Final = 5
"""Of one project, one run after the other."""
PATIENCE_S: Final = 3600.0
"""No run of the small campaign takes as long, on however busy a machine."""
Case = dict[str, Any]


class Project:
    """A campaign with its workflow in a folder of its own; Snakemake runs there."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.results = folder, folder / "results"
        if (folder / "tiny.yaml").exists():
            return
        folder.mkdir(exist_ok=True)
        shutil.copy(ROOT / "Snakefile", folder)
        for name in ("workflow", "config", "profiles"):
            shutil.copytree(ROOT / name, folder / name)
        write_decay(folder / "decay.csv", 0.05, 0.1, 1.0)
        (folder / "records.tsv").write_text(RECORDS, encoding="utf-8")
        (folder / "tiny.yaml").write_text(CONFIGURATION, encoding="utf-8")

    def start(self, *words: str, printed: IO[bytes] | None = None) -> subprocess.Popen[bytes]:
        """Start Snakemake as the leader of a group."""
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        command = [sys.executable, "-m", "snakemake", "--cores", "2", *words]
        return subprocess.Popen(
            # What follows --configfile is one more of them.
            [*command, "--configfile", "tiny.yaml"],
            cwd=self.folder,
            env=os.environ | {"PATH": path},
            stdout=printed or subprocess.DEVNULL,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def run(self, *words: str) -> tuple[int, str]:
        """Run Snakemake to its end; return its status and what it printed."""
        with tempfile.TemporaryFile() as printed:
            status = self.start(*words, printed=printed).wait(PATIENCE_S)
            printed.seek(0)
            return status, printed.read().decode(errors="replace")

    def doctor(self) -> Counter[str]:
        """Unlock if `pendpipe doctor` says so; how many findings of each kind it has."""
        command = [sys.executable, "-m", "pendpipe.cli", "doctor", "results", "--json"]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, check=False)
        # Where there are neither results nor a lock it finds nothing.
        findings = json.loads(done.stdout)["findings"] if done.stdout else []
        if any("--unlock" in finding["safe"] for finding in findings):
            self.run("--unlock")
        return Counter(finding["kind"] for finding in findings)

    def wait(self, process: subprocess.Popen[bytes], share: float, files: int) -> bool:
        """Wait until a share of the files is there; return whether the run is still alive.

        A tenth of the instants lie before the first new file, when the run is planned.
        """
        begun = time.monotonic()
        there = sum(path.is_file() for path in self.results.rglob("*"))
        while process.poll() is None:
            made = sum(path.is_file() for path in self.results.rglob("*"))
            if share < 0.1 and time.monotonic() - begun > 30.0 * share:
                return True
            if made >= max(there + 1.0, (share - 0.1) / 0.9 * files):
                time.sleep(0.5 * (share * files % 1.0))
                return process.poll() is None
            time.sleep(0.03)
        return False

    def sums(self) -> dict[str, str]:
        """The hash of each result."""
        sums = {}
        for path in sorted(self.results.rglob("*")):
            name = path.relative_to(self.results).as_posix()
            ours = path.is_file() and path.parent.name != "logs" and SET_ASIDE not in name
            if ours and not TEMPORARY.fullmatch(path.name):
                sums[name] = sha256(path)
        return sums

    def jobs(self) -> list[int]:
        """The processes of pendpipe at work in this folder, without the shells around them."""
        found = []
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                words = (process / "cmdline").read_bytes().split(b"\0")
                here = (process / "cwd").resolve() == self.folder.resolve()
                if here and words[1:2] and words[1].endswith(b"/pendpipe"):
                    found.append(int(process.name))
        return found


class Trial:
    """The undisturbed run that all cases are compared with, kept while the code is the same."""

    def __init__(self) -> None:
        self.kept = KEPT / f"undisturbed-{code(('src/pendpipe/**/*.py', *SOURCES))}"
        if not self.kept.is_dir():
            for old in KEPT.glob("undisturbed-*"):
                shutil.rmtree(old)
            project = Project(self.kept.with_suffix(".new"))
            if (done := project.run())[0]:
                raise SystemExit(f"the undisturbed run ended with status {done[0]}:\n{done[1]}")
            self.kept.with_suffix(".new").rename(self.kept)
        self.sums = Project(self.kept).sums()

    def ended(self, project: Project, case: Case) -> Case:
        """Do what the doctor says, run again, and tell how it ended."""
        began = time.monotonic()
        case["left"] = project.doctor()
        status, said = project.run()
        sums = project.sums()
        differ = [n for n in sorted({*sums, *self.sums}) if sums.get(n) != self.sums.get(n)]
        case |= {"same": not differ and status == 0, "after": project.doctor(), "differ": differ}
        return case | {"said": said[-9000:], "rerun_s": round(time.monotonic() - began, 1)}


def wrong(trial: Trial, project: Project) -> list[str]:
    """Results that are sound by themselves and others than in the undisturbed run.

    One that is missing is none: Snakemake deletes what a job that was killed had written.
    """
    sums = project.sums()
    return [name for name, found in sums.items() if found != trial.sums.get(name)]


def kill_group(process: subprocess.Popen[bytes], *_: object) -> bool:
    """Kill Snakemake and all its jobs with signal 9."""
    alive = process.poll() is None
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(PATIENCE_S)
    return alive


def kill_job(process: subprocess.Popen[bytes], project: Project, draw: random.Random) -> bool:
    """Kill one job with signal 9; Snakemake ends by itself."""
    killed = False
    while not killed and process.poll() is None:
        if jobs := project.jobs():
            time.sleep(draw.uniform(0.0, 0.3))
            with suppress(ProcessLookupError):
                os.kill(draw.choice(jobs), signal.SIGKILL)
                killed = True
        time.sleep(0.02)
    process.wait(PATIENCE_S)
    return killed


def killed(trial: Trial, folder: Path, draw: random.Random, kill: Callable[..., bool]) -> Case:
    """Kill one run after the other at growing shares of the files, then let one end."""
    project, alive, bad = Project(folder), 0, []
    for share in sorted(draw.random() for _ in range(KILLS)):
        process = project.start()
        project.wait(process, share, len(trial.sums))
        alive += kill(process, project, draw)
        bad += wrong(trial, project)
        project.doctor()
    case = trial.ended(project, {"disturbed": alive, "named": True})
    return case | {"same": case["same"] and not bad, "differ": case["differ"] + bad}


def torn(trial: Trial, folder: Path, draw: random.Random) -> Case:
    """A result of a finished run is torn, emptied or altered, its old time put back or not."""
    shutil.copytree(trial.kept, folder, dirs_exist_ok=True)
    project = Project(folder)
    files = [each for each in project.results.rglob("*") if each.is_file()]
    path = draw.choice(sorted(each for each in files if each.parent.name != "logs"))
    name = path.relative_to(project.results).as_posix()
    content, status = path.read_bytes(), path.stat()
    at = draw.randrange(len(content))
    altered = content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]
    path.write_bytes(draw.choice([content[:at], b"", altered]))
    if draw.randrange(2):
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    case = trial.ended(project, {"disturbed": 1, "name": name})
    aside = [each for each in path.parent.glob(f"{path.name}*") if SET_ASIDE in each.name]
    return case | {"named": f"{name}: " in case["said"] and len(aside) == 1}


PARTS: Final[dict[str, tuple[str, Callable[..., Case], int]]] = {
    "group": ("kill -9 of the group, 5 times", partial(killed, kill=kill_group), 20),
    "job": ("kill -9 of a job, 5 times", partial(killed, kill=kill_job), 10),
    "torn": ("result torn, emptied or altered", torn, 60),
}


def tried(key: tuple[str, int], trial: Trial) -> Case:
    """Try one case of a part in a folder of its own."""
    with tempfile.TemporaryDirectory(prefix="pendpipe-") as folder:
        case = PARTS[key[0]][1](trial, Path(folder), random.Random(f"{key[0]} {key[1]}"))
    if case["same"] and case["named"]:
        del case["said"]
    return case


def row(what: str, cases: Sequence[Case]) -> str:
    """A part's line of the table."""
    left: Counter[str] = sum((Counter(case["left"]) for case in cases), Counter())
    after = {kind for case in cases for kind in case["after"]} - {"temporary", "set-aside"}
    cells: list[object] = [len(cases), sum(case["disturbed"] for case in cases)]
    cells += [left["locked"], left["incomplete"], left["temporary"]]
    cells += [sum(case["same"] and case["named"] for case in cases), ", ".join(after) or "none"]
    middle = sorted(case["rerun_s"] for case in cases)[len(cases) // 2]
    return table_row(what, [*cells, f"{middle:.0f}"])


def main() -> int:
    """Try what is left to try; print the table."""
    parser = judge_parser(__doc__, "kills", 0)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all, if none is named")
    told = parser.parse_args()
    KEPT.mkdir(exist_ok=True)
    trial, bad = Trial(), []
    titles = ("what", "cases", "disturbed", "locks left", "cut results", "temporary files")
    print(head(*titles, "ended as undisturbed", "findings after it", "a case, s"))
    for name in told.parts or PARTS:
        what, _, number = PARTS[name]
        keys = [(name, case) for case in range(told.number or number)]
        cases = list(answers(told, keys, partial(tried, trial=trial), SOURCES))
        print(row(what, cases), flush=True)
        bad += [f"{name} {n}: {case}" for n, case in enumerate(cases) if "said" in case]
    print("", *bad, f"{len(bad)} wrong. Made by commit {commit()}.", sep="\n")
    return int(bool(bad))


if __name__ == "__main__":
    raise SystemExit(main())
