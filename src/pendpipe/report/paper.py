"""The paper's own numbers, for the column beside the campaign's."""

from __future__ import annotations

from typing import Final, NamedTuple


class Printed(NamedTuple):
    """A number as the paper prints it, and its value where it is one."""

    text: str
    value: float | None = None


TYPICAL_FREQUENCY_HZ: Final = 0.516
"""The frequency of the paper's figures 7 and 8."""

NUMBERS: Final = {
    "hysteretic_coefficient": Printed("3940 s²", 3940.0),
    "volts_per_radian": Printed("3.85 V/rad", 3.85),
    "limit": Printed("136", 136.0),
    "largest": Printed("about 120", 120.0),
    "first": Printed("below 40"),
    "hysteretic": Printed("1049", 1049.0),
    "viscous": Printed("156", 156.0),
    "viscous_theory": Printed("176", 176.0),
    "inertia": Printed("0.099 kg m²", 0.099),
    "theory_factor": Printed("1.13 (176/156)", 176.0 / 156.0),
    "history_coefficient": Printed("1 (assumed)", 1.0),
    "exponent_high": Printed("−5.6", -5.6),
    "exponent_low": Printed("0.50", 0.50),
    "steady": Printed("1000 to 3000 %"),
    "smallest": Printed("about 10", 10.0),
    "ratio": Printed("about ten and more"),
}
