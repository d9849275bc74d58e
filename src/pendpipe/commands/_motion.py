"""A recording as angles (or metres), with what its results must say of where it comes from."""

from __future__ import annotations

import argparse
from typing import Any

from pendpipe.commands import _reading
from pendpipe.recording import Recording


def read_motion(arguments: argparse.Namespace) -> tuple[Recording, dict[str, Any]]:
    """Read FILE, apply the sensor constant, and say what was guessed.

    Returns
    -------
    recording
        In rad, or in its own unit where no constant makes it an angle.
    provenance
        ``input_sha256``, ``version``, ``volts_per_radian`` (None where none was used).
    """
    from pendpipe.formats import read
    from pendpipe.version import __version__

    recording = read(arguments.file, _reading.options(arguments))
    constant = arguments.volts_per_radian or _calibrated(arguments.calibration)
    was_volts = recording.quantity == "volts"
    recording = recording.as_motion(constant, arguments.file)
    _reading.announce(arguments, recording)
    return recording, {
        "input_sha256": _reading.digest(arguments),
        "version": __version__,
        "volts_per_radian": recording.number("volts_per_radian") if was_volts else None,
    }


def _calibrated(path: Any) -> float | None:
    """The sensor constant in a result of ``pendpipe calibrate``; None where it has none."""
    from pendpipe.errors import InputError
    from pendpipe.files import read_json

    if path is None:
        return None
    try:
        constant = read_json(path)["volts_per_radian"]
    except (KeyError, TypeError):
        raise InputError(path, "this is no calibration", "run pendpipe calibrate") from None
    return None if constant is None else float(constant["value"])
