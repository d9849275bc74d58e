"""A plausible finished campaign on disk, made from the paper's equations and noise.

The figures and the page read what other stages have written; their tests must not wait for
those stages, and must know the truth. Pendulums come from ``config/config.yaml``.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import yaml

from pendpipe import physics
from pendpipe.files import write_json
from pendpipe.recording import Recording, write_plain

FloatArray = npt.NDArray[np.float64]
ROOT = Path(__file__).parents[2]
HYSTERETIC, DRAG, SENSOR, NOISE_RAD = 3940.0, 1.117, 3.85, 8.0e-5
TYPICAL = "water-low-7"
FIT_NAMES = ("amplitude", "a", "b", "c")


class Example(NamedTuple):
    """Where the example campaign lies, and what it holds."""

    folder: Path
    campaign: Path
    comparison: Path
    summary: Path
    content: dict[str, Any]


class Truth(NamedTuple):
    """One pendulum's motion and theory."""

    frequency: float
    rates: tuple[float, float, float]
    start_rad: float
    duration_s: float
    inertia: float
    viscous: float
    steady: float
    depth_ratio: float
    lengthening: physics.Lengthening | None


def estimate(value: float, sd: float, unit: str) -> dict[str, Any]:
    half = 1.96 * sd
    return {"value": value, "sd": sd, "unit": unit, "interval95": [value - half, value + half]}


def parts_of(
    settings: dict[str, Any], weights: dict[str, float], *, sphere: bool
) -> list[physics.Part]:
    apparatus = settings["apparatus"]
    rod, bob = apparatus["rod"], apparatus["sphere"]
    parts: list[physics.Part] = [physics.Rod(rod["mass_kg"], rod["length_m"])]
    for name, position in weights.items():
        parts.append(physics.PointMass(apparatus["weights"][name]["mass_kg"], position))
    if sphere:
        radius = bob["diameter_m"] / 2
        parts.append(physics.Sphere(bob["mass_kg"], radius, bob["distance_m"], submerged=True))
    return parts


def truth_of(settings: dict[str, Any], weights: dict[str, float], fluid_name: str) -> Truth:
    wet = fluid_name == "water"
    parts = parts_of(settings, weights, sphere=wet)
    entry = settings["fluids"][fluid_name]
    fluid = physics.Fluid(entry["density_kg_per_m3"], entry["viscosity_pa_s"])
    moving = physics.swing(parts, fluid if wet else None)
    omega, inertia = moving.angular_frequency_per_s, moving.moment_of_inertia_kg_m2
    frequency = float(moving.frequency_hz)
    hysteretic = HYSTERETIC * frequency**2
    viscous, steady = (
        float(physics.viscous_quality_factor(
            inertia, omega, 0.01895, 0.452, fluid[1], fluid[0], history
        ))
        for history in (1.0, 0.0)
    )  # fmt: skip
    loss = 1 / hysteretic + (DRAG / viscous if wet else 0.0)
    reach = (0.01895, 0.452) if wet else (0.023, 0.35)
    quadratic = float(
        physics.quadratic_drag_rate(entry["drag_coefficient"], inertia, omega, *reach, fluid[0])
    )
    coulomb = float(physics.bearing_friction_rate(7.1e-7, inertia, omega))
    return Truth(
        frequency, (quadratic, np.pi * frequency * loss, coulomb),
        0.068 if wet else 0.25, 300.0 if wet else 1500.0,
        float(inertia), viscous, steady,
        0.01895 / float(physics.penetration_depth(omega, fluid[1], fluid[0])),
        physics.period_lengthening(parts, fluid) if wet else None,
    )  # fmt: skip


def turning_points(truth: Truth, random: np.random.Generator) -> dict[str, FloatArray]:
    half = 0.5 / truth.frequency
    count = int(truth.duration_s / half)
    time = 0.2 + half * np.arange(count)
    amplitude = physics.amplitude(time - time[0], truth.start_rad, *truth.rates)
    error = NOISE_RAD / np.sqrt(0.5 * half * 50.0)
    keep = amplitude > 5 * error
    time, amplitude = time[keep], amplitude[keep]
    noisy = amplitude + error * random.standard_normal(len(time))
    index = np.arange(len(time))
    return {
        "half_cycle": index.astype(np.float64),
        "time_s": time,
        "time_sd_s": np.full(len(time), 1e-3),
        "angle_rad": noisy * (1.0 - 2.0 * (index % 2)),
        "angle_sd_rad": np.full(len(time), error),
        "level_rad": np.full(len(time), 0.0031),
    }


