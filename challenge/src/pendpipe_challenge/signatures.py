"""What each effect of the catalogue changes in the reading, and how well it can be known.

An effect may have several shapes (exponents, moments, frequencies): each is a subspace of
one or two directions, whitened and without what the baseline absorbs, and the effect's score
is the largest of them. Tones are looked for at every frequency at once. Random effects,
spikes, codes and colour are no directions: their score is 2 ln(likelihood ratio).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe_challenge.bench import Bench
from pendpipe_challenge.chain import play
from pendpipe_challenge.scenario import Scenario, Whitening

BLOCKS: Final = 48
"""Moments at which steps are looked for, over the record."""
PHASES: Final = 8
"""Moments within the cycle at each of them."""


@dataclass(frozen=True)
class Shape:
    """One shape of one effect.

    Parameters
    ----------
    effect
        Identifier of the contract.
    columns
        Orthonormal whitened directions, baseline taken out, shape (kept, 1 or 2).
    parameter
        The motion's parameter that is its strength, where a refit can move it.
    details
        The motion's other parameters of this shape; those in `free` move in a refit.
    free
        Names of shape parameters that a refit may move.
    step
        Step of `parameter` for differences.
    """

    effect: str
    columns: FloatArray
    parameter: str = ""
    details: tuple[tuple[str, float], ...] = ()
    free: tuple[str, ...] = ()
    step: float = 0.0


def laws(bench: Bench) -> Iterator[tuple[str, str, float, dict[str, float], tuple[str, ...]]]:
    """Torques whose signature is integrated: effect, parameter, step, details, free shapes."""
    omega, span = bench.scenario.omega, bench.scenario.span_s
    a = float(np.hypot(bench.track.angle_rad[0], bench.track.rate_rad_s[0] / omega))
    top, cycle = omega * a, 2.0 * np.pi / omega
    rate = bench.sizes["gamma"]
    phase = bench.sizes["omega"]
    yield "circular-error", "sine", phase / a**2 * 16, {}, ()
    yield "cubic-stiffness", "cubic", phase / a**2 * 3, {}, ()
    yield "quadratic-stiffness", "square", 1e-4 / a, {}, ()
    if bench.scenario.baseline == "viscous":
        yield "coulomb-friction", "coulomb", bench.sizes["coulomb"], {}, ()
        yield "quadratic-drag", "quadratic", bench.sizes["quadratic"], {}, ()
    yield "drag-form", "drag", rate / top, {}, ()
    for n in (0.5, 1.5, 2.5):
        step = rate * top ** (1.0 - n)
        yield "power-law-damping", "power", step, {"power_exponent": n}, ("power_exponent",)
    for e in (0.25, 0.75):
        step = rate * top ** (1.0 - 2.0 * e)
        yield "power-law-damping", "energy", step, {"energy_exponent": e}, ("energy_exponent",)
    yield "cubic-damping", "rayleigh", rate / top**2, {}, ()
    yield "cubic-damping", "van_der_pol", rate / a**2, {}, ()
    for share in (0.08, 0.25):
        yield (
            "stribeck-friction",
            "stribeck",
            rate * top,
            {"stribeck_speed": share * top},
            ("stribeck_speed",),
        )
    for share in (0.15, 0.5):
        yield (
            "presliding-friction",
            "dahl",
            3 * rate / omega,
            {"dahl_reach": share * a},
            ("dahl_reach",),
        )
    yield "history-force", "basset", rate / np.sqrt(omega), {}, ()
    for share in (0.45, 0.7):
        yield (
            "vortex-shedding",
            "shedding",
            rate * omega,
            {"shedding_amplitude": share * a},
            ("shedding_amplitude",),
        )
    for tau in (0.0, span / 3.0):
        yield (
            "frequency-drift",
            "omega_drift",
            phase / span,
            {"omega_drift_time": tau},
            () if tau == 0.0 else ("omega_drift_time",),
        )
        yield (
            "damping-drift",
            "gamma_drift",
            rate / span,
            {"gamma_drift_time": tau},
            () if tau == 0.0 else ("gamma_drift_time",),
        )
    for cycles in (1.0, 2.5, 6.0):
        yield (
            "release-transient",
            "release",
            rate * span / cycle / 10,
            {"release_time": cycles * cycle},
            ("release_time",),
        )


def integrated(bench: Bench) -> Iterator[Shape]:
    """Signatures by central differences of trajectories."""
    base = bench.truth.motion
    time = bench.scenario.time_s
    for effect, name, step, details, free in laws(bench):
        held = base.value(name)
        up = base.changed(**{name: held + step}, **details).run(time).angle_rad
        down = base.changed(**{name: held - step}, **details).run(time).angle_rad
        column = bench.gain * (up - down)[bench.kept] / (2.0 * step)
        yield from _shape(bench, effect, column, name, details, free, step)
    step = 2e-4 * float(np.abs(bench.track.angle_rad).max())
    moved = base.changed(play=step).run(time).angle_rad - bench.track.angle_rad
    yield from _shape(bench, "backlash", bench.gain * moved[bench.kept] / step, "play")


def instrument(bench: Bench) -> Iterator[Shape]:
    """Signatures of the reading itself: they need no trajectory."""
    kept = bench.kept
    time = bench.scenario.time_s[kept]
    span = bench.scenario.span_s
    x, v = bench.track.angle_rad[kept], bench.track.rate_rad_s[kept]
    relaxing = {tau: -np.expm1(-time / tau) for tau in (span / 30, span / 10, span / 3)}
    yield from _shape(bench, "sensor-quadratic", x**2)
    yield from _shape(bench, "sensor-cubic", x**3)
    width = 2.0 * bench.scenario.sd_rad
    yield from _shape(bench, "sensor-backlash", play(x, width) - x)
    for effect in ("offset-drift", "equilibrium-creep", "ac-coupling"):
        yield from _shape(bench, effect, time)
        for slow in relaxing.values():
            yield from _shape(bench, effect, slow)
    yield from _shape(bench, "offset-drift", time**2)
    yield from _shape(bench, "equilibrium-creep", np.log1p(time / (span / 20)))
    yield from _shape(bench, "gain-drift", time * x)
    yield from _shape(bench, "gain-drift", relaxing[span / 3] * x)
    yield from _shape(bench, "clock-drift", time**2 * v)
    tau = span / 3
    yield from _shape(bench, "clock-drift", (time + tau * np.expm1(-time / tau)) * v)
    high, low = x.max(), x.min()
    for share in (0.01, 0.03, 0.08, 0.18, 0.35):
        upper = np.maximum(x - high * (1 - share), 0.0)
        lower = np.minimum(x - low * (1 - share), 0.0)
        for cut in (upper, lower, upper + lower):
            yield from _shape(bench, "clipping", -cut)


def beats(bench: Bench) -> Iterator[Shape]:
    """A second swing near the pendulum's own frequency, decaying as it does."""
    omega, time = bench.scenario.omega, bench.scenario.time_s[bench.kept]
    track = bench.track
    swing = np.hypot(track.angle_rad, track.rate_rad_s / omega)[bench.kept]
    for number in (*np.arange(0.5, 3.1, 0.5), 4.0, 5.0):
        for sign in (-1.0, 1.0):
            angle = (omega + sign * 2.0 * np.pi * number / bench.scenario.span_s) * time
            yield from _shape(
                bench,
                "plane-coupling",
                swing[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1),
            )


