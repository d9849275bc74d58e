"""The challenge's world: one integrator, effects and readings, independent of the library."""
# ruff: noqa: ARG005

import ast
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

import pendpipe_challenge
from pendpipe.arrays import FloatArray
from pendpipe.effects import catalogue
from pendpipe_challenge.causes import CATALOGUE, OUTSIDE, Law
from pendpipe_challenge.items import EFFECTS, PHYSICS, SENSORS, draw_scene, events, sized
from pendpipe_challenge.motion import Motion
from pendpipe_challenge.torques import BOOK
from pendpipe_challenge.world import Bench, Cause, Scene

from ..effects.integration import integrate

# What stands on the bench: noise, evidence, and causes that do what their names say.

LAWS = [law for laws in (CATALOGUE | OUTSIDE).values() for law in laws]
LATER = {"offset-step", "tracking-noise", "coloured-noise"}
"""Of the library's catalogue, what no scene has."""


def scene(**other: object) -> Scene:
    """A rod with a converter: 3000 readings at 50 Hz."""
    given = {
        "apparatus": "encoder",
        "frequency_hz": 0.7,
        "rates": (0.02, 0.004, 0.0, 1e-3),
        "amplitude": 0.6,
        "lead_s": 0.3,
        "offset": 0.0,
        "noise_rms": 1e-3,
        "step": 0.0,
        "time_s": np.arange(3000) / 50,
    }
    return Scene(**(given | other))


def law_of(effect: str, form: str = "") -> Law:
    """The first law of an effect, or the one of that form."""
    return next(each for each in (CATALOGUE | OUTSIDE)[effect] if form in each.form)


def change(effect: str, size: float, form: str = "", **other: object) -> tuple[FloatArray, ...]:
    """What a cause changes in the reading; angle and rate without it."""
    there = scene(**other)
    drawn = law_of(effect, form).draw(np.random.default_rng(4), there)
    plain, seen = there.reading([])
    return there.reading([Cause(effect, drawn, size)])[0] - plain, seen.x, seen.v


def test_the_level_falls_as_eq_13_says_where_the_loss_is_small() -> None:
    there = scene(frequency_hz=1.0, rates=(2e-3, 2e-4, 1e-4, 1e-5), amplitude=0.2, lead_s=0.0)
    _, seen = there.reading([])
    fall = solve_ivp(
        *(lambda _, y: -(2e-3 * y**2 + 3e-4 * y + 1e-5), (0, 59.0), [0.2]),
        rtol=1e-10,
        atol=1e-12,
    )
    level = np.hypot(seen.x, seen.v / there.omega)
    # Within a cycle it falls by steps.
    assert level[59 * 50] == pytest.approx(fall.y[0, -1], rel=1e-5)


def test_whitened_noise_is_white() -> None:
    there = scene(red=1.2, noise_rms=1e-4)
    random = np.random.default_rng(0)
    drawn = np.column_stack([there.noise(random) for _ in range(200)])
    white = there.whitened(drawn, there.time_s)
    power, raw = (
        np.mean(np.abs(np.fft.rfft(each, axis=0)) ** 2, axis=1) / len(drawn)
        for each in (white, drawn / 1e-4)
    )
    # A finite record's window spreads a steep spectrum: a quarter's accuracy at most.
    hertz = np.fft.rfftfreq(len(drawn), 0.02)[1:3]
    assert np.allclose(raw[1:3], 1 + (0.05 / hertz) ** 1.2, rtol=0.35)
    # 200 draws: a bin's mean is good to 7 %; the lowest share their power with the mean's.
    assert abs(power[1:100].mean() - 1) < 0.05
    assert power[1:9].max() < 1.5


def test_a_tone_is_worth_its_power_over_that_of_the_noise() -> None:
    there = scene(place=0.35)
    tone = Cause("tone", law_of("tone-pickup").draw(np.random.default_rng(2), there), 1e-3)
    (worth,) = Bench(there, [tone]).evidence
    expected = 3000 * (1e-3 * there.amplitude) ** 2 / 2 / there.noise_rms**2
    assert worth == pytest.approx(expected, rel=0.02)


