"""Make the items of a set: each a recording, what is true of it, and the oracle's figures.

    recipe = {"family": "single", "effects": ["cubic-stiffness"], "delta_chi2": [100.0]}
    item = make_item(recipe, rng)
    Path("recording.csv").write_text(item.text)
    item.truth["effects"][0]["delta_chi2"], item.truth["oracle"]["class"]

Four kinds of apparatus: a laboratory's converter, whose pendulum swings by x; and encoders, cameras
and converters of pendulums that swing by sin x, up to 2.6 rad, or of torsion wheels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray as Array
from pendpipe_challenge.causes import (
    CATALOGUE,
    MEASUREMENT,
    ONLY_VISCOUS,
    OUTSIDE,
    Law,
    kind_of,
    log_uniform,
)
from pendpipe_challenge.oracle import Oracle
from pendpipe_challenge.world import EVENT_EDGE, EVENT_JITTER_S, Bench, Cause, Rng, Scene, Seen

Recipe = dict[str, Any]
"""``family``, ``apparatus``, ``effects`` and the ``delta_chi2`` wanted of each."""
Noise = Callable[[Rng, Seen, Array, Array, float], Array]
"""Adds noise of another kind to a reading, from its amplitude and an rms."""
VOLTS_PER_RADIAN: Final = 3.85
RANGES_VOLTS: Final = (1.25, 2.5, 5.0, 10.0)


class Kind(NamedTuple):
    """What an apparatus has.

    Parameters
    ----------
    weights
        Shares of drag, of viscous and of dry friction, as a Dirichlet distribution takes them.
    frequencies_hz, swings, cycles, rates_hz
        From and to.
    readings
        At most.
    """

    weights: tuple[float, float, float]
    frequencies_hz: tuple[float, float]
    swings: tuple[float, float]
    cycles: tuple[float, float]
    rates_hz: tuple[float, float]
    readings: int = 18_000


KINDS: Final = {
    "laboratory": Kind((1.0, 3.0, 0.3), (0.4, 2.0), (0.02, 0.5), (15, 250), (12, 100), 4000),
    "encoder": Kind((1.0, 1.0, 2.0), (0.4, 1.3), (0.35, 2.6), (15, 90), (60, 300)),
    "camera": Kind((2.0, 1.0, 0.2), (0.4, 1.3), (0.15, 1.3), (30, 120), (20, 60)),
    "converter": Kind((1.0, 2.0, 0.5), (0.4, 1.3), (0.05, 0.7), (30, 120), (15, 80)),
    "wheel": Kind((1.0, 2.0, 0.5), (0.2, 0.8), (0.3, 2.6), (30, 120), (15, 80)),
}
SENSORS: Final = {
    "encoder": (
        *("count-slips", "clock-slips", "camera-geometry", "dropped-samples", "clock-drift"),
        *("jitter", "glitches", "sensor-backlash"),
    ),
    "camera": (
        *("rolling-shutter", "camera-geometry", "dropped-samples", "glitches", "offset-drift"),
        *("jitter", "sensor-cubic", "clock-drift"),
    ),
    "converter": (
        *("sensor-quadratic", "sensor-cubic", "sensor-backlash", "offset-drift", "gain-drift"),
        *("ac-coupling", "tone-pickup", "clipping", "missing-codes", "clock-drift"),
        *("dropped-samples", "glitches"),
    ),
    "wheel": (
        *("sensor-quadratic", "sensor-backlash", "offset-drift", "gain-drift", "ac-coupling"),
        *("tone-pickup", "clipping", "missing-codes", "clock-drift", "dropped-samples"),
        "glitches",
    ),
}
"""What may be wrong with each kind of sensor."""
OF_A_PENDULUM: Final = frozenset(
    {"circular-error", "vibrated-pivot", "winding-string", "elastic-string", "rolling-edge"}
)
"""Laws that a torsion wheel can't have."""


