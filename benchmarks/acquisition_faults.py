"""10^5 faults of the stream, one in each short recording, through the decoders alone."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np

from pendpipe.acquire.clock_losses import find_clock_losses
from pendpipe.acquire.devices.faults import Fault, FaultyPath
from pendpipe.acquire.devices.models import DEVICES
from pendpipe.acquire.drivers import find_driver

MODELS = ["di154", "di194", "di149", "di155", "di245", "di1100", "di1110", "di1120", "di2108",
          "di2108p", "di4108", "di4208", "di4718b"]  # fmt: skip
MARKED = set(MODELS[:5])
SCANS = 24
FAULTS = 100_000
KINDS = ["drop 1", "drop 2", "drop 3", "drop scan", "duplicate 1", "duplicate 2", "flip mark",
         "flip data", "overflow"]  # fmt: skip
LABELS = {
    "drop 1": "one byte lost",
    "drop 2": "two bytes lost",
    "drop 3": "three bytes lost",
    "drop scan": "a whole scan lost",
    "duplicate 1": "one byte twice",
    "duplicate 2": "two bytes twice",
    "flip mark": "bit 0 of a byte flipped",
    "flip data": "another bit flipped",
    "overflow": "`stop 01` to `stop 03` in the stream",
}


def draw(random: np.random.Generator, kind: str, scan_bytes: int) -> Fault:
    """One fault at a random byte, away from the ends by two scans."""
    at = int(random.integers(2 * scan_bytes, (SCANS - 3) * scan_bytes))
    name, _, what = kind.partition(" ")
    if kind == "drop scan":
        return Fault("lost scans", at=at // scan_bytes * scan_bytes)
    if name in ("drop", "duplicate"):
        return Fault(name, at=at, count=int(what))
    if name == "flip":
        return Fault("flip", at=at, bit=0 if what == "mark" else int(random.integers(1, 8)))
    return Fault("overflow", at=at, code=int(random.integers(1, 4)))


def one(random: np.random.Generator, model: str, kind: str) -> tuple[bool, int, int]:
    """Return whether a fault was flagged, the good scans it cost, and the false ones it made.

    A scan is false when it is delivered as good and was never sent.
    """
    driver, device = find_driver(model), DEVICES[model]()
    channels = int(random.integers(1, 5))
    half = 2 ** (driver.bits - 1)
    # Distinct, so that every scan tells where it belongs.
    codes = random.choice(2 * half, size=(SCANS, channels), replace=False) - half
    sent = device.encode(codes)
    scan_bytes = 2 * channels
    path = FaultyPath([draw(random, kind, scan_bytes)])
    decoder = driver.decoder(channels)
    fed, end = decoder.feed(path.stream(sent, scan_bytes)), decoder.finish()
    losses = (*fed.losses, *end.losses)
    suspect = {loss.after_scan - 1 for loss in losses if loss.suspect_before}
    rows = np.concatenate([fed.counts, end.counts]).tolist()
    true = {tuple(row) for row in codes.tolist()}
    good = [tuple(row) for number, row in enumerate(rows) if number not in suspect]
    false = sum(row not in true for row in good)
    return bool(losses), SCANS - len(set(good) & true), false


def fault_table(_folder: Path) -> str:
    """Count, over all families."""
    random = np.random.default_rng(20261121)
    tally: dict[tuple[str, bool], list[tuple[bool, int, int]]] = defaultdict(list)
    cells = [(model, kind) for model in MODELS for kind in KINDS]
    cells = [(m, k) for m, k in cells if not (k == "overflow" and m in MARKED)]
    each = -(-FAULTS // len(cells))
    for model, kind in cells:
        for _ in range(each):
            tally[kind, model in MARKED].append(one(random, model, kind))
    lines = [
        f"{each * len(cells)} faults in recordings of {SCANS} scans of 1 to 4 channels, "
        'random codes; one fault each. "False" is a scan delivered as good that was never '
        "sent.",
        "",
        "| fault | family | faults | flagged | scans lost, mean (most) | unflagged with false "
        "scans | unflagged without |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in KINDS:
        for marked in (True, False):
            found = tally[kind, marked]
            if not found:
                continue
            flagged = [lost for seen, lost, _ in found if seen]
            worst = f"{np.mean(flagged):.2f} ({max(flagged)})" if flagged else "-"
            silent = sum(not seen and false > 0 for seen, _, false in found)
            clean = sum(not seen and not false for seen, _, false in found)
            lines.append(
                f"| {LABELS[kind]} | {'frame mark' if marked else 'CDC words'} | {len(found)} | "
                f"{100 * len(flagged) / len(found):.2f} % | {worst} | "
                f"{100 * silent / len(found):.2f} % | {100 * clean / len(found):.2f} % |"
            )
    flagged_false = [
        (kind, false) for (kind, marked), found in tally.items() if marked
        for seen, _, false in found if seen and false
    ]  # fmt: skip
    total = sum(seen for (_, marked), found in tally.items() if marked for seen, _, _ in found)
    lines += [
        "",
        f"Of {total} flagged faults in the families with a frame mark, {len(flagged_false)} left "
        f"a false scan beside the flag (at most {max((n for _, n in flagged_false), default=0)}): "
        "bytes cut off a scan before and behind that make a whole one.",
    ]
    return "\n".join(lines)


def clock_table(_folder: Path) -> str:
    """How short a loss of whole scans the clock still tells, by the host's delays."""
    random = np.random.default_rng(20261122)
    lines = [
        "500 recordings of 120 s at 100 Hz a line, an arrival every two scans, exponential "
        "delays; the limit is the median that the finder states.",
        "",
        "| mean delay | stated limit | scans lost | found | of the right number (+-1) | "
        "found where none was lost |",
        "|---|---|---|---|---|---|",
    ]
    for delay_s in (0.001, 0.005, 0.02):
        for lost in (1, 3, 10, 30):
            found = right = invented = 0
            limits = []
            for _ in range(500):
                scans = np.arange(2.0, 12_002.0, 2.0)
                place = float(random.uniform(2000, 10_000))
                delay = random.exponential(delay_s, len(scans))
                whole, limit_s = find_clock_losses(scans / 100.0 + delay, scans, 100.0)
                invented += bool(whole)
                limits.append(limit_s)
                made = scans + np.where(scans > place, lost, 0)
                losses, _ = find_clock_losses(made / 100.0 + delay, scans, 100.0)
                found += bool(losses)
                right += len(losses) == 1 and abs(losses[0].scans - lost) <= 1
            lines.append(
                f"| {1e3 * delay_s:g} ms | {1e3 * np.median(limits):.0f} ms | {lost} | "
                f"{found / 5:.1f} % | {right / 5:.1f} % | {invented / 5:.1f} % |"
            )
    return "\n".join(lines)