def fitted(truth: Truth, points: dict[str, FloatArray], random: np.random.Generator) -> FloatArray:
    """Covariance of (y0, a, b, c) from the turning points."""
    time = points["time_s"] - points["time_s"][0]
    _, slope = physics.amplitude_and_gradient(time, truth.start_rad, *truth.rates)
    scaled = slope / points["angle_sd_rad"][:, np.newaxis]
    covariance: FloatArray = np.linalg.inv(scaled.T @ scaled)
    return covariance


def write_record(folder: Path, name: str, truth: Truth, seed: int) -> dict[str, Any]:
    """Write turning_points.csv and fit.json; return the record's numbers."""
    random = np.random.default_rng(seed)
    points = turning_points(truth, random)
    covariance = fitted(truth, points, random)
    values = np.array([truth.start_rad, *truth.rates])
    values = values + np.linalg.cholesky(covariance) @ random.standard_normal(4)
    values[1:] = np.maximum(values[1:], 0.0)
    sd = np.sqrt(np.diag(covariance))
    units = ("rad", "1/(rad s)", "1/s", "rad/s")
    parameters = {
        key: estimate(float(values[i]), float(sd[i]), units[i])
        | {"at_bound": bool(i > 0 and values[i] == 0.0)}
        for i, key in enumerate(FIT_NAMES)
    }
    parameters["frequency"] = estimate(truth.frequency, 2e-6, "Hz")
    parameters["phase"] = estimate(-2 * np.pi * truth.frequency * 0.2, 1e-3, "rad")
    parameters["offset"] = estimate(0.0031, 1e-6, "rad")
    limit = np.pi * truth.frequency / values[2]
    fit = {
        "schema_version": 1, "method": "waveform", "baseline": "eq8", "parameters": parameters,
        "quality_factor_limit": estimate(limit, limit * sd[2] / values[2], ""),
        "quality_factor_hysteretic": None, "quality_factor_viscous": None,
        "covariance": {"order": list(FIT_NAMES), "matrix": covariance.tolist()},
        "noise_rms_rad": NOISE_RAD, "residual_rms_rad": NOISE_RAD * 1.004,
        "chi2_per_dof": 1.008, "samples": 16384, "turning_points": len(points["time_s"]),
        "cuts": [{"start_s": 0.0, "stop_s": 0.2, "reason": "before the first turning point"}],
        "provenance": {"input_sha256": f"{seed:064x}", "version": "0.1.0", "seed": 1,
                       "volts_per_radian": SENSOR},
        "warnings": [],
    }  # fmt: skip
    write_json(folder / name / "fit.json", fit)
    rows = zip(*(column.tolist() for column in points.values()), strict=True)
    head = "# unit: rad\n# samples: 16384\n" + ",".join(points) + "\n"
    text = head + "".join(",".join(map(repr, row)) + "\n" for row in rows)
    (folder / name / "turning_points.csv").write_text(text)
    fit["provenance"] = {}
    return fit


def record_entry(
    row: dict[str, str], truth: Truth, fit: dict[str, Any], points: int
) -> dict[str, Any]:
    """One record of comparison.json."""
    parameters, limit = fit["parameters"], fit["quality_factor_limit"]
    hysteretic = 3938.0 * truth.frequency**2
    viscous = 1 / (1 / limit["value"] - 1 / hysteretic) if row["fluid"] == "water" else None
    wet = viscous is not None
    lengthening = truth.lengthening
    return {
        **{key: row[key] for key in ("record", "source", "fluid", "branch", "geometry")},
        "temperature_c": 20.0, "refused": None,
        **{key: parameters[key] for key in ("frequency", "a", "b", "c", "amplitude", "offset")},
        "quality_factor_limit": limit,
        "quality_factor_hysteretic": estimate(hysteretic, 0.002 * hysteretic, ""),
        "quality_factor_viscous": estimate(viscous, 0.006 * viscous, "") if viscous else None,
        "quality_factor_viscous_theory":
            estimate(truth.viscous, 0.004 * truth.viscous, "") if wet else None,
        "quality_factor_viscous_steady": truth.steady if wet else None,
        "quality_factor_limit_theory": 1 / (1 / truth.viscous + 1 / hysteretic) if wet else None,
        "a_over_delta": truth.depth_ratio if wet else None,
        "moment_of_inertia": estimate(truth.inertia, 1e-4 * truth.inertia, "kg m^2"),
        "moment_of_inertia_from_frequency":
            estimate(truth.inertia * 1.001, 0.002 * truth.inertia, "kg m^2"),
        "lengthening": {k: float(v) for k, v in lengthening._asdict().items()}
        if lengthening else None,
        **{key: fit[key] for key in ("method", "noise_rms_rad", "residual_rms_rad",
                                     "chi2_per_dof", "samples", "cuts", "warnings")},
        "turning_points": points, "start_s": 0.2, "stop_s": truth.duration_s,
        "volts_per_radian": estimate(SENSOR, 0.0009, "V/rad"),
        "misfit": {"amplitude_rms_rad": 1.1e-5, "linear_damping_rms_rad": 1.9e-3,
                   "half_cycles": points},
    }  # fmt: skip


