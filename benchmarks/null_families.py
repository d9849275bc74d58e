"""False alarms and coverage on decays that lack nothing, under many kinds of noise.

    python -m benchmarks.null_families --number 300 [--family red] [--journal FILE] [--processes 2]

Each recording is a solution of Eq. 8 and noise, nothing else: every name, and every curve, is
false. The noise is made here, with numpy and scipy and no code of the library, so that
the library's own idea of noise is not what it is tried with. A recording is the function of its
family and its number.

The motion is the challenge's own. How the loss of a smoothed recording changes the motion itself is
a measurement effect of its own; here smoothing acts on the noise alone.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any, Final
from zlib import crc32

import numpy as np
from scipy import signal

from benchmarks import journal
from benchmarks.table import head, share, table_row
from pendpipe.arrays import FloatArray as Array
from pendpipe_challenge.world import Scene

RATES: Final = ("a", "b", "c", "frequency")
STATED: Final = frozenset({"coloured-noise"})
"""Effects that say what the noise is, and name no cause."""


# ---------------------------------------------------------------- the noise


@dataclass(frozen=True)
class Swing:
    """A recording without its noise: times, angle, amplitude, and the noise's rms, SI."""

    time_s: Array
    angle: Array
    level: Array
    noise_rms: float

    @property
    def rate_hz(self) -> float:
        """Readings a second."""
        return float(1 / (self.time_s[1] - self.time_s[0]))


Family = Callable[[np.random.Generator, Swing], Array]
"""What adds noise to a swing, and returns the readings."""


def _unit(noise: Array) -> Array:
    return (noise - noise.mean()) / noise.std()


def _coloured(rng: np.random.Generator, swing: Swing, power: Callable[[Array], Array]) -> Array:
    """Gaussian noise of a spectrum, rms 1; four times as long at first, so that it drifts too."""
    long = 4 * len(swing.time_s)
    frequency = np.fft.rfftfreq(long, 1 / swing.rate_hz)[1:]
    drawn = rng.normal(size=(2, len(frequency)))
    sizes = np.sqrt(power(frequency)) * (drawn[0] + 1j * drawn[1])
    return _unit(np.fft.irfft(np.r_[0, sizes], long)[: len(swing.time_s)])


def white(rng: np.random.Generator, swing: Swing) -> Array:
    """Each reading by itself."""
    return swing.angle + swing.noise_rms * rng.normal(size=len(swing.angle))


def memory(rng: np.random.Generator, swing: Swing) -> Array:
    """AR(1), phi 0.3 to 0.95; in every second one beside white noise of up to half its power."""
    phi, share = rng.uniform(0.3, 0.95), rng.uniform(0, 0.5) * rng.integers(2)
    drawn = rng.normal(size=len(swing.angle) + 1000)
    slow = signal.lfilter([np.sqrt(1 - phi**2)], [1, -phi], drawn)[1000:]
    noise = np.sqrt(1 - share) * slow + np.sqrt(share) * rng.normal(size=len(slow))
    return swing.angle + swing.noise_rms * noise


def red(rng: np.random.Generator, swing: Swing) -> Array:
    """Slope 0.5 to 3, corner 0.02 to 0.5 Hz: white above the corner, or level below it.

    Noise that is level below its corner stands on white noise of 0.1 to 0.5 of its rms.
    """
    slope, corner_hz = rng.uniform(0.5, 3), np.exp(rng.uniform(*np.log([0.02, 0.5])))
    if rng.integers(2):
        noise = _coloured(rng, swing, lambda f: 1 + (corner_hz / f) ** slope)
    else:
        noise = _coloured(rng, swing, lambda f: (1 + (f / corner_hz) ** 2) ** (-slope / 2))
        noise = _unit(noise + rng.uniform(0.1, 0.5) * rng.normal(size=len(noise)))
    return swing.angle + swing.noise_rms * noise


def changing(rng: np.random.Generator, swing: Swing) -> Array:
    """White, its sd falling by 3, growing by 3, or proportional to the amplitude down to 1/3."""
    run = np.linspace(0, 1, len(swing.angle))
    forms = (1.5 - run, 0.5 + run, np.maximum(swing.level / swing.level[0], 1 / 3))
    sd = forms[rng.integers(3)]
    sd = sd / np.sqrt(np.mean(sd**2))
    return swing.angle + swing.noise_rms * sd * rng.normal(size=len(run))


def heavy_tails(rng: np.random.Generator, swing: Swing) -> Array:
    """Student's t with 3 to 5 degrees of freedom, scaled to its standard deviation."""
    freedom = rng.uniform(3, 5)
    noise = rng.standard_t(freedom, size=len(swing.angle)) / np.sqrt(freedom / (freedom - 2))
    return swing.angle + swing.noise_rms * noise