def moments(bench: Bench) -> IntArray:
    """Indices of samples at which steps are looked for: blocks, and phases in each."""
    per_cycle = 2.0 * np.pi / bench.scenario.omega / bench.scenario.interval_s
    edge = max(3, int(0.02 * bench.count))
    blocks = np.linspace(edge, bench.count - edge - per_cycle, BLOCKS)
    found = (blocks[:, None] + per_cycle * np.arange(PHASES) / PHASES).astype(int)
    return np.asarray(np.clip(found, 1, bench.count - 5))


def steps(bench: Bench) -> Iterator[tuple[str, FloatArray]]:
    """Signatures of sudden changes, by the propagator: effect and columns (kept, moments)."""
    kept, at = bench.kept, moments(bench)
    motion = bench.propagator[kept]
    time = np.arange(bench.count)

    def after(places: IntArray, state: FloatArray, more: FloatArray | float) -> FloatArray:
        """H(t - t0)·(response to a change of state at t0, plus more)."""
        start = np.einsum("pij,pj->pi", bench.back[kept][places], state)
        response: FloatArray = motion[:, 0, :] @ start.T + more
        return np.asarray(bench.gain * np.where(time[:, None] >= places, response, 0.0))

    every, first = at.ravel(), at[:, 0]
    ones, zeros = np.ones(len(every)), np.zeros(len(every))
    yield "impulse", after(every, np.stack([zeros, ones], 1), 0.0)
    yield "equilibrium-step", after(every, np.stack([-ones, zeros], 1), 1.0)
    state = np.column_stack([bench.track.angle_rad, bench.track.rate_rad_s])[kept]
    yield "amplitude-step", after(first, state[first], 0.0)
    for effect, name in (("frequency-step", "omega"), ("damping-step", "gamma")):
        change = bench.state_change(name)[kept]
        yield effect, after(first, -change[first], change[:, :1])