def missed(there: Scene, cause: Cause) -> float:
    """The chi^2 by which the best Eq. 8 misses a reading without noise."""
    wanted, _ = there.reading([cause])
    a_was, b_was, _, c_was = there.rates

    def misses(p: FloatArray) -> FloatArray:
        omega, a, b, c, top, lead, offset = p
        like = replace(
            there,
            frequency_hz=there.frequency_hz * (1 + omega),
            rates=(a_was * (1 + a), b_was * (1 + b), 0.0, c_was * (1 + c)),
            amplitude=there.amplitude * (1 + top),
            lead_s=there.lead_s * (1 + lead),
            offset=offset,
        )
        return (like.reading([])[0] - wanted) / there.sd

    scales = [1e-3, 0.5, 0.5, 0.5, 0.01, 0.01, 1e-3]
    return 2.0 * least_squares(misses, np.zeros(7), x_scale=scales, xtol=1e-12, ftol=1e-12).cost


QUIET = {"amplitude": 0.3, "rates": (0.05, 0.01, 0.0, 1e-3), "noise_rms": 1e-4}


@pytest.mark.parametrize("effect", ["cubic-stiffness", "power-law-damping", "sensor-cubic"])
def test_what_an_effect_was_sized_for_is_what_a_fit_loses(effect: str) -> None:
    there = scene(**QUIET)
    cause = sized(np.random.default_rng(4), there, [], law_of(effect), 400.0, 4.0)
    assert cause is not None
    assert missed(there, cause) == pytest.approx(400.0, rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["history-force", "clock-drift", "sensor-cubic"])
def test_what_is_left_of_a_cause_is_what_a_fit_loses_however_far_it_moves_the_frequency(
    effect: str,
) -> None:
    there = scene(**QUIET)
    cause = sized(np.random.default_rng(4), there, [], law_of(effect), 400.0, 4.0)
    assert cause is not None
    (left,) = Bench(there, [cause]).refined().alone
    assert left == pytest.approx(missed(there, cause), rel=0.02)


def test_a_far_frequency_is_no_cause() -> None:
    far = Cause("faster", lambda world, size: world.add("omega", 0.01 * size), 1.0)
    bench = Bench(scene(noise_rms=1e-6), [far])
    assert bench.alone > 1000.0
    assert bench.refined().alone < 1.0


@pytest.mark.parametrize("wanted", [25.0, 400.0])
@pytest.mark.parametrize("effect", ["slow-pen", "sensor-backlash", "cogging"])
def test_a_cause_that_sets_in_at_a_threshold_has_the_evidence_that_is_wanted(
    effect: str, wanted: float
) -> None:
    there = scene(step=1e-4)
    cause = sized(np.random.default_rng(4), there, [], law_of(effect), wanted, 4.0)
    assert cause is not None
    assert Bench(there, [cause]).evidence == pytest.approx([wanted], rel=0.15)


def test_a_motion_that_runs_away_is_worth_nothing() -> None:
    fed = Cause("negative damping", lambda world, size: world.add("gamma", -100.0 * size), 1.0)
    with pytest.raises(FloatingPointError, match="runs away"):
        Bench(scene(), [fed])


def test_all_effects_of_the_catalogue_but_three_can_be_hidden() -> None:
    listed = {effect.identifier for effect in catalogue.CATALOGUE}
    assert listed - LATER == CATALOGUE.keys()
    assert {*EFFECTS, *PHYSICS, *sum(SENSORS.values(), ())} == CATALOGUE.keys()


def test_a_quarter_of_the_laws_are_not_the_catalogues_own() -> None:
    laws = [law for laws in CATALOGUE.values() for law in laws]
    assert sum(not law.own for law in laws) >= len(laws) / 4


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.effect} {law.form}")
def test_a_cause_is_absent_at_size_nought_and_changes_the_reading_otherwise(law: Law) -> None:
    there = scene(step=2e-3)
    apply = law.draw(np.random.default_rng(4), there)
    plain, _ = there.reading([])
    without, _ = there.reading([Cause(law.effect, apply, 0.0)])
    changed, _ = there.reading([Cause(law.effect, apply, law.size)])
    # A switch divides a step in two, which moves the reading by what a step is wrong.
    assert without == pytest.approx(plain, abs=2e-7)
    assert np.abs(changed - plain).max() > 1e-6


