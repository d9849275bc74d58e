"""How pendulums lose energy, from the instrument's bytes to the physics that was left out.

The package imports nothing on its own: a job's cost is its imports, so every part is
imported by name where it is used (``from pendpipe.physics import amplitude``).
"""

from pendpipe.version import __version__

__all__ = ["__version__"]