def _shape(
    bench: Bench,
    effect: str,
    columns: FloatArray,
    parameter: str = "",
    details: dict[str, float] | None = None,
    free: tuple[str, ...] = (),
    step: float = 0.0,
) -> Iterator[Shape]:
    """Whiten, project, normalise; nothing where the baseline absorbs it."""
    columns = columns.reshape(bench.count, -1)
    white = bench.whiten(columns)
    if not np.isfinite(white).all():
        return
    left = bench.off(white)
    size = np.linalg.norm(left, axis=0)
    if (size <= 1e-7 * np.linalg.norm(white, axis=0)).any():
        return
    unit = left / size
    if unit.shape[1] == 2:
        unit = np.linalg.qr(unit)[0]
    pairs = tuple(sorted((details or {}).items()))
    yield Shape(effect, unit, parameter, pairs, free, step)


def smooth_length(count: int) -> int:
    """The next number with no factors above 5, which Fourier transforms like."""
    while True:
        rest = count
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return count
        count += 1


class Tones:
    """Scores of the subspaces {cos, sin} at all frequencies, for many residuals at once.

    Whitened noise is white, so a frequency's score is its periodogram, whatever the colour.
    """

    def __init__(self, bench: Bench) -> None:
        self.length = smooth_length(2 * bench.count)
        interval = bench.scenario.interval_s
        hertz = np.fft.rfftfreq(self.length, interval)
        line, span = bench.scenario.omega / 2 / np.pi, bench.count * interval
        time = interval * np.arange(bench.count)
        clear = (np.abs(hertz - line) > 2.5 / span) & (hertz > 1.5 / span)
        clear &= hertz < 0.49 / interval
        ringing = clear & (hertz > 1.8 * line)
        self.windows: list[tuple[str, FloatArray, BoolArray]] = [
            ("tone-pickup", np.ones(bench.count), clear)
        ]
        for cycles in (8.0, 25.0):
            self.windows.append(("second-mode", np.exp(-time * line / cycles), ringing))

    def scores(self, residuals: FloatArray) -> dict[str, FloatArray]:
        """Largest score of each effect; `residuals` (kept, draws), whitened and projected."""
        found: dict[str, FloatArray] = {}
        for effect, window, allowed in self.windows:
            spectrum = np.fft.rfft(residuals.T * window, self.length, axis=1)[:, allowed]
            power = np.abs(spectrum) ** 2 / (0.5 * float(np.sum(window**2)))
            best = power.max(axis=1) if power.size else np.zeros(residuals.shape[1])
            found[effect] = np.maximum(found.get(effect, 0.0), best)
        # A drive's response is a tone and a free swing, which the baseline absorbs.
        found["periodic-drive"] = found["tone-pickup"]
        return found


DRAWS = 48


def excess(eigenvalues: FloatArray) -> float:
    """Sum of lambda - ln(1 + lambda): covariance 1 + lambda tested against 1."""
    return float(np.sum(eigenvalues - np.log1p(eigenvalues)))


