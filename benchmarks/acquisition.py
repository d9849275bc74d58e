"""What a recorder keeps of lost bytes and flipped bits: nothing is lost in silence.

    python -m benchmarks.acquisition [faults] [flips] [swings] [rates] [--number N]

prints the tables: one fault in each of 100,000 recordings of 24 scans of random codes (a protocol
that can't mark it gives no decoder a sign), and a flipped bit in each of 2,000 raw files. Status 1
where a false scan stands beside a flagged fault, or a flip costs more than a frame. Then swings on
one, two and four channels: two bytes or a word lost or doubled, whose false readings must be
said (status 1 where a protocol with marks leaves one); and rates that change in the middle.
"""

from __future__ import annotations

import random
import tempfile
from collections import defaultdict
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from benchmarks.faulty_device import Fault, FaultyPath
from benchmarks.journal import commit, judge_parser
from benchmarks.table import head, table_row
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers import DRIVERS, find_driver
from pendpipe.acquisition.drivers.streams import marked_scans
from pendpipe.acquisition.raw import RawWriter, read_raw
from pendpipe.acquisition.recorder import acquire_simulated
from pendpipe.arrays import FloatArray
from pendpipe.recording import GOOD

SCANS = 24
KINDS = {
    "one byte lost": ("drop", 1),
    "two bytes lost": ("drop", 2),
    "three bytes lost": ("drop", 3),
    "a whole scan lost": ("lost scans", 1),
    "one byte twice": ("duplicate", 1),
    "two bytes twice": ("duplicate", 2),
    "bit 0 of a byte flipped": ("flip", 0),
    "another bit flipped": ("flip", 1),
    "`stop 01` to `stop 03` in the stream": ("overflow", 1),
}


