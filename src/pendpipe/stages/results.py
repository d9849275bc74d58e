"""What the campaign's own stages build on: the records' results, their joint fit, the theory."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pendpipe import physics
from pendpipe.analysis.compare import theory_curve
from pendpipe.analysis.fit.result import FitResult, read_fit
from pendpipe.arrays import FloatArray
from pendpipe.campaign.design import Design, design_of
from pendpipe.campaign.fit import Measured, measured
from pendpipe.configuration.apparatus import fluid_at, pendulum, pendulum_parts
from pendpipe.configuration.load import Campaign, Record
from pendpipe.configuration.models import Apparatus, Geometry
from pendpipe.estimate import Estimate
from pendpipe.files import read_json

FEWEST_RECORDS = 3
"""With fewer there is nothing to compare."""
POINTS_OF_A_CURVE = 60
"""Of a theoretical branch: a smooth line on a page."""


@dataclass(frozen=True)
class RecordResult:
    """One record's fit and calibration, or why it has none."""

    record: Record
    fit: FitResult | None
    calibration: dict[str, Any]
    refused: str | None = None

    @property
    def usable(self) -> bool:
        """Whether there is a fit that does not contradict the decay."""
        return self.fit is not None and self.fit.light != "red"

    def parameter(self, name: str) -> Estimate:
        """One of the fit's parameters (``a``, ``b``, ``c``, ``frequency``, ...)."""
        assert self.fit is not None
        return self.fit.parameters[name]


def read_results(campaign: Campaign, folder: Path) -> list[RecordResult]:
    """Read every record's fit, in the order of the table, from a folder with one for each."""
    results = []
    for record in campaign.records:
        home = folder / record.record
        refused = read_json(home / "fit.json").get("refused")
        fit = None if refused else read_fit(home / "fit.json")
        constant = read_json(home / "calibration.json")
        results.append(RecordResult(record, fit, constant, refused))
    return results


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
    campaign: Campaign, results: Sequence[RecordResult], without: Collection[str] = ()
) -> tuple[Design, Measured] | None:
    """Design and data of the usable records with a geometry, each recording once; None without."""
    out = {*twins(results), *without}
    used = [one for one in placed(campaign, results) if one.record.record not in out]
    if not used:
        return None
    design = design_of(campaign, [result.record for result in used])
    fits = [result.fit for result in used if result.fit is not None]
    values = np.array([(fit.value("frequency"), fit.value("b")) for fit in fits])
    return design, measured(values, np.array([fit.covariance_of("frequency", "b") for fit in fits]))


def left_out(
    campaign: Campaign, results: Sequence[RecordResult], diagnosis: Path | None = None
) -> dict[str, str]:
    """Records that disagree with all others, and by how much, as the campaign's diagnosis says.

    Where there is none they are searched for. The campaign's numbers are those without them.
    """
    from pendpipe.campaign.search import search
    from pendpipe.campaign.seen import Far, off

    together = campaign_data(campaign, results)
    if together is None or not enough(together[0]):
        return {}
    found = (
        [Far(**far) for far in read_json(diagnosis)["left_out"]]
        if diagnosis
        else search(*together, level=campaign.configuration.diagnose.level).left_out
    )
    return {far.record: f"off the others: {off(far)}" for far in found}


def surprises(diagnosis: Path | None) -> dict[str, float]:
    """By how many sigma each record is off what all the others predict of it, if they can."""
    rows = read_json(diagnosis).get("records", []) if diagnosis else []
    return {row["record"]: row["pull_from_the_others"] for row in rows}


def enough(design: Design) -> bool:
    """Whether records can be compared: k and one effect are free."""
    return len(design.runs) >= FEWEST_RECORDS and design.wet.sum() >= 2.0


def twins(results: Sequence[RecordResult]) -> dict[str, str]:
    """Records whose fit is another's to the last digit, and the first that has it."""
    first: dict[tuple[float, float], str] = {}
    found = {}
    for result in results:
        if result.fit is not None:
            name = result.record.record
            numbers = result.fit.value("frequency"), result.fit.value("b")
            if first.setdefault(numbers, name) != name:
                found[name] = first[numbers]
    return found


def record_theory(campaign: Campaign, record: Record) -> dict[str, Any] | None:
    """What geometry and theory say of one record; ``None`` without a geometry.

    Returns
    -------
    dict
        ``frequency_hz``, ``moment_of_inertia_kg_m2`` and ``restoring_torque_n_m_per_rad``
        of any pendulum; with a sphere in the fluid also a/delta and the lengthening of the
        period.
    """
    apparatus = campaign.configuration.apparatus
    if apparatus is None or campaign.geometry(record) is None:
        return None
    built = pendulum(campaign, record)
    content: dict[str, Any] = {
        "frequency_hz": float(built.swing.frequency_hz),
        "moment_of_inertia_kg_m2": float(built.swing.moment_of_inertia_kg_m2),
        "restoring_torque_n_m_per_rad": float(built.swing.restoring_torque_n_m_per_rad),
    }
    curve = _theory(apparatus, built.parts, built.fluid)
    if curve is None:
        return content
    names = ("buoyancy", "added_mass", "both")
    return content | {
        "a_over_delta": float(curve["a_over_delta"][0]),
        "lengthening": {name: float(curve[f"lengthening_{name}"][0]) for name in names},
    }


def branch_curves(campaign: Campaign, branch: str) -> dict[str, list[float]] | None:
    """Theory along a branch: the weights move evenly from each record's place to the next.

    ``None`` for a branch of fewer than two records, or without a sphere in a fluid.
    """
    apparatus = campaign.configuration.apparatus
    records = [record for record in campaign.records if record.branch == branch]
    geometries = [place for record in records if (place := campaign.geometry(record))]
    if apparatus is None or len(geometries) < 2 or not all(place.sphere for place in geometries):
        return None
    parts = pendulum_parts(apparatus, _moved(geometries), sphere=True)
    fluid = fluid_at(campaign.configuration.fluids[records[0].fluid], records[0].temperature_c)
    curve = _theory(apparatus, parts, fluid)
    assert curve is not None
    order = np.argsort(curve["frequency_hz"])
    return {name: values[order].tolist() for name, values in curve.items()}


def _theory(
    apparatus: Apparatus, parts: Sequence[physics.Part], fluid: physics.Fluid
) -> dict[str, FloatArray] | None:
    return theory_curve(
        parts, fluid, apparatus.gravity_m_per_s2, plain_added_mass=apparatus.added_mass == "plain"
    )


def _moved(geometries: Sequence[Geometry]) -> dict[str, FloatArray]:
    """Each weight's positions along the way; a weight that comes and goes is left out."""
    names = set.intersection(*(set(place.weights_m) for place in geometries))
    way = np.linspace(0.0, len(geometries) - 1.0, POINTS_OF_A_CURVE)
    return {
        name: np.interp(
            way, np.arange(len(geometries)), [place.weights_m[name] for place in geometries]
        )
        for name in sorted(names)
    }
