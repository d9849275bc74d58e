"""An item of a set: a recording as an apparatus makes it, and the truth about it.

Sizes are drawn by what they are worth: `evidence`, an oracle's Delta chi^2, from 100 to 100 000.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final
from zlib import crc32

import numpy as np
from scipy.signal import lfilter

from benchmarks import null_families as nulls
from benchmarks.apparatus.causes import CATALOGUE, OUTSIDE, Kind, Rng
from benchmarks.apparatus.world import EVENT_EDGE, EVENT_JITTER_S, Cause, Scene, evidence
from pendpipe.arrays import FloatArray as Array

PARTS: Final = {"null": 0.2, "one": 0.45, "two": 0.15, "outside": 0.2}
"""Of a set, by what is hidden in an item beside sin x."""
EVIDENCE: Final = (100.0, 1e5)
MOTION: Final = (
    *("cubic-stiffness", "quadratic-stiffness", "drag-form", "power-law-damping", "cubic-damping"),
    *("stribeck-friction", "presliding-friction", "vortex-shedding", "plane-coupling"),
    *("periodic-drive", "broadband-drive", "frequency-drift", "damping-drift", "release-transient"),
    *("equilibrium-creep", "equilibrium-step", "frequency-step", "damping-step", "impulse"),
    *("second-mode", "backlash", "amplitude-linear-stiffness", "parametric-drive"),
)
NOISES: Final = ("white", "memory", "red", "changing", "heavy-tails", "smoothed")
"""Families of `benchmarks.null_families` that some nulls have."""
FAULTS: Final = ("glitches", "clipping", "missing-codes", "jitter", "tracking-noise")
"""Entered when the readings are written; what they are worth is counted there."""
SENSORS: Final = {
    "encoder": (
        *("count-slips", "clock-slips", "camera-geometry", "dropped-samples", "clock-drift"),
        *("jitter", "glitches", "differential-nonlinearity", "sensor-backlash"),
    ),
    "camera": (
        *("rolling-shutter", "camera-geometry", "tracking-noise", "dropped-samples", "glitches"),
        *("offset-drift", "jitter", "sensor-cubic", "clock-drift"),
    ),
    "converter": (
        *(
            "sensor-quadratic",
            "sensor-cubic",
            "sensor-dead-band",
            "sensor-backlash",
            "offset-drift",
        ),
        *("gain-drift", "ac-coupling", "tone-pickup", "clipping", "missing-codes", "clock-drift"),
        *("dropped-samples", "glitches", "differential-nonlinearity"),
    ),
}
"""What may be wrong with each kind of sensor."""
WHEEL: Final = frozenset({"vibrated-pivot", "winding-string", "elastic-string", "rolling-edge"})
"""Laws of a pendulum that a torsion wheel can't have."""


@dataclass(frozen=True)
class Item:
    """A recording and the truth about it.

    Parameters
    ----------
    present
        Each effect's evidence; not a number where it is a matter of chance (jitter, tracking).
    hidden
        What was put in beside sin x: none, one or two names.
    outside
        The law out of the catalogue, or nothing, and the names that come near it.
    allowed
        Names that are true of the sensor whatever was hidden.
    columns
        By heading, as the file has them.
    """

    number: int
    part: str
    apparatus: str
    noise: str
    present: dict[str, float]
    hidden: tuple[str, ...]
    outside: str
    near: frozenset[str]
    allowed: frozenset[str]
    columns: dict[str, Array]

    def write(self, path: Path) -> None:
        """Write the recording as a plain CSV file."""
        rows = np.column_stack(list(self.columns.values()))
        np.savetxt(path, rows, "%.9g", ",", header=",".join(self.columns), comments="")


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _rates(rng: Rng, amplitude: float, duration_s: float, weights: Array, falls_by: float) -> Array:
    """a, b_v, b_h, c that let the amplitude fall by exp(-falls_by) within the recording."""
    shares = rng.dirichlet(weights)
    y = np.exp(-np.linspace(0, falls_by, 600))
    pace = shares @ np.array([y**2, y, np.full_like(y, 0.3)])
    scale = -np.trapezoid(1 / pace, y) / duration_s
    dry = scale * shares[1] * (rng.uniform() if rng.integers(2) else 0.0)
    a, c = scale * shares[0] / amplitude, scale * shares[2] * 0.3 * amplitude
    return np.array([a, scale * shares[1] - dry, dry, c])


