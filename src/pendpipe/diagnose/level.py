"""How the level of an accusation is shared among those that may make one."""

from typing import Final

CATALOGUE_SHARE: Final = 0.5
"""Part of the level that the catalogue's scan spends."""
REDNESS_SHARE: Final = 0.2
"""Part of it for the doubt whether red noise is an effect."""
TESTS_SHARE: Final = 1.0 - CATALOGUE_SHARE - REDNESS_SHARE
"""Part of it that the tests of the measurement share."""
