"""Whether fit and diagnosis give the numbers of clean recordings of the law within their errors.

    python -m benchmarks.consistency [--number 200] [--seed N] [--fits] [--processes 2]
    python -m benchmarks.consistency --fits-only 3000

The recordings are integrated by `pendpipe_challenge.motion`, which shares no code with the
library: pendulums (sin x, angles) and every fourth a spring (x, displacements), Q 5 to 5000 at the
first amplitude, 0.01 to 2.5 rad, white noise of 1e-6 to 1e-2 of that amplitude, 12 to 1000 readings
a cycle, 5 to 1000 cycles; each loss alone and all together, the drag in the paper's energy form or
v|v|. A recording ends where the amplitude meets the noise. Where the Cramer-Rao error of Q exceeds
20 % a refusal is right: these are counted apart. It prints a line a recording as it goes, then the
rates by region and over all. A run that was stopped goes on. Exit status 1 where a rate misses what
is asked of it. The second form asks how often the one test of fit refutes a perfect
recording: it fits so many of one law, which differ in their noise alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, Final

import numpy as np

import pendpipe as pp
from benchmarks.journal import answers, judge_parser
from benchmarks.table import head, table_row
from pendpipe.arrays import FloatArray as Array
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian
from pendpipe.errors import InputError
from pendpipe.levels import REFUTED as LEVEL
from pendpipe_challenge.motion import Motion
from pendpipe_challenge.torques import of_rates

CODE: Final = ("src/pendpipe/**/*.py", "benchmarks/consistency.py", "challenge/src/*/motion.py")
MOST_READINGS: Final = 300_000
FEWEST_CYCLES: Final = 5.0
KINDS: Final = ("a", "b hysteretic", "b viscous", "c", "all")
QUANTITIES: Final = ("T0", "Q", "a", "b", "c")
REFUTED: Final = 0.003
"""Of perfect recordings, that may be red: three times the level of the test."""
UNDECIDABLE: Final = 0.2
"""Cramer-Rao error of Q, relative, from which a refusal is right."""


@dataclass(frozen=True)
class Truth:
    """One recording's law and how it is recorded; SI, radians (metres for a spring)."""

    number: int
    sine: bool
    speed: bool
    kind: str
    omega: float
    amplitude: float
    a: float
    hysteretic: float
    viscous: float
    c: float
    quality: float
    noise: float
    per_cycle: float
    cycles: float
    phase: float
    offset: float

    @property
    def b(self) -> float:
        return self.hysteretic + self.viscous

    @property
    def law(self) -> Eq8:
        """The same in the energy form, for the Cramer-Rao bound."""
        torque: Any = "sine" if self.sine else "linear"
        return Eq8(self.omega, self.a, self.hysteretic, self.viscous, self.c, torque)

    def value(self, name: str) -> float:
        """T0 in s, Q at the first amplitude to first order, a, b, c."""
        if name == "T0":
            return 2.0 * math.pi / self.omega
        return self.quality if name == "Q" else float(getattr(self, name))


def draw(number: int, seed: int) -> Truth:
    """Draw a recording's law."""
    rng = np.random.default_rng([seed, number])

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    frequency, amplitude, quality = log(0.3, 3.0), log(0.01, 2.5), log(5.0, 5000.0)
    omega = 2.0 * math.pi * frequency
    kind = KINDS[number % len(KINDS)]
    share = rng.dirichlet(np.ones(4)) if kind == "all" else np.eye(4)[KINDS.index(kind)]
    losses = 0.5 * omega / quality * share
    relative = log(1e-6, 1e-2)
    # Dry friction stops a pendulum of Q after Q/pi cycles.
    while (most := _lasts(losses, relative) * frequency) < FEWEST_CYCLES:
        losses, quality = losses / 1.5, quality * 1.5
    per_cycle, cycles = log(12.0, 1000.0), min(log(FEWEST_CYCLES, 1000.0), most)
    return Truth(
        number=number,
        sine=number % 4 != 3,
        speed=bool(share[0] > 0.0 and rng.random() < 0.5),
        kind=kind,
        omega=omega,
        amplitude=amplitude,
        a=float(losses[0]) / amplitude,
        hysteretic=float(losses[1]),
        viscous=float(losses[2]),
        c=float(losses[3]) * amplitude,
        quality=quality,
        noise=relative * amplitude,
        per_cycle=min(per_cycle, MOST_READINGS / cycles),
        cycles=cycles,
        phase=float(rng.uniform(0.0, 1.0)),
        offset=float(rng.uniform(-0.02, 0.02)) * amplitude,
    )


