"""Kill and starve a small campaign: the next run ends as an undisturbed one.

    python -m benchmarks.kills                       every part; goes on where it was stopped
    python -m benchmarks.kills group job --number 10 of these parts ten cases more each

Each case runs three records (two of a simulated instrument, one file) in a project of its own,
disturbs the run, does what ``pendpipe doctor`` says about a lock, runs the same command
again and compares every file of the results, byte for byte, with an undisturbed run. One project
suffers `CHAIN` kills before it may end: after each, what the doctor finds sound is compared. Left
out are the logs, which carry the dates, and temporary files that a killed process left. The
table is printed. What was done is kept in ``.evidence`` for as long as the
code is the same.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from benchmarks import journal
from pendpipe.commands.doctor import TEMPORARY
from pendpipe.files import sha256
from pendpipe.manifest import SET_ASIDE, manifests

ROOT: Final = Path(__file__).resolve().parents[1]
GUARDS: Final = (
    "pendpipe.manifest",
    "pendpipe.commands.doctor",
    "pendpipe.stages.refusal",
    "pendpipe.stages.chunks",
    "pendpipe.commands.stage",
    "pendpipe.stages.acquire",
    "workflow/rules/*.smk",
    "workflow/Snakefile",
    "profiles/*/*",
    "./Snakefile",
    "benchmarks/kills.py",
)
"""What a case tries: other code of the campaign makes other numbers, but guards nothing."""
STAGES: Final = (
    *GUARDS,
    *("pendpipe.commands.acquire", "pendpipe.commands.calibrate", "pendpipe.commands.fit"),
    *("pendpipe.commands.turning_points", "pendpipe.commands.diagnose", "pendpipe.stages.acquire"),
    *("pendpipe.commands.separate", "pendpipe.commands.compare", "pendpipe.commands.figures"),
    *("pendpipe.commands.report", "config/*.yaml"),
)
"""What makes the numbers: while it is the same, the undisturbed run is kept from call to call."""
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
CHAIN: Final = 5
"""Kills of one project, one run after the other."""
PATIENCE_S: Final = 3600.0
"""No run of the small campaign takes as long, on however busy a machine."""

Sums = dict[str, str]
Case = dict[str, Any]


def decay() -> str:
    """A viscous decay of 20 swings with a little noise, as a file."""
    noise = np.random.default_rng(1).normal(0.0, 1e-3, 1200)
    time_s = np.arange(1200) / 60.0
    angle = 0.05 * np.exp(-time_s / 10.0) * np.cos(2.0 * np.pi * time_s) + noise
    rows = zip(time_s.tolist(), angle.tolist(), strict=True)
    return "time_s,angle_rad\n" + "".join(f"{t:.6f},{y:.7f}\n" for t, y in rows)


class Project:
    """A campaign with its workflow in a folder of its own; Snakemake runs there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.results = folder / "results"
        folder.mkdir(exist_ok=True)
        shutil.copy(ROOT / "Snakefile", folder)
        for name in ("workflow", "config", "profiles"):
            shutil.copytree(ROOT / name, folder / name)
        (folder / "decay.csv").write_text(decay(), encoding="utf-8")
        (folder / "tiny.yaml").write_text(CONFIGURATION, encoding="utf-8")
        (folder / "records.tsv").write_text(RECORDS, encoding="utf-8")

    def start(
        self,
        *arguments: str,
        cores: int = 2,
        printed: IO[bytes] | None = None,
        **environment: str,
    ) -> subprocess.Popen[bytes]:
        """Start Snakemake as the leader of a group."""
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        command = [sys.executable, "-m", "snakemake", "--cores", str(cores)]

        with tempfile.TemporaryFile() as nobody:
            return subprocess.Popen(
                # What follows --configfile is one more of them.
                [*command, *arguments, "--configfile", "tiny.yaml"],
                cwd=self.folder,
                env=os.environ | {"PATH": path} | environment,
                stdout=printed or nobody,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def run(self, *arguments: str, **options: Any) -> tuple[int, str]:
        """Run Snakemake to its end; return its status and what it printed."""
        with tempfile.TemporaryFile() as printed:
            status = end_of(self.start(*arguments, printed=printed, **options))
            printed.seek(0)
            return status, printed.read().decode(errors="replace")

    def doctor(self) -> list[dict[str, str]]:
        """What `pendpipe doctor` finds; nothing where there are neither results nor a lock."""
        command = [sys.executable, "-m", "pendpipe.cli", "doctor", "results", "--json"]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, check=False)
        return list(json.loads(done.stdout)["findings"]) if done.stdout else []

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

    def sums(self) -> Sums:
        """The hash of each result."""
        return {
            path.relative_to(self.results).as_posix(): sha256(path)
            for path in sorted(self.results.rglob("*"))
            if path.is_file()
            and path.parent.name != "logs"
            and not TEMPORARY.fullmatch(path.name)
            and SET_ASIDE not in path.name
        }

    def jobs(self) -> list[int]:
        """The processes of pendpipe at work in this folder, without the shells around them."""
        found = []
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                words = (process / "cmdline").read_bytes().split(b"\0")
                if words[1:2] and words[1].endswith(b"/pendpipe") and self._is_at(process):
                    found.append(int(process.name))
        return found

    def alive(self) -> int:
        """How many processes of any kind are at work in this folder."""
        return sum(self._is_at(process) for process in Path("/proc").glob("[0-9]*"))

    def _is_at(self, process: Path) -> bool:
        try:
            return (process / "cwd").resolve() == self.folder.resolve()
        except OSError:
            return False


