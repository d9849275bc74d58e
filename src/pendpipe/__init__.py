"""How pendulums lose energy, from the instrument's bytes to the physics that was left out.

`read` a recording from a file of any kind, `fit` period, Q and losses, `diagnose` what physics is
missing, `predict` another experiment, `simulate` a recording, `acquire` one from an instrument;
`help(pp.fit)` tells more.

>>> import pendpipe as pp
>>> recording = pp.read("examples/rod-pendulum.csv")
>>> fit = pp.fit(recording)
>>> round(fit["b"].value, 4), fit.light
(0.0104, 'green')

Nothing is imported before it is used: a job's cost is its imports.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pendpipe.version import __version__

if TYPE_CHECKING:
    from pendpipe import effects, physics
    from pendpipe.acquisition.verbs import acquire
    from pendpipe.api import diagnose, find_free_decay, fit, turning_points
    from pendpipe.batch import fit_many
    from pendpipe.dynamics import Eq8
    from pendpipe.errors import InputError
    from pendpipe.estimate import Estimate
    from pendpipe.prediction import predict
    from pendpipe.reading import inspect, read
    from pendpipe.recording import Recording
    from pendpipe.reliability import judge
    from pendpipe.simulation.verbs import simulate

__all__ = [
    "Eq8",
    "Estimate",
    "InputError",
    "Recording",
    "__version__",
    "acquire",
    "diagnose",
    "effects",
    "find_free_decay",
    "fit",
    "fit_many",
    "inspect",
    "judge",
    "physics",
    "predict",
    "read",
    "simulate",
    "turning_points",
]

_HOMES = {
    "Eq8": "dynamics",
    "Estimate": "estimate",
    "InputError": "errors",
    "Recording": "recording",
    "acquire": "acquisition.verbs",
    "fit_many": "batch",
    "inspect": "reading",
    "judge": "reliability",
    "predict": "prediction",
    "read": "reading",
    "simulate": "simulation.verbs",
}
"""Modules of the public names that are not in `api`."""


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in __all__:
        raise AttributeError(f"module 'pendpipe' has no attribute {name!r}")
    if name in ("effects", "physics"):
        return import_module(f"pendpipe.{name}")
    return getattr(import_module(f"pendpipe.{_HOMES.get(name, 'api')}"), name)


def __dir__() -> list[str]:
    """List the public names, imported or not."""
    return sorted({*__all__, *globals()})