def branch_curve(settings: dict[str, Any], branch: str) -> dict[str, list[float]]:
    """Theory along a branch, the weights moved from record to record."""
    places = [v["weights_m"] for k, v in settings["geometries"].items() if k.startswith(branch)]
    way = np.linspace(0, len(places) - 1, 60)
    curve: list[Truth] = []
    for step in way:
        index = min(int(step), len(places) - 2)
        share = step - index
        weights = {
            name: (1 - share) * places[index][name] + share * places[index + 1][name]
            for name in places[0]
        }
        curve.append(truth_of(settings, weights, "water"))
    lengthening = [t.lengthening for t in curve if t.lengthening is not None]
    return {
        "frequency_hz": [t.frequency for t in curve],
        "quality_factor_viscous_theory": [t.viscous for t in curve],
        "quality_factor_viscous_steady": [t.steady for t in curve],
        "quality_factor_limit_theory":
            [1 / (1 / t.viscous + 1 / (HYSTERETIC * t.frequency**2)) for t in curve],
        "lengthening_buoyancy": [float(x.buoyancy) for x in lengthening],
        "lengthening_added_mass": [float(x.added_mass) for x in lengthening],
        "lengthening_both": [float(x.both) for x in lengthening],
        "moment_of_inertia_kg_m2": [t.inertia for t in curve],
    }  # fmt: skip


def tail_fits(truth: Truth) -> list[dict[str, Any]]:
    """Fits to ever shorter tails: their errors grow, and a goes astray first."""
    random = np.random.default_rng(5)
    starts = np.array([0.2, 10.0, 20.0, 35.0, 50.0, 70.0, 90.0, 115.0])
    entries = []
    for index, start in enumerate(starts):
        amplitude = float(physics.amplitude(start, truth.start_rad, *truth.rates))
        time = np.arange(start, truth.duration_s, 0.97)
        _, slope = physics.amplitude_and_gradient(time - start, amplitude, *truth.rates)
        covariance = np.linalg.inv(slope.T @ slope) * 1.3e-5**2
        sd = np.sqrt(np.diag(covariance))[1:]
        drawn = np.array(truth.rates) + sd * random.standard_normal(3) * (index > 0)
        units = ("1/(rad s)", "1/s", "rad/s")
        entries.append(
            {"start_s": float(start), "amplitude_rad": amplitude}
            | {key: estimate(float(drawn[i]), float(sd[i]), units[i])
               for i, key in enumerate("abc")}
        )  # fmt: skip
    return entries


def calibration() -> dict[str, Any]:
    random = np.random.default_rng(7)
    angle = np.linspace(-0.06, 0.06, 25)
    volts = 0.012 + SENSOR * angle + 1.35e-4 * random.standard_normal(25)
    points = [
        {"angle_rad": x, "volts": y, "volts_sd": 4e-5, "angle_sd_rad": 3.3e-5}
        for x, y in zip(angle.tolist(), volts.tolist(), strict=True)
    ]
    return {
        "volts_per_radian": estimate(3.8503, 0.0007, "V/rad"),
        "offset_volts": estimate(0.01201, 2.7e-5, "V"),
        "points": points,
        "linear": {"p_value": 0.41, "chi2": 22.9, "dof": 23},
    }


