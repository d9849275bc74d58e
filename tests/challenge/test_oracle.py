"""Noise, tangent space, sizing and the oracle: what they say comes true."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.apparatus.scores import catalogue

from pendpipe_challenge.bench import Bench
from pendpipe_challenge.catalogue import CATALOGUE, EFFECTS, hide
from pendpipe_challenge.items import make_null, make_outside, make_pair, make_single
from pendpipe_challenge.oracle import members
from pendpipe_challenge.scenario import Noise, Scenario, Whitening, draw_scenario
from pendpipe_challenge.sizing import size


def scenario(seed: int = 1, **options: object) -> Scenario:
    drawn = draw_scenario(
        np.random.default_rng(seed), amplitude_rad=0.2, stop=False, bits=16, **options
    )
    return replace(drawn, samples=min(drawn.samples, 2000))


def test_whitened_noise_is_white() -> None:
    time = 0.05 * np.arange(2000)
    noise = Noise(1e-4, alpha=1.2)
    whiten = Whitening(noise.white_sd, noise.slow(time))
    random = np.random.default_rng(0)
    drawn = np.column_stack([noise.draw(time, random) for _ in range(200)])
    power = np.mean(np.abs(np.fft.rfft(whiten(drawn), axis=0)) ** 2, axis=1) / len(time)
    raw = np.mean(np.abs(np.fft.rfft(drawn, axis=0)) ** 2, axis=1) / len(time) / 1e-8
    hertz = np.fft.rfftfreq(len(time), time[1])[1:5]
    # A finite record's window spreads a steep spectrum: a quarter's accuracy at most.
    assert np.allclose(raw[1:5], 1.0 + (0.05 / hertz) ** 1.2, rtol=0.35)
    # 200 draws: a bin's mean is good to 7 %; the lowest share their power with the mean's.
    assert np.abs(power[1:100].mean() - 1.0) < 0.05
    assert power[1:9].max() < 1.5


def test_heavy_tails_keep_the_variance() -> None:
    drawn = Noise(1.0, freedom=6.0).draw(np.arange(200000.0), np.random.default_rng(0))
    assert drawn.std() == pytest.approx(1.0, rel=0.02)
    assert np.abs(drawn).max() > 7.0


def test_the_baseline_absorbs_its_own_parameters() -> None:
    bench = Bench(scenario())
    for name in bench.names:
        step = 3.0 * bench.sizes.get(name, 1e-4)
        change = bench.residual(bench.reading(bench.truth.moved(name, step)))
        left = bench.off(change)
        assert left @ left < 1e-5 * (change @ change)


def test_a_refit_finds_the_baseline_again() -> None:
    bench = Bench(scenario())
    moved = bench.truth.moved("omega", 1e-5).moved("gamma", 1e-4).moved("offset", 1e-3)
    point, _, square = bench.refit(bench.reading(moved))
    assert square < 1e-3
    assert point.motion.value("omega") == pytest.approx(moved.motion.value("omega"), rel=1e-8)


@pytest.mark.parametrize("effect", ["cubic-stiffness", "power-law-damping", "sensor-cubic"])
def test_what_an_effect_was_sized_for_is_what_a_refit_loses(effect: str) -> None:
    """Chi^2 of the refitted baseline rises by the wanted Delta chi^2, with real noise."""
    random = np.random.default_rng(4)
    sized = next(
        found
        for seed in range(1, 30)
        if (found := size(hide(random, effect, scenario(seed, colour=False)), 400.0))
    )
    assert sized.delta_chi2 == pytest.approx(400.0, rel=0.04)
    quiet = Bench(replace(sized.without), sized.bench.kept)
    noise = sized.scenario.noise.white_sd * random.standard_normal(sized.scenario.samples)
    clean = sized.scenario.reading_rad()
    _, _, with_it = quiet.refit(clean + noise, sized.point)
    _, _, without = quiet.refit(quiet.reading(quiet.truth) + noise)
    # The cross term has the standard deviation 2 sqrt(400).
    assert abs(with_it - without - sized.delta_chi2) < 4 * 2 * 20


APPARATUS = {
    "amplitude-linear-stiffness",
    "parametric-drive",
    "camera-geometry",
    "clock-slips",
    "count-slips",
    "offset-step",
    "rolling-shutter",
    "tracking-noise",
}
"""Added after the generator was sealed; `benchmarks/apparatus` hides most of them."""


def test_every_effect_that_the_generator_knew_can_be_hidden() -> None:
    contract = [name for name in catalogue() if not name.startswith("unnamed-")]
    assert len(contract) >= 41
    assert sorted(EFFECTS) == sorted(set(contract) - APPARATUS)


def test_a_third_of_the_laws_are_not_the_catalogues_own() -> None:
    random = np.random.default_rng(2)
    laws = [maker(random, scenario()) for makers in CATALOGUE.values() for maker in makers]
    assert sum(not law.own_form for law in laws) >= len(laws) / 3


@pytest.mark.parametrize("effect", EFFECTS)
def test_a_hidden_effect_changes_the_codes(effect: str) -> None:
    random = np.random.default_rng(3)
    hidden = hide(random, effect, scenario())
    strength = 30.0 * hidden.scale if hidden.sized != "fixed" else hidden.scale
    strength = float(np.sign(strength) * min(abs(strength), 0.9 * hidden.largest))
    with_it = hidden.at(strength).record(np.random.default_rng(5))
    without = hidden.without(strength).record(np.random.default_rng(5))
    assert not np.array_equal(with_it, without)


def test_the_oracle_finds_and_names_a_large_effect_and_no_null() -> None:
    random = np.random.default_rng(11)
    single = make_single(random, "sensor-cubic", 400.0, own_form=True).truth
    assert single["oracle"]["detected"]
    assert "sensor-cubic" in single["oracle"]["class"]
    assert 20.0 < single["oracle"]["threshold"] < 35.0
    nulls = [make_null(random, oracle=True).truth["oracle"] for _ in range(6)]
    assert sum(null["detected"] for null in nulls) <= 1


def test_a_cancelling_pair_hides_itself() -> None:
    item = make_pair(
        np.random.default_rng(2),
        "cubic-stiffness",
        "frequency-drift",
        (100.0, 100.0),
        cancelling=True,
    )
    assert item.truth["total_delta_chi2"] < 0.5 * 200.0
    assert all(e["marginal_delta_chi2"] < 100.0 for e in item.truth["effects"])


@pytest.mark.parametrize(
    "names", [("sensor-cubic", "circular-error"), ("circular-error", "tone-pickup")]
)
def test_both_of_a_pair_are_as_large_as_told(names: tuple[str, str]) -> None:
    """The amplitude is sin x's strength: what is beside it is sized on the swing that is made."""
    item = make_pair(np.random.default_rng(3), *names, (400.0, 400.0))
    cosine = item.truth["cosine"]
    alone = sum(e["delta_chi2"] for e in item.truth["effects"])
    assert alone == pytest.approx(800.0, rel=0.05)
    assert item.truth["total_delta_chi2"] == pytest.approx(alone, rel=0.1 + abs(cosine))
    assert item.truth["oracle"]["found_each"] == [True, True]


def test_what_is_outside_leaves_something_to_every_catalogue_entry() -> None:
    item = make_outside(np.random.default_rng(1), "cogging-torque", 100.0)
    effect = item.truth["effects"][0]
    assert effect["left_by_catalogue"] == pytest.approx(100.0, rel=0.16)
    assert effect["delta_chi2"] > effect["left_by_catalogue"]
    assert effect["effect"] == "unnamed-restoring"


def test_a_class_ends_where_the_likelihood_has_fallen_by_exp_minus_3() -> None:
    scores = {"impulse": 50.0, "backlash": 44.5, "gain-drift": 43.5}
    assert members(scores) == ("impulse", "backlash")
