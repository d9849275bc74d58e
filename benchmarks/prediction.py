"""Predict experiments that were not fitted: a tank's driven states, hulls, simulated pendulums.

    python -m benchmarks.prediction [tank] [hull] [simulated] [--number 20] [--pictures FOLDER]

``tank``: three decays of a sloshing tank (``../shared/strangers/apparatus``) predict the phases and
amplitudes of its driven states; nothing is fitted to the drive but one force constant. ``hull``: of
two roll decays of a tanker, at two speeds, each predicts the other. ``simulated``: springs and
pendulums (sin x, x^3, x|x|, v|v|, dry friction), two decays each, predict a third and fifteen
driven states, which Runge and Kutta's method integrates here, without code of the library.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

import pendpipe as pp
from benchmarks.journal import ROOT, commit
from benchmarks.table import head, table_row
from pendpipe.arrays import FloatArray as Array

APPARATUS: Final = ROOT.parent / "shared" / "strangers" / "apparatus"
DECAYS: Final = ("0.953", "0.960", "0.967")
DRIVES: Final = ("0.09", "0.17", "0.32")
UNIT: Final = 7.8
"""Of the tank's frequencies, rad/s."""
KINDS: Final = ("sin x", "x^3", "x|x|", "v|v|", "dry friction")
STATES, STEPS = 15, 256
"""Driven states, and steps of a cycle."""


def shares(found: Any) -> list[str]:
    """How many measured numbers the bands hold, by quantity, inside the decays' amplitudes."""
    said = []
    for (quantity, outside), rows in found.compared.groupby(["quantity", "extrapolated"]):
        rms = np.sqrt(np.mean((rows.measured - rows.value) ** 2))
        beyond = "beyond the decays " if outside else ""
        said.append(f"{quantity} {beyond}{rows.held.sum()} of {len(rows)} (rms {rms:.2g})")
    return said


def tank(pictures: Path | None) -> None:
    """Print a row a drive; the first second of a decay is left out, as its authors do."""
    place = APPARATUS / "haller-sloshing"
    fits = [pp.fit(pp.read(place / f"decay_{each}.csv", start=1.0)) for each in DECAYS]
    print(head("drive, %", "force constant", "in the 95 % band"))
    for drive in DRIVES:
        rows = np.genfromtxt(place / f"frc_{drive}.txt", comments="%")
        rows = rows[np.isfinite(rows).all(axis=1)]
        rows[:, 0] *= UNIT / (2.0 * np.pi)
        with tempfile.TemporaryDirectory() as folder:
            table = Path(folder) / "driven.csv"
            columns = ("frequency_hz", "amplitude", "phase_deg")
            pd.DataFrame(rows, columns=columns).assign(drive=float(drive)).to_csv(
                table, index=False
            )
            found = pp.predict(fits, points=table)
        print(table_row(drive, [str(found.force), "; ".join(shares(found))]))
        if pictures:
            found.plot().savefig(pictures / f"tank-{drive}.png", dpi=120)


def hull(pictures: Path | None) -> None:
    """Each of two decays predicts the other, from its own largest amplitude."""
    files = [APPARATUS / "kvlcc2-roll-decay" / f"model_test_{each}.csv" for each in (21338, 21340)]
    print(head("from", "to", "in the 95 % band"))
    for one, other in (files, files[::-1]):
        found = pp.predict(pp.fit(one), points=pp.turning_points(other))
        print(table_row(one.stem, [other.stem, "; ".join(shares(found))]))
        if pictures:
            found.plot().savefig(pictures / f"hull-{one.stem}.png", dpi=120)


def moved(kind: str, omega: float, loss: float, size: float) -> Callable[..., Array]:
    """The acceleration of a kind."""
    extra: dict[str, Callable[[Array, Array], Array]] = {
        "sin x": lambda x, _: omega**2 * (x - np.sin(x)),
        "x^3": lambda x, _: -(omega**2) * size * x**3,
        "x|x|": lambda x, _: -(omega**2) * size * x * np.abs(x),
        "v|v|": lambda _, v: -size * v * np.abs(v),
        "dry friction": lambda _, v: -size * np.tanh(v / (4e-4 * omega)),
    }
    return lambda x, v, push: -(omega**2) * x - 2.0 * loss * v + extra[kind](x, v) + push


