"""Pulls and coverage: whether an effect's parameters are right, and their errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from pendpipe.challenge import intervals
from pendpipe.challenge.answers import Answer


def expected(truth: dict[str, Any]) -> dict[str, float]:
    """What the first effect's parameters should be, by the names of ``docs/effects.md``.

    The solver knows the nominal V/rad only: what has the dimension of an angle appears to it
    times the true gain over the nominal one.
    """
    effect, known = truth["effects"][0], truth["nuisances"]
    p, name = effect["parameters"], effect["effect"]
    gain, hertz = known["gain"], known["frequency_hz"]
    omega = 2.0 * np.pi * hertz
    straight = effect["law"] == "straight"
    table: dict[str, dict[str, tuple[str, float]]] = {
        "cubic-stiffness": {"k3": ("cubic", gain**-2)},
        "quadratic-stiffness": {"k2": ("square", 1.0 / gain)},
        "coulomb-friction": {"c": ("coulomb", 2.0 / np.pi / omega * gain)},
        "quadratic-drag": {"a": ("quadratic", 2.0 / np.pi * omega / gain)},
        "stribeck-friction": {
            "f_s": ("stribeck", gain),
            "v_s": ("stribeck_speed", gain),
        },
        "presliding-friction": {"k_d": ("dahl", 1.0), "z_c": ("dahl_reach", gain)},
        "backlash": {"b": ("play", 2.0 * gain)},
        "history-force": {"h": ("basset", 1.0)},
        "release-transient": {"gamma": ("release", 0.5), "tau": ("release_time", 1.0)},
        "second-mode": {"f_2": ("frequency_hz", 1.0), "tau_2": ("decay_s", 1.0)},
        "plane-coupling": {"detuning": ("detuning", hertz)},
        "frequency-drift": {"rate": ("omega_drift", 1.0)} if straight else {},
        "equilibrium-step": {"J": ("rest_jump", gain), "time": ("rest_jump_at", 1.0)},
        "amplitude-step": {"s": ("scaling", 1.0), "time": ("scaling_at", 1.0)},
        "frequency-step": {"change": ("omega_jump", 1.0), "time": ("omega_jump_at", 1.0)},
        "impulse": {"dv": ("impulse", gain), "time": ("impulse_at", 1.0)},
        "sensor-quadratic": {"s2": ("square", 1.0 / gain)},
        "sensor-cubic": {"s3": ("cubic", gain**-2)},
        "sensor-backlash": {"b": ("play_rad", gain)},
        "offset-drift": {"rate": ("drift_volts_s", 1.0 / 3.85)} if straight else {},
        "gain-drift": {"rate": ("gain_drift", 1.0)} if straight else {},
        "clock-drift": {"rate": ("clock_drift", 1.0)} if straight else {},
        "tone-pickup": {"f_a": ("tone_hz", 1.0)},
        "jitter": {"sigma_t": ("jitter_s", 1.0)},
    }
    wanted = table.get(name, {})
    return {theirs: p[ours] * factor for theirs, (ours, factor) in wanted.items() if ours in p}


def pulls_of(items: list[tuple[dict[str, Any], Answer]]) -> dict[str, Any]:
    """Pulls and coverage of effects that act by the catalogue's own law and were named so."""
    pulls: list[float] = []
    covered: list[bool] = []
    by_effect: dict[str, list[float]] = {}
    for truth, answer in items:
        effect = truth["effects"][0]
        if not (answer.detected and effect["own_form"] and answer.lead == effect["effect"]):
            continue
        told = answer.content["effects"][0].get("parameters") or {}
        for name, true in expected(truth).items():
            estimate = told.get(name) or {}
            value, sd = estimate.get("value"), estimate.get("sd")
            if value is None or not sd:
                continue
            pulls.append((value - true) / sd)
            by_effect.setdefault(f"{effect['effect']} {name}", []).append(pulls[-1])
            low, high = estimate.get("interval95") or [value - 1.96 * sd, value + 1.96 * sd]
            covered.append(bool(low <= true <= high))
    middle = float(np.median(pulls)) if pulls else 0.0
    return {
        "parameters": len(pulls),
        "mean": intervals.mean(pulls),
        "median": intervals.median(pulls),
        "sd": intervals.spread(pulls),
        "robust_sd": intervals.median([1.4826 * abs(pull - middle) for pull in pulls]),
        "coverage68": intervals.of([abs(pull) < 1.0 for pull in pulls]),
        "coverage95": intervals.of(covered),
        "by_parameter": by_effect,
    }
