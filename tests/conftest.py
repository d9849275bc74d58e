"""What all tests share: no example of hypothesis fails for a busy machine's sake."""

from hypothesis import settings

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
