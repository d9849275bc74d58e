"""All tests of the measurement one after the other, as a search makes them on a record."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pendpipe.diagnosis.forensics import FINDERS
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.result import Finding

from .decays import Fitted

_SURE = 1e-3
"""p-value from which a finding's readings are left out of the tests that follow."""


def _made(name: str) -> Callable[..., Finding]:
    """Make the tests for one fault: what the first says that can be made."""
    finds = [finder.find for finder in FINDERS if finder.name == name]

    def make(*given: Any) -> Finding:
        found = (find(Evidence(*given)) for find in finds)
        return next((each for each in found if each is not None), Finding(name, 1.0))

    return make


_NOTES = ("changing-noise", "wandering-zero")
TESTS = {each.name: _made(each.name) for each in FINDERS if each.name not in _NOTES}
"""By name of a fault, its test."""


def examine(record: Fitted) -> list[Finding]:
    """Make every test; what is found and what is not."""
    data, findings = record.data, []
    for find in TESTS.values():
        finding = find(data, record.fit, record.noise, record.samples)
        findings.append(finding)
        if finding.p_value > _SURE:
            continue
        if finding.mask is not None:
            data = data.masked((data.weight == 0.0) | finding.mask)
        if finding.time_s is not None:
            # To first order, the readings that the false stamps' moments would have had.
            late = data.time_s - finding.time_s
            data = replace(data, values=data.values + record.fit.at.sampled.velocity * late)
    return findings
