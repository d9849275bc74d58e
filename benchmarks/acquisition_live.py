"""Recordings that must last: live ones in a campaign, and raw files with a flipped bit."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.raw import read_raw
from pendpipe.acquisition.recorder import acquire_simulated
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.recording import GOOD

ROOT: Final = Path(__file__).resolve().parents[1]
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
def served_device(folder: Path, link: str) -> Iterator[str]:
    """A simulated DI-2108 in a process of its own; yields its port."""
    with served_process(folder, link) as (_, port):
        yield port


@contextmanager
def served_process(folder: Path, link: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """As `served_device`; yields its process as well."""
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


def slow(time_s: FloatArray) -> FloatArray:
    return np.asarray(5.0 * np.sin(0.02 * time_s))


def recorded_bytes(kind: str) -> bytes:
    """A raw recording of 40 s of the simulated device, some hundred frames."""
    with tempfile.TemporaryDirectory(prefix="pendpipe-") as folder:
        raw = Path(folder, "flips.raw")
        acquire_simulated(
            kind, slow, rate_hz=100.0, duration_s=40.0, clock_scale=20.0, raw_path=raw
        )
        return raw.read_bytes()


@dataclass(frozen=True)
class Flip:
    """What one flipped bit of a raw file costs.

    Parameters
    ----------
    noticed
        Whether the recording's notes tell of it.
    frames_lost, scans_lost
        Frames and scans that are no longer there.
    false_samples
        Samples that are called good, and differ from those without the flip.
    """

    noticed: bool
    frames_lost: int
    scans_lost: int
    false_samples: int


def flip(whole: bytes, bit: int) -> Flip:
    """Flip a bit of a raw file and decode it."""
    damaged = bytearray(whole)
    damaged[bit // 8] ^= 1 << bit % 8
    before, after = decode_recording(whole), decode_recording(bytes(damaged))
    raw_before, raw_after = read_raw(whole), read_raw(bytes(damaged))
    good = after.usable if after.quality is None else after.usable & (after.quality == GOOD)
    index = np.rint(after.time_s[good] / before.interval_s).astype(np.int64)
    inside = index < len(before)
    false = int(np.sum(before.values[index[inside]] != after.values[good][inside]))
    false += int(np.sum(~inside))
    return Flip(
        any("damaged" in note for note in after.notes),
        len(raw_before.arrival_s) - len(raw_after.arrival_s),
        len(before) - int(np.sum(good)),
        false,
    )
