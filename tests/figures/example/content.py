"""The example's comparison.json, as the stage `compare` would have written it."""

from typing import Any

import numpy as np

from pendpipe import physics

from .pendulums import HYSTERETIC, Truth, estimate, truth_of

SENSOR = 3.85
TYPICAL = "water-low-7"


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
        "temperature_c": 20.0,
        "refused": None,
        **{key: parameters[key] for key in ("frequency", "a", "b", "c", "amplitude", "offset")},
        "quality_factor_limit": limit,
        "input_sha256": fit["provenance"]["input_sha256"],
        "quality_factor_hysteretic": estimate(hysteretic, 0.002 * hysteretic, ""),
        "quality_factor_viscous": estimate(viscous, 0.006 * viscous, "") if viscous else None,
        "quality_factor_viscous_theory": estimate(truth.viscous, 0.004 * truth.viscous, "")
        if wet
        else None,
        "quality_factor_viscous_steady": truth.steady if wet else None,
        "quality_factor_limit_theory": 1 / (1 / truth.viscous + 1 / hysteretic) if wet else None,
        "quality_factor_limit_theory_sd": 0.01 * truth.viscous if wet else None,
        "a_over_delta": truth.depth_ratio if wet else None,
        "moment_of_inertia": estimate(truth.inertia, 1e-4 * truth.inertia, "kg m^2"),
        "moment_of_inertia_from_frequency": estimate(
            truth.inertia * 1.001, 0.002 * truth.inertia, "kg m^2"
        ),
        "lengthening": {k: float(v) for k, v in lengthening._asdict().items()}
        if lengthening
        else None,
        **{
            key: fit[key]
            for key in (
                "method",
                "noise_rms_rad",
                "residual_rms_rad",
                "chi2_per_dof",
                "samples",
                "cuts",
                "warnings",
            )
        },
        "light": "green",
        "light_reason": "period and Q are right to 5 % and to their errors",
        "turning_points": points,
        "start_s": 0.2,
        "stop_s": truth.duration_s,
        "volts_per_radian": estimate(SENSOR, 0.0009, "V/rad"),
        "misfit": {
            "amplitude_rms_rad": 1.1e-5,
            "linear_damping_rms_rad": 1.9e-3,
            "half_cycles": points,
        },
    }


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
        "quality_factor_limit_theory": [
            1 / (1 / t.viscous + 1 / (HYSTERETIC * t.frequency**2)) for t in curve
        ],
        "lengthening_buoyancy": [float(x.buoyancy) for x in lengthening],
        "lengthening_added_mass": [float(x.added_mass) for x in lengthening],
        "lengthening_both": [float(x.both) for x in lengthening],
        "moment_of_inertia_kg_m2": [t.inertia for t in curve],
    }


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
            | {
                key: estimate(float(drawn[i]), float(sd[i]), units[i])
                for i, key in enumerate("abc")
            }
        )
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


def comparison(
    settings: dict[str, Any], entries: list[dict[str, Any]], tail: list[dict[str, Any]]
) -> dict[str, Any]:
    """The content of comparison.json."""
    return {
        "schema_version": 1,
        "title": settings["title"],
        "typical_record": TYPICAL,
        "has_theory": True,
        "records": entries,
        "curves": {branch: branch_curve(settings, branch) for branch in ("high", "low")},
        "hysteretic_coefficient": estimate(3938.0, 6.0, "s^2")
        | {"chi2": 10.2, "dof": 11, "p_value": 0.51, "free_exponent": estimate(1.9993, 0.0011, "")},
        "viscous_exponents": {
            "high": estimate(-5.68, 0.04, "")
            | {
                "local_slopes": [-4.1, -4.4, -4.9, -5.4, -6.1, -7.2, -9.4],
                "curvature": estimate(-3.1, 0.2, ""),
            },
            "low": estimate(0.506, 0.006, "")
            | {
                "local_slopes": [0.48, 0.5, 0.52, 0.5, 0.49, 0.51],
                "curvature": estimate(0.01, 0.02, ""),
            },
        },
        "theory_factor": estimate(1.1165, 0.0062, "")
        | {"sd_own": 0.0011, "sd_common": 0.0061, "chi2": 13.1, "dof": 14},
        "history_coefficient": estimate(1.121, 0.007, "")
        | {"sd_own": 0.0012, "sd_common": 0.0069, "chi2": 13.4, "dof": 14},
        "theory_factor_in_tank": estimate(0.83, 0.06, ""),
        "walls": {
            "frequency_hz": 0.5,
            "told_depth_m": 0.05,
            "told_depth_sd_m": 0.003,
            "depth_m": [0.04, 0.05, 0.06, 0.08, 0.11],
            "clean": [1.83, 1.33, 1.20, 1.10, 1.06],
            "film": [1.97, 1.37, 1.21, 1.11, 1.06],
        },
        "steady_stokes_percent": [940.0, 3540.0],
        "budget": [
            {"source": "sphere distance from the axis", "relative_sd": 0.0022},
            {"source": "sphere diameter", "relative_sd": 0.0025},
            {"source": "hysteretic coefficient", "relative_sd": 0.0003},
            {"source": "sensor constant", "relative_sd": 0.0002},
        ],
        "tail": tail,
        "calibration": calibration(),
        "provenance": {
            "version": "0.1.0",
            "code": "0123456789ab",
            "configuration": "fedcba987654",
            "seed": 1,
            "packages": {"numpy": np.__version__, "python": "3.11.7"},
        },
    }
