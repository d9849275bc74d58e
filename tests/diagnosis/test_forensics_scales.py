"""The tests of the measurement know no second and no radian: Eq. 8 looks the same in any unit."""

from dataclasses import dataclass

import numpy as np
import pytest

from pendpipe.arrays import FloatArray

from .decays import Fitted, Pendulum, fitted
from .examine import TESTS
from .faults import AIR, FAULTS


@dataclass(frozen=True)
class Scaled(Pendulum):
    """The same decay, slower and larger by two factors."""

    slower: float = 1.0
    larger: float = 1.0

    def values(self) -> FloatArray:
        a, b, c, share, omega, angle, start, offset = super().values()
        slow, large = self.slower, self.larger
        losses = a / (slow * large), b / slow, c * large / slow
        motion = omega / slow, angle * large, start * slow, offset * large
        return np.array([*losses, share, *motion])


def judged(record: Fitted) -> dict[str, tuple[float, float]]:
    """By test: the p-value's logarithm, and the gain."""
    found = {}
    for name, find in TESTS.items():
        finding = find(record.data, record.fit, record.noise, record.samples)
        found[name] = float(np.log(max(finding.p_value, 1e-290))), finding.delta_chi2
    return found


@pytest.fixture(scope="module")
def clean() -> FloatArray:
    return AIR.model().reading(AIR.values())


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize(("slower", "larger"), [(1.0 / 16.0, 64.0), (8.0, 1.0 / 32.0)])
def test_a_fault_is_as_clear_in_other_units(
    fault: str, slower: float, larger: float, clean: FloatArray
) -> None:
    record = FAULTS[fault].make(clean, np.random.default_rng([17, 5]))
    scaled = fitted(
        Scaled(rate_hz=AIR.rate_hz / slower, slower=slower, larger=larger),
        larger * record.data.values,
        slower * record.data.time_s,
    )
    expected, found = judged(record), judged(scaled)
    for name in TESTS:
        assert found[name] == pytest.approx(expected[name], rel=1e-3, abs=1e-3), name
