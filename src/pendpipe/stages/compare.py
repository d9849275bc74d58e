"""Compare a campaign's losses with Eq. 16, and sum the campaign up in numbers."""

from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.analysis.compare import (
    Comparison,
    SharedErrors,
    SharedEstimate,
    Surroundings,
    amplitude_misfit,
    compare,
    tail_fits,
)
from pendpipe.analysis.turning_points import read_turning_points
from pendpipe.arguments import INPUT, OUTPUT, Arguments, load, shared
from pendpipe.campaign.design import design_of
from pendpipe.campaign.fit import InertiaSds, inertia_sds, joint_values
from pendpipe.configuration.apparatus import pendulum
from pendpipe.configuration.jobs import digest
from pendpipe.configuration.load import Campaign
from pendpipe.estimate import Estimate
from pendpipe.files import read_json, write_json
from pendpipe.manifest import job
from pendpipe.physics import hysteretic_quality_factor, inertia_from_frequency
from pendpipe.provenance import code_version
from pendpipe.stages.results import (
    RecordResult,
    branch_curves,
    campaign_data,
    placed,
    read_results,
    record_files,
    record_theory,
    sensor_file,
)
from pendpipe.stages.separate import Separation, read_separation
from pendpipe.version import __version__

ARGUMENTS: Final = shared("--campaign", required=True) | {
    "--separation": {"type": Path, "required": True, "help": "the stage before's JSON"} | INPUT,
    "--out": {"type": Path, "required": True, "help": "the comparison, JSON"} | OUTPUT,
    "--summary": {"type": Path, "required": True, "help": "campaign.json"} | OUTPUT,
}


def run(arguments: Arguments) -> None:
    """Compare."""
    campaign = load(arguments.campaign)
    inputs = [
        arguments.separation,
        sensor_file(campaign),
        *record_files(campaign, "fit.json", "calibration.json", "turning_points.csv"),
    ]
    outputs = [arguments.out, arguments.summary]
    with job(campaign.folder, "compare", inputs=inputs, outputs=outputs):
        compare_campaign(campaign, arguments.separation, arguments.out, arguments.summary)


def compare_campaign(campaign: Campaign, separation: Path, out: Path, summary: Path) -> None:
    """Compare the losses with Eq. 16 and write both files."""
    results = read_results(campaign)
    separated = read_separation(separation)
    together = campaign_data(campaign, results)
    rows = [result.record for result in placed(campaign, results)]
    spread = inertia_sds(design_of(campaign, rows)) if rows else {}
    found = _comparison(campaign, separated, spread)
    settings = campaign.configuration
    content = {
        "schema_version": 1,
        "title": settings.title,
        "typical_record": settings.typical_record,
        "has_theory": settings.apparatus is not None,
        "records": [_record(campaign, result, separated, found, spread) for result in results],
        "curves": _curves(campaign, separated),
        "hysteretic_coefficient": separated.benchmark,
        **_campaign_numbers(found),
        "joint": None if together is None else joint_values(*together),
        # The trap of tail fits, on the typical record.
        "tail": [
            fit
            for result in results
            if result.record.record == settings.typical_record and result.refused is None
            for fit in tail_fits(
                read_turning_points(campaign.folder / result.record.record / "turning_points.csv")
            )
        ],
        "calibration": read_json(sensor_file(campaign)) if settings.calibration else None,
        "provenance": {
            "version": __version__,
            "code": code_version("pendpipe.stages.compare"),
            "configuration": digest(settings.model_dump(exclude={"results", "records"})),
            "seed": settings.seed,
            "packages": {name: version(name) for name in PACKAGES},
        },
    }
    write_json(out, content)
    write_json(summary, campaign_summary(content))


