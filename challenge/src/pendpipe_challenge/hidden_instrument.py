"""Hidden faults of the measurement: sensor, amplifier, clock, converter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pendpipe_challenge.hidden import Hidden, amplitude, either_sign, enter, law
from pendpipe_challenge.scenario import Scenario

Random = np.random.Generator


def _volts(s: Scenario) -> float:
    """The noise, as the amplifier gives it."""
    return s.sd_rad * s.chain.volts_per_radian


enter(
    *("sensor-quadratic", "x^2", "square"),
    lambda r, s: (either_sign(r) * s.sd_rad / amplitude(s) ** 2, {}),
    chain=True,
)
# A capacitor whose moving plate does not rest in the middle.
enter(
    *("sensor-quadratic", "plates", "plates"),
    lambda r, s: (s.sd_rad / amplitude(s) ** 2, {"lean": either_sign(r) * 0.4}),
    chain=True,
    own=False,
    largest=lambda s, d: 0.4 / amplitude(s),
)
enter(
    *("sensor-cubic", "x^3", "cubic"),
    lambda r, s: (either_sign(r) * s.sd_rad / amplitude(s) ** 3, {}),
    chain=True,
)
# A differential capacitor: (C1 - C2)/(C1 + C2) with parallel plates and strays.
enter(
    *("sensor-cubic", "plates", "plates"),
    lambda r, s: (0.1 / amplitude(s), {}),
    chain=True,
    own=False,
    growth=4.0,
    largest=lambda s, d: 0.9 / amplitude(s),
)
# A sensor whose field weakens off its centre.
enter(
    *("sensor-cubic", "tanh", "logistic"),
    lambda r, s: (s.sd_rad / amplitude(s) ** 3, {}),
    chain=True,
    own=False,
)
# Play between axis and sensor, and a coupling that gives before it slips.
enter("sensor-backlash", "play", "play_rad", lambda r, s: (s.sd_rad, {}), chain=True)
enter(
    *("sensor-backlash", "elastic slip", "elastic_play_rad"),
    lambda r, s: (s.sd_rad, {}),
    chain=True,
    own=False,
)
enter(
    *("offset-drift", "straight", "drift_volts_s"),
    lambda r, s: (either_sign(r) * _volts(s) / s.span_s, {}),
    chain=True,
)
enter(
    *("offset-drift", "warm-up", "warm_up_volts"),
    lambda r, s: (
        either_sign(r) * _volts(s),
        {"warm_up_s": float(r.uniform(0.1, 0.5)) * s.span_s},
    ),
    chain=True,
    own=False,
)


@law("offset-drift")
def walk(r: Random, s: Scenario) -> Hidden:
    """It wanders."""
    knots = np.cumsum(r.standard_normal(6))
    volts = s.sd_rad * s.chain.volts_per_radian

    def build(base: Scenario, size: float) -> Scenario:
        return base.with_chain(walk_volts=tuple((size * knots).tolist()))

    return Hidden("offset-drift", "wandering", build, volts, False, s, parameter="step_volts")


def _relaxing(r: Random, s: Scenario, size: float, name: str) -> tuple[float, dict[str, float]]:
    tau = float(r.uniform(0.15, 0.5)) * s.span_s
    return either_sign(r) * size / tau, {name: tau}


enter(
    *("gain-drift", "straight", "gain_drift"),
    lambda r, s: (either_sign(r) * 1e-2 / s.span_s, {}),
    chain=True,
    largest=lambda s, d: 0.5 / s.span_s,
)
# With the amplifier's temperature.
enter(
    *("gain-drift", "relaxing", "gain_drift"),
    lambda r, s: _relaxing(r, s, 1e-2, "gain_drift_s"),
    chain=True,
    largest=lambda s, d: 0.5 / d["gain_drift_s"],
)


@law("ac-coupling")
def ac(r: Random, s: Scenario) -> Hidden:
    """A capacitor in the way; the level it takes away must not be zero."""
    offset = either_sign(r) * s.chain.volts_per_radian * amplitude(s) * 0.1
    offset += s.chain.offset_volts
    prepared = s.with_chain(offset_volts=offset)

    def build(base: Scenario, rate: float) -> Scenario:
        return base.with_chain(ac_time_s=1.0 / rate)

    return Hidden(
        "ac-coupling",
        "RC",
        build,
        1e-4 / s.span_s,
        True,
        prepared,
        largest=s.omega / 3.0,
        parameter="rate",
    )


def _tone(r: Random, s: Scenario, second: float) -> tuple[float, dict[str, float]]:
    nyquist = 0.5 / s.interval_s
    line = s.omega / 2 / np.pi
    hertz = float(r.uniform(0.15 * line, nyquist))
    while min(abs(hertz - k * line) for k in (1, 2, 3, 5)) < 0.1 * line:
        hertz = float(r.uniform(0.15 * line, nyquist))
    phase = float(r.uniform(0, 2 * np.pi))
    return _volts(s), {"tone_hz": hertz, "tone_phase": phase, "tone_second": second}


# Mains or its alias.
enter("tone-pickup", "cosine", "tone_volts", lambda r, s: _tone(r, s, 0.0), chain=True)
enter(
    *("tone-pickup", "with harmonic", "tone_volts"),
    lambda r, s: _tone(r, s, 0.3),
    chain=True,
    own=False,
)


def _peaks(s: Scenario) -> tuple[float, float]:
    volts = s.chain.volts(s.track(), s.samples)
    return float(volts.max()), float(volts.min())


@law("clipping")
def clipped(r: Random, s: Scenario) -> Hidden:
    """A limit below the first peaks, on one side or on both."""
    high, low = _peaks(s)
    both = r.random() < 0.6

    def build(base: Scenario, share: float) -> Scenario:
        limits = {"clip_high_volts": high * (1.0 - share)}
        if both:
            limits["clip_low_volts"] = low * (1.0 - share)
        return base.with_chain(**limits)

    return Hidden(
        "clipping", "hard", build, 0.01, True, s, growth=3.5, largest=0.7, parameter="share"
    )


@law("clipping")
def saturated(_: Random, s: Scenario) -> Hidden:
    """An amplifier that rounds the peaks on one side."""
    high, _low = _peaks(s)

    def build(base: Scenario, share: float) -> Scenario:
        return base.with_chain(clip_high_volts=high * (1.0 - share), soft_clip=0.02 * high)

    return Hidden(
        "clipping", "soft", build, 0.01, False, s, growth=3.0, largest=0.7, parameter="share"
    )


@law("missing-codes")
def missing(_: Random, s: Scenario) -> Hidden:
    """Codes that the converter never gives; the next one gets their readings."""
    volts = s.chain.volts(s.track(), s.samples)
    used, count = np.unique(np.rint(volts / s.chain.step_volts).astype(int), return_counts=True)

    def build(base: Scenario, number: float) -> Scenario:
        # The busiest codes that together hold about so many readings.
        left, wanted = number, list[int]()
        for at in np.argsort(-count, kind="stable"):
            if count[at] <= left or (not wanted and at == np.argmin(count)):
                wanted.append(int(used[at]))
                left -= count[at]
        return base.with_chain(missing_codes=tuple(sorted(wanted)))

    return Hidden(
        "missing-codes",
        "skipped",
        build,
        5.0,
        True,
        s,
        sized="codes",
        growth=1.0,
        largest=300.0,
        parameter="readings",
    )


@law("missing-codes")
def comb(r: Random, s: Scenario) -> Hidden:
    """A faulty bit: every so many codes one is missing."""
    volts = s.chain.volts(s.track(), s.samples)
    code = np.rint(volts / s.chain.step_volts).astype(int)
    phase = int(r.integers(0, 128))

    def build(base: Scenario, number: float) -> Scenario:
        spacing = 2 ** max(2, 8 - round(number))
        first = int(code.min()) + 1 + (phase - int(code.min()) - 1) % spacing
        return base.with_chain(missing_codes=tuple(range(first, int(code.max()), spacing)))

    return Hidden(
        "missing-codes",
        "comb",
        build,
        1.0,
        False,
        s,
        sized="codes",
        growth=3.0,
        largest=6.0,
        parameter="comb",
    )


@law("coarse-quantisation")
def coarse(r: Random, s: Scenario) -> Hidden:
    """Low bits that do not move."""
    dead = int(r.integers(2, 5))

    def build(base: Scenario, _: float) -> Scenario:
        return base.with_chain(dead_bits=dead)

    return Hidden(
        "coarse-quantisation",
        "dead bits",
        build,
        1.0,
        True,
        s,
        sized="fixed",
        parameter="on",
        details={"dead_bits": float(dead)},
    )


enter(
    *("clock-drift", "straight", "clock_drift"),
    lambda r, s: (either_sign(r) * 1e-4 / s.span_s, {}),
    chain=True,
)
# A crystal that warms up.
enter(
    *("clock-drift", "relaxing", "clock_drift"),
    lambda r, s: _relaxing(r, s, 1e-4, "clock_drift_s"),
    chain=True,
)
enter(
    *("jitter", "Gaussian", "jitter_s"),
    lambda r, s: (0.5 * s.sd_rad / (s.omega * amplitude(s)), {}),
    chain=True,
    sized="variance",
    growth=4.0,
)


@law("dropped-samples")
def dropped(r: Random, s: Scenario) -> Hidden:
    """One to three samples lost at one place, or one repeated."""
    at = int(r.uniform(0.1, 0.9) * s.samples)
    lost = int(r.choice([1, 1, 2, 3, -1]))

    def build(base: Scenario, _: float) -> Scenario:
        return base.with_chain(dropped=((at, lost),))

    return Hidden(
        "dropped-samples",
        "lost" if lost > 0 else "repeated",
        build,
        1.0,
        True,
        s,
        sized="fixed",
        parameter="on",
        details={"sample": float(at), "lost": float(lost)},
    )


@law("glitches")
def glitches(r: Random, s: Scenario) -> Hidden:
    """One to four wild samples."""
    number = int(r.integers(1, 5))
    places = np.sort(r.choice(np.arange(20, s.samples - 20), number, replace=False))
    shares = r.choice([-1.0, 1.0], number) * r.uniform(0.7, 1.3, number)
    volts = s.sd_rad * s.chain.volts_per_radian

    def build(base: Scenario, size: float) -> Scenario:
        wild = tuple(
            (int(at), float(size * share)) for at, share in zip(places, shares, strict=True)
        )
        return base.with_chain(glitches=wild)

    samples = {f"sample_{i}": float(at) for i, at in enumerate(places, 1)}
    return Hidden(
        "glitches",
        "single samples",
        build,
        5.0 * volts,
        True,
        s,
        parameter="volts",
        details={"number": float(number), **samples},
    )


@law("coloured-noise")
def coloured(r: Random, s: Scenario) -> Hidden:
    """Red noise up to a third of the pendulum's frequency, far above what is usual."""
    corner = 0.3 * s.omega / 2 / np.pi
    alpha = float(r.uniform(1.0, 2.0))

    def build(base: Scenario, _: float) -> Scenario:
        return replace(base, noise=replace(base.noise, alpha=alpha, corner_hz=corner))

    white = replace(s, noise=replace(s.noise, alpha=0.0))
    return Hidden(
        "coloured-noise",
        "red",
        build,
        1.0,
        True,
        white,
        sized="fixed",
        parameter="on",
        details={"alpha": alpha, "corner_hz": corner},
    )
