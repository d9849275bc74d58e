"""What stands on the bench: noise, evidence, and causes that do what their names say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from pendpipe.arrays import FloatArray
from pendpipe.effects import catalogue
from pendpipe_challenge.causes import CATALOGUE, OUTSIDE, Law
from pendpipe_challenge.items import EFFECTS, PHYSICS, SENSORS, draw_scene, events, sized
from pendpipe_challenge.world import Bench, Cause, Scene

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


@pytest.mark.parametrize("effect", ["cubic-stiffness", "power-law-damping", "sensor-cubic"])
def test_what_an_effect_was_sized_for_is_what_a_fit_loses(effect: str) -> None:
    """The best Eq. 8 misses a reading without noise by the wanted Delta chi^2."""
    there = scene(amplitude=0.3, rates=(0.05, 0.01, 0.0, 1e-3), noise_rms=1e-4)
    cause = sized(np.random.default_rng(4), there, [], law_of(effect), 400.0, 4.0)
    assert cause is not None
    wanted, _ = there.reading([cause])

    def misses(p: FloatArray) -> FloatArray:
        omega, a, b, c, top, lead, offset = p
        rates = (0.05 * (1 + a), 0.01 * (1 + b), 0.0, 1e-3 * (1 + c))
        like = replace(
            there,
            frequency_hz=0.7 * (1 + omega),
            rates=rates,
            amplitude=0.3 * (1 + top),
            lead_s=0.3 * (1 + lead),
            offset=offset,
        )
        return (like.reading([])[0] - wanted) / there.sd

    scales = [1e-3, 0.5, 0.5, 0.5, 0.01, 0.01, 1e-3]
    left = least_squares(misses, np.zeros(7), x_scale=scales, xtol=1e-12, ftol=1e-12)
    assert 2 * left.cost == pytest.approx(400.0, rel=0.25)


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
