"""The result of a fit, and its form on disk (``fit.json``)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from pendpipe.analysis.fit.decrement import Decrement, Light
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.estimate import Estimate, number
from pendpipe.files import read_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from pendpipe.analysis.turning_points import TurningPoints
    from pendpipe.dynamics import Eq8
    from pendpipe.recording import Recording

Method = Literal["waveform", "turning-points"]
Baseline = Literal["eq8", "viscous"]
Restoring = Literal["linear", "sine"]
TORQUES: Final[tuple[Restoring, ...]] = ("linear", "sine")
PARAMETERS: Final = ("a", "b", "c", "frequency", "amplitude", "phase", "offset")


_RATES: Final = {
    "1": ("1/s", "1/s"),
    "rad/s": ("1/rad", "rad/s^2"),
    "rad/s^2": ("s/rad", "rad/s^3"),
    "m/s": ("1/m", "m/s^2"),
    "m/s^2": ("s/m", "m/s^3"),
}
"""Units of a and c where that of the motion has the second in it."""


def units(unit: str) -> dict[str, str]:
    """Unit of each parameter, for motions in a unit."""
    a, c = _RATES.get(unit, (f"1/({unit} s)", f"{unit}/s"))
    return {
        "a": a,
        "b": "1/s",
        "c": c,
        "frequency": "Hz",
        "amplitude": unit,
        "phase": "rad",
        "offset": unit,
    }


@dataclass(frozen=True, repr=False)
class FitResult:
    """What one recording says of a, b, c and the rest.

    Parameters
    ----------
    method, baseline
        How it was fitted, and with which model.
    parameters
        The seven of `PARAMETERS`: the rates of Eq. 13, Eq. 8's frequency omega/(2 pi),
        |y| at the first turning point kept, the phase at the first sample kept (the motion
        is there ``offset + amplitude cos(phase)`` to first order), and the level.
    quality_factor_limit
        pi f/b: the Q that the exponential losses alone would give; None for b = 0.
    quality_factor_hysteretic, quality_factor_viscous
        The parts of b, given Eq. 8's form; None where they were not asked for.
    covariance_order, covariance
        Names and matrix, shape (n, n).
    noise_rms_rad, residual_rms_rad, chi2_per_dof
        Noise of one reading (never below step/sqrt(12)); what the model leaves; and their
        comparison.
    samples, turning_points
        How many of each were used.
    cuts
        Spans left out: ``start_s``, ``stop_s``, ``reason``.
    provenance, warnings
        Where it comes from; and what the reader should know.
    restoring
        Which restoring torque the numbers belong to.
    settled
        Whether the search came to its end; a fit that did not is no result.
    decrement_check
        The law's loss beside that of the turning points, the large amplitude first.
    light, light_reason
        How far the numbers may be believed (`decrement.light_of`), and why.
    points, decay
        The turning points and the readings of the fitted decay; None where the fit was read
        from a file.
    """

    method: Method
    baseline: Baseline
    parameters: Mapping[str, Estimate]
    quality_factor_limit: Estimate | None
    covariance_order: tuple[str, ...]
    covariance: FloatArray
    noise_rms_rad: float
    residual_rms_rad: float
    chi2_per_dof: float
    samples: int
    turning_points: int
    quality_factor_hysteretic: Estimate | None = None
    quality_factor_viscous: Estimate | None = None
    cuts: tuple[Mapping[str, Any], ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    restoring: Restoring = "linear"
    settled: bool = True
    decrement_check: tuple[Decrement, ...] = ()
    light: Light = "amber"
    light_reason: str = "the decrement was not checked"
    points: TurningPoints | None = field(default=None, repr=False, compare=False)
    decay: Recording | None = field(default=None, repr=False, compare=False)

    def __getitem__(self, name: str) -> Estimate:
        """Return one parameter: ``fit["b"].value``, ``fit["b"].sd``."""
        return self.parameters[name]

    def __str__(self) -> str:
        """Return the light, what can be quoted, and how to quote it."""
        from pendpipe.analysis.fit.summary import lines

        return "\n".join(lines(self))

    def __repr__(self) -> str:
        """Return the numbers in one line."""
        numbers = ", ".join(
            f"{name}={entry.value:.6g}+-{entry.sd:.2g}" for name, entry in self.parameters.items()
        )
        return f"FitResult({self.light}: {numbers})"

    def _repr_html_(self) -> str:
        """Return the summary for a notebook."""
        from html import escape

        return f"<pre>{escape(str(self))}</pre>"

    @property
    def equation(self) -> str:
        """Name of the law that was fitted."""
        if self.restoring == "sine":
            return "Eq. 8 with the torque of sin x"
        return "Eq. 14" if self.method == "turning-points" else "Eq. 8"

    @property
    def law(self) -> Eq8:
        """Eq. 8 with the fitted numbers; b is halved where its parts are not known."""
        from pendpipe.dynamics import Eq8

        b, held = self.value("b"), self.quality_factor_hysteretic
        share = 0.5 * b if held is None else math.pi * self.value("frequency") / held.value
        hysteretic = min(max(share, 0.0), b)
        return Eq8(
            2.0 * math.pi * self.value("frequency"),
            self.value("a"),
            hysteretic,
            b - hysteretic,
            self.value("c"),
            restoring=self.restoring,
        )

    def plot(self) -> Figure:
        """Draw the decay with its fit, what the fit leaves, and Q against amplitude."""
        from pendpipe.figures.data import Decay
        from pendpipe.figures.decays import draw_fit

        if self.points is None or self.decay is None:
            raise InputError("plot", "the readings are not with this fit", "fit the recording anew")
        return draw_fit(Decay("", self.points, self), self.decay)

    def to_frame(self) -> DataFrame:
        """Return a table with a row a parameter: value, sd, low95, high95, unit."""
        from pandas import DataFrame

        rows = [
            (name, entry.value, entry.sd, *entry.bounds95, entry.unit)
            for name, entry in self.parameters.items()
        ]
        columns = ["parameter", "value", "sd", "low95", "high95", "unit"]
        return DataFrame(rows, columns=columns).set_index("parameter")

    def save(self, folder: str | Path) -> Path:
        """Write ``fit.json`` and, with the readings, ``turning_points.csv`` and ``fit.svg``.

        Returns the folder, which is made where it does not exist.
        """
        from pendpipe.analysis.turning_points import write_turning_points
        from pendpipe.files import make_folder, write_json

        target = Path(folder)
        make_folder(target)
        write_json(target / "fit.json", self.to_dict())
        if self.points is not None and self.decay is not None:
            from pendpipe.figures.style import save

            write_turning_points(target / "turning_points.csv", self.points)
            save(self.plot(), target / "fit")
        return target

    def value(self, name: str) -> float:
        """Value of one parameter."""
        return self.parameters[name].value

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``fit.json``."""
        limit = self.quality_factor_limit
        if limit is None:
            limit = Estimate(math.nan, math.nan, "", (math.nan, math.nan))
        return {
            "schema_version": 1,
            "method": self.method,
            "baseline": self.baseline,
            "restoring": self.restoring,
            "light": self.light,
            "light_reason": self.light_reason,
            "decrement_check": [check._asdict() for check in self.decrement_check],
            "parameters": {name: self.parameters[name].as_json() for name in PARAMETERS},
            "quality_factor_limit": limit.as_json(),
            "quality_factor_hysteretic": _optional(self.quality_factor_hysteretic),
            "quality_factor_viscous": _optional(self.quality_factor_viscous),
            "covariance": {
                "order": list(self.covariance_order),
                "matrix": self.covariance.tolist(),
            },
            "noise_rms_rad": self.noise_rms_rad,
            "residual_rms_rad": self.residual_rms_rad,
            "chi2_per_dof": self.chi2_per_dof,
            "samples": self.samples,
            "turning_points": self.turning_points,
            "cuts": [dict(cut) for cut in self.cuts],
            "provenance": dict(self.provenance),
            "warnings": list(self.warnings),
        }

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> FitResult:
        """Rebuild a result from the content of ``fit.json``."""
        limit = content["quality_factor_limit"]
        covariance = content["covariance"]
        return cls(
            method=content["method"],
            baseline=content["baseline"],
            parameters={
                name: Estimate.from_json(entry) for name, entry in content["parameters"].items()
            },
            quality_factor_limit=None if limit["value"] is None else Estimate.from_json(limit),
            covariance_order=tuple(covariance["order"]),
            covariance=np.array(covariance["matrix"], dtype=np.float64),
            noise_rms_rad=number(content["noise_rms_rad"]),
            residual_rms_rad=number(content["residual_rms_rad"]),
            chi2_per_dof=number(content["chi2_per_dof"]),
            samples=content["samples"],
            turning_points=content["turning_points"],
            quality_factor_hysteretic=_maybe(content["quality_factor_hysteretic"]),
            quality_factor_viscous=_maybe(content["quality_factor_viscous"]),
            cuts=tuple(content["cuts"]),
            provenance=content["provenance"],
            warnings=tuple(content["warnings"]),
            restoring=content["restoring"],
            light=content["light"],
            light_reason=content["light_reason"],
            decrement_check=tuple(Decrement(**check) for check in content["decrement_check"]),
        )


def read_fit(path: str | Path) -> FitResult:
    """Read ``fit.json``.

    Raises
    ------
    InputError
        If the file is absent, is no fit, or holds the refusal of its record.
    """
    content = read_json(path)
    if "refused" in content:
        raise InputError(path, f"the record was refused ({content['refused']})", "correct it first")
    try:
        return FitResult.from_json(content)
    except (KeyError, TypeError) as fault:
        raise InputError(path, f"this is no fit ({fault})", "run pendpipe fit") from None


def _optional(estimate: Estimate | None) -> dict[str, Any] | None:
    return None if estimate is None else estimate.as_json()


def _maybe(entry: Mapping[str, Any] | None) -> Estimate | None:
    return None if entry is None else Estimate.from_json(entry)
