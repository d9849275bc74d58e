"""a, b, c and the rest of one recording: Eq. 14 on turning points, Eq. 8 on all readings."""

from typing import TYPE_CHECKING

from pendpipe.analysis.fit.result import FitResult, read_fit

if TYPE_CHECKING:
    from pendpipe.analysis.fit.recorded import fit_recording

__all__ = ["FitResult", "fit_recording", "read_fit"]


def __getattr__(name: str) -> object:
    """Import the fits only when they are asked for."""
    if name == "fit_recording":
        from pendpipe.analysis.fit.recorded import fit_recording

        return fit_recording
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
