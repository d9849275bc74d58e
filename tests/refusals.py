"""What is refused, in one line that says why."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from pendpipe.errors import InputError


@contextmanager
def refused(said: str, place: str = "") -> Iterator[None]:
    """Something is refused in one line that begins with a place and says so."""
    with pytest.raises(InputError) as caught:
        yield
    message = str(caught.value)
    assert message.startswith(place)
    assert said in message
    assert "\n" not in message
