"""A campaign with a live record, and the device that it records."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.acquisition.raw import read_raw
from pendpipe.errors import InputError

ROOT: Final = Path(__file__).resolve().parents[2]
SIGNAL: Final = """
pendulum = {frequency_hz = 3.0, quality_factor_viscous = 60.0, release_angle_rad = 0.3}
sensor = {volts_per_radian = 3.85, noise_volts = 0.001}
sampling = {sample_rate_hz = 240.0, duration_s = 60.0}
"""
CONFIGURATION: Final = """
title: Live
records: {folder}/records.tsv
results: {folder}/results
apparatus: null
calibration: null
simulated: null
typical_record: null
diagnose: {{enabled: false}}
"""


@contextmanager
def served_process(folder: Path, link: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A simulated DI-2108 in a process of its own; yields it and its port."""
    description = folder / "signal.toml"
    description.write_text(SIGNAL, encoding="utf-8")
    command = [sys.executable, "-m", "pendpipe.cli", "acquire", "--serve", "di2108"]
    command += ["--signal", str(description), "--link", link]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process, process.stdout.readline().strip()
    finally:
        process.terminate()
        process.communicate(timeout=30)


class LiveCampaign:
    """A campaign with one live record and one from a file, in a folder of its own.

    Parameters
    ----------
    folder
        Where it is made.
    port, duration_s
        What the live record is recorded from, and for how long.
    stage
        Up to which stage both records are asked for.
    """

    def __init__(self, folder: Path, port: str, duration_s: float, stage: str = "acquire") -> None:
        self.folder = folder
        self.stage = stage
        self.results = folder / "results"
        self.recording = self.results / "live/recording.csv"
        time_s = np.arange(0.0, 10.0, 1 / 60)
        angle = 0.3 * np.exp(-time_s / 5) * np.cos(6.0 * time_s)
        rows = (f"{t!r},{y!r}\n" for t, y in zip(time_s.tolist(), angle.tolist(), strict=True))
        (folder / "decay.csv").write_text("time_s,angle_rad\n" + "".join(rows))
        configuration = CONFIGURATION.format(folder=folder.as_posix())
        (folder / "config.yaml").write_text(configuration)
        self.connect(port, duration_s)

    def connect(self, port: str, duration_s: float) -> None:
        """Write the table of records, with this port for the live one."""
        (self.folder / "records.tsv").write_text(
            "record\tsource\tstop_s\tvolts_per_radian\n"
            f"live\tdataq:{port}\t{duration_s}\t3.85\n"
            f"file\t{self.folder.as_posix()}/decay.csv\n"
        )

    @property
    def raw_files(self) -> dict[str, bytes]:
        """The raw files of the live record, by name."""
        return {path.name: path.read_bytes() for path in self.results.glob("live/raw/*")}

    def command(self, *arguments: str) -> list[str]:
        """The call of Snakemake that runs the stage of both records."""
        done = f"{self.results}/chunks/{self.stage}"
        return [
            *(sys.executable, "-m", "snakemake", "--cores", "2", "--nolock"),
            *("--configfile", str(self.folder / "config.yaml"), *arguments, "--"),
            *(f"{done}-{chunk}.json" for chunk in ("record.live", "all")),
        ]

    def run(self, *arguments: str, library: Path | None = None) -> subprocess.CompletedProcess[str]:
        """Run Snakemake to its end, with another copy of the library if one is given."""
        environment = os.environ | ({"PYTHONPATH": str(library)} if library else {})
        return subprocess.run(
            self.command(*arguments),
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )

    def kill_at(self, recorded_s: float) -> None:
        """Run Snakemake, and kill it with all its jobs when so much has been recorded."""
        process = subprocess.Popen(
            self.command(),
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        while process.poll() is None and self.recorded_s() < recorded_s:
            time.sleep(0.02)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def recorded_s(self) -> float:
        """The last time stamp in the raw files."""
        last_s = 0.0
        for path in self.results.glob("live/raw/*.raw"):
            with suppress(InputError):
                last_s = max([last_s, *read_raw(path).arrival_s[-1:]])
        return last_s


def changed_library(folder: Path) -> Path:
    """A copy of the library with a comment more in the decoder."""
    library = folder / "src"
    shutil.copytree(ROOT / "src", library, ignore=shutil.ignore_patterns("__pycache__"))
    with (library / "pendpipe/acquisition/decode.py").open("a") as source:
        source.write("# changed\n")
    return library
