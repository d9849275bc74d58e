"""A plausible finished campaign on disk, made from the paper's equations and noise.

The figures and the page read what other stages have written; their tests must not wait for
those stages, and must know the truth. Pendulums come from ``config/config.yaml``.
"""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import yaml

from pendpipe import physics
from pendpipe.analysis.turning_points import TurningPoints, write_turning_points
from pendpipe.files import write_json
from pendpipe.recording import Recording, write_plain

from .content import SENSOR, TYPICAL, comparison, record_entry, tail_fits
from .pendulums import Truth, estimate, truth_of

FloatArray = npt.NDArray[np.float64]
ROOT = Path(__file__).parents[3]
NOISE_RAD = 8.0e-5
FIT_NAMES = ("amplitude", "a", "b", "c")


class Example(NamedTuple):
    """Where the example campaign lies, and what it holds."""

    folder: Path
    campaign: Path
    comparison: Path
    summary: Path
    content: dict[str, Any]


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
        key: estimate(float(values[i]), float(sd[i]), units[i], bool(i > 0 and values[i] == 0.0))
        for i, key in enumerate(FIT_NAMES)
    }
    parameters["frequency"] = estimate(truth.frequency, 2e-6, "Hz")
    parameters["phase"] = estimate(-2 * np.pi * truth.frequency * 0.2, 1e-3, "rad")
    parameters["offset"] = estimate(0.0031, 1e-6, "rad")
    limit = np.pi * truth.frequency / values[2]
    fit = {
        "schema_version": 1,
        "method": "turning-points",
        "baseline": "eq8",
        "parameters": parameters,
        "quality_factor_limit": estimate(limit, limit * sd[2] / values[2], ""),
        "quality_factor_hysteretic": None,
        "quality_factor_viscous": None,
        "covariance": {"order": list(FIT_NAMES), "matrix": covariance.tolist()},
        "noise_rms_rad": NOISE_RAD,
        "residual_rms_rad": NOISE_RAD * 1.004,
        "chi2_per_dof": 1.008,
        "samples": 16384,
        "turning_points": len(points["time_s"]),
        "cuts": [{"start_s": 0.0, "stop_s": 0.2, "reason": "before the first turning point"}],
        "provenance": {
            "input_sha256": f"{seed:064x}",
            "version": "0.1.0",
            "seed": 1,
            "volts_per_radian": SENSOR,
        },
        "warnings": [],
        "restoring": "linear",
        "drag_form": "undecided",
        "drag": "energy",
        "fit_p_value": 0.5,
        "torque_log_odds": 0.0,
        "zero_drift": None,
        "other_frequency": None,
        "light": "green",
        "light_reason": "",
        "quotable": [],
        "period_check": [],
        "decrement_check": [],
    }
    write_json(folder / name / "fit.json", fit)
    index = points["half_cycle"].astype(np.int64)
    table = TurningPoints(**points | {"half_cycle": index}, level_coupling=1.0, samples=16384)  # type: ignore[arg-type]
    write_turning_points(folder / name / "turning_points.csv", table)
    return fit


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
        truth = truth_of(
            settings, settings["geometries"][row["geometry"]]["weights_m"], row["fluid"]
        )
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
    return Example(
        results, campaign, results / "comparison.json", results / "campaign.json", content
    )


def refused_entry(record: str, reason: str) -> dict[str, Any]:
    return {
        "record": record,
        "source": "file",
        "fluid": "",
        "branch": "",
        "geometry": "",
        "temperature_c": None,
        "refused": reason,
    }
