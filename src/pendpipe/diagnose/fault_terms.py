"""The numbers of a fault by the names and in the units of the catalogue."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from pendpipe.diagnose.data import Data
from pendpipe.diagnose.result import Named
from pendpipe.effects.catalogue import by_identifier
from pendpipe.estimate import Estimate

_NAMES: Final = {
    "broadband-drive": {"S_a": "acceleration_density"},
    "clipping": {"low": "lower_level", "high": "upper_level"},
}
"""What the tests of the measurement call it, and what the catalogue does."""


def in_catalogue_terms(fault: Named, data: Data) -> Named:
    """Tell a fault's numbers as `pendpipe simulate` asks for them, where it asks for them.

    What a test measures beside them (a share, a number of readings) keeps its own name.

    Parameters
    ----------
    fault
        As its test tells it.
    data
        The readings: their unit and their interval.
    """
    names = _NAMES.get(fault.identifier, {})
    units = {
        parameter.name: parameter.unit_in(data.unit)
        for parameter in by_identifier(fault.identifier).parameters
    }
    told = {}
    for own, estimate in fault.parameters.items():
        name = names.get(own, own)
        told[name] = replace(estimate, unit=units.get(name, estimate.unit))
    if fault.identifier == "dropped-samples" and "samples" in told:
        late = told["samples"].value * data.interval_s / data.fold
        told = {"d": Estimate(late, 0.0, units["d"]), **told}
    return replace(fault, parameters=told)