def _comparison(
    campaign: Campaign, separated: Separation, spread: dict[str, InertiaSds]
) -> Comparison | None:
    """Compare Eq. 16 with what Eq. 17 leaves; ``None`` where no record has a theory."""
    apparatus = campaign.configuration.apparatus
    if apparatus is None or apparatus.sphere is None or separated.benchmark is None:
        return None
    around, warm = {}, (0.0, 20.0)
    for split in separated.records:
        row = campaign.record(split.measured.record)
        geometry = campaign.geometry(row)
        if geometry is None or not geometry.sphere or not row.fluid:
            continue
        density, viscosity = pendulum(campaign, row).fluid
        fluid = campaign.configuration.fluids[row.fluid]
        if fluid.temperature_c is not None:
            at = fluid.temperature_c if row.temperature_c is None else row.temperature_c
            warm = max(warm, (fluid.temperature_sd_k, at))
        around[row.record] = Surroundings(
            apparatus.sphere.diameter_m / 2,
            apparatus.sphere.distance_m,
            float(np.asarray(viscosity)),
            float(np.asarray(density)),
        )
    if not around:
        return None
    errors = SharedErrors(
        inverse_k=float(separated.benchmark["inverse_sd"]),
        radius_m=apparatus.sphere.diameter_sd_m / 2,
        distance_m=apparatus.sphere.distance_sd_m,
        relative_inertia=float(np.mean([spread[name].common for name in around])),
        temperature_k=warm[0],
        temperature_c=warm[1],
    )
    return compare(separated.records, around, errors)


_OF_A_FIT: Final = (
    "quality_factor_limit",
    "method",
    "noise_rms_rad",
    "residual_rms_rad",
    "chi2_per_dof",
    "samples",
    "turning_points",
    "cuts",
    "light",
    "light_reason",
)
"""What is taken over from fit.json as it stands."""


def _record(
    campaign: Campaign,
    result: RecordResult,
    separated: Separation,
    found: Comparison | None,
    spread: dict[str, InertiaSds],
) -> dict[str, Any]:
    """Everything that is known of one record."""
    row = result.record
    content: dict[str, Any] = {
        "record": row.record,
        "source": row.file.name if row.file else row.source.partition(":")[0],
        "fluid": row.fluid,
        "branch": row.branch,
        "geometry": row.geometry,
        "temperature_c": row.temperature_c,
        "refused": result.refused,
    }
    if result.fit is None:
        return content
    fit = result.fit.to_dict()
    split = next((s for s in separated.records if s.measured.record == row.record), None)
    excluded = [] if result.usable else [f"not separated: {fit['light_reason']}"]
    points = read_turning_points(campaign.folder / row.record / "turning_points.csv")
    content |= {
        **fit["parameters"],
        **{name: fit[name] for name in _OF_A_FIT},
        "input_sha256": fit["provenance"].get("input_sha256"),
        "warnings": [*excluded, *fit["warnings"], *result.calibration["warnings"]],
        "volts_per_radian": result.calibration["volts_per_radian"],
        "start_s": float(points.time_s[0]),
        "stop_s": float(points.time_s[-1]),
        "misfit": amplitude_misfit(points),
    }
    if split is not None:
        # The losses after Eq. 17, the errors of the calibration and of k in them.
        content |= {
            "a": split.quadratic.as_json(),
            "c": split.coulomb.as_json(),
            "quality_factor_limit": split.quality_factor_limit.as_json(),
            "quality_factor_hysteretic": split.quality_factor_hysteretic.as_json(),
            "quality_factor_viscous": split.quality_factor_viscous.as_json(),
        }
    return content | _theory(campaign, result, found, spread.get(row.record))


def _theory(
    campaign: Campaign,
    result: RecordResult,
    found: Comparison | None,
    spread: InertiaSds | None,
) -> dict[str, Any]:
    """Inertia in two ways, Eq. 16 and its neighbours."""
    theory = record_theory(campaign, result.record)
    if theory is None:
        return {}
    torque = theory["restoring_torque_n_m_per_rad"]
    frequency = result.parameter("frequency")
    known = theory["moment_of_inertia_kg_m2"]
    inertia = float(inertia_from_frequency(frequency.value, torque))
    spread = spread or InertiaSds(0.0, 0.0, 0.0)
    relative = np.hypot(2.0 * frequency.sd / frequency.value, spread.from_frequency)
    content: dict[str, Any] = {
        "moment_of_inertia": Estimate(
            known, known * float(np.hypot(spread.own, spread.common)), "kg m^2"
        ).as_json(),
        "moment_of_inertia_from_frequency": Estimate(
            inertia, inertia * float(relative), "kg m^2"
        ).as_json(),
        "frequency_theory_hz": theory["frequency_hz"],
    }
    if "a_over_delta" not in theory:
        return content
    content |= {name: theory[name] for name in ("a_over_delta", "lengthening")}
    names = [] if found is None else found.table["record"].tolist()
    if found is None or result.record.record not in names:
        return content
    index = names.index(result.record.record)
    row = {name: column[index].item() for name, column in found.table.items()}
    return content | {
        "quality_factor_viscous_theory": Estimate(
            row["quality_factor_theory"], row["quality_factor_theory_sd"], ""
        ).as_json(),
        "quality_factor_viscous_steady": row["quality_factor_steady"],
        "quality_factor_limit_theory": row["quality_factor_limit"],
        "drag_over_theory": row["drag_over_theory"],
    }