def write_recording(folder: Path, name: str, truth: Truth) -> None:
    """The typical record's samples, in volts."""
    random = np.random.default_rng(3)
    time = np.linspace(0.0, truth.duration_s, 32768)
    amplitude = physics.amplitude(time - 0.2, truth.start_rad, *truth.rates)
    angle = 0.0031 + amplitude * np.cos(2 * np.pi * truth.frequency * (time - 0.2))
    volts = SENSOR * (angle + NOISE_RAD * random.standard_normal(len(time)))
    write_plain(folder / name / "recording.csv", Recording(time, volts, "volts"))


def make_example(folder: Path, *, records: int | None = None) -> Example:
    """Write the whole example below `folder` (the first `records` of each kind, if given)."""
    settings = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))
    lines = (ROOT / "config/records.tsv").read_text(encoding="utf-8").splitlines()
    rows = [dict(zip(lines[0].split("\t"), line.split("\t"), strict=False)) for line in lines[1:]]
    results = folder / "results"
    entries: list[dict[str, Any]] = []
    for number, row in enumerate(rows):
        if records is not None and row["record"] != TYPICAL and number % 8 >= records:
            continue
        truth = truth_of(settings, settings["geometries"][row["geometry"]]["weights_m"],
                         row["fluid"])  # fmt: skip
        fit = write_record(results, row["record"], truth, number + 1)
        entries.append(record_entry(row, truth, fit, int(fit["turning_points"])))
        if row["record"] == TYPICAL:
            write_recording(results, TYPICAL, truth)
            tail = tail_fits(truth)
    content = comparison(settings, entries, tail)
    campaign = folder / "configuration.json"
    campaign.write_text(json.dumps(settings | {"results": results.as_posix()}))
    write_json(results / "comparison.json", content)
    write_json(results / "campaign.json", {"schema_version": 1})
    return Example(results, campaign, results / "comparison.json", results / "campaign.json",
                   content)  # fmt: skip


def comparison(
    settings: dict[str, Any], entries: list[dict[str, Any]], tail: list[dict[str, Any]]
) -> dict[str, Any]:
    """The content of comparison.json."""
    ranges = [
        {"first": "water-high-1", "last": f"water-high-{last}", "exponent": -4.9 - 0.1 * last,
         "sd": 0.05}
        for last in (5, 6, 7, 8)
    ]  # fmt: skip
    return {
        "schema_version": 1, "title": settings["title"], "typical_record": TYPICAL,
        "has_theory": True, "records": entries,
        "curves": {branch: branch_curve(settings, branch) for branch in ("high", "low")},
        "hysteretic_coefficient": estimate(3938.0, 6.0, "s^2")
        | {"chi2": 10.2, "dof": 11, "p_value": 0.51, "free_exponent": estimate(1.9993, 0.0011, "")},
        "viscous_exponents": {
            "high": estimate(-5.68, 0.04, "")
            | {"local_slopes": [-4.1, -4.4, -4.9, -5.4, -6.1, -7.2, -9.4], "curvature":
               estimate(-3.1, 0.2, ""), "ranges": ranges},
            "low": estimate(0.506, 0.006, "")
            | {"local_slopes": [0.48, 0.5, 0.52, 0.5, 0.49, 0.51], "curvature":
               estimate(0.01, 0.02, ""), "ranges": []},
        },
        "theory_factor": estimate(1.1165, 0.0062, "")
        | {"sd_own": 0.0011, "sd_common": 0.0061, "chi2": 13.1, "dof": 14},
        "history_coefficient": estimate(1.121, 0.007, "")
        | {"sd_own": 0.0012, "sd_common": 0.0069, "chi2": 13.4, "dof": 14},
        "steady_stokes_percent": [940.0, 3540.0],
        "budget": [
            {"source": "sphere distance from the axis", "relative_sd": 0.0022},
            {"source": "sphere diameter", "relative_sd": 0.0025},
            {"source": "hysteretic coefficient", "relative_sd": 0.0003},
            {"source": "sensor constant", "relative_sd": 0.0002},
        ],
        "tail": tail, "calibration": calibration(),
        "provenance": {"version": "0.1.0", "code": "0123456789ab", "configuration":
                       "fedcba987654", "seed": 1,
                       "packages": {"numpy": np.__version__, "python": "3.11.7"}},
    }  # fmt: skip


def refused_entry(record: str, reason: str) -> dict[str, Any]:
    return {"record": record, "source": "file", "fluid": "", "branch": "", "geometry": "",
            "temperature_c": None, "refused": reason}  # fmt: skip
