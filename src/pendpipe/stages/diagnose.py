"""The diagnosis of one recording as files: ``diagnosis.json`` and its figures."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from pendpipe.diagnose import Progress, silent
from pendpipe.files import replaced, write_json

if TYPE_CHECKING:
    from pendpipe.analysis.fit.result import Baseline
    from pendpipe.diagnose.run import Outcome
    from pendpipe.recording import Recording

RESULT: Final = "diagnosis.json"
DIAGNOSIS_FIGURES: Final = ("residual_map", "residual_spectrum", "damping", "frequency")
"""The figures that the diagnosis of every record has."""
FIGURES: Final = (*DIAGNOSIS_FIGURES, "codes", "curve")
"""The figures' names; `codes` and `curve` are drawn where they have something to show."""
_EMPTY: Final = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 520 60">
<text x="260" y="34" text-anchor="middle" font-family="sans-serif" font-size="13" fill="#5F6670">\
{}</text></svg>
"""
Figures = Literal["all", "found", "none"]
"""Of every recording, of those in which something is missing, or of none."""


@dataclass(frozen=True)
class DiagnosisOptions:
    """What a recording is asked.

    Parameters
    ----------
    baseline, fixed
        The model that it is held against, and which of its parameters are held.
    seed, level
        Of the draws that count trials; global p-value of an accusation.
    figures
        Which are drawn.
    in_campaign
        Whether a workflow waits for the figures: one that is not drawn then says so.
    """

    baseline: Baseline = "eq8"
    fixed: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0
    level: float = 0.01
    figures: Figures = "all"
    in_campaign: bool = False


def diagnose_motion(
    recording: Recording,
    question: DiagnosisOptions,
    *,
    place: str | Path,
    turning_points: Path | None = None,
    provenance: Mapping[str, Any] | None = None,
    progress: Progress = silent,
) -> Outcome:
    """Diagnose a recording in rad (or m), with turning points found before where there are."""
    from pendpipe.analysis.turning_points import read_turning_points
    from pendpipe.diagnose.run import diagnose_decay, diagnose_recording

    asked: dict[str, Any] = {
        "baseline": question.baseline,
        "fixed": question.fixed,
        "seed": question.seed,
        "level": question.level,
        "place": place,
        "provenance": provenance,
        "progress": progress,
    }
    if turning_points is None:
        return diagnose_recording(recording, **asked)
    points = read_turning_points(turning_points)
    part = recording.between(points.start_s, points.stop_s)
    return diagnose_decay(part, points, whole=recording, **asked)


def write_diagnosis(
    folder: Path, outcome: Outcome, question: DiagnosisOptions, progress: Progress = silent
) -> dict[str, Any]:
    """Draw the figures that are asked for, then write the result that names them."""
    diagnosis = outcome.diagnosis
    wanted = question.figures == "all" or (
        question.figures == "found" and diagnosis.verdict == "missing-physics"
    )
    _forget_figures(folder)
    if wanted:
        from pendpipe.figures.diagnosis import draw_diagnosis

        progress("drawing")
        drawn = draw_diagnosis(outcome, folder)
        diagnosis = dataclasses.replace(diagnosis, figures=tuple(path.name for path in drawn))
    _say_what_is_not_drawn(folder, question, "Not drawn: nothing is missing here.")
    content = diagnosis.as_json()
    write_json(folder / RESULT, content)
    return content


def _forget_figures(folder: Path) -> None:
    """Remove what an earlier diagnosis has drawn here."""
    for name in FIGURES:
        for form in (".svg", ".png"):
            folder.joinpath(name).with_suffix(form).unlink(missing_ok=True)


def _say_what_is_not_drawn(folder: Path, question: DiagnosisOptions, reason: str) -> None:
    """Put a line in the place of each figure that a workflow waits for."""
    if not question.in_campaign or question.figures == "none":
        return
    for name in DIAGNOSIS_FIGURES:
        path = folder / f"{name}.svg"
        if not path.exists():
            with replaced(path) as stream:
                stream.write(_EMPTY.format(reason))


def write_not_analysable(
    folder: Path, question: DiagnosisOptions, reason: str, provenance: Mapping[str, Any]
) -> None:
    """Write the result of a recording that can't be analysed."""
    from pendpipe.diagnose.result import not_analysable

    _forget_figures(folder)
    _say_what_is_not_drawn(folder, question, "Not drawn: this record can't be analysed.")
    write_json(folder / RESULT, not_analysable(question.baseline, reason, provenance))


def refused_before(refused: Path | None) -> str | None:
    """Why a record of a campaign was refused by a stage that the diagnosis builds on.

    The fit runs beside the diagnosis and not before it, so it has no say. A diagnosis
    refuses no record either: what can't be diagnosed may still have been fitted.
    """
    from pendpipe.stages.refusal import reason_of

    return None if refused is None else reason_of(refused, before="fit")
