"""Concealed effects: an independent generator, its oracle, sealing and scoring.

Nothing here imports `pendpipe.dynamics`, `pendpipe.effects` or `pendpipe.diagnose`: the
proof may not be the program agreeing with itself.
"""
