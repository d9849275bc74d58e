"""Other packages add effects; one that can't be loaded is named in a line and passed over."""

from dataclasses import dataclass

import pytest

from pendpipe.effects import catalogue
from pendpipe.effects.effect import Effect


@dataclass(order=True)
class Entry:
    """An entry point of a package that is installed."""

    name: str
    effect: Effect | None = None

    def load(self) -> Effect:
        if self.effect is None:
            raise ImportError(f"no module named {self.name}")
        return self.effect


def test_an_effect_of_another_package_is_found(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    known = tuple(catalogue.CATALOGUE)
    entries = [Entry("absent"), Entry("other", known[0])]
    monkeypatch.setattr(catalogue, "entry_points", lambda **_: entries)
    assert tuple(catalogue._found()) == (*known, known[0])
    assert "the plugin 'absent' is passed over" in capsys.readouterr().err