def _lasts(losses: Array, relative: float) -> float:
    """Time until the amplitude has fallen to the noise, s."""
    y = np.geomspace(1.0, relative, 4000)
    fall = losses[0] * y**2 + (losses[1] + losses[2]) * y + losses[3]
    return float(np.sum(-np.diff(y) * 0.5 * (1.0 / fall[1:] + 1.0 / fall[:-1])))


def recorded(truth: Truth, seed: int) -> tuple[Array, Array]:
    """Times from the release on and noisy readings, shape (n,)."""
    rng = np.random.default_rng([seed, truth.number, 1])
    period = 2.0 * math.pi / truth.omega
    interval = period / truth.per_cycle
    count = max(int(truth.cycles * truth.per_cycle), 24)
    rates = (truth.omega, truth.a, truth.viscous, truth.hysteretic, truth.c)
    law = of_rates(*rates, speed=truth.speed) | {"sine": float(truth.sine), "step_phase": 0.05}
    time_s = truth.phase * period + interval * np.arange(count)
    angle = Motion(law, truth.amplitude).run(np.r_[0.0, time_s]).angle_rad[1:] + truth.offset
    return time_s, angle + truth.noise * rng.standard_normal(count)


def cramer_rao_of_quality(truth: Truth, time_s: Array) -> float:
    """Relative error of Q at the first amplitude that no unbiased estimate falls below."""
    thin = time_s[:: max(len(time_s) // 50_000, 1)]
    release = Release(0.0, truth.amplitude, truth.offset)
    _, jacobian = sample_with_jacobian(truth.law, release, thin)
    jacobian = jacobian * math.sqrt(len(time_s) / len(thin)) / truth.noise
    merged = np.delete(jacobian, 2, axis=1)
    merged[:, 1] = 0.5 * (jacobian[:, 1] + jacobian[:, 2])
    scale = np.linalg.norm(merged, axis=0)
    keep = scale > 0.0
    inverse = np.linalg.pinv((merged / np.where(keep, scale, 1.0)), rcond=1e-12)
    y = truth.amplitude
    slope = np.zeros(merged.shape[1])
    slope[:3] = y, 1.0, 1.0 / y
    relative = slope / (y * truth.a + truth.b + truth.c / y) / np.where(keep, scale, 1.0)
    return float(np.linalg.norm(relative @ inverse))


@dataclass
class Found:
    """What the library says of one recording."""

    truth: Truth
    bound: float
    readings: int
    seconds: float = 0.0
    refused: str = ""
    light: str = ""
    reason: str = ""
    pulls: dict[str, float] = field(default_factory=dict)
    covered: dict[str, bool] = field(default_factory=dict)
    """Of values at a bound: whether the interval covers the truth."""
    noise: float = math.nan
    p_value: float | None = None
    restoring: str = ""
    verdict: str = ""
    names: tuple[str, ...] = ()
    diagnosed_noise: float = math.nan
    same_test: bool = True

    @property
    def decidable(self) -> bool:
        return self.bound < UNDECIDABLE

    @property
    def noise_is_right(self) -> bool:
        """Of fit and diagnosis, to 5 % or to what its readings tell."""
        # What lies behind the decay tells nothing of the noise that was found.
        allowed = max(0.05, 3.0 / math.sqrt(2.0 * self.readings))
        found = [self.noise, self.diagnosed_noise] if self.verdict else [self.noise]
        return all(abs(noise / self.truth.noise - 1.0) <= allowed for noise in found)


def judge(truth: Truth, seed: int, *, diagnose: bool) -> Found:
    """Fit (and diagnose) one recording, and compare with the truth."""
    time_s, values = recorded(truth, seed)
    found = Found(truth, cramer_rao_of_quality(truth, time_s), len(values))
    named: dict[str, Any] = {"angle_rad" if truth.sine else "displacement_m": values}
    recording = pp.Recording(time_s=time_s, **named)
    begun = time.process_time()
    try:
        result = pp.fit(recording)
    except InputError as refusal:
        found.refused = refusal.problem
        return found
    finally:
        found.seconds = time.process_time() - begun
    found.light, found.reason, found.readings = result.light, result.light_reason, result.samples
    found.restoring = result.restoring
    found.noise = result.noise_rms_rad
    found.p_value = getattr(result, "fit_p_value", None)
    _compare(found, result)
    if diagnose:
        try:
            answer = pp.diagnose(recording).to_dict()
        except InputError as refusal:
            found.refused = f"diagnose: {refusal.problem}"
            return found
        effects = [each for each in answer.get("effects", ()) if not each.get("presumed")]
        found.verdict = answer["verdict"]
        found.names = tuple(each["id"] for each in effects)
        found.diagnosed_noise = answer.get("noise_rms_rad") or math.nan
        p = answer.get("baseline", {}).get("fit_p_value")
        # One p is one verdict: that of the fit is whether it lies below the level.
        found.same_test = found.p_value is None or p == found.p_value
        found.seconds = time.process_time() - begun
    return found


def _compare(found: Found, result: Any) -> None:
    truth, y = found.truth, found.truth.amplitude
    frequency = result["frequency"]
    relative = (frequency.value - truth.omega / (2.0 * math.pi)) / frequency.sd
    found.pulls["T0"] = -relative
    matrix = result.covariance_of("a", "b", "c")
    slope = np.array([y, 1.0, 1.0 / y])
    fitted = float(slope @ [result.value(name) for name in "abc"])
    true = float(slope @ [truth.a, truth.b, truth.c])
    bounded = any(result[name].at_bound for name in "abc")
    sd = math.sqrt(max(float(slope @ matrix @ slope), 0.0))
    if not bounded:
        found.pulls["Q"] = -(fitted - true) / sd if sd > 0.0 else math.inf
    for name in "abc":
        estimate = result[name]
        if bounded:
            low, high = estimate.bounds95
            slack = 1e-6 * abs(truth.value(name))
            found.covered[name] = bool(low - slack <= truth.value(name) <= high + slack)
        elif estimate.sd > 0.0:
            found.pulls[name] = (estimate.value - truth.value(name)) / estimate.sd


REGIONS: Final[dict[str, Callable[[Found], bool]]] = {
    "Q below 30": lambda f: f.truth.quality < 30,
    "Q from 300": lambda f: f.truth.quality >= 300,
    "below 0.1 rad": lambda f: f.truth.sine and f.truth.amplitude < 0.1,
    "from 1 rad": lambda f: f.truth.sine and f.truth.amplitude >= 1.0,
    "springs": lambda f: not f.truth.sine,
    "noise below 3e-5": lambda f: f.truth.noise < 3e-5 * f.truth.amplitude,
    "noise from 1e-3": lambda f: f.truth.noise >= 1e-3 * f.truth.amplitude,
    "below 24 a cycle": lambda f: f.truth.per_cycle < 24,
    "below 20 cycles": lambda f: f.truth.cycles < 20,
    "from 200 cycles": lambda f: f.truth.cycles >= 200,
    "drag v²": lambda f: f.truth.speed,
    **{kind: lambda f, kind=kind: f.truth.kind == kind for kind in KINDS},  # type: ignore[misc]
    "all": lambda _: True,
}


def rates(found: list[Found]) -> list[tuple[str, str, bool]]:
    """What is counted of some recordings: its name with what is asked, its size, if that holds."""
    fitted = [each for each in found if not each.refused]
    diagnosed = [each for each in fitted if each.verdict]
    pulls = [abs(pull) for each in fitted for pull in each.pulls.values()]
    covered = [inside for each in fitted for inside in each.covered.values()]
    counted = [
        (
            *("refused or red (at most 1 %)", 0.01),
            [bool(each.refused) or each.light == "red" for each in found],
        ),
        (*("not green (at most 15 %)", 0.15), [each.light != "green" for each in found]),
        (*("beyond 3 sd (at most 1 %)", 0.01), [pull > 3.0 for pull in pulls]),
        (*("beyond 4 sd (at most one)", 0.0), [pull > 4.0 for pull in pulls]),
        (*("outside at a bound (at most 7 %)", 0.07), [not inside for inside in covered]),
        (*("false names (at most 2.5 %)", 0.025), [bool(each.names) for each in diagnosed]),
        (*("noise wrong (none)", None), [not each.noise_is_right for each in fitted]),
        (*("another test of fit (none)", None), [not each.same_test for each in diagnosed]),
    ]
    rows = []
    for what, share, hits in counted:
        # With few recordings chance alone may make one.
        most = 0 if share is None else max(1, share * len(hits))
        rows.append((what, f"{sum(hits)} of {len(hits)}", sum(hits) <= most))
    for name in QUANTITIES:
        own = [each.pulls[name] for each in fitted if name in each.pulls]
        rms = math.sqrt(sum(pull**2 for pull in own) / max(len(own), 1))
        least = 0.85 if name in ("T0", "Q") and own else 0.0
        rows.append((f"rms {name} ({least:g} to 1.15)", f"{rms:.2f}", least <= rms <= 1.15))
    return rows


def line(found: Found) -> str:
    """What one recording was and what came of it."""
    truth = found.truth
    law = f"{'sin x' if truth.sine else 'x'}{', v|v|' if truth.speed else ''}, {truth.kind}"
    about = (
        f"{truth.number:4d} {law:24s} Q {truth.quality:6.3g} {truth.amplitude:6.3g} rad"
        f" noise {truth.noise / truth.amplitude:7.1e} {truth.per_cycle:5.3g} a cycle,"
        f" {truth.cycles:5.3g} cycles: {found.seconds:5.2f} s  {found.light or found.refused}"
    )
    pulls = " ".join(f"{name} {pull:+.1f}" for name, pull in found.pulls.items())
    outside = [name for name, inside in found.covered.items() if not inside]
    more = {
        "outside": outside,
        "names": found.names,
        "noise x": "" if found.noise_is_right else f"{found.noise / truth.noise:.3g}",
        "torque": found.restoring if (found.restoring == "sine") != truth.sine else "",
        "Q open by": "" if found.decidable else f"{found.bound:.2g}",
        "": found.reason if found.light != "green" else "",
    }
    return " ".join([about, pulls, *(f"{key} {what}" for key, what in more.items() if what)])


def _judge(key: tuple[int, int, bool]) -> dict[str, Any]:
    number, seed, diagnosed = key
    return asdict(judge(draw(number, seed), seed, diagnose=diagnosed))


def _perfect(seed: int) -> tuple[str, float]:
    """Light and p of the test of fit of one perfect recording: fig. 8's law at 0.1 rad."""
    law = Eq8(2.0 * math.pi * 0.516, 0.45, 0.00596, 0.00596, 1.4e-6, "sine")
    time_s = np.linspace(0.0, 280.0, 16_384)
    noise = 1e-4 * np.random.default_rng([seed, 2]).standard_normal(len(time_s))
    values = sample(law, Release(-0.1, 0.1), time_s) + noise
    found = pp.fit(pp.Recording(time_s=time_s, angle_rad=values))
    return found.light, 1.0 if found.fit_p_value is None else found.fit_p_value


def main() -> int:
    """Judge recording after recording; print the rates."""
    parser = judge_parser(__doc__, "consistency", 200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--fits", action="store_true", help="no diagnoses")
    parser.add_argument("--fits-only", type=int, metavar="N", help="one law with N kinds of noise")
    arguments = parser.parse_args()
    ask = partial(answers, arguments, sources=CODE)
    if number := arguments.fits_only:
        first = arguments.seed * 1_000_000
        perfect = list(ask(range(first, first + number), _perfect))
        red = sum(light == "red" for light, _ in perfect)
        print(
            f"{number} perfect recordings of one law: {red} red (at most {REFUTED:.1%}),"
            f" {sum(light == 'green' for light, _ in perfect)} green,"
            f" {sum(p < LEVEL for _, p in perfect)} refuted (at the level of {LEVEL:g})"
        )
        return int(red > REFUTED * number)
    found = []
    for kept in ask(
        [(n, arguments.seed, not arguments.fits) for n in range(arguments.number)], _judge
    ):
        found.append(Found(**kept | {"truth": Truth(**kept["truth"])}))
        print(line(found[-1]), flush=True)
    decidable = [each for each in found if each.decidable]
    print(
        f"\n{len(found) - len(decidable)} whose Q is open by more than {UNDECIDABLE:.0%} are apart"
    )
    print(head("recordings", "n", *(what for what, *_ in rates(decidable))))
    for name, inside in REGIONS.items():
        if some := [each for each in decidable if inside(each)]:
            print(table_row(name, [len(some), *(size for _, size, _ in rates(some))]))
    print("missed:", ", ".join(what for what, _, holds in rates(decidable) if not holds) or "none")
    return int(not all(holds for *_, holds in rates(decidable)))


if __name__ == "__main__":
    raise SystemExit(main())
