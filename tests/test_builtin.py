"""The built-in engines and scenes: each can be made, and a missing extra is named."""

from __future__ import annotations

import pytest

from lingjing.builtin import _extra
from lingjing.errors import InfrastructureError
from lingjing.testing import PluginHost


@pytest.mark.parametrize("name", ["camera", "city", "multirotor", "plane", "quadruped", "road", "satellite", "vessel"])
def test_every_engine_can_be_made(name: str) -> None:
    engine = PluginHost().engine(name).factory()
    assert all(hasattr(engine, method) for method in ("reset", "submit", "advance", "capture", "close"))


def test_a_missing_extra_is_named_with_the_command() -> None:
    with (
        pytest.raises(InfrastructureError, match="`nosuchpackage` is not installed") as caught,
        _extra("road", "nosuchpackage"),
    ):
        import nosuchpackage  # noqa: F401
    assert caught.value.hint == "pip install 'eclipse-sumo>=1.24' 'libsumo>=1.24'"


def test_a_missing_import_of_an_engine_is_not_reported_as_a_missing_extra() -> None:
    with pytest.raises(ModuleNotFoundError), _extra("road", "libsumo"):
        import nosuchpackage  # noqa: F401
