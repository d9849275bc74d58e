"""The real WinDaq files of ``../shared/recordings`` against what its README says of them."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from benchmarks.fuzz_seeds import windaq
from pendpipe.errors import InputError
from pendpipe.formats import inspect, read

RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "recordings"


@dataclass(frozen=True)
class Known:
    """What the README says of a file; ``None`` where it says nothing."""

    channels: int | None
    rate_hz: float | None
    scans: int | None
    markers: list[int] | int | None = None
    pause: tuple[int, float] | None = None


KNOWN = {
    "windaq-vendor-sample/SAMPLE.WDQ": Known(4, 250.0, 5000, [0, 591, 3002]),
    "windaq-vendor-sample/SAMPLE.WDH": Known(2, 100.0, 2208, [0, 860, 1116]),
    "windaq-vendor-sample/SAMPLE.WHC": Known(1, 200.0, 2000),
    "windaq-windaq3/AUTO.WDQ": Known(6, 9.375, 4067, 6),
    "windaq-windaq3/DI-2108_sine_sample.WDH": Known(1, 1000.0, 1000),
    "wdq-peter-t-ruehr/example_0.WDQ": Known(4, 20.0, 943, [0, 886], (886, 113.0)),
    "wdq-peter-t-ruehr/example_1.WDQ": Known(4, 20.0, 563),
}


def windaq_table(_folder: Path) -> str:
    """Decode every file there is; where there is none, say so."""
    if not RECORDINGS.is_dir():
        return "There is no ../shared/recordings here: the real files were skipped."
    names = [*KNOWN]
    for pattern in ("windaq-pytool/*.WDH", "windaq-pylle-di149-ascii/*.cso"):
        names += sorted(str(path.relative_to(RECORDINGS)) for path in RECORDINGS.glob(pattern))
    lines = [
        "| file | channels | scans | rate, Hz | markers at scans | pause | as its README says |",
        "|---|---|---|---|---|---|---|",
        *map(_row, names),
        "",
        "Damaged files: what is said.",
        "",
        "| file | outcome |",
        "|---|---|",
    ]
    broken = sorted(RECORDINGS.glob("windaq-vendor-broken/*"))
    lines += [f"| {path.relative_to(RECORDINGS)} | {_said(path)} |" for path in broken]
    return "\n".join([*lines, *_damaged(_folder)])


def _row(name: str) -> str:
    """One file."""
    found = inspect(RECORDINGS / name)
    marks = [mark.sample for mark in found.markers]
    gaps = [(gap.after_sample + 1, gap.missing_s) for gap in found.gaps]
    known = KNOWN.get(name) or Known(*_by_folder(name))
    right = [
        known.channels in (None, len(found.channels)),
        known.scans in (None, found.samples),
        known.rate_hz is None or abs(found.sample_rate_hz / known.rate_hz - 1) < 1e-4,
        known.markers in (None, marks, len(marks)),
        known.pause is None or (len(gaps) == 1 and gaps[0][0] == known.pause[0]
                                and abs(gaps[0][1] - known.pause[1]) < 1.0),
    ]  # fmt: skip
    pause = "; ".join(f"{missing:.1f} s before scan {scan}" for scan, missing in gaps) or "-"
    shown = ", ".join(map(str, marks)) or "-"
    verdict = "yes" if all(right) else f"**no**: {known}"
    return (
        f"| {name} | {len(found.channels)} | {found.samples} | {found.sample_rate_hz:.6g} | "
        f"{shown} | {pause} | {verdict} |"
    )


def _by_folder(name: str) -> tuple[int | None, float | None, int | None]:
    """What the README says of all files in a folder: channels, rate, scans."""
    if name.startswith("windaq-pytool"):
        return 2, 100.0, None
    return None, 750_000 / 65535, None


def _said(path: Path) -> str:
    """What reading a file ends in."""
    try:
        recording = read(path)
    except InputError as fault:
        return f"refused: {fault.problem}"
    notes = [note for note in recording.notes if "reading is taken" not in note]
    return f"{len(recording)} samples; {'; '.join(notes) or 'nothing is said'}"


def _damaged(folder: Path) -> list[str]:
    """The vendor's list of illegal header values, put into a file of our own."""
    whole = windaq(hires=False, scans=400)
    cases = {
        "data size 268475456 (byte 8)": (8, struct.pack("<I", 268475456)),
        "size of the events (byte 12)": (12, struct.pack("<I", 0x7FFFFFFF)),
        "size of the annotations (byte 16)": (16, b"\xff\xff"),
        "interval -1.2e-41 s (byte 28)": (28, struct.pack("<d", -1.2e-41)),
        "compression 0 (byte 44)": (44, b"\0\0\0\0"),
        "compression -5 (byte 44)": (44, struct.pack("<i", -5)),
        "no channels (byte 0)": (0, b"\0\0"),
        "no mark 0x8001": (1154, b"\0\0"),
        "cut within the samples": (-1, b""),
        "cut within the header": (-2, b""),
    }
    rows = []
    for name, (at, junk) in cases.items():
        data = bytearray(whole)
        if at >= 0:
            data[at : at + len(junk)] = junk
        path = folder / "damaged.WDQ"
        path.write_bytes(bytes(data[: {-1: 2001, -2: 900}.get(at, len(data))]))
        rows.append(f"| made here: {name} | {_said(path)} |")
    return rows