def scene_of(rng: Rng, apparatus: str, wheel: bool) -> Scene:
    """A pendulum (or a torsion wheel) with its sensor."""
    # Shares of drag, of viscous and of dry friction; readings a second; swings; how many cycles.
    weights, rates_hz, swings, cycles = {
        "encoder": ([1.0, 1.0, 2.0], (60, 300), (0.35, 2.6), (15, 90)),
        "camera": ([2.0, 1.0, 0.2], (20, 60), (0.15, 1.3), (30, 120)),
        "converter": ([1.0, 2.0, 0.5], (15, 80), (0.05, 0.7), (30, 120)),
    }[apparatus]
    frequency, amplitude = _log(rng, 0.4, 1.3), _log(rng, *swings)
    if wheel:
        frequency, amplitude = _log(rng, 0.2, 0.8), _log(rng, 0.3, 2.6)
    rate = max(_log(rng, *rates_hz), 12 * frequency)
    duration = min(_log(rng, *cycles) / frequency, 18_000 / rate)
    # Some rods swing until they rest.
    to_rest = apparatus == "encoder" and rng.uniform() < 0.25
    falls_by = 7.0 if to_rest else rng.uniform(0.7, 3.0)
    rates = _rates(rng, amplitude, duration, np.array(weights), falls_by)
    step, noise = 0.0, amplitude / _log(rng, 300, 5000)
    event = apparatus == "encoder" and rng.uniform() < 0.35
    memory = float(rng.choice([0.0, rng.uniform(0.2, 0.9)]))
    if apparatus == "encoder":
        several = [1200, 2000, 2400, 4096, 8192, 16384, 40000]
        counts = float(rng.choice(several[: 4 if event else 7]))
        step = 2 * np.pi / counts
        noise, memory = step * _log(rng, 0.02, 0.3), 0.0
        if event:
            noise = 0.0
    elif apparatus == "converter":
        step, memory = 2 * 1.3 * amplitude / 2.0 ** int(rng.integers(9, 17)), 0.0
    return Scene(
        apparatus=apparatus,
        frequency_hz=frequency,
        rates=tuple(float(rate) for rate in rates),
        amplitude=amplitude,
        lead_s=float(rng.uniform(0.0, 1.0) / frequency),
        offset=float(rng.normal() * 0.02 * amplitude),
        noise_rms=noise,
        memory=memory,
        step=step,
        event_driven=event,
        time_s=np.arange(int(duration * rate)) / rate,
    )


def sized(rng: Rng, scene: Scene, causes: list[Cause], name: str, kind: Kind) -> Cause | None:
    """A cause that is worth what was drawn; None where the scene can't show it."""
    goal = _log(rng, *EVIDENCE)
    sign = float(rng.choice([-1, 1])) if kind.signed else 1.0
    cause = Cause(name, kind.draw(rng, scene), sign * kind.size)
    for _ in range(4 if kind.most > kind.size else 1):
        worth = evidence(scene, [*causes, cause])[-1]
        if not np.isfinite(worth) or worth <= 0:
            return None
        if kind.most == kind.size:
            return cause if worth >= EVIDENCE[0] else None
        size = min(abs(cause.size) * (goal / worth) ** 0.5, kind.most)
        cause = cause._replace(size=sign * size)
    return cause if evidence(scene, [*causes, cause])[-1] >= EVIDENCE[0] else None