def _curves(campaign: Campaign, separated: Separation) -> dict[str, Any]:
    """Theory along each branch, with the hysteresis where k is known."""
    curves: dict[str, Any] = {}
    for branch in dict.fromkeys(record.branch for record in campaign.records if record.branch):
        curve = branch_curves(campaign, branch)
        if curve is None:
            continue
        if separated.benchmark is not None:
            viscous = np.array(curve["quality_factor_viscous_theory"])
            hysteretic = hysteretic_quality_factor(
                np.array(curve["frequency_hz"]), separated.benchmark["value"]
            )
            curve["quality_factor_limit_theory"] = (1 / (1 / viscous + 1 / hysteretic)).tolist()
        curves[branch] = curve
    return curves


def _campaign_numbers(found: Comparison | None) -> dict[str, Any]:
    """The numbers that describe the whole campaign."""
    names = ("viscous_exponents", "theory_factor", "history_coefficient", "checks", "budget")
    if found is None:
        return dict.fromkeys((*names, "steady_stokes_percent"))
    return {
        "viscous_exponents": {
            branch: {
                **fitted.exponent.as_json(),
                "sd_own": fitted.sd_own,
                "sd_common": fitted.sd_common,
                "curvature": fitted.curvature.as_json(),
                "local_slopes": list(fitted.local_slopes),
                "records": list(fitted.records),
            }
            for branch, fitted in found.exponents.items()
        },
        "theory_factor": _shared(found.theory_factor),
        "history_coefficient": _shared(found.history_coefficient),
        "checks": found.checks,
        "budget": [{"source": name, "relative_sd": sd} for name, sd in found.budget.items()],
        "steady_stokes_percent": list(found.steady_stokes_percent),
    }


def _shared(number: SharedEstimate) -> dict[str, Any]:
    return {
        **number.estimate.as_json(),
        "sd_own": number.sd_own,
        "sd_common": number.sd_common,
        "shared": number.shared,
        "chi2": number.chi2,
        "dof": number.degrees_of_freedom,
        "p_value": number.p_value,
    }


NUMBERS: Final = (
    "frequency",
    "moment_of_inertia",
    "a",
    "b",
    "c",
    "quality_factor_limit",
    "quality_factor_hysteretic",
    "quality_factor_viscous",
    "quality_factor_viscous_theory",
)


def campaign_summary(comparison: dict[str, Any]) -> dict[str, Any]:
    """Take the contract's numbers out of the comparison; each has value, sd and unit."""
    exponents = comparison["viscous_exponents"] or {}
    calibration = comparison["calibration"]
    return {
        "schema_version": 1,
        "hysteretic_coefficient": _number(comparison["hysteretic_coefficient"]),
        "viscous_exponents": {branch: _number(exponents.get(branch)) for branch in ("low", "high")},
        "theory_factor": _number(comparison["theory_factor"]),
        "history_coefficient": _number(comparison["history_coefficient"]),
        "volts_per_radian": _number(calibration and calibration["volts_per_radian"]),
        "joint": comparison["joint"],
        "records": [
            {name: record[name] for name in ("record", "fluid", "branch")}
            | {name: _number(record.get(name)) for name in NUMBERS}
            for record in comparison["records"]
            if record["refused"] is None
        ],
        "refused": [
            {"record": record["record"], "reason": record["refused"]}
            for record in comparison["records"]
            if record["refused"] is not None
        ],
    }


def _number(content: dict[str, Any] | None) -> dict[str, Any] | None:
    """Value, sd and unit of a number; ``None`` where the campaign has none."""
    return content and {name: content[name] for name in ("value", "sd", "unit")}


PACKAGES: Final = ("numpy", "scipy", "numba", "matplotlib", "pyserial", "snakemake")