def integrated(
    law: Callable[..., Array], x: Array, step: Array, count: int, drive: Array, force: float
) -> Iterator[tuple[Array, Array]]:
    """Yield x and the drive's phase, step by step, from rest at x."""
    v, phase = np.zeros_like(x), np.zeros_like(x)
    for _ in range(count):
        yield x, phase
        now, middle, then = (force * np.cos(phase + k * drive * step) for k in (0.0, 0.5, 1.0))
        a1 = law(x, v, now)
        a2 = law(x + 0.5 * step * v, v + 0.5 * step * a1, middle)
        a3 = law(x + 0.5 * step * (v + 0.5 * step * a1), v + 0.5 * step * a2, middle)
        a4 = law(x + step * (v + 0.5 * step * a2), v + step * a3, then)
        x = x + step * v + step**2 * (a1 + a2 + a3) / 6.0
        v = v + step * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        phase = phase + drive * step


def simulated(number: int) -> tuple[str, Any, Any]:
    """Predict one: its kind, a third decay, and driven states, as `Prediction.compared`."""
    rng, kind = np.random.default_rng(number), KINDS[number % len(KINDS)]
    omega, quality = rng.uniform(3.0, 7.0), rng.uniform(25.0, 60.0)
    largest = rng.uniform(0.25, 0.7) if kind == "sin x" else 0.4
    dry = rng.uniform(0.05, 0.15) * omega**2 * largest / quality
    sizes = {"x^3": 0.3, "x|x|": 0.15, "v|v|": 1.0 / quality}
    size = dry if kind == "dry friction" else rng.uniform(-1.0, 1.0) * sizes.get(kind, 0.0)
    law = moved(kind, omega, 0.5 * omega / quality, abs(size) if kind == "v|v|" else size)
    fine = np.array([0.04 / max(round(0.04 * omega * STEPS / (2.0 * np.pi)), 1)])
    decays = []
    for part in (1.0, 0.8, 0.6):
        steps = round(0.04 / fine[0])
        count = round(6.0 * quality / omega / 0.04) * steps
        path = integrated(law, np.array([part * largest]), fine, count, np.zeros(1), 0.0)
        x = np.array([x[0] for place, (x, _) in enumerate(path) if place % steps == 0])
        x += 1e-3 * largest * rng.standard_normal(x.size)
        decays.append(pp.Recording(time_s=0.04 * np.arange(x.size), angle_rad=x))
    fits = [pp.fit(each) for each in decays[:2]]
    third = pp.predict(fits, points=pp.turning_points(decays[2]))
    drive = omega * np.linspace(1.0 - 2.0 / quality, 1.0 + 2.0 / quality, STATES)
    force, cycle = 0.6 * largest * omega**2 / quality, 2.0 * np.pi / drive / STEPS
    count = round(8.0 * quality) * STEPS
    path = integrated(law, np.full(STATES, largest), cycle, count, drive, force)
    last = [state for place, state in enumerate(path) if place >= count - STEPS]
    x, phase = (np.array(each) for each in zip(*last, strict=True))
    turned = np.angle(np.mean(x * np.exp(-1j * phase), axis=0), deg=True)
    columns = {"frequency_hz": drive / (2.0 * np.pi), "amplitude": np.abs(x).max(axis=0)}
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "driven.csv"
        pd.DataFrame({**columns, "phase_deg": turned, "drive": force}).to_csv(table, index=False)
        return kind, third, pp.predict(fits, points=table)


def main() -> None:
    """Print what was asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", help="tank, hull, simulated; all, if none is named")
    parser.add_argument("--number", type=int, default=20, help="of those that are simulated")
    parser.add_argument("--pictures", type=Path, help="a folder for figures")
    told = parser.parse_args()
    if told.pictures:
        told.pictures.mkdir(parents=True, exist_ok=True)
    parts = told.parts or ("tank", "hull", "simulated")
    if {"tank", "hull"} & set(parts) and not APPARATUS.exists():
        print("the tank and the hull need ../shared")
        parts = [each for each in parts if each == "simulated"]
    if "tank" in parts:
        tank(told.pictures)
    if "hull" in parts:
        hull(told.pictures)
    if "simulated" in parts:
        tables = []
        print(head("simulated", "a third decay", "driven"))
        for number in range(told.number):
            kind, third, driven = simulated(number)
            print(
                table_row(kind, ["; ".join(shares(each)) for each in (third, driven)]), flush=True
            )
            tables += [third.compared.assign(of="decay"), driven.compared.assign(of="driven")]
        whole = pd.concat(tables)
        held = whole.groupby(["of", "quantity"]).held.agg(["sum", "size"])
        for (of, quantity), row in held.iterrows():
            print(
                f"{of}, {quantity}: {row['sum']} of {row['size']} in the 95 % band, "
                f"{100.0 * row['sum'] / row['size']:.1f} %"
            )
    print(f"({commit()})")


if __name__ == "__main__":
    main()
