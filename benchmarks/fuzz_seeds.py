"""Valid small files of every dialect, put together here, for the fuzzer to damage."""

from __future__ import annotations

import gzip
import io
import lzma
import re
import struct
import zipfile
import zlib

import numpy as np

from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.raw import Frame, RawWriter, description_line
from pendpipe.arrays import FloatArray

ROWS = 30


def swing(rows: int = ROWS, rate_hz: float = 10.0) -> tuple[FloatArray, FloatArray]:
    time_s = np.arange(rows) / rate_hz
    return time_s, 0.5 * np.exp(-0.05 * time_s) * np.cos(2 * np.pi * 0.8 * time_s)


def rows(form: str, scale: float = 1.0, count: int = ROWS) -> str:
    time_s, angle = swing(count)
    pairs = zip(time_s.tolist(), (scale * angle).tolist(), strict=True)
    return "".join(form.format(t=t, x=x, n=n, c=round(100 * x)) for n, (t, x) in enumerate(pairs))


def texts() -> list[bytes]:
    """Tables as instruments, trackers and spreadsheets write them."""
    comma = rows("{t:.2f};{x:.5f}\n").replace(".", ",")
    steps = "".join(f"{1000 * t:.0f} {round(x / 0.01)}\n" for t, x in zip(*swing(), strict=True))
    clock = rows("12:34:{n:02d}.5,{x:.4f}\n")
    return [
        ("t,theta\n" + rows("{t:.2f},{x:.5f}\n")).encode(),
        ("\ufeffZeit [s];Winkel [rad]\r\n" + comma.replace("\n", "\r\n")).encode(),
        ("made by hand\nsample rate: 10 Hz\nangle (deg)\n" + rows("{x:.3f}\n", 57.3)).encode(),
        ("time(ms) count\n" + steps).encode(),
        (
            '"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)"\n'
            + rows('{t:.6E},{x:.6E},"1.0E-3"\n')
        ).encode(),
        ("mass A,,\nt,x,y\n" + rows("{t:.3f},{x:.4f},-0.9\n")).encode(),
        (
            "Run #1;;Run #2;\nTime ( s );Angle ( rad );Time ( s );Angle ( rad )\n"
            + rows("{t:.2f};{x:.4f};{t:.2f};\n")
        ).encode(),
        ("% remark\nlocal time,angle_deg\n" + clock).encode("utf-16"),
        ("sample rate (Hz): 10\n" + rows("{n}\t{x:.4f}\t{x:.2e}\n")).encode(),
        ("t1;theta1;t2;theta2\n" + rows("{t:.0e};{x:.4f};{t:.2f};{x:.3f}\n")).encode(),
        ("t,theta\n" + rows("{t:.2f},{x:.5f}\n") * 3).encode(),
        ("TM,PT\n" + "".join(rows("{t:.3f},{x:.4f}\n").splitlines(keepends=True)[::-1])).encode(),
        (
            'MIN=0\t-1\nMAX=3\t1\nSCALE=3\t1\nDEC=1\t3\nDEF="Zeit" t / s\t"Winkel" w / rad\n'
            + rows("{t:.3f}\t{x:.4f}\n").replace(".", ",")
        ).encode(),
        ("time,what,value\n" + rows("{t:.2f},theta,{x:.4f}\n{t:.2f},omega,1.5\n")).encode(),
        ("ready\n" + rows("2024-05-01 12:00:{n:02d} t = {t:.2f} s, theta: {x:.3f} deg\n")).encode(),
        (
            "IGOR\nWAVES/D\tphi\nBEGIN\n" + rows("\t{x:.4f}\n") + "END\nX SetScale/P x,0,0.1,phi"
        ).encode(),
        ("TIMESERIES A, 40 sps, SLIST\n" + rows("{n}\t{n}\t{x:.3f}\n")).encode(),
        ("Long Name\tTime\tAngle\nUnits\ts\trad\n" + rows("{n}\t{t:.2f}\t{x:.4f}\n")).encode(),
        f"t: [{rows('{t:.2f}, ')}0]\ntheta: [{rows('{x:.4f}, ')}0]\n".encode(),
        ("[" + rows('{{"t": "{t:.2f}", "sensor": "arm", "x": {x:.4f}}},') + "{}]").encode(),
    ]


def opendocument() -> bytes:
    """The content of an OpenDocument table, its cells and rows repeated."""
    of = "<table-cell value='{}'/>"
    body = rows(f"<table-row>{of.format('{t}')}{of.format('{x}')}</table-row>")
    rest = (
        "<table-row number-rows-repeated='9'><table-cell number-columns-repeated='99'/></table-row>"
    )
    return f"<body><table>{body}{rest}</table></body>".encode()


def tdms() -> bytes:
    """A recording of one channel as LabVIEW writes it."""
    from nptdms import ChannelObject, TdmsWriter

    held = io.BytesIO()
    with TdmsWriter(held) as writer:
        told = {"wf_increment": 0.1, "unit_string": "deg"}
        writer.write_segment([ChannelObject("log", "arm", swing()[1], told)])
    return held.getvalue()


