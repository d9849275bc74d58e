"""Which causes of a drag that is 12 % too large the default campaign can tell apart.

    python -m benchmarks.identifiability [--sd 0.001]

For 15 records in water and 12 in air, b to 0.1 % (or `--sd`), each cause is scaled to 12 % at the
paper's record (water-low-7). Printed are its excess over Eq. 16 at four records; the sigma by
which the wrong one of each pair is rejected (above the diagonal; the worse direction) and the
|cosine| of their patterns (below), from b alone and from b and frequency; then what is left of
each outside the wall family.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pendpipe.campaign.design import Design, design_of
from pendpipe.campaign.fit import Candidate, JointFit, joint_fit, measured, named, predict
from pendpipe.configuration.load import load_campaign, read_configuration

ROOT: Final = Path(__file__).resolve().parents[1]
RECORD, SIZE = "water-low-7", 0.12
CAUSES: Final = {
    "A": ("uniform-drag-excess", None),
    "B": ("history-term", None),
    "T": ("viscosity-temperature", None),
    "S": ("stem-drag", None),
    "W": ("wall-confinement", "slip"),
    "M": ("added-mass", None),
    "F": ("free-surface", 1.42),
    "Q": ("drag-law-transition", None),
    "I": ("moment-of-inertia", ("branch", "high")),
    "D": ("temperature-trend", None),
    "K": ("hysteresis-inertia-scaling", None),
    "R": ("air-drag-in-benchmark", None),
    "G": ("grease-drag", None),
}
FIXED: Final = {"I": -0.12, "D": 3.0}
"""Sizes that are not 12 % at the paper's record: relative I of the high branch, and K."""


def default_design() -> Design:
    """The paper's 27 records, with a constant loss torque and air that drags."""
    content = read_configuration(ROOT / "config/config.yaml")
    content["records"] = str(ROOT / "config/records.tsv")
    content["fluids"]["air"]["boundary_layer"] = True
    content["apparatus"]["hysteresis"] = {"inertia_exponent": 1.0, "assembly_relative_sd": 0.0}
    campaign = load_campaign(content, "config.yaml")
    return design_of(campaign, campaign.records)


def patterns(design: Design, fit: JointFit) -> dict[str, NDArray[np.float64]]:
    """Change of the whitened residuals by each cause at its size, shape (rows,)."""
    number = [run.record for run in design.runs].index(RECORD)
    nothing = np.zeros(len(design.nuisances))
    plain = predict(design, (), nothing)
    viscous = predict(replace(design, coefficient_s2=np.inf), (), nothing)[number, 1]
    found = {}
    for letter, (identifier, shape) in CAUSES.items():
        one = Candidate(named(identifier)[0].effect, shape)
        column = fit.derivative(one)
        if letter == "D":
            found[letter] = column * FIXED["D"] / one.effect.expected
            continue
        step = 1e-3
        moved = predict(design, (one,), np.append(nothing, step))
        if letter == "I":  # 12 % of I at the branch's middle
            change = 0.12 * 0.0579 / one.effect.expected
            found[letter] = -column * change
            continue
        slope = (moved[number, 1] - plain[number, 1]) / step
        found[letter] = column * SIZE * viscous / slope if slope else column
    return found


def table(design: Design, relative_sd: float, *, frequency: bool) -> str:
    """Sigma above, |cosine| below the diagonal."""
    nothing = np.zeros(len(design.nuisances))
    plain = predict(design, (), nothing)
    sds = plain * np.array([3e-6, relative_sd])
    covariance = sds[:, :, None] * sds[:, None, :] * np.eye(2)
    data = measured(plain, covariance)
    if not frequency:  # b alone, the second row of each record
        data = data._replace(whitening=data.whitening[:, 1:])
    fit = joint_fit(design, data)
    basis, _ = np.linalg.qr(fit.jacobian)
    left = {
        letter: column - basis @ (basis.T @ column)
        for letter, column in patterns(design, fit).items()
    }
    sizes = {letter: float(np.linalg.norm(column)) for letter, column in left.items()}
    lines = ["| |" + "|".join(left) + "|", "|-" * (len(left) + 1) + "|"]
    letters = list(left)
    for row, one in enumerate(letters):
        cells = []
        for column, other in enumerate(letters):
            cosine = abs(float(left[one] @ left[other])) / (sizes[one] * sizes[other])
            apart = min(sizes[one], sizes[other]) * np.sqrt(max(1.0 - cosine**2, 0.0))
            cells.append(
                "-" if row == column else f"{apart:.2g}" if column > row else f"{cosine:.3f}"
            )
        lines.append(f"|{one}|" + "|".join(cells) + "|")
    walls = np.stack([left["W"]], axis=-1)
    outside, _ = np.linalg.qr(walls)
    rest = {
        letter: float(np.linalg.norm(column - outside @ (outside.T @ column)))
        for letter, column in left.items()
    }
    lines.append("alone: " + ", ".join(f"{letter} {size:.3g}" for letter, size in sizes.items()))
    lines.append(
        "outside the walls: " + ", ".join(f"{letter} {size:.3g}" for letter, size in rest.items())
    )
    return "\n".join(lines)


def excess(design: Design) -> str:
    """Excess of the viscous loss over Eq. 16 at four records, 12 % at the paper's."""
    records = ("water-low-1", "water-low-7", "water-high-1", "water-high-8")
    index = [[run.record for run in design.runs].index(name) for name in records]
    nothing = np.zeros(len(design.nuisances))
    plain = predict(design, (), nothing)
    viscous = predict(replace(design, coefficient_s2=np.inf), (), nothing)[index, 1]
    lines = ["| cause | " + " | ".join(records) + " |", "|---|---|---|---|---|"]
    for letter, (identifier, shape) in CAUSES.items():
        one = Candidate(named(identifier)[0].effect, shape)
        moved = predict(design, (one,), np.append(nothing, 1e-3))
        change = ((moved - plain)[index, 1]) / viscous
        if abs(change[1]) > 1e-12:
            change = SIZE * change / change[1]
        else:
            change = SIZE * change / np.abs(change).max()
        lines.append(f"| {letter} {identifier} | " + " | ".join(f"{x:.3f}" for x in change) + " |")
    return "\n".join(lines)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--sd", type=float, default=1e-3, help="relative, of b (%(default)s)")
    spread = parser.parse_args().sd
    design = default_design()
    print(excess(design), "\nfrom b alone", table(design, spread, frequency=False), sep="\n\n")
    print("\nfrom b and the frequency", table(design, spread, frequency=True), sep="\n\n")


if __name__ == "__main__":
    main()