def draw_scene(rng: Rng, apparatus: str) -> Scene:
    """A pendulum (or a torsion wheel) with its sensor."""
    kind = KINDS[apparatus]
    frequency, amplitude = log_uniform(rng, *kind.frequencies_hz), log_uniform(rng, *kind.swings)
    cycles = log_uniform(rng, *kind.cycles)
    # Some rods swing until they rest.
    to_rest = apparatus in ("encoder", "laboratory") and rng.uniform() < 0.2
    falls_by = 7.0 if to_rest else rng.uniform(0.5, 3.0)
    step, red, bits = 0.0, 0.0, 0
    noise = amplitude / log_uniform(rng, 300, 5000)
    rate = max(log_uniform(rng, *kind.rates_hz), 12 * frequency)
    event = apparatus == "encoder" and rng.uniform() < 0.35
    if apparatus == "encoder":
        several = [1200, 2000, 2400, 4096, 8192, 16384, 40000]
        step = 2 * np.pi / float(rng.choice(several[: 4 if event else 7]))
        noise = 0.0 if event else step * log_uniform(rng, 0.02, 0.3)
    elif apparatus in ("converter", "wheel"):
        step = 2 * 1.3 * amplitude / 2.0 ** int(rng.integers(9, 17))
    elif apparatus == "laboratory":
        bits = 16 if rng.uniform() < 0.65 else 12
        ranges = [r for r in RANGES_VOLTS if r > 1.15 * VOLTS_PER_RADIAN * amplitude + 0.1]
        # A 12-bit step is coarse: a laboratory takes the narrowest range.
        full = ranges[0] if bits == 12 else float(rng.choice(ranges))
        step = 2 * full / 2.0**bits / VOLTS_PER_RADIAN
        noise = step * log_uniform(rng, 0.3, 3.0)
        red = rng.uniform(0.3, 1.5) if rng.uniform() < 0.5 else 0.0
        # A laboratory sets a round rate.
        in_cycle = min(max(12.0, kind.readings / cycles * rng.uniform(0.7, 1.0)), 120.0)
        rate = float(f"{in_cycle * frequency:.2g}")
    duration = min(cycles / frequency, kind.readings / rate)
    rates = _rates(rng, amplitude, duration, kind.weights, falls_by)
    return Scene(
        apparatus=apparatus,
        frequency_hz=frequency,
        rates=rates,
        amplitude=amplitude,
        lead_s=float(rng.uniform(0.0, 1.0) / frequency),
        offset=float(rng.normal() * 0.02 * amplitude),
        noise_rms=noise,
        step=step,
        time_s=np.arange(int(duration * rate)) / rate,
        red=red,
        event_driven=event,
        place=float(rng.uniform()),
        bits=bits,
    )


def _rates(
    rng: Rng, amplitude: float, duration_s: float, weights: tuple[float, ...], falls_by: float
) -> tuple[float, float, float, float]:
    """a, b_v, b_h, c that let the amplitude fall by exp(-falls_by) within the recording."""
    drag, linear, solid = rng.dirichlet(weights)
    y = np.exp(-np.linspace(0, falls_by, 600))
    scale = -np.trapezoid(1 / (drag * y**2 + linear * y + 0.3 * solid), y) / duration_s
    dry = rng.uniform() if rng.integers(2) else 0.0
    a, c = scale * drag / amplitude, scale * 0.3 * solid * amplitude
    return float(a), float(scale * linear * (1 - dry)), float(scale * linear * dry), float(c)


def fits(law: Law, scene: Scene) -> bool:
    """Whether a scene can have an effect."""
    uniform, wheel = not scene.event_driven, scene.apparatus == "wheel"
    stepped, laboratory = scene.step > 0, scene.apparatus == "laboratory"
    return {
        "coulomb-friction": scene.baseline == "viscous",
        "quadratic-drag": scene.baseline == "viscous",
        "circular-error": laboratory,
        "clock-slips": uniform and len(scene.time_s) > 3000,
        "count-slips": scene.apparatus == "encoder",
        "camera-geometry": scene.apparatus in ("encoder", "camera"),
        "rolling-shutter": scene.apparatus == "camera",
        "missing-codes": stepped and (laboratory or scene.step > scene.noise_rms),
        "coarse-quantisation": laboratory,
        "differential-nonlinearity": uniform and scene.step > scene.noise_rms,
        "dropped-samples": uniform,
        "jitter": uniform,
        "glitches": uniform,
        "interleave": uniform,
        "packet-times": uniform,
        "slow-pen": uniform,
        "drag-form": scene.rates[0] > 0,
    }.get(law.effect, not (wheel and law.effect in OF_A_PENDULUM))


