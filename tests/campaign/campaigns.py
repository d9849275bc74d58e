"""The default campaign's design, and data that its model predicts."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.campaign.design import Design, design_of
from pendpipe.campaign.fit import Candidate, Measured, measured, predict
from pendpipe.configuration.load import load_campaign, read_configuration

ROOT = Path(__file__).parents[2]


@cache
def default(inertia_exponent: float = 1.0, walls: bool = False) -> Design:
    """The paper's 27 records; by default with its loss torque, k f^2 whatever the inertia.

    With `walls` Eq. 16 is that in the tank that the configuration tells.
    """
    path = ROOT / "config/config.yaml"
    content = read_configuration(path) | {"records": str(ROOT / "config/records.tsv")}
    content["apparatus"]["hysteresis"] = {"inertia_exponent": inertia_exponent}
    campaign = load_campaign(content, path)
    return replace(design_of(campaign, campaign.records), walls=walls)


def data(
    design: Design,
    added: tuple[Candidate, ...] = (),
    sizes: tuple[float, ...] = (),
    seed: int | None = None,
    moved: FloatArray | None = None,
) -> Measured:
    """What the records would read: b to 0.1 %, the frequency to 3e-6; noise where there is a seed.

    Sizes are in the effects' own units; `moved` are the nuisances in their standard deviations.
    """
    at = np.zeros(len(design.nuisances)) if moved is None else moved
    units = [size / one.effect.expected for size, one in zip(sizes, added, strict=True)]
    values = predict(design, added, np.concatenate([at, units]))
    sds = values * np.array([3e-6, 1e-3])
    if seed is not None:
        values = values + sds * np.random.default_rng(seed).standard_normal(values.shape)
    return measured(values, sds[:, :, None] * sds[:, None, :] * np.eye(2))