def projects() -> list[tuple[str, bytes]]:
    """Projects kept as XML, and tables in a zip archive."""
    channel = "<channel><quantity>{}</quantity><symbol>a</symbol><unit>{}</unit><values>{}</values>"
    cells = [rows("<value>{t}</value>"), rows("<value>{x}</value>")]
    cassy = "".join(
        channel.format(name, unit, each) + "</channel>"
        for name, unit, each in zip(("Zeit", "Winkel"), ("s", "rad"), cells, strict=True)
    )
    column = (
        "<DataColumn><DataObjectName>{}</DataObjectName><ColumnCells>{}</ColumnCells></DataColumn>"
    )
    marks = rows(
        '<property name="[{n}]"><object class="tracker.PointMass$FrameData">'
        '<property name="x" type="double">{x}</property><property name="y" type="double">1.5'
        "</property></object></property>"
    )
    tracker = (
        '<object class="tracker.TrackerPanel"><property name="delta_t">33.3</property>'
        f'<object class="a.tracker.PointMass">{marks}</object></object>'
    )
    head = "<?xml version='1.0'?>"
    return [
        (".labx", (head + f"<cassylab>{cassy}</cassylab>").encode()),
        (
            ".cmbl",
            (
                head
                + "<Document>"
                + column.format("Time", rows("{t}\n"))
                + column.format("Angle", rows("{x}\n"))
                + "</Document>"
            ).encode(),
        ),
        (".trk", (head + tracker).encode()),
        (".zip", zipped({"Raw Data.csv": texts()[0], "meta/time.csv": b"event,0\n"})),
        (".trz", zipped({"a.trk": (head + tracker).encode()})),
        (".ods", zipped({"content.xml": opendocument()})),
        (".csv.gz", gzip.compress(texts()[0])),
        (".csv.xz", lzma.compress(texts()[0], preset=0)),
        (".tdms", tdms()),
    ]


def plain() -> list[bytes]:
    """The project's own form, with metadata, markers, gaps."""
    head = "# volts_per_radian: 3.85\n# bits: 16\n# range_volts: 10\n# marker_1: 5; 0.5 s; go\n"
    good = [line + ",0" for line in rows("{t!r},{x!r}\n").split("\n")[:-1]]
    good[20] = good[20].split(",")[0] + ",nan,2"
    good[25] = good[25][:-1] + "1"
    return [
        (head + "time_s,volts,quality\n" + "\n".join(good) + "\n").encode(),
        ("time_s,angle_rad\n" + rows("{t!r},{x!r}\n")).encode(),
        ("time_s,displacement_m\n" + rows("{t!r},{x!r}\n")).encode(),
    ]


def windaq_csv() -> list[bytes]:
    head = "Relative Time,Date,Time Stamp UTC,Volt,Volt,Chn 1 Events\n"
    line = "{t:.6f},7/27/2026,2:45:{n:02d} PM,{x:.9f},0.5,\n"
    first, last = rows(line).split("2.000000", 1)
    later = first + "2.000000" + last.replace("2:45", "2:46")
    return [
        (head + rows(line)).encode(),
        ("preamble\n" + head + later.replace(",\n2.1", ",Resume\n2.1", 1)).encode(),
    ]


def captures() -> list[bytes]:
    body = rows("sc {c} -12\r", count=30)
    return [
        ("1376398772.89\nstart\n" + body.replace("\r", "\n") + "stop\n").encode(),
        ("srate x400\rstart\r" + body + "stop\r").encode(),
    ]


def windaq(
    *,
    hires: bool,
    size: int = 1156,
    channels: int = 2,
    packed: bool = False,
    comment: bool = False,
    wrapped: bool = False,
    scans: int = ROWS,
) -> bytes:
    """A WinDaq file after the format's description."""
    counts = np.rint(swing(scans)[1] * 8000).astype(np.int64)[:, None].repeat(channels, 1)
    words = counts if hires else counts * 4
    divisors = [1, 4] * 8 if packed else [1] * channels
    due = np.arange(scans)[:, None] % np.array(divisors[:channels]) == 0
    data = words[due].astype("<i2").tobytes()
    texts = b"Angle\0" + b"\0" * (channels - 1)
    events = [0, 0, 10, 60] if hires else [0, 0, 10, 60, -20]
    if comment:
        events += [25 * (channels if hires else 1), 70, len(texts) - (1 << 31)]
    head = bytearray(size)
    struct.pack_into("<HHBBh", head, 0, channels, 1, 110, 36, size)
    struct.pack_into("<IIH", head, 8, 2 * scans * channels, 4 * len(events), len(texts))
    struct.pack_into("<dii", head, 28, 0.1, 1_700_000_000, 1_700_000_090)
    struct.pack_into("<i", head, 44, 1)
    struct.pack_into("<H", head, 56, 7)
    head[65] = 0x80 if wrapped else 7
    struct.pack_into("<H", head, 100, 2 * hires | packed << 14)
    for place in range(channels):
        at = 110 + 36 * place
        struct.pack_into("<dd4s", head, at + 8, 10 / 8192, 0.1, b"Volt")
        head[at + 31], head[at + 32] = divisors[place], place + 1
    struct.pack_into("<H", head, size - 2, 0x8001)
    listed = struct.pack(f"<{len(events)}i", *events)
    return bytes(head) + data + listed + texts + b"released\0" * comment


