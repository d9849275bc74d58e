"""A live recording in a campaign survives unplugging, code changes, failures and kills."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.raw import RawWriter, read_raw
from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.recording import read_plain
from pendpipe.stages.archive import unpack

# A campaign with a live record, and the device that it records.

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


LIVE: Final = "record.live"
"""The chunk of the live record."""


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
    """

    def __init__(self, folder: Path, port: str, duration_s: float) -> None:
        self.folder = folder
        self.results = folder / "results"
        self.recording = self.results / "live/recording.csv"
        self.archive = self.results / f"chunks/acquire-{LIVE}.zip"
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

    def words(self, chunk: str = LIVE, stage: str = "acquire") -> list[str]:
        """The command of the job that does a stage for a chunk."""
        campaign, done = (
            str(self.folder / "config.yaml"),
            self.results / f"chunks/{stage}-{chunk}.zip",
        )
        words = ["stage", stage, "--campaign", campaign, "--chunk", chunk, "--out", str(done)]
        return words if stage == "acquire" else [*words, "--reading", str(self.archive)]

    def job(self, chunk: str = LIVE, stage: str = "acquire") -> int:
        """Do a stage for a chunk, bring out its files, and return the job's status."""
        status = main(self.words(chunk, stage))
        if status == 0:
            unpack(self.results / f"chunks/{stage}-{chunk}.zip", self.results)
        return status

    def snakemake(self) -> list[str]:
        """The call of Snakemake that runs the live record up to its turning points."""
        return [
            *(sys.executable, "-m", "snakemake", "--cores", "2", "--nolock"),
            *("--configfile", str(self.folder / "config.yaml"), "--"),
            f"{self.results}/live/turning_points.csv",
            f"{self.results}/live/recording.csv",
        ]

    def kill_at(self, recorded_s: float) -> None:
        """Run Snakemake, and kill it with all its jobs when so much has been recorded."""
        process = subprocess.Popen(
            self.snakemake(),
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


# A live recording in a campaign survives unplugging, code changes, failures and kills.

pytestmark = pytest.mark.slow
LINK = "pty" if hasattr(os, "openpty") else "socket"
"""Both kinds of line are those of `test_sessions`."""
DURATION_S = 2.0
LONG_S = 4.0
"""Of a recording that is broken off, so that a busy machine does not end it before."""


def test_neither_changed_code_nor_force_records_again(tmp_path: Path) -> None:
    """With the device gone, everything is made from the raw file, byte for byte."""
    with served_process(tmp_path, LINK) as (_, port):
        campaign = LiveCampaign(tmp_path, port, DURATION_S)
        assert campaign.job() == 0
    recording, raw = campaign.recording.read_bytes(), campaign.raw_files
    assert len(read_plain(campaign.recording)) == 60 * DURATION_S
    assert len(raw) == 1
    done = subprocess.run(
        [sys.executable, "-m", "pendpipe.cli", *campaign.words()],
        env=os.environ | {"PYTHONPATH": str(changed_library(tmp_path))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert f"live: {60 * DURATION_S:g} samples" in done.stdout
    assert campaign.recording.read_bytes() == recording
    # Another length and another port in the table are no request to record either.
    campaign.connect("no-such-port", 2 * DURATION_S)
    assert campaign.job() == 0
    campaign.archive.unlink()
    assert campaign.job() == 0
    assert campaign.recording.read_bytes() == recording
    assert campaign.raw_files == raw
    # Even a recording that has lost its raw file is never given up.
    for path in campaign.results.glob("live/raw/*"):
        path.unlink()
    assert campaign.job() == 0
    assert campaign.recording.read_bytes() == recording


def test_a_killed_campaign_uses_what_was_recorded(tmp_path: Path) -> None:
    with served_process(tmp_path, LINK) as (_, port):
        campaign = LiveCampaign(tmp_path, port, 600.0)
        campaign.kill_at(0.7 * DURATION_S)
        raw = campaign.raw_files
        done = subprocess.run(
            campaign.snakemake(), cwd=ROOT, capture_output=True, text=True, check=False
        )
    assert done.returncode == 0, done.stderr
    assert campaign.raw_files == raw
    recording = read_plain(campaign.recording)
    assert recording.time_s[-1] > 0.7 * DURATION_S - 0.1
    assert "cut short" in recording.metadata["notes"]
    lines = [line for line in done.stdout.splitlines() if line.startswith("live: ")]
    assert len(lines) == 1
    assert next(iter(raw)) in lines[0]
    assert "--anew" in lines[0]
    assert (campaign.results / "live/turning_points.csv").stat().st_size > 500


def test_a_dead_line_fails_its_job_alone_and_the_next_tries_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Nobody listens there, and nobody else can: the name of a terminal, or of a socket that was
    # closed, is given to the next device of any test.
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        port = f"socket://127.0.0.1:{silent.getsockname()[1]}"
        campaign = LiveCampaign(tmp_path, port, DURATION_S)
        assert campaign.job() != 0
        assert campaign.job("all") == 0
    assert port in capsys.readouterr().err
    assert (campaign.results / "file/recording.csv").exists()
    assert not campaign.recording.exists()
    assert not (campaign.results / "live/refused.json").exists()
    with served_process(tmp_path, LINK) as (_, port):
        campaign.connect(port, 1.0)
        assert campaign.job() == 0
    assert len(read_plain(campaign.recording)) == 60


def test_a_line_that_is_lost_fails_its_job_and_the_next_records_anew(tmp_path: Path) -> None:
    with served_process(tmp_path, LINK) as (device, port):
        campaign = LiveCampaign(tmp_path, port, LONG_S)
        job = subprocess.Popen(
            [sys.executable, "-m", "pendpipe.cli", *campaign.words()],
            stderr=subprocess.PIPE,
            text=True,
        )
        while job.poll() is None and campaign.recorded_s() < 0.5:
            time.sleep(0.02)
        device.kill()
        _, log = job.communicate()
    assert job.returncode == 1
    assert f"s of {LONG_S:g} s are kept in" in log.splitlines()[-1]
    assert "Traceback" not in log
    assert not campaign.recording.exists()
    first = campaign.raw_files
    assert len(first) == 1
    with served_process(tmp_path, LINK) as (_, port):
        campaign.connect(port, 1.0)
        assert campaign.job() == 0
    assert first.items() < campaign.raw_files.items()
    assert len(read_plain(campaign.recording)) == 60


def test_what_is_kept_of_a_lost_line_is_a_recording_once_it_is_accepted(tmp_path: Path) -> None:
    campaign = LiveCampaign(tmp_path, "gone", LONG_S)
    codes = np.rint(9000.0 * np.cos(0.3 * np.arange(120))).astype(np.int64)
    header = {"model": "DI-2108", "port": "gone", "channels": [1], "rate_hz": 60.0}
    header |= {"duration_s": LONG_S, "recorded_at": "2026-01-01T00:00:00+00:00"}
    raw = campaign.results / "live/raw/1.raw"
    raw.parent.mkdir(parents=True)
    with raw.open("wb") as stream:
        writer = RawWriter(stream, header)
        for number, code in enumerate(codes, start=1):
            writer.data(number / 60.0, DEVICES["di2108"]().encode(np.array([[code]])))
        writer.event(2.0, event="stopped", reason="the line was lost")
    call = ["acquire", "--campaign", str(tmp_path / "config.yaml"), "--record", "live"]
    assert main([*call, "--accept-short"]) == 0
    recording = campaign.recording.read_bytes()
    assert [campaign.job(LIVE, stage) for stage in ("acquire", "calibrate")] == [0, 0]
    assert campaign.recording.read_bytes() == recording
    assert list(campaign.raw_files) == ["1.raw"]
    kept_s = read_plain(campaign.recording).time_s[-1]
    # The report prints the calibration's warnings.
    calibration = json.loads((campaign.results / "live/calibration.json").read_text())
    warning = calibration["warnings"][-1]
    assert warning.startswith("the recording is incomplete: ended early: the line was lost")
    assert f"{kept_s:.6g} s of {LONG_S:g} s kept" in warning


def test_only_an_explicit_request_records_anew(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["acquire", "--campaign", str(tmp_path / "config.yaml"), "--record"]
    with served_process(tmp_path, LINK) as (_, port):
        campaign = LiveCampaign(tmp_path, port, 1.0)
        assert main([*call, "live"]) == 0
        first = campaign.raw_files
        assert main([*call, "live"]) == 0
        assert campaign.raw_files == first
        assert main([*call, "live", "--anew"]) == 0
        assert first.items() < campaign.raw_files.items()
        assert len(campaign.raw_files) == 2
    assert "1 more kept beside it" in capsys.readouterr().out
    second = campaign.recording.read_bytes()
    # A request that fails leaves the recording as it is.
    assert main([*call, "live", "--anew"]) == 2
    assert campaign.recording.read_bytes() == second
    assert main([*call, "file", "--anew"]) == 2


def test_two_jobs_never_record_from_one_port(tmp_path: Path) -> None:
    begun: list[datetime] = []
    with served_process(tmp_path, LINK) as (_, port):
        command = [sys.executable, "-m", "pendpipe.cli", "acquire", "--port", port]
        command += ["--model", "di2108", "--duration", "1.5", "--force", "--out"]
        for _ in range(9):  # on a busy machine the device may be too late for both
            if begun:
                break
            files = [str(tmp_path / f"{name}.csv") for name in "ab"]
            jobs = [
                subprocess.Popen([*command, file], stderr=subprocess.PIPE, text=True)
                for file in files
            ]
            errors = [job.communicate()[1] for job in jobs]
            for job, error, file in zip(jobs, errors, files, strict=True):
                if job.returncode:
                    assert error.count("\n") == 1
                    continue
                recording = read_plain(Path(file))
                assert len(recording) == 90
                begun.append(datetime.fromisoformat(recording.metadata["recorded_at"]))
    assert begun
    # On a socket the second may get its turn when the first has done.
    assert (max(begun) - min(begun)).total_seconds() >= 1 * (len(begun) - 1)
