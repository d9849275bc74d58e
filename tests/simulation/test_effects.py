"""Simulated recordings with effects: each can be switched on, and what is wrong is refused."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pendpipe.dynamics import Release, sample
from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.errors import InputError
from pendpipe.recording import Recording
from pendpipe.simulation.model import Model, read_model, simulate

from ..effects.pendulums import VALUES
from ..refusals import refused

FORENSIC: dict[str, dict[str, float]] = {
    "broadband-drive": {"acceleration_density": 1e-8},
    "clipping": {"upper_level": 0.12},
    "count-slips": {"step": 3e-3, "number": 6},
    "clock-slips": {"dt": 0.05, "number": 6},
    "missing-codes": {"number": 20},
    "coarse-quantisation": {"step": 2e-3},
    "jitter": {"sigma_t": 2e-3},
    "glitches": {"number": 5, "rms": 0.02},
    "tracking-noise": {"rms": 3e-3},
    "coloured-noise": {"corner": 0.3, "exponent": 1.5},
}

TOML = """
seed = 3
noise_rad = 1e-5
[pendulum]
frequency_hz = 0.9
quality_factor_viscous = 300.0
a = 7e-3
c = 1e-4
release_angle_rad = 0.15
release_time_s = -0.2
[sampling]
sample_rate_hz = 20.0
duration_s = 40.0
"""
LINEAR = TOML.replace("[pendulum]", '[pendulum]\nrestoring = "linear"')
MEASURED = "[sensor]\nnoise_volts = 1e-4\n[converter]\n"


def model(tmp_path: Path, more: str = "", text: str = TOML) -> Model:
    path = tmp_path / "model.toml"
    path.write_text(text + more, encoding="utf-8")
    return read_model(path)


def table(identifier: str, **values: float) -> str:
    lines = [f"{name} = {value!r}" for name, value in values.items()]
    return "\n".join(["[[effects]]", f'id = "{identifier}"', *lines, ""])


def named(identifier: str) -> dict[str, float]:
    if identifier in FORENSIC:
        return FORENSIC[identifier]
    effect = next(effect for effect in CATALOGUE if effect.identifier == identifier)
    values = VALUES[identifier][1:] if effect.parameter_free else VALUES[identifier]
    return dict(zip((p.name for p in effect.parameters), values, strict=True))


@pytest.mark.parametrize("identifier", [effect.identifier for effect in CATALOGUE])
def test_each_effect_can_be_switched_on(identifier: str, tmp_path: Path) -> None:
    """And changes the recording by more than its rounding."""
    effect = MEASURED + table(identifier, **named(identifier))
    without, found = (simulate(model(tmp_path, each, LINEAR)) for each in (MEASURED, effect))
    assert found.metadata["effects"] == identifier
    change = np.abs(found.values - without.values)
    assert np.max(change) > 2e-4, "about a code of 16 bits"
    assert np.max(change) < 1.2


def test_without_effects_it_is_eq8(tmp_path: Path) -> None:
    described = model(tmp_path, text=TOML.replace("noise_rad = 1e-5", ""))
    found = simulate(described)
    expected = sample(described.pendulum.equation(), Release(-0.2, 0.15), found.time_s)
    np.testing.assert_array_equal(found.values, expected)


def test_effects_add_up(tmp_path: Path) -> None:
    """A sensor's curvature on top of a jump of the pendulum's frequency."""
    both = model(
        tmp_path,
        table("frequency-step", change=1e-3, time=20.0) + table("sensor-quadratic", s2=0.3),
        TOML.replace("1e-5", "0.0"),
    )
    one = model(
        tmp_path, table("frequency-step", change=1e-3, time=20.0), TOML.replace("1e-5", "0.0")
    )
    plain = simulate(one).values
    np.testing.assert_allclose(simulate(both).values, plain + 0.3 * plain**2, 0.0, 1e-9)


def test_friction_stops_it_near_eq8s_own_stop(tmp_path: Path) -> None:
    """With an effect that does nothing, the motion is the engine's, and it rests within delta."""
    text = LINEAR.replace("c = 1e-4", "c = 5e-3").replace("1e-5", "0.0")
    described = model(tmp_path, table("cubic-stiffness", k3=0.0), text)
    found = simulate(described)
    expected = sample(described.pendulum.equation(), Release(-0.2, 0.15), found.time_s)
    displacement = 0.5 * math.pi * 5e-3 / (2.0 * math.pi * 0.9)
    assert np.ptp(found.values[-100:]) == 0.0
    assert abs(found.values[-1]) < 2.0 * displacement
    moving = np.abs(expected - expected[-1]) > 6.0 * displacement
    last = int(np.flatnonzero(moving)[-1])
    np.testing.assert_allclose(found.values[:last], expected[:last], 0.0, 1e-7)