def test_play_holds_the_reading_back_by_half_its_width() -> None:
    """Also right after a turn between two readings: the coupling turns where the pendulum does."""
    moved, _, v = change("sensor-backlash", 1e-3, "play", time_s=np.arange(200) / 7)
    away = np.abs(v) > 0.3 * np.abs(v).max()
    assert moved[away] == pytest.approx(-np.sign(v[away]) * 3e-4, abs=1e-9)


def test_a_late_clock_reads_what_comes_later() -> None:
    moved, _, v = change("clock-drift", 1e-5, "straight")
    late = 1e-5 * (np.arange(3000) / 50) ** 2 / 2 / (2999 / 50)
    assert np.abs(moved).max() > 2e-4
    assert moved == pytest.approx(v * late, abs=1e-6)


def test_lost_readings_move_all_later_ones_by_whole_ticks() -> None:
    moved, x, _ = change("dropped-samples", 1.0)
    first = int(np.flatnonzero(np.abs(moved) > 1e-6)[0])
    assert first == pytest.approx(0.5 * 3000, abs=2)
    read = (x + moved)[first:-3]
    whole = [np.abs(read - x[first + n : len(x) - 3 + n]).max() for n in (-1, 1, 2, 3)]
    assert min(whole) < 1e-7


def test_jitter_grows_with_the_speed() -> None:
    moved, _, v = change("jitter", 1.0)
    fast, slow = np.abs(v) > 0.7 * np.abs(v).max(), np.abs(v) < 0.05 * np.abs(v).max()
    assert (moved / v)[fast].std() == pytest.approx(1e-3 / (2 * np.pi * 0.7 * 0.6), rel=0.1)
    assert moved[slow].std() < 0.1 * moved[fast].std()


@pytest.mark.parametrize("form", ["skipped", "comb"])
def test_missing_codes_go_to_their_neighbour(form: str) -> None:
    there = scene(step=0.02)
    limit = law_of("missing-codes", form).draw(np.random.default_rng(1), there)
    world = there.world([Cause("missing-codes", limit, 1.0)])
    codes = np.arange(-30, 31)
    written = np.rint(world.limits[0](0.02 * codes) / 0.02).astype(int)
    gone = written != codes
    assert gone.any()
    assert np.all(written[gone] == codes[gone] + 1)


def test_dead_bits_and_limits_act_on_the_noise_as_well() -> None:
    there = scene(step=1e-3)
    random = np.random.default_rng(1)
    drawn = np.linspace(-0.7, 0.7, 1001)
    for effect in ("coarse-quantisation", "clipping"):
        law = law_of(effect)
        (limit,) = there.world([Cause(effect, law.draw(random, there), 1.0)]).limits
        assert np.allclose(limit(limit(drawn)), limit(drawn))
        assert len(np.unique(limit(drawn))) < 1001


def test_a_row_is_written_where_the_count_changes() -> None:
    there = scene(step=5e-3, event_driven=True)
    columns = events(np.random.default_rng(1), there, [])
    y, seen = there.reading([], time_s=columns["time_s"])
    assert set(np.abs(np.round(np.diff(columns["angle_rad"]) / 5e-3))) <= {0.0, 1.0}
    # An edge that is passed upwards gives the count above it, and downwards the count below.
    ahead = (columns["angle_rad"] - y) / 5e-3
    fast = np.abs(seen.v) > 0.3 * there.omega * np.abs(seen.turn)
    upwards, downwards = (ahead[fast & (side * seen.v > 0)] for side in (1, -1))
    assert upwards.mean() - downwards.mean() == pytest.approx(1.0, abs=0.05)
    assert max(upwards.std(), downwards.std()) < 0.1


