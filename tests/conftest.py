"""Which engines must be there: a missing engine is a failure where it is required, else a skip."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from springcheck import engines


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--require-engine",
        action="append",
        default=[],
        metavar="NAME",
        help="an engine whose absence fails the tests instead of skipping them; 'all' for every engine",
    )


@pytest.fixture
def need(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Call with a label: skips without its engine or platform, or fails where it is required."""
    required: list[str] = request.config.getoption("--require-engine")

    def check(label: str) -> None:
        name = engines.parse(label).engine
        reason = engines.absence(name) or _platform_absence(label)
        if reason is None:
            return
        if "all" in required or name in required:
            pytest.fail(reason)
        pytest.skip(reason)

    return check


def _platform_absence(label: str) -> str | None:
    platform = engines.parse(label).platform
    if not platform:
        return None
    import openmm

    here = [openmm.Platform.getPlatform(i).getName() for i in range(openmm.Platform.getNumPlatforms())]
    return None if platform in here else f"OpenMM has no platform {platform} here"
