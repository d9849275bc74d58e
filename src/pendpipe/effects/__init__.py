"""What may have been left out: the catalogue, an effect a function."""

from pendpipe.effects.effect import Effect, Kick, Parameter, Pendulum, Span

__all__ = ["Effect", "Kick", "Parameter", "Pendulum", "Span"]