@dataclass(frozen=True)
class Item:
    """A recording and what is true of it.

    Parameters
    ----------
    columns
        By heading, as the file has them.
    header
        What the laboratory states about its converter.
    truth
        ``family``, ``apparatus``, ``baseline``, ``effects``, ``present`` and ``allowed`` (names
        that are true whatever was hidden), ``nuisances``, ``oracle`` (None where it was not asked).
    bench
        Where it was recorded.
    """

    columns: dict[str, Array]
    header: dict[str, str]
    truth: dict[str, Any]
    bench: Bench | None = None

    @property
    def text(self) -> str:
        """The file, with nothing about what acted."""
        lines = [f"# {key}: {value}" for key, value in self.header.items()]
        lines.append(",".join(self.columns))
        rows = zip(*(column.tolist() for column in self.columns.values()), strict=True)
        return "\n".join([*lines, *(f"{t:.9g},{y:.9g}" for t, y in rows)]) + "\n"


TRIES: Final = 30
CLOSE: Final = 0.15
"""Relative distance from the wanted Delta chi^2 that is near enough."""
SIZINGS: Final = 16
"""Sizes tried for one cause."""


def make_item(recipe: Recipe, rng: Rng, noise: Noise | None = None) -> Item:
    """Make an item; what no drawn scene can show is made smaller.

    Raises
    ------
    ValueError
        When no scene can show it at all.
    """
    for turn in range(6 * TRIES):
        # A motion that runs away can't be shown either.
        with suppress(FloatingPointError):
            item = _try(recipe, rng, 0.25 ** (turn // TRIES), noise)
            if item is not None:
                return item
    raise ValueError(f"no pendulum can show {recipe}")


def _try(recipe: Recipe, rng: Rng, ease: float, noise: Noise | None) -> Item | None:
    """An item, unless the scene that is drawn can't show what is wanted of it."""
    family, apparatus = recipe["family"], recipe.get("apparatus", "laboratory")
    scene, laboratory = draw_scene(rng, apparatus), apparatus == "laboratory"
    effects = recipe["effects"] if "effects" in recipe else _effects(rng, family, scene)
    if ONLY_VISCOUS.intersection(effects):
        scene = replace(scene, baseline="viscous", rates=(0.0, scene.loss_rate, 0.0, 0.0))
    causes = []
    if apparatus not in ("laboratory", "wheel"):
        (sine,) = CATALOGUE["circular-error"]
        causes.append(Cause(sine.effect, sine.draw(rng, scene), 1.0))
    background = len(causes)
    laws = _hide(recipe, rng, scene, causes, effects, ease)
    if laws is None:
        return None
    bench = Bench(scene, causes)
    if (
        recipe.get("cancelling")
        and laws[1].signed
        and float(bench.columns.T[0] @ bench.columns.T[1]) > 0
    ):
        bench = Bench(scene, [causes[0], causes[1]._replace(size=-causes[1].size)])
    left: dict[str, Any] = {}
    if laboratory and family != "outside":
        bench = bench.refined()
        oracle = Oracle(bench, listed(scene), rng)
    elif laboratory:
        # Sized by what no listed effect takes up.
        (cause,), seed = causes, int(rng.integers(2**32))

        @cache
        def at(size: float) -> Oracle:
            there = cause._replace(size=float(np.copysign(size, cause.size)))
            bench = Bench(scene, [there])
            return Oracle(bench, listed(scene), np.random.default_rng(seed))

        size, _ = size_worth(
            recipe["delta_chi2"][0] * ease,
            lambda size: at(size).left_by_catalogue()[0],
            abs(cause.size),
            laws[0].most,
            close=2 * CLOSE,
        )
        bench = at(size).bench.refined()
        oracle = Oracle(bench, listed(scene), np.random.default_rng(seed))
        left = dict(
            zip(("left_by_catalogue", "best_mimic"), oracle.left_by_catalogue(), strict=True)
        )
    columns = recorded(rng, scene, bench.causes, noise)
    if columns is None:
        return None
    truth = truth_of(family, scene, laws, bench, background)
    truth["wanted_delta_chi2"] = recipe["delta_chi2"]
    if noise is not None:
        truth["allowed"] = sorted({*truth["allowed"], "coloured-noise"})
    if not laboratory:
        return Item(columns, {}, truth, bench)
    if left:
        truth["effects"][0] |= left
    if not any(law.chance for law in laws):
        truth["oracle"] = oracle.judge(columns["angle_rad"] - bench.there, rng)
    full = scene.step * VOLTS_PER_RADIAN * 2.0 ** (scene.bits - 1)
    stated = {"volts_per_radian": VOLTS_PER_RADIAN, "bits": scene.bits, "range_volts": full}
    volts = {"time_s": columns["time_s"], "volts": VOLTS_PER_RADIAN * columns["angle_rad"]}
    return Item(volts, {key: f"{value:.9g}" for key, value in stated.items()}, truth, bench)


def _hide(
    recipe: Recipe,
    rng: Rng,
    scene: Scene,
    causes: list[Cause],
    effects: Sequence[str],
    ease: float,
) -> list[Law] | None:
    """Add a cause for each effect, by one of its laws, of the size that is wanted."""
    laws = []
    for effect, wanted in zip(effects, recipe["delta_chi2"], strict=False):
        forms = [law for law in (CATALOGUE | OUTSIDE)[effect] if fits(law, scene)]
        forms = [law for law in forms if law.own is recipe.get("own_form", law.own)] or forms
        if not forms:
            return None
        laws.append(forms[int(rng.integers(len(forms)))])
        least = recipe.get("least", 4.0)
        cause = sized(rng, scene, causes, laws[-1], max(wanted * ease, min(wanted, least)), least)
        if cause is None:
            return None
        causes.append(cause)
    return laws


def listed(scene: Scene) -> list[str]:
    """Effects of the catalogue that a scene can have."""
    return [effect for effect, laws in CATALOGUE.items() if fits(laws[0], scene)]


def _effects(rng: Rng, family: str, scene: Scene) -> list[str]:
    """What is hidden in an apparatus: physics, its sensor's fault, both, or what nobody lists."""
    if family == "null":
        return []
    if family == "outside":
        return [str(rng.choice([e for e, (law,) in OUTSIDE.items() if fits(law, scene)]))]
    there = listed(scene)
    physics = [effect for effect in PHYSICS if effect in there]
    faults = [effect for effect in SENSORS[scene.apparatus] if effect in there]
    groups = [physics, faults][:: int(rng.choice([-1, 1]))]
    return [str(rng.choice(each)) for each in groups[: 1 if family == "single" else 2]]


def sized(
    rng: Rng, scene: Scene, causes: list[Cause], law: Law, wanted: float, least: float
) -> Cause | None:
    """A cause of the wanted evidence; None where the scene can't show it."""
    sign = float(rng.choice([-1, 1])) if law.signed else 1.0
    cause = Cause(law.effect, law.draw(rng, scene), sign)

    def worth(size: float) -> float:
        return worth_of(law, Bench(scene, [*causes, cause._replace(size=sign * size)]), -1)

    if law.sizeless:
        size, found = law.size, worth(law.size)
    else:
        size, found = size_worth(wanted, worth, law.size, law.most, 0.25 if law.chance else 0.5)
        if not abs(found / wanted - 1) < CLOSE:
            return None
    return cause._replace(size=sign * size) if found >= least else None


def size_worth(
    wanted: float,
    worth: Callable[[float], float],
    size: float,
    most: float,
    power: float = 0.5,
    close: float = CLOSE,
) -> tuple[float, float]:
    """The size that has the wanted evidence, or the last that was tried; and its evidence.

    Evidence grows as size^(1/power). Where that leads out of the bracket, as for a cause that
    sets in at a threshold, the bracket is halved.
    """
    low, high, ahead = 0.0, most, size
    for _ in range(SIZINGS):
        size = ahead
        found = worth(size)
        if abs(found / wanted - 1) < close or (found < wanted and size == most):
            break
        low, high = (size, high) if found < wanted else (low, size)
        ahead = min(size * (wanted / found) ** power, most) if 0 < found < np.inf else most
        if not (low < ahead < high or ahead == high == most):
            ahead = (low + high) / 2
    return size, found


def worth_of(law: Law, bench: Bench, number: int) -> float:
    """Delta chi^2 of a cause with the others fitted too.

    Of what only scatters it is what a variance in proportion would gain: half the sum of the
    squared ratios of the variances, where Gaussian readings have three times their square.
    """
    if law.effect == "jitter":
        return float(np.sum(bench.columns[:, number] ** 4) / 6)
    return float(bench.evidence[number])


def truth_of(
    family: str, scene: Scene, laws: list[Law], bench: Bench, background: int
) -> dict[str, Any]:
    """The truth in plain numbers."""
    effects = []
    plain = scene.world([]).motion.parameters
    for number, law in enumerate(laws, background):
        changed = scene.world([bench.causes[number]]).motion.parameters
        entry = {
            "effect": law.names[0],
            "also": list(law.names[1:]),
            "law": f"{law.effect}: {law.form}",
            "kind": kind_of(law.names[0]),
            "own_form": law.own,
            "delta_chi2": worth_of(law, bench, number),
            "alone_delta_chi2": float(bench.alone[number]),
            "size": bench.causes[number].size,
            "parameters": {k: float(v) for k, v in changed.items() if v != plain.get(k)},
        }
        if law.effect == "tone-pickup":
            entry["tone_hz"] = scene.tone_hz
        elif law.local and law.effect != "periodic-drive":
            entry |= {"instant_s": scene.instant_s, "tick_s": scene.tick_s}
        effects.append(entry)
    allowed = {"coarse-quantisation"} if scene.step > 0.5 * scene.noise_rms else set()
    if scene.event_driven:
        # The count changes at its edges whichever way it is passed: a play of one count.
        allowed |= {"coarse-quantisation", "sensor-backlash", "jitter"}
    if scene.red:
        allowed |= {"coloured-noise"}
    a, viscous, hysteretic, c = scene.rates
    return {
        "family": family,
        "apparatus": scene.apparatus + ", events" * scene.event_driven,
        "baseline": scene.baseline,
        "effects": effects,
        "present": [cause.name for cause in bench.causes[:background]],
        "allowed": sorted(allowed),
        "nuisances": {
            "frequency_hz": scene.frequency_hz,
            "amplitude_rad": scene.amplitude,
            "rates": [a, viscous + hysteretic, c],
            "noise_rms_rad": scene.noise_rms,
            "step_rad": scene.step,
            "red": scene.red,
            "readings": len(scene.time_s),
        },
        "total_delta_chi2": float(np.sum(bench.columns[:, background:].sum(axis=1) ** 2)),
        "oracle": None,
    }


def recorded(
    rng: Rng, scene: Scene, causes: list[Cause], noise: Noise | None
) -> dict[str, Array] | None:
    """Columns of the file; None where there are too few events, or too many."""
    if scene.event_driven:
        columns = events(rng, scene, causes)
        return columns if 500 <= len(columns["time_s"]) <= 60_000 else None

    def noisy(seen: Seen, y: Array) -> Array:
        if noise is None:
            return y + scene.noise(rng)
        return noise(rng, seen, y, np.hypot(seen.x, seen.v / scene.omega), scene.noise_rms)

    y, seen = scene.reading(causes, noise=noisy)
    if scene.step:
        y = scene.step * np.floor(y / scene.step + 0.5)
    return {"time_s": seen.time_s, "angle_rad": y}


def events(rng: Rng, scene: Scene, causes: list[Cause]) -> dict[str, Array]:
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


# ------------------------------------------------------------ what a set holds

ABSENT: Final = frozenset({"camera-geometry", "count-slips", "rolling-shutter"})
"""What a laboratory's converter can't have."""
EFFECTS: Final = tuple(effect for effect in CATALOGUE if effect not in ABSENT)
PHYSICS: Final = tuple(
    effect
    for effect in CATALOGUE
    if effect not in MEASUREMENT | ONLY_VISCOUS | {"circular-error", "amplitude-step"}
)
SIZES: Final = (4.0, 9.0, 16.0, 25.0, 50.0, 100.0, 400.0, 2500.0)
SHARES: Final = {
    "null": 0.34,
    "single": 0.33,
    "combination": 0.08,
    "tie": 0.05,
    "outside": 0.12,
    "withheld": 0.08,
}
"""Of a set; what rounding leaves goes to the nulls."""
PAIRS: Final = (
    ("cubic-stiffness", "tone-pickup", False),
    ("circular-error", "glitches", False),
    ("equilibrium-step", "sensor-quadratic", False),
    ("history-force", "clock-drift", False),
    ("frequency-step", "offset-drift", False),
    ("release-transient", "sensor-cubic", False),
    ("second-mode", "jitter", False),
    ("impulse", "cubic-damping", False),
    ("cubic-stiffness", "frequency-drift", True),
    ("sensor-cubic", "cubic-damping", True),
    ("damping-drift", "gain-drift", True),
    ("plane-coupling", "frequency-step", True),
)
"""First, second, whether the second is to hide the first."""
PAIR_SIZES: Final = ((50.0, 50.0), (400.0, 25.0), (400.0, 400.0))
TIES: Final = (
    *("equilibrium-creep", "offset-drift", "periodic-drive", "tone-pickup", "clock-drift"),
    *("frequency-drift", "damping-drift", "power-law-damping"),
)
"""Effects that one record can hardly tell from a rival."""
ROUNDS: Final[tuple[tuple[str, tuple[str, ...], tuple[float, ...]], ...]] = (
    ("tie", TIES, (50.0, 100.0, 400.0)),
    ("outside", tuple(OUTSIDE), (25.0, 100.0, 100.0, 400.0)),
    ("withheld", ("circular-error", "coulomb-friction", "quadratic-drag"), (1e4,)),
)
"""Families whose effects and sizes go round."""


def plan(count: int, rng: Rng) -> list[Recipe]:
    """What each item of a set hides, in an order that gives nothing away."""
    number = {name: int(share * count) for name, share in SHARES.items()}
    number["null"] += count - sum(number.values())
    recipes: list[Recipe] = [{"family": "null", "effects": [], "delta_chi2": []}] * number["null"]
    recipes += _singles(number["single"], rng)
    for i in range(number["combination"]):
        first, second, cancelling = PAIRS[i % len(PAIRS)]
        sizes = list(PAIR_SIZES[(i // len(PAIRS) + i) % len(PAIR_SIZES)])
        recipe = {"family": "combination", "effects": [first, second], "delta_chi2": sizes}
        recipes.append(recipe | {"cancelling": cancelling})
    for family, names, wanted in ROUNDS:
        begin = int(rng.integers(len(names)))
        recipes += [
            {
                "family": family,
                "effects": [names[(i + begin) % len(names)]],
                "delta_chi2": [wanted[i % len(wanted)]],
            }
            for i in range(number[family])
        ]
    rng.shuffle(recipes)
    return recipes


def _singles(count: int, rng: Rng) -> list[Recipe]:
    """Two in five singles are faults of the instrument; sizes go round."""
    faults = [e for e in EFFECTS if e in MEASUREMENT]
    physics = [e for e in EFFECTS if e not in MEASUREMENT]
    rng.shuffle(faults)
    rng.shuffle(physics)
    found = []
    for i in range(count):
        fault = i % 5 < 2
        pool = faults if fault else physics
        at = 2 * (i // 5) + i % 5 if fault else 3 * (i // 5) + i % 5 - 2
        # Each effect meets the sizes in turn, beginning anywhere.
        size = SIZES[(at // len(pool) * 3 + at) % len(SIZES)]
        recipe = {"family": "single", "effects": [pool[at % len(pool)]], "delta_chi2": [size]}
        found.append(recipe if at % 2 else recipe | {"own_form": False})
    return found
