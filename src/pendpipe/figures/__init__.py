"""Figures: the paper's for a campaign, and a record's decay and diagnosis.

A figure of a campaign is a function and a row in `campaign`, and a caption in
`pendpipe.report.captions`; a figure of a diagnosis is a function, a row in `diagnosis` and
its name below, where it can be read without matplotlib.
"""

from typing import Final

OF_A_DIAGNOSIS: Final = (
    *("decay", "residual_map", "residual_spectrum"),
    *("damping", "frequency", "curve"),
)
"""The figures of a diagnosis, each drawn where it has something to show."""