def smoothed(rng: np.random.Generator, swing: Swing) -> Array:
    """A running mean of 3, 5 or 7, binomial weights of as many, or a Butterworth low pass."""
    width, kind = int(rng.choice([3, 5, 7])), rng.integers(3)
    drawn = rng.normal(size=len(swing.angle) + 1000)
    if kind == 2:
        order, edge = int(rng.integers(1, 5)), rng.uniform(0.15, 0.6)
        noise = signal.lfilter(*signal.butter(order, edge), drawn)
    else:
        weights = np.poly(-np.ones(width - 1)) if kind else np.ones(width)
        noise = signal.lfilter(weights, 1, drawn)
    return swing.angle + swing.noise_rms * _unit(noise[1000:])


def rounded(rng: np.random.Generator, swing: Swing) -> Array:
    """White noise and a converter of 8 to 16 bits, whose range is 1.2 to 3 times the swing."""
    span = 2 * rng.uniform(1.2, 3) * np.abs(swing.angle).max()
    step = span / 2.0 ** rng.integers(8, 17)
    noisy = white(rng, swing)
    return step * np.round(noisy / step)


def stand(rng: np.random.Generator, swing: Swing) -> Array:
    """A stand that sways of its own at random: one resonance of Q 3 to 15, over white noise.

    It lies at 0.05 to 0.8 of the Nyquist frequency; the white noise has 0.2 to 0.7 of its rms.
    """
    centre_hz = np.exp(rng.uniform(*np.log([0.05, 0.8]))) * swing.rate_hz / 2
    quality = np.exp(rng.uniform(*np.log([3, 15])))

    def power(frequency: Array) -> Array:
        ratio = frequency / centre_hz
        return 1 / ((1 - ratio**2) ** 2 + (ratio / quality) ** 2)

    sway = _coloured(rng, swing, power)
    noise = _unit(sway + rng.uniform(0.2, 0.7) * rng.normal(size=len(sway)))
    return swing.angle + swing.noise_rms * noise


def popcorn(rng: np.random.Generator, swing: Swing) -> Array:
    """An amplifier's burst noise: the level jumps between two, 1 to 4 sd of the white part apart.

    It dwells 0.1 to 10 s in each on average.
    """
    dwell_s = np.exp(rng.uniform(*np.log([0.1, 10]), size=2))
    level, at, state = np.empty(len(swing.angle)), 0, int(rng.integers(2))
    while at < len(level):
        end = at + 1 + int(rng.exponential(dwell_s[state]) * swing.rate_hz)
        level[at:end] = state
        at, state = end, 1 - state
    noise = _unit(rng.uniform(1, 4) * level + rng.normal(size=len(level)))
    return swing.angle + swing.noise_rms * noise


FAMILIES: Final[dict[str, Family]] = {
    "white": white,
    "memory": memory,
    "red": red,
    "changing": changing,
    "heavy-tails": heavy_tails,
    "smoothed": smoothed,
    "rounded": rounded,
    "stand": stand,
    "popcorn": popcorn,
}
TRUE_NAMES: Final = {"rounded": frozenset({"coarse-quantisation"})}
"""By family: what stands in the catalogue and is there."""


# ---------------------------------------------------------------- a recording


@dataclass(frozen=True)
class Null:
    """A recording that lacks nothing, and the pendulum that made it."""

    time_s: Array
    angle_rad: Array
    scene: Scene

    @property
    def rates(self) -> dict[str, float]:
        """What a fit should find."""
        a, viscous, hysteretic, c = self.scene.rates
        found = (a, viscous + hysteretic, c, self.scene.frequency_hz)
        return dict(zip(RATES, found, strict=True))


def draw(family: str, number: int) -> Null:
    """The recording of a family and a number, always the same."""
    rng = np.random.default_rng([crc32(family.encode()), number])
    while True:
        cycles, in_cycle = np.exp(rng.uniform(*np.log([[30, 10], [120, 60]])))
        readings = round(cycles * in_cycle)
        if 1000 <= readings <= 6000:
            break
    frequency = float(np.exp(rng.uniform(*np.log([0.3, 2]))))
    amplitude, falls_by = rng.uniform(0.05, 0.3), rng.uniform(0.5, 3.3)
    shares = rng.dirichlet([1, 1, 1]) * rng.permutation([1, 1, rng.integers(2)])
    # T = integral of dy/(a y^2 + b y + c) from y0 exp(-falls_by) to y0 sets the scale of all three.
    y = np.exp(-np.linspace(0, falls_by, 400))
    pace = shares @ np.array([y**2, y, np.full_like(y, 0.2)])
    scale = -np.trapezoid(1 / pace, y) * frequency / cycles
    hysteretic = rng.choice([0.0, 0.0, 1.0, rng.uniform()])
    linear = scale * shares[1]
    rates = (scale * shares[0] / amplitude, linear * (1 - hysteretic), linear * hysteretic)
    scene = Scene(
        apparatus=family,
        frequency_hz=frequency,
        rates=(*map(float, rates), float(scale * shares[2] * 0.2 * amplitude)),
        amplitude=float(amplitude),
        lead_s=float(rng.uniform() / frequency),
        offset=float(0.1 * amplitude * rng.uniform(-1, 1)),
        noise_rms=float(amplitude / np.exp(rng.uniform(*np.log([200, 5000])))),
        step=0.0,
        time_s=np.arange(readings) / (in_cycle * frequency),
    )
    angle, seen = scene.reading([])
    level = np.hypot(seen.x, seen.v / scene.omega)
    read = FAMILIES[family](rng, Swing(scene.time_s, angle, level, scene.noise_rms))
    return Null(scene.time_s, read, scene)


