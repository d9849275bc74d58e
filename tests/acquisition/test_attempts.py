"""Which of the kept attempts is used, and what is never taken for one."""

from io import BytesIO
from pathlib import Path

import pytest

from pendpipe.acquisition.attempts import accept, choose, new_path, read_attempts, refuse_lost
from pendpipe.acquisition.line import LineLostError
from pendpipe.acquisition.raw import RawWriter, append_event, lock, read_raw
from pendpipe.errors import InputError


def kept(folder: Path, minute: int, scans: int, reason: str | None) -> Path:
    """A raw file with so many scans, which ended for a reason or not at all."""
    header = {
        "model": "DI-2108",
        "port": "COM3",
        "channels": [1],
        "rate_hz": 100.0,
        "duration_s": 1.0,
        "recorded_at": f"2026-01-01T00:{minute:02}:00+00:00",
    }
    stream = BytesIO()
    writer = RawWriter(stream, header)
    for number in range(scans):
        writer.data(0.01 * number, b"\0\1")
    if reason:
        writer.event(1.0, event="stopped", reason=reason)
    path = new_path(f"{folder}/")
    path.write_bytes(stream.getvalue())
    return path


@pytest.mark.parametrize(
    ("attempts", "chosen"),
    [
        # The newest complete one; without one the longest.
        ([(100, "scans"), (100, "time"), (300, None), (300, "interrupted by the user")], 1),
        ([(20, None), (90, "the line was lost"), (50, None)], 1),
    ],
)
def test_the_best_attempt_is_used(
    attempts: list[tuple[int, str | None]], chosen: int, tmp_path: Path
) -> None:
    paths = [kept(tmp_path, minute, *attempt) for minute, attempt in enumerate(attempts)]
    assert choose(read_attempts(tmp_path.iterdir())).path == paths[chosen]


@pytest.mark.parametrize(
    ("events", "lost"),
    [
        ([("stopped", "scans")], ""),
        ([("stopped", "interrupted by the user")], ""),
        ([("stopped", "the line was lost")], "the line was lost"),
        ([("stopped", "the device fell silent")], "the device fell silent"),
        ([], ""),  # killed
        ([("broken", "the line was lost")], "the line was lost"),  # and killed while it waited
        ([("broken", "the line was lost"), ("restarted", "")], ""),
        ([("stopped", "the line was lost"), ("accepted", "")], ""),
    ],
)
def test_what_a_lost_line_has_ended_is_no_recording_unless_it_is_accepted(
    events: list[tuple[str, str]], lost: str, tmp_path: Path
) -> None:
    path = kept(tmp_path, 1, 20, None)
    for event, reason in events:
        append_event(path, event=event, reason=reason)
    assert read_raw(path).lost_line == lost


def test_a_lost_line_is_reported_with_what_is_kept_of_what_was_asked(tmp_path: Path) -> None:
    (attempt,) = read_attempts([kept(tmp_path, 1, 51, "the line was lost")])
    with pytest.raises(LineLostError, match=r"COM3: the line was lost; 0\.5 s of 1 s are kept in"):
        refuse_lost(attempt, "record anew")
    assert LineLostError.status == 1
    accept(attempt)
    refuse_lost(read_raw(attempt.path), "record anew")


def test_attempts_without_a_scan_do_not_count(tmp_path: Path) -> None:
    """A header alone, a part of one, an empty file; a damaged file beside a sound one."""
    kept(tmp_path, 1, 0, None)
    (tmp_path / "part.raw").write_bytes(kept(tmp_path, 2, 0, None).read_bytes()[:20])
    (tmp_path / "empty.raw").touch()
    assert read_attempts(tmp_path.iterdir()) == []
    (tmp_path / "damaged.raw").write_bytes(b"x" * 500)
    with pytest.raises(InputError, match=r"damaged\.raw: this is no raw recording"):
        read_attempts(tmp_path.iterdir())
    sound = kept(tmp_path, 3, 10, None)
    assert [one.path for one in read_attempts(tmp_path.iterdir())] == [sound]


def test_what_is_being_recorded_is_left_alone(tmp_path: Path) -> None:
    """A recorder may outlive a Snakemake that was killed."""
    pytest.importorskip("fcntl", reason="this system has no such lock")
    path = kept(tmp_path, 1, 50, None)
    with path.open("ab") as recorder:
        assert lock(recorder)
        with pytest.raises(InputError, match="another process is recording into it"):
            read_attempts([path])
    assert len(read_attempts([path])) == 1
