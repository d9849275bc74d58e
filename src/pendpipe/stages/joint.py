"""The records' fits as the data of one joint fit, and its numbers in the form of campaign.json."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pendpipe.campaign.design import Design, design_of
from pendpipe.campaign.fit import Measured, measured
from pendpipe.configuration.load import Campaign
from pendpipe.stages.results import RecordResult

FEWEST_RECORDS = 3
"""With fewer there is nothing to compare: k and one effect are free."""


def placed(campaign: Campaign, results: Sequence[RecordResult]) -> list[RecordResult]:
    """The usable records of the configured apparatus: those with a fluid and a geometry."""
    return [
        result
        for result in results
        if campaign.configuration.apparatus is not None
        and (result.usable and result.record.fluid)
        and campaign.geometry(result.record) is not None
    ]


def campaign_data(
    campaign: Campaign, results: Sequence[RecordResult]
) -> tuple[Design, Measured] | None:
    """Design and data of the usable records with a geometry; None where too few swing.

    The joint fit compares with Eq. 16: it needs an apparatus, and three records, two of them in a
    fluid.
    """
    used = placed(campaign, results)
    if len(used) < FEWEST_RECORDS:
        return None
    design = design_of(campaign, [result.record for result in used])
    if design.wet.sum() < 2.0:
        return None
    values, covariances = [], []
    for result in used:
        fit = result.fit
        assert fit is not None
        order = [fit.covariance_order.index(name) for name in ("frequency", "b")]
        values.append([fit.parameters[name].value for name in ("frequency", "b")])
        covariances.append(np.asarray(fit.covariance)[np.ix_(order, order)])
    return design, measured(np.array(values), np.array(covariances))