def wander(bench: Bench) -> tuple[FloatArray, FloatArray]:
    """Modes of a white acceleration's response, whitened and off the baseline.

    Returns
    -------
    tuple
        Orthonormal modes, shape (kept, modes), and their variance in units of the noise
        for a one-sided root density of 1 rad/s^2/sqrt(Hz).
    """
    motion = bench.propagator
    inverse = bench.back[bench.kept]
    unit = np.random.default_rng(0).standard_normal((bench.count, DRAWS))
    kicks = np.sqrt(0.5 * bench.scenario.interval_s) * unit
    summed = np.cumsum(inverse[:, :, 1, None] * kicks[:, None, :], axis=0)
    response = np.einsum("nj,njm->nm", motion[bench.kept][:, 0, :], summed)
    white = bench.off(bench.whiten(bench.gain * response))
    modes, sizes, _ = np.linalg.svd(white, full_matrices=False)
    return modes, sizes**2 / DRAWS


def jitter_weights(bench: Bench) -> FloatArray:
    """Variance of the kept readings for a clock error of 1 s rms, in units of the noise."""
    rate = bench.gain * bench.track.rate_rad_s[bench.kept] / bench.scenario.sd_rad
    return np.asarray(rate**2)


def jitter_excess(weights: FloatArray, jitter_s: float) -> float:
    """Expected 2 ln L of a variance that follows v^2, the noise level being free."""
    spread = 1.0 + weights * jitter_s**2
    return float(len(spread) * np.log(spread.mean()) - np.log(spread).sum())


def expected_counts(scenario: Scenario, codes: IntArray, used: IntArray) -> FloatArray:
    """How often each of `codes` would come; `used` are an ideal converter's codes."""
    sd = scenario.noise.white_sd / scenario.chain.step_rad
    low, high = int(used.min()) - 8, int(used.max()) + 9
    histogram = np.bincount(used - low, minlength=high - low).astype(float)
    reach = np.arange(-8, 9)
    spread = np.exp(-0.5 * (reach / np.hypot(sd, 0.3)) ** 2)
    smooth = np.convolve(histogram, spread / spread.sum(), mode="same")
    return np.asarray(smooth[np.clip(codes - low, 0, len(smooth) - 1)])


def missing_excess(scenario: Scenario) -> float:
    """2 ln L of codes that never come, their readings going to the next code."""
    missing = np.array(scenario.chain.missing_codes)
    plain = scenario.with_chain(missing_codes=())
    volts = plain.chain.volts(plain.track(), plain.samples)
    counts = expected_counts(plain, missing, plain.chain.codes(volts))
    return float(4.0 * np.log(2.0) * counts.sum())


def coloured_excess(with_it: Scenario, without: Scenario) -> float:
    """2 ln L of the noise's colour, whose spectrum is known to the oracle."""
    slow = with_it.noise.slow(with_it.time_s)
    whitening = Whitening(without.sd_rad, slow)
    ratio = 1.0 / (1.0 - whitening.shrink) ** 2 - 1.0
    return excess(ratio)


SPIKES = 5
"""So many wild samples at most are single faults."""


