"""The attempts at a recording: each keeps its bytes in a raw file of its own, never overwritten.

A campaign has them in ``results/<record>/raw/``, the command line beside ``--out``. A recording is
always decoded from such a file, so it can be made again at any time.
"""

import re
import secrets
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from pendpipe.acquisition.decode import SHORT, decode_recording
from pendpipe.acquisition.line import LineLostError
from pendpipe.acquisition.raw import (
    NothingRecordedError,
    RawRecording,
    append_event,
    is_being_recorded,
    read_raw,
)
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import is_stream
from pendpipe.recording import Recording

_FORM: Final = "%Y%m%dT%H%M%S.%f"
_STAMP: Final = r"\d{8}T\d{6}\.\d{6}Z-[0-9a-f]{8}"


def new_path(start: str | Path) -> Path:
    r"""Name a raw file that nobody else has: `start`, a UTC time stamp, and a random number.

    Examples
    --------
    >>> re.sub(r"\d", "0", new_path("raw/").name[:23])
    '00000000T000000.000000Z'
    """
    first = Path(f"{start}x")
    names = first.parent.glob("*.raw") if first.parent.is_dir() else ()
    known = [
        re.search(_STAMP, path.name) for path in names if path.name.startswith(first.name[:-1])
    ]
    last = max((found[0].split("Z")[0] for found in known if found), default="")
    now = datetime.now(UTC)
    if last >= now.strftime(_FORM):
        now = datetime.strptime(last, _FORM) + timedelta(microseconds=1)
    stamp = now.strftime(f"{_FORM}Z")
    return Path(f"{start}{stamp}-{secrets.token_hex(4)}.raw")


def new_path_beside(out: Path) -> Path:
    """Name the raw file of a recording on the command line: ``OUT.raw`` if that is free.

    Beside a device or a pipe nothing is kept: ``recording.raw`` in the current folder is.
    """
    out = _file_of(out)
    first = out.with_suffix(".raw")
    return new_path(f"{out.with_suffix('')}.") if paths_beside(out) else first


def _file_of(out: Path) -> Path:
    no_file = is_stream(out) or (out.exists() and not out.is_file())
    return Path("recording.csv") if no_file else out


def paths_beside(out: Path) -> list[Path]:
    """List the raw files that `new_path_beside` has named for a recording."""
    out = _file_of(out)
    pattern = re.compile(re.escape(out.stem) + rf"(\.{_STAMP})?\.raw")
    return [path for path in out.parent.glob("*") if pattern.fullmatch(path.name)]


def read_attempts(paths: Iterable[Path]) -> list[RawRecording]:
    """Read the attempts that hold at least one scan, the oldest first.

    Raises
    ------
    InputError
        If one of them is being recorded now, or none holds a scan and one is damaged.
    """
    found: list[RawRecording] = []
    damages: list[InputError] = []
    for path in sorted(path for path in paths if path.is_file()):
        refuse_if(
            is_being_recorded(path),
            path,
            "another process is recording into it",
            "wait for its end",
        )
        try:
            raw = read_raw(path)
            decode_recording(raw)
        except NothingRecordedError:
            continue
        except InputError as fault:
            damages.append(fault)
        else:
            found.append(raw)
    if damages and not found:
        raise damages[0]
    # The order of the names; OUT.raw, the first of all, has no stamp. The clock may have been set.
    return sorted(found, key=lambda raw: re.findall(_STAMP, raw.path.name))


def choose(attempts: Sequence[RawRecording]) -> RawRecording:
    """Return the newest complete attempt; if none is complete, the longest."""
    complete = [attempt for attempt in attempts if attempt.is_complete]
    return complete[-1] if complete else max(attempts, key=lambda attempt: len(attempt.data))


def decode_attempt(path: Path, folder: Path, channel: int | None = None) -> Recording:
    """Decode a raw file; the recording's metadata names it and holds the notes.

    Parameters
    ----------
    path
        The raw file.
    folder
        Where the recording goes: the file is named relative to it.
    channel
        As printed on the box; the first one recorded by default.
    """
    recording = decode_recording(path, channel)
    named = path.relative_to(folder) if path.is_relative_to(folder) else Path(path.name)
    short = next((note for note in recording.notes if note.startswith(SHORT)), "")
    told = {"raw_file": named.as_posix(), "notes": "; ".join(recording.notes), "incomplete": short}
    kept = {key: text for key, text in told.items() if text}
    return replace(recording, metadata={**recording.metadata, **kept})


def accept(attempt: RawRecording) -> None:
    """Note in a raw file that what the line had brought before it was lost is the recording."""
    append_event(attempt.path, event="accepted")


def refuse_lost(attempt: RawRecording, remedy: str) -> None:
    """Refuse an attempt that a lost line has ended.

    Raises
    ------
    LineLostError
        With the seconds kept of those asked for. The raw file stays.
    """
    if not attempt.lost_line:
        return
    kept_s, asked_s = decode_recording(attempt).time_s[-1], attempt.header.get("duration_s")
    asked = f" of {asked_s:g} s" if isinstance(asked_s, int | float) else ""
    raise LineLostError(
        str(attempt.header["port"]),
        f"{attempt.lost_line}; {kept_s:.6g} s{asked} are kept in {attempt.path}",
        remedy,
    )


@contextmanager
def kept_in(raw_path: Path, out: Path) -> Iterator[None]:
    """Name the raw file that still holds a recording, if writing the recording fails.

    Raises
    ------
    InputError
        Where the recording can't be written, for a full disk for one.
    """
    kept = f"the recording is kept in {raw_path}: call again to write it"
    try:
        yield
    except OSError as fault:
        raise InputError(
            out, f"it can't be written ({fault.strerror or fault})", f"make room; {kept}"
        ) from None
    except InputError as fault:
        raise InputError(fault.place, fault.problem, f"{fault.remedy}; {kept}") from None
