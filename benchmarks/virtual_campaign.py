"""One campaign in memory: noise on independent motions, then the library's own stages."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.independent import Truth

Track = tuple[Truth, np.ndarray, np.ndarray]
Pulls = dict[str, tuple[float, float, float]]
"""Of each quantity: estimate, standard deviation, truth."""

VOLTS_PER_RADIAN = 3.85
NOISE_V, OFFSET_V, STEP_V = 3.0e-4, 0.012, 20.0 / 2**16
ARM_M, TRAVEL_M, POINTS, CALIPER_SD_M, AVERAGED = 0.300, 0.018, 25, 1.0e-5, 64
RADIUS_M, RADIUS_SD_M, DISTANCE_M, DISTANCE_SD_M = 0.0190, 2.5e-5, 0.452, 5.0e-4
VISCOSITY_PA_S, DENSITY_KG_PER_M3 = 1.0016e-3, 1000.0


def recorded(angle: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Volts as the converter gives them: sensor, noise, 16 bits over 20 V."""
    volts = OFFSET_V + VOLTS_PER_RADIAN * angle + NOISE_V * random.standard_normal(len(angle))
    return STEP_V * np.round(volts / STEP_V)


def calibrated(random: np.random.Generator) -> Any:
    """The sensor's constant from a caliper run."""
    from pendpipe.analysis.calibrate import calibrate

    angle = np.linspace(-TRAVEL_M, TRAVEL_M, POINTS) / ARM_M
    readings = recorded(np.repeat(angle, AVERAGED), random).reshape(POINTS, AVERAGED)
    told = angle + CALIPER_SD_M / ARM_M * random.standard_normal(POINTS)
    return calibrate(
        told,
        readings.mean(axis=1),
        volts_sd=readings.std(axis=1, ddof=1) / np.sqrt(AVERAGED),
        angle_sd_rad=np.full(POINTS, CALIPER_SD_M / ARM_M),
    )


def one_campaign(tracks: list[Track], seed: list[int], method: str = "waveform") -> Pulls:
    """Record, fit, separate and compare once; the sphere is measured anew with its errors."""
    from pendpipe.analysis.compare import compare
    from pendpipe.analysis.fit import fit_recording
    from pendpipe.analysis.losses import MeasuredRecord
    from pendpipe.analysis.separate import fit_benchmark, separate
    from pendpipe.analysis.viscous import SharedErrors, Surroundings
    from pendpipe.estimate import Estimate
    from pendpipe.recording import Recording

    random = np.random.default_rng(seed)
    constant = calibrated(random).volts_per_radian
    pulls: Pulls = {"V/rad": (constant.value, constant.sd, VOLTS_PER_RADIAN)}
    measured = []
    for truth, time, angle in tracks:
        volts = Recording(time, recorded(angle, random), "volts", resolution=STEP_V)
        found = fit_recording(volts.as_motion(constant.value), method=method).parameters  # type: ignore[arg-type]
        inertia = Estimate(truth.inertia, 0.0, "kg m^2") if np.isfinite(truth.q_viscous) else None
        measured.append(
            MeasuredRecord(
                truth.record,
                "",
                truth.branch,
                found["frequency"],
                found["a"],
                found["b"],
                found["c"],
                inertia,
            )
        )
    benchmark = fit_benchmark([record for record in measured if record.branch == "air"])
    separated = separate(measured, benchmark, calibration_relative_sd=constant.sd / constant.value)
    told = {track[0].record: track[0] for track in tracks}
    for split in separated:
        name = split.measured.record
        truth = told[name]
        for letter, estimate in {
            "a": split.quadratic, "b": split.measured.linear, "c": split.coulomb,
        }.items():  # fmt: skip
            pulls[f"{letter} of {name}"] = (estimate.value, estimate.sd, getattr(truth, letter))
        frequency = split.measured.frequency
        pulls[f"f of {name}"] = (frequency.value, frequency.sd, truth.omega / (2 * np.pi))
    sphere = Surroundings(
        RADIUS_M + RADIUS_SD_M * random.standard_normal(),
        DISTANCE_M + DISTANCE_SD_M * random.standard_normal(),
        VISCOSITY_PA_S,
        DENSITY_KG_PER_M3,
    )
    wet = {name: sphere for name, truth in told.items() if np.isfinite(truth.q_viscous)}
    shared = SharedErrors(benchmark.inverse_sd, RADIUS_SD_M, DISTANCE_SD_M)
    result = compare(separated, wet, shared)
    return pulls | _campaign(result, benchmark, told)


def _campaign(result: Any, benchmark: Any, told: dict[str, Truth]) -> Pulls:
    """The campaign's own numbers beside their truth."""
    wet = [truth for truth in told.values() if np.isfinite(truth.q_viscous)]
    hysteretic = next(iter(told.values()))
    k = hysteretic.q_hysteretic / (hysteretic.omega / (2 * np.pi)) ** 2
    factor = wet[0].q_viscous_theory / wet[0].q_viscous
    found = benchmark.coefficient
    pulls: Pulls = {
        "k": (found.value, found.sd, k),
        "theory factor": (
            result.theory_factor.estimate.value, result.theory_factor.estimate.sd, factor,
        ),
    }  # fmt: skip
    for branch, fitted in result.exponents.items():
        members = [truth for truth in wet if truth.branch == branch]
        logs = np.log([truth.omega for truth in members])
        slope = np.polyfit(logs, np.log([truth.q_viscous for truth in members]), 1)[0]
        pulls[f"exponent, {branch}"] = (fitted.exponent.value, fitted.exponent.sd, float(slope))
    if factor == 1.0:
        history = result.history_coefficient.estimate
        pulls["C_H"] = (history.value, history.sd, 1.0)
    return pulls