@pytest.mark.parametrize("apparatus", ["laboratory", *SENSORS])
def test_a_scene_has_at_least_a_dozen_readings_a_cycle_and_loses_swing(apparatus: str) -> None:
    random = np.random.default_rng(5)
    for _ in range(20):
        drawn = draw_scene(random, apparatus)
        assert 1 / drawn.tick_s / drawn.frequency_hz > 11.5
        assert len(drawn.time_s) <= 18_000
        assert drawn.loss_rate > 0


# The challenge's own integrator against scipy's, and against what physics books say.

OMEGA, AMPLITUDE = 5.6, 0.2
LOSSES = {
    "omega": OMEGA,
    "gamma": 0.03,
    "hysteretic": 0.004,
    "quadratic": 0.02,
    "coulomb": 0.004,
}
TIME = 0.05 * np.arange(600)


def eq8(x: float, v: float, *, sine: bool) -> float:
    """Eq. 8's acceleration, written out once more: rho^2 is twice the energy, also with sin x."""
    torque, potential = (np.sin(x), 2.0 * (1.0 - np.cos(x))) if sine else (x, x**2)
    square = OMEGA**2 * potential + v**2
    solid = LOSSES["coulomb"] + LOSSES["hysteretic"] * np.sqrt(square)
    solid += LOSSES["quadratic"] * square
    return float(-solid * np.sign(v) - LOSSES["gamma"] * v - OMEGA**2 * torque)


MOTION_LAWS: dict[str, tuple[dict[str, float], Callable[[float, float, float], float]]] = {
    "Eq. 8 alone": ({}, lambda t, x, v: 0.0),
    "sin x": ({"sine": 1.0}, lambda t, x, v: 0.0),
    "x^3": ({"cubic": 0.3}, lambda t, x, v: -(OMEGA**2) * 0.3 * x**3),
    "x^2": ({"square": 0.1}, lambda t, x, v: -(OMEGA**2) * 0.1 * x**2),
    # Its slope has a kink at 0, within a step.
    "x|x|": ({"sided": 0.01}, lambda t, x, v: -(OMEGA**2) * 0.01 * x * abs(x)),
    "modulated torque": (
        {"parametric": 0.01, "parametric_omega": 9.0},
        lambda t, x, v: -(OMEGA**2) * 0.01 * np.cos(9.0 * t) * x,
    ),
    "a brake beyond its best speed": (
        {"book": float(BOOK["eddy-peak"]), "book_size": 0.05, "book_shape": 0.5},
        lambda t, x, v: -0.05 * v / (1 + (v / 0.5) ** 2),
    ),
    "v|v|": ({"drag": 0.05}, lambda t, x, v: -0.05 * abs(v) * v),
    "|v|^1.5": ({"power": 0.02}, lambda t, x, v: -0.02 * abs(v) ** 1.5 * np.sign(v)),
    "v^3": ({"rayleigh": 0.02}, lambda t, x, v: -0.02 * v**3),
    "x^2 v": ({"van_der_pol": 1.0}, lambda t, x, v: -(x**2) * v),
    "C_D(Re)": (
        {"reynolds": 0.02, "reynolds_speed": 0.01},
        lambda t, x, v: -0.02 * v * (1 + 0.15 * (abs(v) / 0.01) ** 0.687),
    ),
    "Stribeck": (
        {"stribeck": 0.01, "stribeck_speed": 0.2},
        lambda t, x, v: -0.01 * np.exp(-((v / 0.2) ** 2)) * np.sign(v),
    ),
    "drive": (
        {"drive": 0.05, "drive_omega": 9.0, "drive_phase": 1.0},
        lambda t, x, v: 0.05 * np.cos(9.0 * t + 1.0),
    ),
    "frequency drift": (
        {"omega_drift": 1e-3},
        lambda t, x, v: -((OMEGA * (1 + 1e-3 * t)) ** 2 - OMEGA**2) * x,
    ),
    "damping drift": ({"gamma_drift": 1e-3}, lambda t, x, v: -1e-3 * t * v),
    "creep": ({"creep": 1e-4}, lambda t, x, v: OMEGA**2 * 1e-4 * t),
    "release": (
        {"release": 0.1, "release_time": 3.0},
        lambda t, x, v: -0.1 * np.exp(-t / 3.0) * v,
    ),
    "rough spot": (
        {"rough": 0.05, "rough_place": 0.08, "rough_width": 0.02},
        lambda t, x, v: -0.05 * np.exp(-(((x - 0.08) / 0.02) ** 2)) * np.sign(v),
    ),
}