def fault_at(random: np.random.Generator, label: str, scan_bytes: int) -> Fault:
    """One fault at a random byte, away from the ends by two scans."""
    kind, number = KINDS[label]
    at = int(random.integers(2 * scan_bytes, (SCANS - 3) * scan_bytes))
    if kind == "flip":
        return Fault(kind, at=at, bit=int(random.integers(1, 8)) if number else 0)
    if kind == "overflow":
        return Fault(kind, at=at, code=int(random.integers(1, 4)))
    return Fault(kind, at=at // scan_bytes * scan_bytes if "scans" in kind else at, count=number)


def one_fault(random: np.random.Generator, model: str, label: str) -> tuple[bool, int, int]:
    """Whether a fault was marked, the good scans it cost, and those called good but never sent."""
    driver, device = find_driver(model), DEVICES[model]()
    channels, half = int(random.integers(1, 5)), 1 << (driver.bits - 1)
    # Distinct, so that every scan tells where it belongs.
    codes = random.choice(2 * half, size=(SCANS, channels), replace=False) - half
    path = FaultyPath(fault_at(random, label, 2 * channels))
    scans = driver.decode(path.stream(device.encode(codes), 2 * channels), channels)
    good = [tuple(row) for row in scans.counts[~scans.suspect].tolist()]
    true = {tuple(row) for row in codes.tolist()}
    return bool(scans.losses), SCANS - len(set(good) & true), sum(row not in true for row in good)


def faults(told: Any) -> bool:
    """Count over all families of devices."""
    random = np.random.default_rng(20261121)
    marked = {m: find_driver(m).scans_of is marked_scans for m in DRIVERS}
    cells = [(m, k) for m in DRIVERS for k in KINDS if not (marked[m] and "stop" in k)]
    tally = defaultdict(list)
    for model, label in cells:
        found = [
            one_fault(random, model, label)
            for _ in range(-(-(told.number or 100_000) // len(cells)))
        ]
        tally[label, marked[model]] += found
    print(head("fault", "family", "faults", "marked, %", "scans lost, mean (most)", "silent, %"))
    for (label, mark), found in sorted(tally.items()):
        lost = [scans for seen, scans, _ in found if seen] or [0]
        shares = [100.0 * np.mean([seen for seen, *_ in found])]
        shares += [100.0 * np.mean([not seen and false > 0 for seen, _, false in found])]
        cost = f"{np.mean(lost):.2f} ({max(lost)})"
        kind = "frame mark" if mark else "CDC words"
        print(table_row(label, [kind, len(found), f"{shares[0]:.2f}", cost, f"{shares[1]:.2f}"]))
    flagged = [false for found in tally.values() for seen, _, false in found if seen]
    print(f"\n{sum(map(bool, flagged))} of {len(flagged)} flagged faults left a false scan beside")
    return not any(flagged)


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


class Flip(NamedTuple):
    """What one flipped bit of a raw file costs; samples are false that are called good."""

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


def flips(told: Any) -> bool:
    """Flip one bit at random places of raw files: the check sums see each."""
    print(head("device", "flips", "noticed", "frames lost, most", "scans lost", "false samples"))
    good = True
    for kind in ("di154", "di149", "di245", "di2108"):
        whole, places = recorded_bytes(kind), random.Random(7)
        found = [flip(whole, places.randrange(8 * len(whole))) for _ in range(told.number or 500)]
        noticed, false = sum(each.noticed for each in found), sum(e.false_samples for e in found)
        most = [
            max(getattr(each, name) for each in found) for name in ("frames_lost", "scans_lost")
        ]
        print(table_row(kind, [len(found), noticed, *most, false]), flush=True)
        good &= noticed == len(found) and not false and most[0] <= 1
    return good


def swinging(random: np.random.Generator, model: str, channels: int, count: int) -> FloatArray:
    """Counts of sensors that swing or hang still, each with noise, shape (count, channels)."""
    half = 1 << (DEVICES[model].bits - 1)
    swings = np.append(True, random.uniform(size=channels - 1) < 0.6)
    size, phase = random.uniform(0.1, 0.4, channels), random.uniform(0.0, 6.28, channels)
    scan = np.arange(count)[:, None]
    turns = scan * 2.0 * np.pi / random.uniform(40.0, 200.0)
    swing = size * swings * np.exp(-scan / 3000.0) * np.cos(turns + phase)
    noise = random.normal(0.0, 1e-4, (count, channels))
    return half * (random.uniform(-0.3, 0.3, channels) + swing + noise)


def one_swing(random: np.random.Generator, model: str, channels: int, bytes_: int) -> bool:
    """Whether lost (or doubled, if negative) bytes leave a false good reading, or false places."""
    volts = swinging(random, model, channels, 2000)
    data = bytearray(DEVICES[model]().encode(np.rint(volts).astype(np.int64)))
    at = int(random.integers(300 * 2 * channels, 1700 * 2 * channels))
    if bytes_ > 0:
        del data[at : at + bytes_]
    else:
        data[at:at] = data[at : at - bytes_]
    scans = find_driver(model).decode(bytes(data), channels)
    lost = np.zeros(len(scans.counts), dtype=int)
    for loss in scans.losses:
        lost[min(loss.after_scan, len(lost) - 1)] += loss.lost_scans * loss.is_gap
    number = np.arange(len(lost)) + np.cumsum(lost)
    # A scan earlier or later is no false reading.
    near = [
        np.abs(scans.counts - volts[np.clip(number + late, 0, len(volts) - 1)]).max(axis=1)
        for late in (-1, 0, 1)
    ]
    bound = 8.0 * (1.0 + 1e-4 * (1 << (DEVICES[model].bits - 1)))
    return bool(np.any((np.minimum.reduce(near) > bound) & ~scans.suspect))


def swings(told: Any) -> bool:
    """Count false readings that are called good, by protocol, channels and fault."""
    random, good = np.random.default_rng(20261128), True
    print(head("fault", "family", "channels", "recordings", "with a false reading unsaid"))
    for model, family in (("di154", "frame mark"), ("di2108", "CDC words")):
        for channels in (1, 2, 4):
            for label, bytes_ in (("two bytes lost", 2), ("two bytes twice", -2)):
                number = told.number or 500
                wrong = sum(one_swing(random, model, channels, bytes_) for _ in range(number))
                print(table_row(label, [family, channels, number, wrong]), flush=True)
                good &= not wrong or family == "CDC words"
    return good


def session(
    random: np.random.Generator, *pieces: tuple[float, float], lost: int = 0
) -> tuple[bytes, FloatArray]:
    """A raw recording of so many Hz for so many seconds each, and when its scans were made.

    The host takes what has come every 20 ms, or later where it is busy; some scans are lost in the
    middle.
    """
    steps = np.concatenate([np.full(round(hz * span_s), 1.0 / hz) for hz, span_s in pieces])
    made_s = np.cumsum(steps)
    made_s = np.delete(made_s, np.arange(lost) + len(made_s) // 2)
    delay_s = 0.02 * np.ceil(made_s / 0.02) - made_s + random.exponential(0.002, len(made_s))
    arrival_s = np.maximum.accumulate(made_s + delay_s)
    header = {"model": "DI-2108", "port": "COM3", "channels": [1], "rate_hz": pieces[0][0]}
    stream = BytesIO()
    writer = RawWriter(stream, header | {"recorded_at": "2026-01-01T00:00:00+00:00"})
    codes = np.rint(9000.0 * np.cos(made_s)).astype(np.int64)[:, None]
    for when, data in zip(arrival_s.tolist(), codes, strict=True):
        writer.data(when, DEVICES["di2108"]().encode(data[None]))
    writer.event(float(arrival_s[-1]), event="stopped", reason="time")
    return stream.getvalue(), made_s - made_s[0]


RATES: Final[Mapping[str, tuple[tuple[float, float], ...]]] = {
    "60 Hz": ((60.0, 450.0),),
    "60 to 120 Hz": ((60.0, 225.0), (120.0, 225.0)),
    "60 to 59.9 Hz": ((60.0, 225.0), (59.9, 225.0)),
    "60 to 120 Hz and back": ((60.0, 150.0), (120.0, 150.0), (60.0, 150.0)),
    "60 to 30 Hz late": ((60.0, 400.0), (30.0, 50.0)),
}


def rates(told: Any) -> bool:
    """How far off the times of readings are where the rate changes, and whether it is said."""
    print(head("rate", "recordings", "changes said", "times off, largest, ms"))
    good = True
    for name, pieces in RATES.items():
        said, off_s = 0, 0.0
        for seed in range(number := told.number or 10):
            content, made_s = session(np.random.default_rng(seed), *pieces)
            found = decode_recording(content)
            said += sum("the scan rate changes" in note for note in found.notes)
            off_s = max(off_s, float(np.abs(found.time_s - made_s).max()))
        print(table_row(name, [number, said, f"{1e3 * off_s:.1f}"]), flush=True)
        good &= said == number * (len(pieces) - 1) and off_s < 0.05
    return good


PARTS: dict[str, Callable[[Any], bool]] = {
    each.__name__: each for each in (faults, flips, swings, rates)
}


def main() -> int:
    """Print the parts that are named, or all."""
    parser = judge_parser(__doc__, "acquisition", 0)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all, if none is named")
    told = parser.parse_args()
    missed = []
    for name in told.parts or PARTS:
        print(f"\n{name}\n")
        missed += [] if PARTS[name](told) else [name]
    print(f"\nmissed: {', '.join(missed) or 'none'}. Made by commit {commit()}.")
    return len(missed)


if __name__ == "__main__":
    raise SystemExit(main())
