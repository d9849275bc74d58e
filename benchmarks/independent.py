"""The truth that the evidence is measured against; it shares no code with the library.

Eq. 8 in the paper's own quality factors, integrated in time by scipy's DOP853 with a
restart at every turning point, and the apparatus worked out anew from config.yaml.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.integrate import solve_ivp


@dataclass(frozen=True)
class Truth:
    """Eq. 8's numbers for one record."""

    record: str
    branch: str
    omega: float
    inertia: float
    q_coulomb: float
    q_hysteretic: float
    q_fluid: float
    q_viscous: float
    q_viscous_theory: float
    release: float
    samples: int
    longest: float

    @property
    def a(self) -> float:
        return self.omega / (2 * self.release * self.q_fluid)

    @property
    def b(self) -> float:
        return self.omega / 2 * (1 / self.q_hysteretic + 1 / self.q_viscous)

    @property
    def c(self) -> float:
        return self.omega * self.release / (2 * self.q_coulomb)


def truths(root: Path, drag_factor: float | None = None) -> list[Truth]:
    """Work out every simulated record's truth from the default configuration."""
    settings = yaml.safe_load((root / "config/config.yaml").read_text(encoding="utf-8"))
    if drag_factor is not None:
        settings["simulated"]["drag_factor"] = drag_factor
    lines = (root / settings["records"]).read_text(encoding="utf-8").splitlines()
    header = lines[0].split("\t")
    rows = [dict(zip(header, line.split("\t"), strict=False)) for line in lines[1:]]
    return [_truth(settings, row) for row in rows]


def _truth(settings: dict[str, Any], row: dict[str, str]) -> Truth:
    app, told = settings["apparatus"], settings["simulated"]
    place, fluid = settings["geometries"][row["geometry"]], settings["fluids"][row["fluid"]]
    ball = app["sphere"]
    wet = place.get("sphere", True)
    eta, rho, g = fluid["viscosity_pa_s"], fluid["density_kg_per_m3"], app["gravity_m_per_s2"]
    inertia0 = app["rod"]["mass_kg"] * app["rod"]["length_m"] ** 2 / 12
    moment = 0.0
    discs = []
    for name, z in place["weights_m"].items():
        body = app["weights"][name]
        inertia0 += body["mass_kg"] * (z * z + 0.4 * body.get("radius_m", 0.0) ** 2)
        moment += body["mass_kg"] * z
        discs.append((body.get("frontal_area_m2", 0.0), abs(z)))
    added = lambda omega: 0.0
    if wet:
        radius, length = ball["diameter_m"] / 2, ball["distance_m"]
        volume = 4 / 3 * math.pi * radius**3
        inertia0 += ball["mass_kg"] * (length**2 + 0.4 * radius**2)
        moment += (ball["mass_kg"] - rho * volume) * length
        discs = [(math.pi * radius**2, length)]
        added = lambda omega: (
            rho * volume * length**2 * (0.5 + 9 * math.sqrt(2 * eta / (omega * rho)) / (4 * radius))
        )
    omega = math.sqrt(g * moment / inertia0)
    for _ in range(200):
        omega = math.sqrt(g * moment / (inertia0 + added(omega)))
    inertia = inertia0 + added(omega)
    q_theory = math.inf
    if wet:
        depth = math.sqrt(2 * eta / (omega * rho))
        q_theory = inertia * omega / (6 * math.pi * eta * radius * (1 + radius / depth) * length**2)
    plan = told["release"].get(row["record"], told["release"].get(row["fluid"]))
    y0 = plan["angle_rad"]
    a = sum(
        4 / (3 * math.pi) * omega * rho * fluid["drag_coefficient"] * area * arm**3 / (2 * inertia)
        for area, arm in discs
    )
    c = 2 * app["bearing_torque_n_m"] / (math.pi * inertia * omega)
    return Truth(
        record=row["record"],
        branch=row["branch"],
        omega=omega,
        inertia=inertia,
        q_coulomb=omega * y0 / (2 * c),
        q_hysteretic=told["hysteretic_coefficient_s2"] * (omega / (2 * math.pi)) ** 2,
        q_fluid=omega / (2 * y0 * a),
        q_viscous=q_theory / told["drag_factor"],
        q_viscous_theory=q_theory,
        release=y0,
        samples=plan["samples"],
        longest=plan["duration_s"],
    )


def motion(truth: Truth, noise_rad: float, start_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Sample the motion from `start_s` after the release until the amplitude meets the noise.

    Returns
    -------
    time_s, angle_rad
        Times since the first sample and angles, shape (samples,).
    """
    w, y0 = truth.omega, truth.release
    coulomb = math.pi * w * w * y0 / (4 * truth.q_coulomb)
    hysteretic = math.pi * w / (4 * truth.q_hysteretic)
    fluid = math.pi / (4 * y0 * truth.q_fluid)

    def force(_: float, state: np.ndarray, sign: float) -> list[float]:
        x, v = state
        energy = w * w * x * x + v * v
        friction = coulomb + hysteretic * math.sqrt(energy) + fluid * energy
        return [v, -friction * sign - w / truth.q_viscous * v - w * w * x]

    def at_rest(_: float, state: np.ndarray, sign: float) -> float:
        return float(state[1])

    at_rest.terminal = True  # type: ignore[attr-defined]
    pieces: list[Any] = []
    time, x = 0.0, y0
    while abs(x) > noise_rad and time < truth.longest + start_s and w * w * abs(x) > coulomb:
        sign = -math.copysign(1.0, x)
        at_rest.direction = -sign  # type: ignore[attr-defined]
        run = solve_ivp(
            force,
            (time, time + 3 * math.pi / w),
            [x, 0.0],
            "DOP853",
            events=at_rest,
            args=(sign,),
            rtol=1e-12,
            atol=1e-16,
            dense_output=True,
            first_step=0.02 / w,
        )
        pieces.append((time, run.t[-1], run.sol))
        time, x = run.t[-1], float(run.y[0, -1])
    end = min(time, truth.longest + start_s)
    grid = np.linspace(start_s, end, truth.samples, endpoint=False)
    angle = np.full(len(grid), x)
    for begin, finish, solution in pieces:
        low, high = np.searchsorted(grid, [begin, finish])
        if high > low:
            angle[low:high] = solution(grid[low:high])[0]
    return grid - start_s, angle