class Specials:
    """2 ln L, by effect, of random effects and faults; the oracle knows the noise."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.weights = jitter_weights(bench)
        self.left = 1.0 - np.sum(bench.basis**2, axis=1)
        self.modes, self.sizes = wander(bench)

    def of_residuals(self, residuals: FloatArray) -> dict[str, FloatArray]:
        """Scores that need the whitened residuals alone, (kept, draws)."""
        return {
            "jitter": self._jitter(residuals),
            "glitches": self._spikes(residuals),
            "broadband-drive": self._wander(residuals),
            "coloured-noise": self._colour(residuals),
        }

    def of_codes(self, codes: IntArray) -> dict[str, float]:
        """Scores of the converter's faults from one record's codes."""
        scenario = self.bench.scenario
        found = {"coarse-quantisation": 0.0, "missing-codes": 0.0}
        step = int(np.gcd.reduce(np.diff(np.unique(codes)))) if len(np.unique(codes)) > 1 else 1
        half = 2 ** (scenario.chain.bits - 1)
        if step > 1 and codes.min() > -half and codes.max() < half - 1:
            found["coarse-quantisation"] = 2.0 * len(codes) * np.log(step)
            return found
        reading = self.bench.reading(self.bench.truth)
        volts = reading * scenario.chain.nominal_volts_per_radian
        ideal = np.rint(volts / scenario.chain.step_volts).astype(np.int64)
        there, count = np.unique(codes, return_counts=True)
        inner = np.arange(there[0] + 1, there[-1])
        absent = np.setdiff1d(inner, there)
        expected = expected_counts(scenario, absent, ideal)
        above = expected_counts(scenario, absent + 1, ideal)
        taken = np.zeros(len(absent))
        place = np.searchsorted(there, absent + 1)
        place = np.clip(place, 0, len(there) - 1)
        hit = there[place] == absent + 1
        taken[hit] = count[place[hit]]
        ratio = np.log((above + expected + 1e-12) / (above + 1e-12))
        # Any of the codes may be absent by chance: each pays for the choice among all.
        gain = 2.0 * taken * ratio
        single = gain - 2.0 * np.log(max(len(inner), 1)) - 4.0
        found["missing-codes"] = max(
            float(np.sum(single[single > 0.0])), _combs(inner, absent, gain)
        )
        return found

    def _jitter(self, residuals: FloatArray) -> FloatArray:
        square, count = residuals**2, residuals.shape[0]
        plain = count * np.log(square.mean(0))
        best = np.zeros(residuals.shape[1])
        top = self.weights.max()
        for ratio in (0.05, 0.15, 0.5, 1.5, 5.0, 30.0):
            spread = 1.0 + self.weights / top * ratio
            fit = count * np.log((square / spread[:, None]).mean(0)) + np.log(spread).sum()
            best = np.maximum(best, plain - fit)
        return best

    def _spikes(self, residuals: FloatArray) -> FloatArray:
        size = np.abs(residuals) / np.sqrt(self.left)[:, None]
        size = as_gaussian(size, self.bench.scenario.noise.freedom)
        wildest = np.sort(size, axis=0)[::-1][:SPIKES] ** 2
        # The first one's place is paid for by the level; each further one pays its own.
        more = np.maximum(wildest[1:] - 2.0 * np.log(len(size)) - 2.0, 0.0)
        return np.asarray(wildest[0] + more.sum(0))

    def _wander(self, residuals: FloatArray) -> FloatArray:
        power = (self.modes.T @ residuals) ** 2
        best = np.zeros(residuals.shape[1])
        for strength in np.geomspace(1.0, 1e6, 13) / max(self.sizes[0], 1e-300):
            spread = 1.0 + strength * self.sizes
            gain = power.T @ (1.0 - 1.0 / spread) - np.log(spread).sum()
            best = np.maximum(best, gain)
        return best

    def _colour(self, residuals: FloatArray) -> FloatArray:
        """Low frequencies stronger than in the known spectrum."""
        count = residuals.shape[0]
        length = smooth_length(count)
        # Padding correlates neighbours a little; the bins are few per cent closer only.
        power = np.abs(np.fft.rfft(residuals, length, axis=0)[1 : length // 2]) ** 2 / count
        bins = np.arange(1, len(power) + 1)
        line = self.bench.scenario.omega / 2 / np.pi * length * self.bench.scenario.interval_s
        away = np.abs(bins - line) > 3
        best = np.zeros(residuals.shape[1])
        for corner in (0.1, 0.3, 0.6):
            for alpha in (1.0, 2.0):
                ratio = np.where(bins < corner * line, (corner * line / bins) ** alpha, 0.0)
                spread = 1.0 + ratio[away]
                gain = power[away].T @ (1.0 - 1.0 / spread) - np.log(spread).sum()
                best = np.maximum(best, 2.0 * gain)
        return best


def _combs(inner: IntArray, absent: IntArray, gain: FloatArray) -> float:
    """Codes missing at even distances, as a faulty bit leaves them: the best such comb."""
    best, choices = 0.0, 2.0 * np.log(254.0)
    for spacing in (2, 4, 8, 16, 32, 64, 128):
        for phase in range(spacing):
            wanted = int(np.sum(inner % spacing == phase))
            hit = absent % spacing == phase
            if wanted and int(hit.sum()) == wanted:
                best = max(best, float(gain[hit].sum()) - choices)
    return best


def as_gaussian(size: FloatArray, freedom: float) -> FloatArray:
    """Size of a Gaussian deviate that is as rare as one of Student's t of unit variance."""
    if freedom <= 2.0:
        return size
    from scipy import stats

    found = size.copy()
    wild = size > 2.5
    rare = stats.t.logsf(size[wild] * np.sqrt(freedom / (freedom - 2.0)), freedom)
    found[wild] = stats.norm.isf(np.maximum(np.exp(rare), 1e-300))
    return found
