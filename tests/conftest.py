"""What all tests share: no example of hypothesis fails for a busy machine's sake.

CI draws the same examples each time, so that its answer depends on the code alone; ``make test``
draws new ones.
"""

from hypothesis import settings

settings.register_profile("untimed", deadline=None)
settings.register_profile("same", settings.get_profile("untimed"), derandomize=True)
settings.load_profile("untimed")
