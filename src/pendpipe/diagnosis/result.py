"""The results of a test and of a diagnosis, and their form on disk (``diagnosis.json``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendpipe.analysis.fit.result import drawer_of
from pendpipe.diagnosis.outcome import Outcome
from pendpipe.diagnosis.summary import BASELINES, Summary, html_of, summarise

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FILE_NAME: Final = "diagnosis.json"


def swinging(baseline: str, restoring: str, drag_form: str) -> str:
    """Return a baseline with its forms, in words."""
    forms = {"sin x": restoring == "sine", "v|v|": drag_form == "speed"}
    with_them = " and ".join(name for name, has in forms.items() if has)
    return BASELINES.get(baseline, baseline) + (f" with {with_them}" if with_them else "")


_DENSITIES: Final = ("log_density_before", "log_density_after", "gain", "gain_sd")


class Diagnosis(Outcome):
    """Where model and recording differ, and what is missing. It prints as a dozen lines."""

    @property
    def summary(self) -> Summary:
        """The answer: what is printed, as fields."""
        return summarise(self)

    @property
    def statement(self) -> str:
        """The answer as it is printed: a dozen lines at most."""
        return "\n".join(self.summary.lines())

    def __str__(self) -> str:
        return "\n".join(self.summary.lines(self.name))

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return html_of(self.summary, self.name)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``diagnosis.json``."""
        held = self.held_out
        densities = (
            (None, None, 0.0, 0.0)
            if held is None
            else (held.before, held.after, held.gain, held.gain_sd)
        )
        return {
            "schema_version": 1,
            "baseline": {"name": self.baseline_name, **self.baseline.as_json()},
            "restoring": self.restoring,
            "drag_form": self.drag_form,
            "noise_rms_rad": self.noise_rms_rad,
            "verdict": self.verdict,
            "p_value": self.p_value,
            "effects": [effect.as_json() for effect in self.effects],
            "improved": self.improved.as_json(),
            "held_out": dict(zip(_DENSITIES, densities, strict=True)),
            "prediction": None if held is None else held.as_json(),
            "unexplained": {
                "residual_rms_rad": self.unexplained_rms_rad,
                "p_value": self.unexplained_p_value,
            },
            "remainder": None if self.remainder is None else self.remainder.as_json(),
            "small_amplitudes": None if self.small_swings is None else self.small_swings.as_json(),
            "statement": self.statement,
            "summary": self.summary.as_json(),
            "details": self.details,
            "excluded": [
                {"id": identifier, "p_value": p_value}
                for identifier, p_value in self.scanned
                if identifier not in {each.identifier for each in self.effects}
            ],
            "figures": list(self.figures),
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
            **({"recordings": list(self.recordings)} if self.recordings else {}),
        }

    def save(
        self, folder: str | Path, *, figures: bool = True, force: bool = False
    ) -> dict[str, Any]:
        """Write ``diagnosis.json`` and the figures.

        Parameters
        ----------
        folder
            Made if it is not there.
        figures
            Whether to draw them; those of several recordings together are not.
        force
            Replace files of these names that pendpipe did not make.

        Returns
        -------
        dict
            What ``diagnosis.json`` holds.

        Raises
        ------
        InputError
            If the folder can't be written, or holds a file that pendpipe did not make.
        """
        from pendpipe.files import write_json, writing

        target, whole = Path(folder), self
        with writing(force=force):
            if figures and self.drawn_by and not self.alone:
                drawn = self.drawn_by().draw_diagnosis(self, target)
                whole = replace(self, figures=tuple(path.name for path in drawn))
            content = whole.to_dict()
            write_json(target / FILE_NAME, content)
        return content

    def plot(self) -> Figure:
        """Draw the decay with both models, and what each of them leaves.

        Returns
        -------
        matplotlib.figure.Figure
        """
        figure: Figure = drawer_of(self.drawn_by).plot(self)
        return figure


def not_analysable(
    baseline: str, reason: str, provenance: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return ``diagnosis.json`` of a recording that can't be analysed.

    It has every key of a real diagnosis, so that a program need not ask which are there;
    numbers that do not exist are None.

    Parameters
    ----------
    baseline
        The model that was asked for.
    reason
        Why the recording can't be analysed, one line.
    provenance
        Goes into the result.
    """
    nothing: dict[str, Any] = {"parameters": {}, "residual_rms_rad": None, "chi2_per_dof": None}
    nothing |= {"noise_rms_rad": None, "fit_p_value": None}
    nothing |= {"period_span_s": None, "quality_factors": []}
    return {
        "schema_version": 1,
        "baseline": {"name": baseline, **nothing},
        "restoring": None,
        "drag_form": None,
        "noise_rms_rad": None,
        "verdict": "not-analysable",
        "reason": reason,
        "p_value": None,
        "effects": [],
        "improved": dict(nothing),
        "held_out": dict.fromkeys(_DENSITIES),
        "unexplained": {"residual_rms_rad": None, "p_value": None},
        "statement": f"This recording can't be analysed: {reason}.",
        "summary": Summary(f"not analysable: {reason}").as_json(),
        "details": "",
        "excluded": [],
        "figures": [],
        "warnings": [],
        "provenance": dict(provenance or {}),
    }
