"""What is known of real recordings is found in them without being given.

They are read where they lie (``../shared/recordings``). Here mostly single laws are fitted, which
is quick; ``docs/recordings.md`` holds whole diagnoses, and what they have found of it.
"""

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pendpipe.analysis.fit import fit_recording
from pendpipe.analysis.free_decay import measure_recording
from pendpipe.analysis.readings import motion_of
from pendpipe.analysis.turning_points.measure import prepare
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.begin import Beginning, begin
from pendpipe.diagnosis.cycles import small_swings
from pendpipe.diagnosis.forensics.sampling_times import gap_note
from pendpipe.diagnosis.hypothesis import first_noise
from pendpipe.diagnosis.location import beat_of
from pendpipe.diagnosis.refine import Fit, fit_in_growing_window
from pendpipe.dynamics.eq8 import A, C, Restoring
from pendpipe.effects.catalogue import by_identifier
from pendpipe.formats import read
from pendpipe.recording import Recording

SHARED = Path(__file__).resolve().parents[3] / "shared" / "recordings"
pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/recordings here")

RIG = "profcarter-adip/adip_pend_data.mat"
STRING = "jiarui-phy180/AAAtAmp3.txt"
SHIP = "kvlcc2-roll-decay/model_test_21337.csv"
SPRING = "filo0509-spring/molla_durissima_discopieno_14.91945_0.2016_1.csv"
ROD, GAP = "yfysiks-encoder/data2_14.csv", "yfysiks-encoder/data2_12.csv"


def whole(name: str) -> Recording:
    return motion_of(read(SHARED / name))


@functools.cache
def beginning_of(name: str) -> Beginning:
    points, part = measure_recording(whole(name), name)
    fit = fit_recording(part, points=points)
    return begin(prepare(part, name), points, fit, baseline="eq8", fixed={})


@functools.cache
def fitted(name: str, restoring: Restoring = "linear", **effects: tuple[float, ...]) -> Fit:
    """Eq. 8 with some effects (underscores for hyphens) from start values, to a recording."""
    found = beginning_of(name)
    model, noise = replace(found.model, restoring=restoring), first_noise(found)
    value = found.value
    for identifier, start in effects.items():
        model = model.adding(by_identifier(identifier.replace("_", "-")))
        value = np.append(value, start)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        fit = fit_in_growing_window(model, found.data, noise, value, held=found.held)
    assert fit is not None
    return fit


def values(fit: Fit, identifier: str) -> FloatArray:
    """An effect's values in a fit."""
    place = next(place for effect, place in fit.model.places() if effect.identifier == identifier)
    return fit.value[place]


def test_a_pendulum_has_the_circular_error_of_its_geometry() -> None:
    sine = fitted(STRING, "sine")
    free = fitted(STRING, cubic_stiffness=(-0.16,))
    # A cubic torque in its place is the first term of sin x = x - x^3/6, and a little less.
    assert values(free, "cubic-stiffness")[0] == pytest.approx(-1.0 / 6.0, rel=0.05)
    # The frequency follows sin x over all cycles to a few tenths of a radian of phase.
    assert sine.max_phase_error_rad < 0.2


@pytest.mark.slow
def test_a_mass_on_a_spring_beats_with_a_second_mode() -> None:
    fit = fitted(SPRING, presliding_friction=(0.0, 0.02), tone_pickup=(0.0, 0.0, 1.005))
    beat = beat_of(fit, by_identifier("tone-pickup"))
    # The readings' spectrum has lines at 1.3451 and 1.0060 Hz.
    assert beat == pytest.approx(1.0 / (1.3451 - 1.0060), rel=0.02)
    # The smaller one's amplitude there is 0.4 mm.
    assert np.hypot(*values(fit, "tone-pickup")[:2]) == pytest.approx(0.4e-3, rel=0.2)


def test_a_bearing_stiffens_where_it_no_longer_slides() -> None:
    found = beginning_of(ROD)
    small = small_swings(fitted(ROD, "sine"), found.data, first_noise(found))
    assert small.significant
    assert small.amplitude_rad < 0.04
    assert 0.005 < small.frequency_excess < 0.1
    assert "stiffer" in small.sentence("rad")


@pytest.mark.slow
def test_bearing_and_air_share_the_loss_of_a_rig() -> None:
    value = beginning_of(RIG).value
    # Known: quadratic drag and Coulomb friction in near equal measure, at 1.2 rad and below.
    drag, friction = value[A] * 1.2, value[C] / 1.2
    assert 0.2 < friction / drag < 5.0


def test_a_gap_of_the_time_stamps_is_noted_with_its_time_and_length() -> None:
    recording = whole(GAP)
    note = gap_note(recording.time_s, 0.72, counts=True)
    assert note is not None
    assert "13.24 s after 241.5" in note
    before = recording.time_s < 200.0
    assert gap_note(recording.time_s[before], 0.72, counts=True) is None