def _fault(
    rng: Rng, name: str, scene: Scene, y: Array, v: Array
) -> tuple[Array, float, Array | None]:
    """Readings with a fault, what it is worth, and the sensor's other coordinate if it has one."""
    sd = float(np.hypot(scene.noise_rms, scene.step / 12**0.5))
    if name == "glitches":
        places = rng.choice(len(y), int(rng.integers(2, 9)), replace=False)
        jumps = rng.choice([-1, 1], len(places)) * rng.uniform(15, 80, len(places)) * sd
        y = y.copy()
        y[places] += jumps
        return y, float(np.sum((jumps / sd) ** 2)), None
    if name == "clipping":
        level = rng.uniform(0.75, 0.97) * np.abs(y).max()
        cut = np.clip(y, -np.inf if rng.integers(2) else -level, level)
        return cut, float(np.sum(((y - cut) / sd) ** 2)), None
    if name == "missing-codes":
        codes = np.round(y / scene.step)
        gone = rng.choice(np.unique(codes), int(rng.integers(3, 20)))
        shifted = y + scene.step * np.isin(codes, gone) * np.where(y > codes * scene.step, 1, -1)
        return shifted, float(np.sum(((y - shifted) / sd) ** 2)), None
    if name == "jitter":
        sigma = _log(rng, 0.7, 4.0) * sd / float(np.std(v))
        ratio = (v * sigma / sd) ** 2
        return y + v * sigma * rng.normal(size=len(y)), float(0.5 * np.sum(ratio**2)), None
    swing = nulls.Swing(scene.time_s, y, np.abs(y), sd)
    corner = 1 / (2 * np.pi * _log(rng, 0.3, 5.0))
    spectrum = lambda f: 1 / (1 + (f / corner) ** 2)
    across, along = (nulls._coloured(rng, swing, spectrum) for _ in range(2))
    size = _log(rng, 1.0, 4.0) * sd
    return y + size * across, float("nan"), size * along


def _events(rng: Rng, scene: Scene, causes: list[Cause]) -> dict[str, Array]:
    """A row for each change of the count: its instant, and the angle of the new count."""
    rate = 4 * 400 * scene.frequency_hz
    dense = np.arange(0, scene.duration_s, 1 / rate)
    y, _ = scene.reading(causes, time_s=dense)
    height = y / scene.step + rng.uniform()
    count = np.floor(height).astype(int)
    instants, values = [], []
    for place in np.flatnonzero(np.diff(count)):
        low, high = height[place], height[place + 1]
        way = 1 if high > low else -1
        for edge in range(count[place] + (way > 0), count[place + 1] + (way > 0), way):
            part = (edge + EVENT_EDGE * rng.normal() - low) / (high - low)
            instants.append(dense[place] + min(max(part, 0.0), 1.0) / rate)
            values.append((edge if way > 0 else edge - 1) * scene.step)
    late = np.array(instants) + rng.exponential(EVENT_JITTER_S, len(instants))
    order = np.argsort(late, kind="stable")
    stamps = np.round(late[order], 6)
    kept = np.r_[True, np.diff(stamps) > 0]
    return {"time_s": stamps[kept], "angle_rad": np.array(values)[order][kept]}


def _fits(name: str, scene: Scene, wheel: bool) -> bool:
    """Whether a scene can have an effect."""
    uniform = not scene.event_driven
    return {
        "clock-slips": uniform and len(scene.time_s) > 3000,
        "missing-codes": scene.step > scene.noise_rms,
        "differential-nonlinearity": uniform and scene.step > scene.noise_rms,
        "dropped-samples": uniform,
        "jitter": uniform,
        "glitches": uniform,
        "interleave": uniform,
        "packet-times": uniform,
        "slow-pen": uniform,
        "drag-form": scene.rates[0] > 0,
        "tracking-noise": scene.apparatus == "camera",
        "sensor-cubic": not wheel,
    }.get(name, not (wheel and name in WHEEL))


def draw(name: str, number: int) -> Item:
    """The item of a set and a number, always the same."""
    rng = np.random.default_rng([crc32(name.encode()), number])
    # The parts stand evenly over the numbers; all the rest is drawn.
    place = (number * 0.6180339887498949) % 1.0
    part = list(PARTS)[int(np.searchsorted(np.cumsum(list(PARTS.values())), place, "right"))]
    while True:
        item = _try(rng, number, part)
        if item is not None:
            return item