# ---------------------------------------------------------------- the answers


def answer(key: tuple[str, int]) -> dict[str, Any]:
    """Ask the library about one recording; what is needed of its answer."""
    import pendpipe as pp

    family, number = key
    null = draw(family, number)
    recording = pp.Recording(time_s=null.time_s, angle_rad=null.angle_rad)
    kept: dict[str, Any] = {"family": family, "number": number}
    before = time.process_time()
    try:
        content = pp.diagnose(recording).to_dict()
    except Exception as error:
        return kept | {"failed": repr(error), "cpu_s": time.process_time() - before}
    kept |= {"verdict": content["verdict"], "cpu_s": time.process_time() - before}
    if content["verdict"] == "not-analysable":
        return kept | {"reason": content["reason"]}
    found = content["improved"]["parameters"]
    covers: dict[str, bool | None] = {}
    for name, truth in null.rates.items():
        low, high = found[name]["interval95"] or (None, None)
        inside = (low is None or low <= truth) and (high is None or truth <= high)
        covers[name] = None if low is None and high is None else inside
    return kept | {
        "p_value": content["p_value"],
        "effects": [
            [effect["id"], effect["probability"]]
            for effect in content["effects"]
            if not effect["presumed"]
        ],
        "covers": covers,
        "chi2_per_dof": content["improved"]["chi2_per_dof"],
        "noise_ratio": content["noise_rms_rad"] / null.scene.noise_rms,
    }


def false_names(kept: dict[str, Any]) -> list[str]:
    """Names and curves that are not there."""
    true = STATED | TRUE_NAMES.get(kept["family"], frozenset())
    return [name for name, _ in kept.get("effects", []) if name not in true]


def row(title: str, kept: list[dict[str, Any]]) -> str:
    """One line of the table."""
    answered = [each for each in kept if "covers" in each]
    wrong = [names for each in answered if (names := false_names(each))]
    stated = sum(any(name in STATED for name, _ in each["effects"]) for each in answered)
    covers = {
        name: [c for each in answered if (c := each["covers"][name]) is not None] for name in RATES
    }
    every = [c for known in covers.values() for c in known]
    chi2, cpu_s = (
        [each[key] for each in some] for key, some in (("chi2_per_dof", answered), ("cpu_s", kept))
    )
    counts = Counter(name for names in wrong for name in set(names))
    cells = [len(kept), len(kept) - len(answered), share(len(wrong), len(answered)), stated]
    cells += [f"{100 * np.mean(known):.1f}" if known else "-" for known in covers.values()]
    cells += [share(sum(every), len(every))]
    cells += [f"{median(each):.2f}, {max(each):.2f}" if each else "-" for each in (chi2, cpu_s)]
    return table_row(title, [*cells, ", ".join(f"{name} {n}" for name, n in counts.items())])


SOURCES: Final = (
    *("src/pendpipe/**/*.py", "benchmarks/null_families.py"),
    "challenge/src/pendpipe_challenge/[mtw]o*.py",
)


def main() -> None:
    """Ask what has not been asked yet, and print a line a family."""
    parser = journal.judge_parser(__doc__, "null_families", 300)
    parser.add_argument("--family", action="append", choices=FAMILIES, help="repeatable")
    arguments = parser.parse_args()
    titles = ("family", "asked", "not answered", "false names, %", "noise stated", *"abcf")
    more = ("covered, %", "chi^2/dof, median and largest", "CPU s", "which")
    print(head(*titles, *more), flush=True)
    pooled = []
    for family in arguments.family or FAMILIES:
        keys = [(family, number) for number in range(arguments.number)]
        kept = list(journal.answers(arguments, keys, answer, SOURCES))
        pooled += kept
        print(row(family, kept), flush=True)
    print(row("pooled", pooled))


if __name__ == "__main__":
    main()