def windaq_files() -> list[tuple[str, bytes]]:
    return [
        (".WDQ", windaq(hires=False)),
        (".WDQ", windaq(hires=False, channels=1, comment=True)),
        (".WDQ", windaq(hires=False, packed=True)),
        (".WDH", windaq(hires=True)),
        (".WDH", windaq(hires=True, channels=3, comment=True)),
        (".WDH", windaq(hires=True, size=5296, channels=32, scans=10)),
        (".WHC", windaq(hires=True, size=1536, wrapped=True)),
        (".WDC", windaq(hires=False, size=1536, channels=1)),
    ]


def matlab(compressed: bool = False) -> list[bytes]:
    from scipy.io import savemat

    time_s, angle = swing()
    found = []
    for content in (
        {"t": time_s, "theta": angle},
        {"data": {"time": time_s, "signals": {"values": angle, "label": "arm"}}, "fs": 10.0},
        {"run": np.array([time_s, angle]), "cells": np.array([1, "two"], dtype=object)},
    ):
        stream = io.BytesIO()
        savemat(stream, content, do_compression=compressed)
        # (The head of the file bears the time at which it was made.)
        found.append(b"MATLAB 5.0 MAT-file for the fuzzer".ljust(116) + stream.getvalue()[116:])
    return found


def repacked_matlab(data: bytes) -> bytes:
    """Compress each element of a file, so that damage lies inside the compressed data."""
    packed, at = data[:128], 128
    while at + 8 <= len(data):
        kind, size = struct.unpack_from("<II", data, at)
        element = data[at : at + 8 + size]
        stuff = zlib.compress(element, 1)
        packed += struct.pack("<II", 15, len(stuff)) + stuff
        at += 8 + size
        if kind == 0 and size == 0:
            break
    return packed


def workbook() -> dict[str, bytes]:
    """Return the parts of an .xlsx archive."""
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    sheet.append(["t (s)", "angle (deg)", "note"])
    for t, x in zip(*swing(12), strict=True):
        sheet.append([float(t), float(57.3 * x), "a"])
    stream = io.BytesIO()
    book.save(stream)
    with zipfile.ZipFile(stream) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    made = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")
    return {name: made.sub(b"2026-01-01T00:00:00Z", part) for name, part in parts.items()}


def zipped(parts: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name, content in parts.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return stream.getvalue()


def streams(model: str, channels: int, scans: int = ROWS) -> bytes:
    """A device's stream of a swing."""
    device = DEVICES[model]()
    half = 1 << (device.bits - 1)
    codes = np.rint(swing(scans)[1][:, None] * half * np.ones(channels)).astype(np.int64)
    return device.encode(np.clip(codes, -half, half - 1))


RAW_HEADER = {
    "model": "DI-2108",
    "port": "COM3",
    "channels": [1, 2],
    "rate_hz": 100.0,
    "range_volts": 10.0,
    "recorded_at": "2026-01-01T00:00:00+00:00",
    "clock_scale": 1.0,
    "firmware": "1.35",
}


def raw_file(model: str = "di2108", title: str = "DI-2108") -> bytes:
    """A raw recording in two pieces, with a break."""
    stream = io.BytesIO()
    writer = RawWriter(stream, {**RAW_HEADER, "model": title})
    data = streams(model, 2, 200)
    pieces = [data[at : at + 30] for at in range(0, len(data), 30)]
    for number, piece in enumerate(pieces):
        if number == 14:
            writer.event(1.0, event="broken", reason="the device fell silent")
            writer.event(1.3, event="restarted", reason="the device fell silent")
        writer.data(0.075 * number + (0.3 if number >= 14 else 0.0), piece)
    writer.event(2.5, event="stopped", reason="scans", keep_scans=190)
    return stream.getvalue()


_FRAME = struct.Struct("<4scIHQdI")


def raw_frames(data: bytes) -> tuple[bytes, list[Frame]]:
    """Take a raw file apart: description, frames."""
    head, _, rest = data.partition(b"\n")
    frames, at = [], 0
    while at + _FRAME.size <= len(rest):
        _, kind, length, stream, at_byte, time_s, _ = _FRAME.unpack_from(rest, at)
        at += _FRAME.size
        frames.append(Frame(kind, time_s, rest[at : at + length], stream, at_byte))
        at += length
    return head, frames


def raw_joined(head: bytes, frames: list[Frame]) -> bytes:
    """Put it together again, check sums and all."""
    return b"".join([head, b"\n", *(frame.packed() for frame in frames)])


def raw_header(change: dict[str, object]) -> bytes:
    return description_line({**RAW_HEADER, **change})
