"""Recordings in the plain form, and real ones with a concealed change.

What a real recording itself holds nobody knows; each changed recording has its unchanged
twin, and what is asked is whether the change is named where the twin's answer does not name
it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError
from pendpipe.files import replaced
from pendpipe_challenge.scenario import Scenario


def plain_text(
    time_s: FloatArray, values: FloatArray, metadata: dict[str, str], quantity: str = "volts"
) -> str:
    """The file's text: ``# key: value`` lines, a header, rows."""
    lines = [f"# {key}: {value}" for key, value in metadata.items()]
    lines.append(f"time_s,{quantity}")
    lines += [f"{t:.9g},{v:.9g}" for t, v in zip(time_s.tolist(), values.tolist(), strict=True)]
    return "\n".join(lines) + "\n"


def recording_text(scenario: Scenario, codes: IntArray) -> str:
    """The laboratory's file of these codes, with nothing about what acted."""
    chain = scenario.chain
    metadata = {
        "volts_per_radian": repr(chain.nominal_volts_per_radian),
        "bits": str(chain.bits),
        "range_volts": repr(chain.range_volts),
    }
    volts = chain.step_volts * codes.astype(np.float64)
    return plain_text(scenario.time_s, volts, metadata)


def write_recording(path: str | Path, scenario: Scenario, codes: IntArray) -> None:
    """Write a recording in the plain form."""
    with replaced(path) as stream:
        stream.write(recording_text(scenario, codes))


def intervals_s(folder: Path, names: Iterable[str]) -> dict[str, float]:
    """Between the samples of a set's recordings, those that are there."""
    found = {}
    for name in names:
        path = folder / "recordings" / f"{name}.csv"
        if path.is_file():
            with path.open(encoding="utf-8") as stream:
                rows = [line for line in islice(stream, 40) if not line.startswith("#")][1:]
            times = [float(row.split(",")[0]) for row in rows]
            found[name] = (times[-1] - times[0]) / (len(times) - 1)
    return found


SOURCES: Final = (
    ("jiarui-phy180/AAAtAmp3.txt", 0.0),
    ("jiarui-phy180/8050.txt", 0.0),
    ("jiarui-phy180/8055.txt", 0.0),
    ("tylertian-phy180/lab1_data.txt", 0.0),
    ("kvlcc2-roll-decay/model_test_21337.csv", 0.0),
    ("profcarter-adip/adip_pend_data.mat", 3.0),
    ("yfysiks-encoder/data32.csv", 2.0),
)
"""Free decays that are evenly sampled, and where their free part begins, s."""

CHANGES: Final = (
    "tone-pickup",
    "dropped-samples",
    "sensor-cubic",
    "clock-drift",
    "coarse-quantisation",
    "offset-drift",
    "glitches",
    "sensor-quadratic",
)
"""Identifiers of what is concealed."""
LONGEST: Final = 4000


@dataclass(frozen=True)
class RealItem:
    """A real recording, changed; texts of the files and the truth."""

    text: str
    twin: str
    truth: dict[str, Any]


def available(folder: Path) -> list[tuple[Path, float]]:
    """The sources that are there."""
    return [(folder / name, start) for name, start in SOURCES if (folder / name).exists()]


