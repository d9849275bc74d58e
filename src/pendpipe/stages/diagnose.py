"""The diagnosis of one recording as files: ``diagnosis.json`` and its figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from pendpipe.diagnosis import Progress, silent
from pendpipe.diagnosis.result import FILE_NAME
from pendpipe.figures import OF_EVERY_DIAGNOSIS, OF_SOME_DIAGNOSES
from pendpipe.files import replaced, write_json

if TYPE_CHECKING:
    from pendpipe.analysis.fit.result import Baseline
    from pendpipe.diagnosis.run import Outcome
    from pendpipe.recording import Recording

RESULT: Final = FILE_NAME
_EMPTY: Final = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 520 60">
<text x="260" y="34" text-anchor="middle" font-family="sans-serif" font-size="13" fill="#5F6670">\
{}</text></svg>
"""
Figures = Literal["all", "found", "none"]
"""Draw figures of every recording, of those in which something is missing, or of none."""


@dataclass(frozen=True)
class DiagnosisOptions:
    """How a recording is diagnosed.

    Parameters
    ----------
    baseline, fixed
        The null model, and which of its parameters are held.
    seed
        Of the random draws that count the trials of the scans.
    level
        The false-alarm probability: the global p-value below which an effect is reported.
    figures
        Which figures are drawn.
    in_campaign
        Whether a workflow waits for the figures: those not drawn then hold one line.
    """

    baseline: Baseline = "eq8"
    fixed: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0
    level: float = 0.01
    figures: Figures = "all"
    in_campaign: bool = False


def diagnose_motion(
    recording: Recording,
    options: DiagnosisOptions,
    *,
    place: str | Path,
    turning_points: Path | None = None,
    provenance: Mapping[str, Any] | None = None,
    progress: Progress = silent,
) -> Outcome:
    """Diagnose a recording in rad (or m), with the turning points of an earlier stage if given."""
    from pendpipe.analysis.turning_points import read_turning_points
    from pendpipe.diagnosis.run import diagnose_decay, diagnose_recording

    asked: dict[str, Any] = {
        "baseline": options.baseline,
        "fixed": options.fixed,
        "seed": options.seed,
        "level": options.level,
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
    folder: Path, outcome: Outcome, options: DiagnosisOptions, progress: Progress = silent
) -> dict[str, Any]:
    """Draw the figures that are wanted, then write the result that names them."""
    wanted = options.figures == "all" or (
        options.figures == "found" and outcome.verdict == "missing-physics"
    )
    _remove_figures(folder)
    if wanted:
        progress("drawing")
    content = outcome.save(folder, figures=wanted)
    _write_placeholders(folder, options, "Not drawn: nothing is missing here.")
    return content


def _remove_figures(folder: Path) -> None:
    """Remove the figures of an earlier diagnosis."""
    for name in (*OF_EVERY_DIAGNOSIS, *OF_SOME_DIAGNOSES):
        for form in (".svg", ".png"):
            folder.joinpath(name).with_suffix(form).unlink(missing_ok=True)


def _write_placeholders(folder: Path, options: DiagnosisOptions, reason: str) -> None:
    """Write one line instead of each figure that a workflow waits for and that was not drawn."""
    if not options.in_campaign or options.figures == "none":
        return
    for name in OF_EVERY_DIAGNOSIS:
        path = folder / f"{name}.svg"
        if not path.exists():
            with replaced(path) as stream:
                stream.write(_EMPTY.format(reason))


def write_not_analysable(
    folder: Path, options: DiagnosisOptions, reason: str, provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """Write the result of a recording that can't be analysed, and return its content."""
    from pendpipe.diagnosis.result import not_analysable

    content = not_analysable(options.baseline, reason, provenance)
    _remove_figures(folder)
    _write_placeholders(folder, options, "Not drawn: this record can't be analysed.")
    write_json(folder / RESULT, content)
    return content


def refused_before(refused: Path | None) -> str | None:
    """Return why a stage that the diagnosis builds on refused a record of a campaign; else None.

    The fit runs beside the diagnosis, so its refusal does not count. Nor does a diagnosis refuse
    a record: what can't be diagnosed may still have been fitted.
    """
    from pendpipe.stages.refusal import reason_of

    return None if refused is None else reason_of(refused, before="fit")