def end_of(process: subprocess.Popen[bytes]) -> int:
    """Wait for the end of a run; one that does not end is killed."""
    try:
        return process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        kill_group(process)
        raise


def kill_group(process: subprocess.Popen[bytes]) -> None:
    """Kill Snakemake and all its jobs with signal 9."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(PATIENCE_S)


def count(findings: Sequence[dict[str, str]]) -> dict[str, int]:
    """How many findings of each kind."""
    kinds = [finding["kind"] for finding in findings]
    return {kind: kinds.count(kind) for kind in sorted(set(kinds))}


class Trial:
    """The undisturbed run that all cases are compared with.

    Parameters
    ----------
    scratch
        A folder for the projects.
    """

    def __init__(self, scratch: Path) -> None:
        self.scratch = scratch
        project = Project(scratch / "undisturbed")
        self.begun_bytes = size_of(project.folder)
        kept = journal.KEPT / f"undisturbed-{journal.code(STAGES)}"
        if kept.is_dir():
            shutil.copytree(kept, project.folder, dirs_exist_ok=True)
        else:
            status, said = project.run()
            if status:
                raise SystemExit(f"the undisturbed run ended with status {status}:\n{said}")
            for old in journal.KEPT.glob("undisturbed-*"):
                shutil.rmtree(old)
            shutil.copytree(project.folder, kept.with_suffix(".new"), dirs_exist_ok=True)
            kept.with_suffix(".new").rename(kept)
        self.project, self.sums = project, project.sums()
        self.bytes = size_of(project.folder)

    def ended(self, project: Project, case: Case) -> Case:
        """Do what the doctor says, run again, and tell how it ended."""
        began = time.monotonic()
        found = project.doctor()
        case["left"] = count(found)
        if any("--unlock" in finding["safe"] for finding in found):
            project.run("--unlock")
        case["status"], said = project.run()
        sums = project.sums()
        differ = [n for n in sorted({*sums, *self.sums}) if sums.get(n) != self.sums.get(n)]
        case["after"] = count(project.doctor())
        case["differ"] = differ
        case["same"] = not differ and case["status"] == 0
        if not case["same"]:
            case["said"] = said[-2000:]
            kept = journal.KEPT / "kills" / f"{time.time():.0f}"
            for name in differ:
                for side, results in (("is", project.results), ("was", self.project.results)):
                    (kept / side / name).parent.mkdir(parents=True, exist_ok=True)
                    with suppress(FileNotFoundError):
                        shutil.copy(results / name, kept / side / name)
        case["rerun_s"] = round(time.monotonic() - began, 1)
        return case


Part = Callable[[Trial, Project, random.Random], list[Case]]


def size_of(folder: Path) -> int:
    """Bytes, in blocks of 4096, of the files and folders."""
    return sum(-(-path.lstat().st_size // 4096) * 4096 for path in folder.rglob("*"))


Kill = Callable[[Trial, Project, random.Random, float], Case]


def chain(kill: Kill) -> Part:
    """Kill one run after the other at growing shares of the files, then let one end."""

    def killed(trial: Trial, project: Project, draw: random.Random) -> list[Case]:
        cases = []
        began = time.monotonic()
        for share in sorted(draw.random() for _ in range(CHAIN)):
            case = kill(trial, project, draw, share)
            found = project.doctor()
            case["left"] = count(found)
            case["wrong"] = wrong(trial, project)
            if any("--unlock" in finding["safe"] for finding in found):
                project.run("--unlock")
            cases.append(case)
        end = trial.ended(project, {})
        for case in cases:
            case |= {key: end[key] for key in ("status", "differ", "after")}
            case["same"] = end["same"] and not case["wrong"]
            case["rerun_s"] = round((time.monotonic() - began) / CHAIN, 1)
        return cases

    return killed


def wrong(trial: Trial, project: Project) -> list[str]:
    """Results that their manifests call sound and that are others than in the undisturbed run.

    One that is missing is none: Snakemake deletes what a job that was killed had written.
    """
    homes = [project.results, *project.results.glob("*/")]
    sound = [
        (home / name).relative_to(project.results).as_posix()
        for home in homes
        for entry in manifests(home)
        if not entry.damages(hash_all=True)
        for name in entry.outputs
    ]
    sums = project.sums()
    return [name for name in sound if name in sums and sums[name] != trial.sums.get(name)]


def group(trial: Trial, project: Project, _draw: random.Random, share: float) -> Case:
    """Snakemake and all its jobs, killed with signal 9."""
    process = project.start()
    alive = project.wait(process, share, len(trial.sums))
    kill_group(process)
    return {"disturbed": alive, "made": len(project.sums()), "alive": project.alive()}


def job(trial: Trial, project: Project, draw: random.Random, share: float) -> Case:
    """One job, killed with signal 9."""
    process = project.start()
    project.wait(process, 0.9 * share, len(trial.sums))
    killed = False
    while not killed and process.poll() is None:
        if jobs := project.jobs():
            time.sleep(draw.uniform(0.0, 0.3))
            with suppress(ProcessLookupError):
                os.kill(draw.choice(jobs), signal.SIGKILL)
                killed = True
        time.sleep(0.02)
    first = end_of(process)
    return {"disturbed": killed, "made": len(project.sums()), "first": first}


@contextmanager
def small_disk(folder: Path, options: str) -> Iterator[bool]:
    """A file system of its own in a folder, if one may be mounted here; yields whether."""
    folder.mkdir()
    mounted = bool(shutil.which("mount")) and mount("-t", "tmpfs", "-o", options, "tmpfs", folder)
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", str(folder)], check=True)
        shutil.rmtree(folder)


def mount(*words: str | Path) -> bool:
    """Call mount(8); return whether it did as it was told."""
    return not subprocess.run(["mount", *map(str, words)], capture_output=True).returncode


def full(trial: Trial, _project: Project, draw: random.Random) -> list[Case]:
    """A run on a disk that gets full, in a project on a file system of its own."""
    share = draw.uniform(0.05, 0.95)
    room = trial.begun_bytes + 65536 + round(share * (trial.bytes - trial.begun_bytes))
    with small_disk(trial.scratch / "small", f"size={room}") as mounted:
        if not mounted:
            return [{}]
        project = Project(trial.scratch / "small")
        first, said = project.run()
        named = said_why(project, said)
        mount("-o", "remount,size=1g", project.folder)
        case = {"room": room, "disturbed": first != 0, "named": named}
        return [trial.ended(project, case)]


def said_why(project: Project, said: str) -> str:
    """The line that names a full or forbidden disk, on the terminal or in a log."""
    logs = "".join(
        path.read_text(encoding="utf-8", errors="replace")
        for path in project.results.glob("**/logs/*.log")
    )
    why = re.compile(r".*(?:No space left|too large).*")
    found = why.search(logs) or why.search(said)
    return found[0].strip()[:200].replace(str(project.folder), "") if found else ""


def two(trial: Trial, project: Project, draw: random.Random) -> list[Case]:
    """Two runs at once."""
    begun = project.start()
    project.wait(begun, draw.uniform(0.0, 0.9), len(trial.sums))
    second, said = project.run()
    statuses = [end_of(begun), second]
    named = re.search("LockException|cannot be locked", said)
    case = {"disturbed": 0 in statuses and statuses != [0, 0], "statuses": statuses}
    return [trial.ended(project, case | {"named": named[0] if named else ""})]


PARTS: Final[dict[str, tuple[str, Part, int]]] = {
    "group": ("kill -9 of the group", chain(group), 100),
    "job": ("kill -9 of a job", chain(job), 50),
    "full": ("disk full", full, 10),
    "two": ("two at once", two, 10),
}


def row(what: str, cases: Sequence[Case], asked: int) -> str:
    """A part's line of the table."""
    tried = [case for case in cases if case]
    if not tried:
        return f"| {what} | 0 of {asked}: {'may not be tried here' if cases else '-'} ||||||||"
    left = [case.get("left", {}) for case in tried]
    unknown = [
        kind for case in tried for kind in case["after"] if kind not in ("temporary", "set-aside")
    ]
    seconds = sorted(case["rerun_s"] for case in tried)
    reasons = [bool(case["named"]) for case in tried if "named" in case]
    return (
        f"| {what} | {len(tried)} of {asked} | {sum(case['disturbed'] for case in tried)} |"
        f" {sum('locked' in each for each in left)} |"
        f" {sum('incomplete' in each for each in left)} |"
        f" {sum(case['after'].get('temporary', 0) for case in tried)} |"
        f" {sum(reasons) if reasons else '-'} |"
        f" {sum(case['same'] for case in tried)} |"
        f" {len(unknown)} | {seconds[len(seconds) // 2]:.0f} |"
    )


