"""Figures: the paper's for a campaign, and a record's decay and diagnosis.

A figure of a campaign is a function and a row in `campaign`, and a caption in
`pendpipe.report.captions`; a figure of a diagnosis is a function, a row in `diagnosis` and
its name below, where it can be read without matplotlib.
"""

from typing import Final

OF_EVERY_DIAGNOSIS: Final = ("residual_map", "residual_spectrum", "damping", "frequency")
"""The figures that the diagnosis of every record has."""
OF_SOME_DIAGNOSES: Final = ("decay", "curve")
"""The figures that are drawn where they have something to show."""