def make_real(folder: Path, number: int, random: np.random.Generator) -> RealItem:
    """Conceal a change in a real recording.

    Parameters
    ----------
    folder
        Where the recordings lie.
    number
        Which of the combinations of recording and change.

    Raises
    ------
    InputError
        When no recording is there, or it is not evenly sampled.
    """
    there = available(folder)
    if not there:
        raise InputError(folder, "none of the real recordings is there", "leave the family out")
    path, start = there[number % len(there)]
    # Each round over the recordings begins one change later, so that all meet all.
    effect = CHANGES[(number % len(there) + number // len(there)) % len(CHANGES)]
    time, angle, quantity = _even(path, start)
    noise = _roughness(angle)
    changed, parameters = _conceal(effect, time, angle, noise, random)
    step = float(np.median(np.diff(time)))
    grid = step * np.arange(len(changed), dtype=np.float64)
    whole = step * np.arange(len(angle), dtype=np.float64)
    truth = {
        "family": "real",
        "baseline": "eq8",
        "source": path.name,
        "effects": [
            {
                "effect": effect,
                "also": _also(effect),
                "law": "concealed in a real recording",
                "kind": "measurement",
                "own_form": False,
                "delta_chi2": None,
                "parameters": parameters,
            }
        ],
        "nuisances": {"samples": len(changed)},
        "oracle": None,
    }
    return RealItem(
        plain_text(grid, changed, {}, quantity),
        plain_text(whole, angle, {}, quantity),
        truth,
    )


def _even(path: Path, start_s: float) -> tuple[FloatArray, FloatArray, str]:
    """Readings of the free part, at most `LONGEST` of them, evenly sampled."""
    from pendpipe.formats.reading import read

    recording = read(path)
    time, values = recording.time_s, recording.values
    good = np.isfinite(values) & (time >= time[0] + start_s)
    time, values = time[good], values[good]
    gaps = np.diff(time)
    if gaps.max() > 1.5 * np.median(gaps):
        raise InputError(path, "it is not evenly sampled", "leave it out of the challenge")
    stride = max(1, int(np.ceil(len(time) / LONGEST)))
    grid = np.linspace(time[0], time[-1], len(time))
    values = np.interp(grid, time, values)
    return grid[::stride] - grid[0], values[::stride], recording.quantity


def _roughness(values: FloatArray) -> float:
    """Noise from third differences, at least the smallest step of the readings."""
    rough = np.abs(np.diff(values, 3))
    steps = np.diff(np.unique(values))
    step = float(np.min(steps[steps > 1e-9 * np.ptp(values)], initial=np.inf))
    return float(max(np.median(rough) / 0.6745 / np.sqrt(20.0), step if step < 1e-2 else 0.0))


def _conceal(
    effect: str, time: FloatArray, values: FloatArray, noise: float, random: np.random.Generator
) -> tuple[FloatArray, dict[str, float]]:
    """The changed readings and the change's numbers."""
    top, span = float(np.abs(values - np.median(values)).max()), float(time[-1])
    sign = float(random.choice([-1.0, 1.0]))
    centred = values - np.median(values)
    size = float(random.uniform(2.0, 6.0)) * noise + 0.004 * top
    if effect == "tone-pickup":
        hertz = float(random.uniform(0.25, 0.45) / np.median(np.diff(time)))
        return values + size * np.cos(2 * np.pi * hertz * time), {"amplitude": size, "hertz": hertz}
    if effect == "dropped-samples":
        at = int(random.uniform(0.2, 0.6) * len(values))
        lost = int(random.integers(2, 6))
        return np.delete(values, np.arange(at, at + lost)), {"sample": at, "lost": lost}
    if effect == "sensor-cubic":
        share = sign * float(random.uniform(0.03, 0.1))
        return values + share * centred**3 / top**2, {"cubic": share / top**2}
    if effect == "sensor-quadratic":
        share = sign * float(random.uniform(0.03, 0.1))
        return values + share * centred**2 / top, {"quadratic": share / top}
    if effect == "clock-drift":
        rate = sign * float(random.uniform(0.004, 0.012))
        true = time * (1.0 - rate) + rate * time**2 / span
        return np.interp(true, time, values), {"relative_change": 2.0 * rate}
    if effect == "coarse-quantisation":
        step = float(random.uniform(0.02, 0.05)) * top
        return step * np.rint(values / step), {"step": step}
    if effect == "offset-drift":
        return values + sign * 3.0 * size * time / span, {"drift": sign * 3.0 * size / span}
    wild = random.choice(np.arange(50, len(values) - 50), 3, replace=False)
    changed = values.copy()
    changed[wild] += sign * (8.0 * noise + 0.1 * top)
    samples = {f"sample_{i}": float(at) for i, at in enumerate(np.sort(wild), 1)}
    return changed, {"number": 3.0, **samples}


def _also(effect: str) -> list[str]:
    """Names that one record cannot tell from it."""
    return {
        "clock-drift": ["frequency-drift"],
        "offset-drift": ["equilibrium-creep", "ac-coupling"],
        "tone-pickup": ["periodic-drive"],
    }.get(effect, [])
