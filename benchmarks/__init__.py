"""Figures that are shown, not asserted: ``python -m benchmarks`` and ``.evidence``."""