def by_scipy(extra: Callable[[float, float, float], float], *, sine: bool) -> FloatArray:
    """Half cycle by half cycle, restarted at every reversal."""

    def law(t: float, state: FloatArray, way: float, _turn: float) -> float:
        # The direction holds throughout a half cycle, also in trial steps beyond its end.
        x, v = float(state[0]), way * max(way * float(state[1]), 1e-300)
        every = eq8(x, v, sine=sine) + extra(t, x, v)
        return every + LOSSES["gamma"] * (v - float(state[1]))

    return integrate(law, AMPLITUDE, 0.0, TIME, longest_s=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("law", MOTION_LAWS)
def test_motion_is_that_of_another_integrator(law: str) -> None:
    parameters, extra = MOTION_LAWS[law]
    motion = Motion({**LOSSES, **parameters}, AMPLITUDE)
    theirs = by_scipy(extra, sine="sine" in parameters)
    # At the coarsest step that is taken; and at half of it, where the eighth order shows.
    assert np.abs(motion.run(TIME).angle_rad - theirs).max() < 2e-7 * AMPLITUDE
    fine = motion.run(np.linspace(0.0, TIME[-1], 2 * len(TIME) - 1)).angle_rad[::2]
    # A fractional power is singular where the motion reverses, x|x| at 0: there the order is lower.
    rough = law in ("|v|^1.5", "C_D(Re)", "x|x|")
    assert np.abs(fine - theirs).max() < (1e-8 if rough else 3e-9) * AMPLITUDE


def test_a_sample_may_follow_a_turning_point_at_once() -> None:
    """However short the rest of a step is: it is still a step."""
    swing = Motion({"omega": 3.0}, 0.2)
    times = np.array([0.0, 0.4, np.pi / 3.0 + 1e-6, 1.7])
    there = swing.run(times)
    turns_s = times[2] + there.rate_rad_s[2] / (9.0 * there.angle_rad[2])
    for late in (0.0, 2e-16, 5e-16, 1e-15, 1e-14, 1e-13, 1e-12):
        times[2] = turns_s + late
        found = swing.run(times).angle_rad
        np.testing.assert_allclose(found, 0.2 * np.cos(3.0 * times), rtol=0.0, atol=1e-8)


def test_error_falls_with_the_eighth_power_of_the_step() -> None:
    motion = Motion({"omega": 1.0, "gamma": 0.05}, 1.0)
    reference = motion.run(np.arange(0.0, 30.001, 0.025)).angle_rad[-1]
    coarse, fine = (
        abs(motion.run(np.arange(0.0, 30.001, step)).angle_rad[-1] - reference)
        for step in (0.3, 0.15)
    )
    assert coarse / fine > 2.0**7


def test_coulomb_friction_stops_off_centre_and_for_good() -> None:
    friction = 0.1
    track = Motion({"omega": OMEGA, "coulomb": friction}, AMPLITUDE).run(TIME)
    dead = friction / OMEGA**2
    # Every half cycle loses twice the dead band, until it ends within it.
    left = AMPLITUDE
    while left > dead:
        left = abs(left - 2 * dead)
    assert abs(track.angle_rad[-1]) == pytest.approx(left, abs=2e-8)
    assert track.rate_rad_s[-1] == 0.0


def frequency(amplitude: float, last_s: float, **law: float) -> float:
    """What a law does to the frequency, over that of the pendulum without it."""
    track = Motion({"omega": OMEGA, **law}, amplitude).run(np.arange(0, last_s, 0.005))
    rising = np.flatnonzero((track.angle_rad[:-1] < 0) & (track.angle_rad[1:] >= 0))
    at = track.time_s[rising] - track.angle_rad[rising] / track.rate_rad_s[rising]
    return float(2 * np.pi * (len(at) - 1) / (at[-1] - at[0])) / OMEGA


def test_play_lowers_the_frequency() -> None:
    """A dead zone of half width b costs 2 b/(pi A) of the frequency (leading order)."""
    b, amplitude = 1e-3, 0.3
    lowered = frequency(amplitude, 60.0, play=b) - 1.0
    assert lowered == pytest.approx(-2 * b / (np.pi * amplitude), rel=0.02)


def test_dahl_is_a_spring_when_small_and_friction_when_large() -> None:
    law = {"dahl": 0.02, "dahl_reach": 0.05}
    assert frequency(1e-4, 8.0, **law) == pytest.approx(np.sqrt(1.02), rel=2e-4)
    assert frequency(2.0, 8.0, **law) == pytest.approx(1.0, abs=6e-4)


def test_history_force_in_steady_swing_damps_as_much_as_it_loads() -> None:
    """d^(1/2)v/dt^(1/2) of a sine leads v by 45 degrees: half damping, half added mass."""
    h = 0.02
    track = Motion({"omega": OMEGA, "basset": h}, AMPLITUDE).run(np.arange(0, 400, 0.04))
    late = track.time_s > 40
    swing = np.hypot(track.angle_rad, track.rate_rad_s / OMEGA)[late]
    rate = -np.polyfit(track.time_s[late], np.log(swing), 1)[0]
    assert rate == pytest.approx(0.5 * h * np.sqrt(OMEGA) / np.sqrt(2), rel=0.05)


def test_an_impulse_changes_v_and_not_x() -> None:
    plain = Motion({"omega": OMEGA}, AMPLITUDE)
    struck = plain.changed(impulse=0.1, impulse_at=10.0).run(TIME)
    before = TIME < 10.0
    assert np.array_equal(struck.angle_rad[before], plain.run(TIME).angle_rad[before])
    change = struck.angle_rad - plain.run(TIME).angle_rad
    after = TIME >= 10.0
    expected = 0.1 / OMEGA * np.sin(OMEGA * (TIME[after] - 10.0))
    assert np.allclose(change[after], expected, atol=1e-9)


def test_unknown_parameters_are_refused() -> None:
    with pytest.raises(KeyError, match="springiness"):
        Motion({"springiness": 1.0}, AMPLITUDE).run(TIME)


# ---------------------------------------------------------------- laws of books
H = 2 * np.pi / OMEGA / 400


def swing(
    law: str = "", size: float = 0.0, shape: float = 1.0, *, cycles: float = 20, **other: float
) -> tuple[FloatArray, ...]:
    """Angle and rate after a release from 1.2 rad; the second coordinate and its rate."""
    book = {"book": float(BOOK.get(law, 0)), "book_size": size, "book_shape": shape}
    book |= {"book_shape_2": 0.0}
    amplitude = other.pop("amplitude", 1.2)
    motion = Motion({"omega": OMEGA, "sine": 1.0, **book, **other}, amplitude)
    track = motion.run(H * np.arange(int(400 * cycles) + 1))
    second = CubicSpline(track.time_s, track.second_rad)
    return track.angle_rad, track.rate_rad_s, track.second_rad, second(track.time_s, 1)


CONSERVATIVE: dict[str, tuple[float, float]] = {
    "": (0.0, 1.0),
    "winding-string": (0.1, 1.0),
    "rolling-edge": (0.2, 1.0),
    "magnet-below": (0.1, 0.4),
    "bumper": (0.5, 0.7),
    "elastic-string": (1.0, 3.1),
    "sloshing-bob": (0.02, 1.3),
    "cogging": (0.3, 8.0),
    "vibrated-pivot": (0.2, 1.0),
}
"""Laws that lose nothing, with a size and a shape."""


def energy(law: str, x: FloatArray, v: FloatArray, p: FloatArray, q: FloatArray) -> FloatArray:
    """Energy over the moment of inertia."""
    s, d = CONSERVATIVE[law]
    inertia = {
        "winding-string": (1 + s * x) ** 2,
        "rolling-edge": 1 + 2 * s * (1 - np.cos(x)),
        "elastic-string": (1 + p) ** 2,
    }.get(law, np.ones_like(x))
    height = {
        "winding-string": s * np.sin(x) - (1 + s * x) * np.cos(x),
        "magnet-below": -np.cos(x) - s * d**2 / 3 * (1 + (x / d) ** 2) ** -1.5,
        "bumper": -np.cos(x) + s * np.maximum(0, x - d) ** 2 / 2,
        "elastic-string": p - (1 + p) * np.cos(x) + (q / OMEGA) ** 2 / 2 + (d * p) ** 2 / 2,
        "sloshing-bob": -np.cos(x) + s * ((q / OMEGA) ** 2 + (d * p) ** 2) / 2 - s * x * p,
        "cogging": -np.cos(x) - s / d / OMEGA**2 * np.cos(d * x),
        "vibrated-pivot": -np.cos(x) - s * np.cos(2 * x) / 4,
    }.get(law, -np.cos(x))
    return np.asarray(inertia * v**2 / 2 + OMEGA**2 * height)


@pytest.mark.parametrize("law", CONSERVATIVE)
def test_laws_without_loss_keep_their_energy(law: str) -> None:
    found = energy(law, *swing(law, *CONSERVATIVE[law]))
    # A cushion's kink lies within a step; the second coordinate's rate is a spline's.
    allowed = {"bumper": 1e-4, "elastic-string": 1e-6}.get(law, 1e-7)
    assert np.ptp(found[5:-5]) < allowed * OMEGA**2


@pytest.mark.parametrize(
    ("law", "size", "shape"),
    [
        ("eddy-peak", 0.05, 1.0),
        ("local-brake", 0.05, 0.3),
        ("one-way-drag", 0.05, 1.0),
        ("ageing-friction", 0.05, 0.2),
        ("cable-hysteresis", 0.02, 0.4),
        ("squeeze-film", 0.01, 1.5),
    ],
)
def test_laws_with_loss_lose_energy_in_each_cycle(law: str, size: float, shape: float) -> None:
    swings = np.abs(swing(law, size, shape)[0][:8000]).reshape(20, 400).max(axis=1)
    assert (np.diff(swings) < 0).all()


def test_a_small_swing_out_of_the_plane_is_a_spherical_pendulums() -> None:
    motion = Motion(
        {"omega": OMEGA, "sine": 1.0, "second": 1.0, "second_omega": OMEGA, "second_gamma": 0.0},
        1.0,
        second_rad=1e-5,
        second_rate_rad_s=2e-5 * OMEGA,
    )
    track = motion.run(H * np.arange(8001))

    def force(_t: float, state: FloatArray) -> FloatArray:
        at, speed = state[:3], state[3:]
        weight = np.array([0.0, 0.0, -(OMEGA**2)])
        return np.concatenate([speed, weight - (weight @ at + speed @ speed) * at])

    start = [np.sin(1.0), 1e-5, -np.cos(1.0), 0.0, 2e-5 * OMEGA, 0.0]
    tight = {"rtol": 1e-11, "atol": 1e-14, "t_eval": track.time_s, "method": "DOP853"}
    sphere = solve_ivp(force, (0.0, track.time_s[-1]), start, **tight)
    assert np.abs(track.angle_rad - np.arctan2(sphere.y[0], -sphere.y[2])).max() < 1e-6
    assert np.abs(track.second_rad - sphere.y[1]).max() < 1e-9


# The proof may not be the program agreeing with itself.

PERMITTED = {"arrays", "errors", "files", "process", "version", "__file__"}
"""Of the library: what says nothing about pendulums."""


def parts_of_the_library(tree: ast.Module) -> Iterator[str]:
    """The modules and names of `pendpipe` that a file of the challenge uses."""
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.Attribute):
            names = [ast.unparse(node)]
        yield from (name.split(".")[1] for name in names if name.startswith("pendpipe."))


def test_the_challenge_imports_nothing_that_it_judges() -> None:
    files = list(Path(pendpipe_challenge.__file__).parent.rglob("*.py"))
    used = {
        part
        for path in files
        for part in parts_of_the_library(ast.parse(path.read_text(encoding="utf-8")))
    }
    assert "arrays" in used
    assert used <= PERMITTED