def table(done: dict[str, list[Case]]) -> str:
    """All parts."""
    head = "| what | cases | disturbed | locks left | cut results | temporary files left |"
    lines = [
        f"{head} reason named | ended as undisturbed | findings after it | a case, s (median) |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [row(what, done.get(name, []), n) for name, (what, _, n) in PARTS.items()]
    return "\n".join(lines)


def try_on(done: dict[str, list[Case]], parts: Sequence[str], more: int | None) -> None:
    """Try what is left of the parts, or so many cases more of each; keep them as they come."""
    with tempfile.TemporaryDirectory(prefix="pendpipe-") as scratch:
        trial = Trial(Path(scratch))
        for name in parts:
            what, disturb, asked = PARTS[name]
            cases = done.setdefault(name, [])
            stop = asked if more is None else len(cases) + more
            while (number := len(cases)) < stop:
                project = Project(Path(scratch) / "project")
                cases += disturb(trial, project, random.Random(f"{name} {number}"))
                shutil.rmtree(project.folder)
                journal.keep("kills", done, GUARDS)
                bad = [case["differ"] for case in cases[number:] if case and not case["same"]]
                print(f"{what} {len(cases)} {bad or ''}", file=sys.stderr, flush=True)


def main() -> int:
    """Try what is left to try; print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; all, if none is named")
    parser.add_argument("--number", type=int, help="how many cases of each part to run now")
    parser.add_argument("--table", action="store_true", help="only print what was done")
    arguments = parser.parse_args()
    if unknown := {*arguments.parts} - {*PARTS}:
        parser.error(f"no part is called {', '.join(unknown)}")
    done: dict[str, list[Case]] = journal.read("kills", {}, GUARDS)
    if not arguments.table:
        try_on(done, arguments.parts or [*PARTS], arguments.number)
    print(f"{table(done)}\n\nMade by commit {journal.commit()}.")
    return int(any(case and not case["same"] for cases in done.values() for case in cases))


if __name__ == "__main__":
    raise SystemExit(main())
