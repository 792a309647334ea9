"""What numbers stand on: the machine, the versions, the command; by it work is recognised and taken up."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from springcheck import engines, store
from springcheck.engines.contract import Label


def origin(labels: Iterable[Label]) -> dict[str, str]:
    """The machine, and the versions of everything that these methods run on."""
    found = {name: str(value) for name, value in store.machine().items()}
    for name in sorted({label.engine for label in labels}):
        distribution = engines.engine(name).distribution
        if distribution and engines.absence(name) is None:
            found[distribution] = engines.installed_version(name)
    return found


def command(study: str, labels: Sequence[Label], *options: str) -> str:
    """All that decides the numbers of a study or a run, by which its journal is recognised.

    The machine and the versions are part of it: times of two machines, limits of two releases of an
    engine, do not belong into one file.
    """
    versions = [f"{name} {version}" for name, version in origin(labels).items()]
    return "\n".join([study, *map(str, labels), *versions, *options])
