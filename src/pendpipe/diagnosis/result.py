"""The results of a test and of a diagnosis, and their form on disk (``diagnosis.json``)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendpipe.analysis.fit.result import drawer_of
from pendpipe.diagnosis.found import FittedModel
from pendpipe.diagnosis.outcome import Outcome
from pendpipe.diagnosis.summary import Summary, details_of, summarise
from pendpipe.files import finite, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FILE_NAME: Final = "diagnosis.json"


_NOT_HELD: Final = (None, None, 0.0, 0.0)
"""Of a recording of which nothing was predicted."""
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
        return "\n".join(self.summary.answer.lines())

    @property
    def details(self) -> str:
        """All that was found: what the answer leaves out too."""
        return "\n".join(details_of(self))

    def __str__(self) -> str:
        return "\n".join(self.summary.answer.lines(self.name))

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return self.summary.answer.html(self.name)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``diagnosis.json``."""
        held, found = self.held_out, {each.identifier for each in self.effects}
        densities = (held.before, held.after, held.gain, held.gain_sd) if held else _NOT_HELD
        return dict(
            finite(
                {
                    "schema_version": 1,
                    "baseline": {"name": self.baseline.name, **self.baseline.as_json()},
                    "restoring": self.restoring,
                    "drag_form": self.drag_form,
                    "noise_rms_rad": self.noise_rms_rad,
                    "verdict": self.verdict,
                    "p_value": self.p_value,
                    "seen": self.seen,
                    "left": self.left,
                    "effects": self.effects,
                    "improved": self.improved,
                    "held_out": dict(zip(_DENSITIES, densities, strict=True)),
                    "prediction": held,
                    "unexplained": {
                        "residual_rms_rad": self.improved.residual_rms_rad,
                        "p_value": self.unexplained_p_value,
                    },
                    "remainder": self.remainder,
                    "small_amplitudes": self.improved.small_swings,
                    "statement": self.statement,
                    "summary": self.summary,
                    "details": self.details,
                    "excluded": [
                        {"id": name, "p_value": p} for name, p in self.scanned if name not in found
                    ],
                    "figures": (),
                    "warnings": self.warnings,
                    "provenance": self.provenance,
                    **({"recordings": self.recordings} if self.recordings else {}),
                }
            )
        )

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

        target, content = Path(folder), self.to_dict()
        with writing(force=force):
            if figures and self.drawn_by and not self.alone:
                drawn = self.drawn_by().draw_diagnosis(self, target)
                content["figures"] = [path.name for path in drawn]
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
    nothing = FittedModel(baseline, {}, math.nan, math.nan, math.nan)
    answer = f"This recording can't be analysed: {reason}."
    empty = Diagnosis(nothing, nothing, (), None).to_dict()
    return dict(
        plain(
            {
                **empty,
                "restoring": None,
                "drag_form": None,
                "verdict": "not-analysable",
                "reason": reason,
                "held_out": dict.fromkeys(_DENSITIES),
                "statement": answer,
                "summary": Summary(f"not analysable: {reason}"),
                "details": "",
                "provenance": provenance or {},
            },
            only_finite=True,
        )
    )
