"""Tables of measured figures, each line with what was asked."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scipy.stats import binomtest

_PEERS = ("numpy", "scipy", "numba", "heyoka", "lmfit")


@dataclass(frozen=True)
class Row:
    """A line of the table.

    Parameters
    ----------
    what
        What was measured.
    measured, asked
        As they are shown.
    met
        Whether what was asked is met; None where nothing was.
    """

    what: str
    measured: str
    asked: str = ""
    met: bool | None = None


def at_least(what: str, value: float, bound: float, unit: str = "") -> Row:
    """A figure that should be large."""
    return Row(what, f"{value:.3g}{unit}", f"at least {bound:g}{unit}", value >= bound)


def at_most(what: str, values: float | Sequence[float], bound: float, unit: str = "") -> Row:
    """A figure, or several, whose size should be small."""
    several = [values] if isinstance(values, float) else list(values)
    shown = ", ".join(f"{value:.3g}{unit}" for value in several)
    met = all(abs(value) <= bound for value in several)
    return Row(what, shown, f"at most {bound:g}{unit}", met)


def within(what: str, values: Sequence[float], about: float, slack: float) -> Row:
    """Percentages that should be close to a given one."""
    shown = ", ".join(f"{value:.1f}" for value in values)
    met = all(abs(value - about) <= slack for value in values)
    return Row(what, shown, f"{about:g} +- {slack:g}", met)


def share(hits: int, of: int) -> str:
    """How many of how many, and the share in percent with its exact 95 % interval."""
    if not of:
        return "none"
    low, high = binomtest(hits, of).proportion_ci()
    return f"{hits} of {of}: {100 * hits / of:.1f} ({100 * low:.1f} to {100 * high:.1f})"


def lower_quartile(values: list[float]) -> float:
    """The value that a quarter of them fall below."""
    return sorted(values)[len(values) // 4]


def cpu_seconds(
    contenders: dict[str, tuple[Callable[[], object], int]],
    rounds: int,
    clock: Callable[[], float] = time.process_time,
    statistic: Callable[[list[float]], float] = lower_quartile,
) -> dict[str, float]:
    """Time of each contender, which take turns; beside each its calls in a round.

    CPU time, and by default its lower quartile, since the machine may be shared, which only
    adds; each is called once before.
    """
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for run, _ in contenders.values():
        run()
    for _ in range(rounds):
        for name, (run, calls) in contenders.items():
            for _ in range(calls):
                begin = clock()
                run()
                times[name].append(clock() - begin)
    return {name: statistic(values) for name, values in times.items()}


def machine() -> str:
    """Name the machine and what ran on it."""
    model = platform.processor() or platform.machine()
    described = Path("/proc/cpuinfo")
    if described.exists():
        lines = described.read_text(encoding="utf-8").splitlines()
        names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        model = names[0] if names else model
    versions = []
    for name in _PEERS:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"{name} not installed")
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return (
        f"{model}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}, Python"
        f" {platform.python_version()}, {', '.join(versions)}{load}"
    )


def write(title: str, rows: Sequence[Row]) -> None:
    """Print a part's table."""
    words = {None: "", True: "met", False: "**missed**"}
    lines = [
        f"## {title}",
        "",
        f"{machine()}.",
        "",
        "| what | measured | asked | |",
        "|---|---|---|---|",
    ]
    lines += [f"| {row.what} | {row.measured} | {row.asked} | {words[row.met]} |" for row in rows]
    print(*lines, sep="\n", flush=True)
