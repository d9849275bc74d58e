"""Tones of any frequency: a line stands out of what lies beside it, a resonance does not."""

from dataclasses import replace

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.spectrum import Band, ToneScan, tone_scan

from .records import FREQUENCY_HZ, INTERVAL_S, TIME_S, null_fit, white

LINE_HZ = 3.3


def scanned(readings: FloatArray, decay_s: float = np.inf) -> tuple[ToneScan, FloatArray]:
    """A scan of readings for tones, steady or fading, and the chi^2 of each frequency."""
    fit, data, noise = null_fit()
    basis = np.linalg.qr(fit.jacobian[:, list(fit.free)])[0]
    scan = tone_scan(data, noise, basis, decay_s, Band(0.1, FREQUENCY_HZ))
    whitened = np.append(noise.whiten(readings), 0.0)
    whitened -= basis @ (basis.T @ whitened)
    return scan, scan.scores(noise.adjoint(whitened[:-1]))


def test_a_line_in_white_noise_is_as_improbable_as_the_noise_says() -> None:
    """exp(-chi^2/2): its neighbours are no louder than they should be."""
    line = 3e-5 * np.cos(2.0 * np.pi * LINE_HZ * TIME_S)
    scan, scores = scanned(white(7) + line)
    best = int(np.argmax(scores))
    assert scan.frequency_hz[best] == pytest.approx(LINE_HZ, abs=1.0 / np.ptp(TIME_S))
    assert scores[best] > 40.0
    assert np.log(scan.p_values(scores)[best]) == pytest.approx(-0.5 * scores[best], rel=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_the_highest_peak_of_a_resonance_is_no_line(seed: int) -> None:
    """Noise that is twenty times as strong at its centre: some of it looks like a line."""
    wave = np.fft.rfft(white(seed))
    frequency_hz = np.fft.rfftfreq(len(TIME_S), INTERVAL_S)
    wave *= np.sqrt(1.0 + 19.0 / (1.0 + ((frequency_hz - LINE_HZ) / 0.6) ** 2))
    scan, scores = scanned(np.fft.irfft(wave, len(TIME_S)))
    best = int(np.argmax(scores))
    # Against the noise that was assumed it would be one in a million or less.
    assert np.exp(-0.5 * scores[best]) < 1e-6
    # 1500 cosines are tried: one in fifty is as improbable as that.
    assert scan.p_values(scores).min() > 0.02 / len(TIME_S)


@pytest.mark.parametrize("decay_s", [25.0, 50.0])
def test_a_tone_that_fades_is_not_hidden_by_its_own_width(decay_s: float) -> None:
    """What lies a few 1/duration beside it is its own."""
    tone = 1e-3 * np.exp(-TIME_S / decay_s) * np.cos(2.0 * np.pi * LINE_HZ * TIME_S)
    scan, scores = scanned(white(7) + tone, decay_s)
    best = int(np.argmax(scores))
    assert scores[best] > 1000.0
    assert np.log(scan.p_values(scores)[best]) < -50.0


def test_beside_a_strong_line_its_neighbours_tell_the_noise() -> None:
    """The spectrum may be unknown there by a factor of four: no line would be improbable."""
    line = 3e-4 * np.cos(2.0 * np.pi * LINE_HZ * TIME_S)
    scan, scores = scanned(white(7) + line)
    unsure = replace(scan, log_scale_variance=np.full_like(scan.log_scale_variance, 2.0))
    best = int(np.argmax(scores))
    assert np.log(unsure.p_values(scores)[best]) < -50.0
    assert unsure.p_values(scanned(white(8))[1]).min() > 0.02 / len(TIME_S)
