"""Simulate a recording: what the front door and the command call."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pendpipe.options import NATURAL, Option, checked

if TYPE_CHECKING:
    from pendpipe.recording import Recording


@checked
def simulate(
    model: str | Path | Mapping[str, Any],
    *,
    seed: Annotated[
        int | None, Option("seed of the noise, instead of the model's", "N", NATURAL)
    ] = None,
) -> "Recording":
    """Simulate a recording from a described pendulum and measurement chain.

    Parameters
    ----------
    model
        A TOML file like ``config/model.toml``, or its content as a mapping.
    {options}

    Examples
    --------
    >>> recording = simulate(
    ...     {
    ...         "pendulum": {"frequency_hz": 0.5, "c": 1e-3, "release_angle_rad": 0.1},
    ...         "sampling": {"sample_rate_hz": 50.0, "duration_s": 20.0},
    ...     }
    ... )
    >>> recording
    Recording(1000 samples of angle_rad, 0 to 19.98 s)
    """
    from pendpipe.simulation import model as models

    described = models.read_model(model)
    if seed is not None:
        described = described.model_copy(update={"seed": seed})
    place = "model" if isinstance(model, Mapping) else str(model)
    return models.simulate(described, f"simulated: {Path(place).name}", place=place)