def tail(recording: Recording) -> NDArray[np.float64]:
    return recording.values[len(recording.values) // 2 :]


def test_broadband_drive_has_its_floor(tmp_path: Path) -> None:
    """The variance at rest is S_a Q/(4 w^3)."""
    density, omega, quality = 1e-8, 2.0 * math.pi * 0.9, 20.0
    text = f"""
seed = 5
[pendulum]
frequency_hz = 0.9
quality_factor_viscous = {quality}
release_angle_rad = 1e-9
[sampling]
sample_rate_hz = 20.0
duration_s = 8000.0
"""
    shaken = simulate(model(tmp_path, table("broadband-drive", acceleration_density=density), text))
    expected = math.sqrt(density * quality / (4.0 * omega**3))
    # Half the record is some 570 correlation times: the rms is good to 3 %.
    assert np.std(tail(shaken)) == pytest.approx(expected, rel=0.15)


def test_jitter_is_noise_in_proportion_to_the_velocity(tmp_path: Path) -> None:
    text = TOML.replace("1e-5", "0.0")
    found = simulate(model(tmp_path, table("jitter", sigma_t=1e-3), text))
    own = simulate(model(tmp_path, text=text))
    velocity = np.gradient(own.values, own.time_s)
    ratio = (found.values - own.values)[1:-1] / velocity[1:-1]
    fast = np.abs(velocity[1:-1]) > 0.3
    assert np.std(ratio[fast]) == pytest.approx(1e-3, rel=0.1)


def test_coloured_noise_has_its_density(tmp_path: Path) -> None:
    text = TOML.replace("1e-5", "1e-3").replace("0.15\n", "1e-9\n")
    text = text.replace("duration_s = 40.0", "duration_s = 4000.0")
    own = simulate(model(tmp_path, text=text))
    found = simulate(model(tmp_path, table("coloured-noise", corner=1.0, exponent=2.0), text))
    frequency = np.fft.rfftfreq(len(found.values), 0.05)
    power = np.abs(np.fft.rfft(found.values)) ** 2 / np.abs(np.fft.rfft(own.values)) ** 2
    low = (frequency > 0.05) & (frequency < 9.0)
    np.testing.assert_allclose(power[low], 1.0 + frequency[low] ** -2.0, 1e-6)


def test_clipping_glitches_steps_and_codes(tmp_path: Path) -> None:
    clipped = simulate(model(tmp_path, table("clipping", upper_level=0.12))).values
    assert clipped.max() == 0.12
    assert clipped.min() < -0.13
    stepped = simulate(model(tmp_path, table("coarse-quantisation", step=2e-3))).values
    np.testing.assert_allclose(stepped / 2e-3, np.round(stepped / 2e-3), 0.0, 1e-9)
    own = simulate(model(tmp_path)).values
    glitched = simulate(model(tmp_path, table("glitches", number=7, rms=0.05))).values
    assert np.count_nonzero(glitched != own) == 7
    coarse = MEASURED + "bits = 8\n"
    own_codes = set(simulate(model(tmp_path, coarse)).values)
    fewer = set(simulate(model(tmp_path, coarse + table("missing-codes", number=2))).values)
    assert len(own_codes) - len(fewer) == 2


def test_a_soft_limit_bends_either_side_alike(tmp_path: Path) -> None:
    """The law y = L - w ln(1 + e^((L - x)/w)), and its mirror image at the lower limit."""
    own, width = simulate(model(tmp_path)).values, 0.01
    for side, level in ((1.0, "upper_level"), (-1.0, "lower_level")):
        given = table("clipping", width=width, **{level: 0.12 * side})
        expected = 0.12 - width * np.log1p(np.exp((0.12 - side * own) / width))
        np.testing.assert_allclose(side * simulate(model(tmp_path, given)).values, expected)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('[[effects]]\nid = "circular-eror"\n', "no effect 'circular-eror'; did you mean 'circ"),
        ("[[effects]]\nk3 = 1.0\n", "effects 1: its id is missing"),
        (table("cubic-stiffness", k4=1.0), "unknown parameter 'k4'; known are k3"),
        (table("impulse", dv=1.0), "'time' is missing; add it, in s"),
        (table("quadratic-drag", a=-1.0), "'a' is -1; give a number from 0 to 100, in 1/"),
        ('[[effects]]\nid = "cubic-stiffness"\nk3 = "x"\n', "'k3' is not a number"),
        (table("missing-codes", number=3), "(missing-codes): there are no missing codes without"),
        (table("coulomb-friction", c=1.0), "the pendulum does not swing"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(more: str, message: str, tmp_path: Path) -> None:
    with refused(message, "m.toml"):
        simulate(model(tmp_path, more), place="m.toml")


def quiet(text: str) -> str:
    return text.replace("noise_rad = 1e-5", "noise_rad = 0.0")


COLOUR = table("coloured-noise", corner=1.0, exponent=1.0)


@pytest.mark.parametrize(
    ("more", "text", "message"),
    [
        (COLOUR, quiet(TOML), "(coloured-noise): it colours the noise, and there is none"),
        ("[sensor]\n" + COLOUR, quiet(TOML), "(coloured-noise): it colours the noise"),
        (table("drag-form"), TOML.replace("a = 7e-3", "a = 0.0"), "where the pendulum's a is 0"),
        (table("clipping"), TOML, "(clipping): neither of its levels is given"),
        (table("clipping", width=0.01), TOML, "(clipping): neither of its levels is given"),
        (
            table("damping-step", change=0.3, time=10.0),
            TOML.replace("a = 7e-3\nc = 1e-4", "").replace("quality_factor_viscous = 300.0", ""),
            "(damping-step): it does nothing where the pendulum has no damping",
        ),
        (
            table("glitches", number=1, rms=0.02) + table("glitches", number=3, rms=0.02),
            TOML,
            "effects 2 (glitches): it is given before",
        ),
    ],
)
def test_an_effect_that_could_do_nothing_is_no_silent_null(
    more: str, text: str, message: str, tmp_path: Path
) -> None:
    """Else a recording would say that it has an effect, and would have none (or only the last)."""
    with refused(message, "m.toml"):
        simulate(model(tmp_path, more, text), place="m.toml")


def test_the_sensors_noise_can_be_coloured_too(tmp_path: Path) -> None:
    without = simulate(model(tmp_path, MEASURED, quiet(TOML)))
    coloured = simulate(model(tmp_path, MEASURED + COLOUR, quiet(TOML)))
    assert np.std(coloured.values - without.values) > 1e-5


def test_two_jumps_are_two_tables_of_one_effect(tmp_path: Path) -> None:
    """What has a template may come twice: the readings have both."""
    text = quiet(TOML)
    first, second = (table("impulse", dv=0.01, time=when) for when in (10.0, 20.0))
    bare, one, both = (
        simulate(model(tmp_path, more, text)).values for more in ("", first, first + second)
    )
    time_s = np.arange(len(bare)) / 20.0
    np.testing.assert_allclose(both[time_s < 20.0], one[time_s < 20.0], 0.0, 1e-9)
    assert np.max(np.abs(both - one)[time_s > 20.0]) > 1e-3
    assert np.max(np.abs(one - bare)) > 1e-3


SINE = quiet(TOML).replace(
    "release_angle_rad = 0.15", 'release_angle_rad = 2.5\nrestoring = "sine"'
)


def test_a_pendulum_with_sin_x_swings_as_the_engine_has_it(tmp_path: Path) -> None:
    recording = simulate(model(tmp_path, text=SINE))
    equation = model(tmp_path, text=SINE).pendulum.equation()
    assert equation.restoring == "sine"
    expected = sample(equation, Release(-0.2, 2.5), recording.time_s)
    np.testing.assert_array_equal(recording.values, expected)
    # At 2.5 rad the frequency is three fifths of that at small amplitudes.
    turned = np.sum(np.diff(np.sign(recording.values)) != 0) / 2.0 / 40.0
    assert 0.5 * 0.9 < turned < 0.9 * 0.9


def test_sin_x_goes_with_effects_and_ends_at_the_top(tmp_path: Path) -> None:
    plain = simulate(model(tmp_path, text=SINE)).values
    curved = simulate(model(tmp_path, table("sensor-cubic", s3=0.05), SINE)).values
    np.testing.assert_allclose(curved, plain + 0.05 * plain**3, rtol=0, atol=1e-6)
    with pytest.raises(InputError, match="beyond pi"):
        simulate(model(tmp_path, text=SINE.replace("2.5", "3.2")))


@pytest.mark.parametrize("drag", ["energy", "speed"])
@pytest.mark.parametrize("angle", [1.0, 2.0, 2.6])
def test_sin_x_as_an_effect_is_the_pendulum_with_sin_x(angle: float, drag: str) -> None:
    """By the general engine and by the compiled one, with every loss."""
    pendulum = {
        "frequency_hz": 0.5,
        "quality_factor_viscous": 100.0,
        "quality_factor_hysteretic": 300.0,
        "a": 3e-3,
        "c": 1e-3,
        "release_angle_rad": angle,
    }
    sampling = {"sample_rate_hz": 50.0, "duration_s": 60.0}
    plain = {"pendulum": pendulum | {"restoring": "linear"}, "sampling": sampling}
    forms = [{"id": "circular-error"}, *([{"id": "drag-form"}] if drag == "speed" else [])]
    sine = {"pendulum": pendulum | {"drag": drag}, "sampling": sampling}
    values = [simulate(read_model(each)).values for each in (plain | {"effects": forms}, sine)]
    np.testing.assert_allclose(*values, rtol=0, atol=2e-7 * angle)