def _try(rng: Rng, number: int, part: str) -> Item | None:
    """An item, unless the scene can't show what was drawn for it."""
    apparatus = str(rng.choice(["encoder", "camera", "converter"]))
    wheel = apparatus == "converter" and rng.uniform() < 0.3
    scene = scene_of(rng, apparatus, wheel)
    family = "own"
    if part == "null" and not scene.event_driven and rng.uniform() < 0.7:
        family = str(rng.choice(NOISES))
        scene = replace(scene, memory=0.0)
    no_sine = CATALOGUE["circular-error"]
    causes = [] if wheel else [Cause("circular-error", no_sine.draw(rng, scene), 1.0)]
    hidden: tuple[str, ...] = ()
    faults: list[str] = []
    if part == "outside":
        name = str(rng.choice([each for each in OUTSIDE if _fits(each, scene, wheel)]))
        found = sized(rng, scene, causes, name, OUTSIDE[name])
        if found is None:
            return None
        causes.append(found)
        hidden = (name,)
    elif part != "null":
        motion, sensor = (
            [each for each in names if _fits(each, scene, wheel)]
            for names in (MOTION, SENSORS[apparatus])
        )
        groups = [motion, sensor][:: int(rng.choice([-1, 1]))][: 1 if part == "one" else 2]
        for names in groups:
            name = str(rng.choice(names))
            hidden += (name,)
            if name in FAULTS:
                faults.append(name)
                continue
            found = sized(rng, scene, causes, name, CATALOGUE[name])
            if found is None:
                return None
            causes.append(found)
    worth = evidence(scene, causes) if causes else []
    present = {cause.name: each for cause, each in zip(causes, worth, strict=True)}
    written = _written(rng, scene, causes, faults, family)
    if written is None:
        return None
    columns, of_faults = written
    present |= of_faults
    if any(present[each] < EVIDENCE[0] for each in hidden):
        return None
    outside = hidden[0] if part == "outside" else ""
    allowed = {"coarse-quantisation"} if scene.step > 0.5 * scene.noise_rms else set()
    if scene.event_driven:
        # The count changes at its edges whichever way it is passed: a play of one count.
        allowed |= {"coarse-quantisation", "sensor-backlash", "jitter"}
    if scene.memory or family in ("memory", "red", "smoothed") or "tracking-noise" in hidden:
        allowed |= {"coloured-noise"}
    return Item(
        number=number,
        part=part,
        apparatus=("wheel, " if wheel else "") + apparatus + (", events" * scene.event_driven),
        noise=family,
        present={each: value for each, value in present.items() if each != outside},
        hidden=hidden,
        outside=outside,
        near=OUTSIDE[outside].near if outside else frozenset(),
        allowed=frozenset(allowed),
        columns=columns,
    )


def _written(
    rng: Rng, scene: Scene, causes: list[Cause], faults: list[str], family: str
) -> tuple[dict[str, Array], dict[str, float]] | None:
    """Columns of the file, and what the faults are worth."""
    if scene.event_driven:
        columns = _events(rng, scene, causes)
        return (columns, {}) if 500 <= len(columns["time_s"]) <= 60_000 else None
    y, seen = scene.reading(causes)
    level = np.hypot(seen.x, seen.v / scene.omega)
    worth, along = {}, None
    for name in faults:
        y, worth[name], radial = _fault(rng, name, scene, y, seen.v)
        along = radial if radial is not None else along
    if family != "own":
        y = nulls.FAMILIES[family](rng, nulls.Swing(seen.time_s, y, level, scene.noise_rms))
    else:
        noise = _noise(rng, scene)
        y = y + noise
    if scene.step:
        y = scene.step * np.floor(y / scene.step + 0.5)
    if along is None:
        return {"time_s": seen.time_s, "angle_rad": y}, worth
    length = float(rng.uniform(0.3, 1.5))
    radius = length * (1 + along + _noise(rng, scene))
    return {"t": seen.time_s, "x": radius * np.sin(y), "y": -radius * np.cos(y)}, worth


def _noise(rng: Rng, scene: Scene) -> Array:
    """White, or with the scene's memory."""
    drawn = rng.normal(size=len(scene.time_s) + 500)
    slow = lfilter([np.sqrt(1 - scene.memory**2)], [1.0, -scene.memory], drawn)
    return scene.noise_rms * slow[500:]
