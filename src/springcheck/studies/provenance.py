"""Provenance of a piece of a study: host, processor, versions, and the last bits of its arithmetic.

Libraries choose their loops by the processor, and two processors may round differently.  Every process that
measures does the same few computations once; where their results differ in a bit, those of a study may differ
too, and its report says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from hashlib import sha256

import numpy as np

from springcheck import engines
from springcheck.text.wording import few

PACKAGES = ("springcheck", "numpy", "numba", "scipy")
"""Packages that numbers depend on, beside those of the engines."""

MOST_HOSTS = 4
"""Hosts that are named for each kind of processor."""

BITS = ("elementary functions", "sums", "linear algebra")
"""Operations whose results differ where the libraries round differently on two processors."""


def versions() -> dict[str, str]:
    """Versions of all that numbers depend on, engines and plug-ins included, as far as installed."""
    # engine files of a call have versions, too; they are part of the command
    known = [name for name in engines.names() if not engines.is_brought(name)]
    engines_ = [engines.engine(name).distribution for name in known]
    plugins = [engines.origin(name).package for name in known]
    return installed([*PACKAGES, *engines_, *plugins])


def installed(names: Iterable[str]) -> dict[str, str]:
    """Versions of those of these packages that are installed."""
    from importlib import metadata

    found = {}
    for name in names:
        with suppress(metadata.PackageNotFoundError, ValueError):
            found[name] = metadata.version(name)
    return found


def bits() -> dict[str, str]:
    """Digests of computations that round as the processor's libraries do."""
    # whole numbers over a power of 2: the arguments are the same on every machine
    x = np.arange(1.0, 4001.0) / 512
    a = np.sqrt(np.arange(1.0, 1601.0)).reshape(40, 40) / 8 + 9 * np.eye(40)
    found = {
        "elementary functions": [np.exp(x), np.log(x), np.sin(x), np.cos(x), np.tanh(x), x**1.3],
        "sums": [
            np.array([np.sum(np.sqrt(x[:n])), np.dot(x[:n], np.sqrt(x[:n]))]) for n in range(1, 4000, 97)
        ],
        "linear algebra": [a @ a, np.linalg.solve(a, x[:40]), np.linalg.eigvalsh(a + a.T)],
    }
    return {
        f"bits of {name}": sha256(b"".join(map(np.ndarray.tobytes, found[name]))).hexdigest()[:16]
        for name in BITS
    }


def sentences(pieces: Iterable[tuple[str, Mapping[str, str]]]) -> list[str]:
    """Sentences on the processors that measured these pieces; none where all were of one kind."""
    measured: dict[tuple[str, ...], list[str]] = {}
    for _, by in pieces:
        kind = (by.get("processor", ""), *(by.get(f"bits of {name}", "") for name in BITS))
        measured.setdefault(kind, []).append(by.get("host", ""))
    if len(measured) < 2:
        return []
    kinds = sorted(measured, key=lambda kind: -len(measured[kind]))
    hosts = {kind: few([*dict.fromkeys(measured[kind])], MOST_HOSTS) for kind in kinds}
    parts = [f"{len(measured[kind])} on {kind[0]} ({hosts[kind]})" for kind in kinds]
    said = [f"Pieces were measured on {len(kinds)} kinds of processors: {'; '.join(parts)}."]
    for kind in kinds[1:]:
        differ = [name for name, one, other in zip(BITS, kinds[0][1:], kind[1:], strict=True) if one != other]
        if differ:
            said.append(
                f"The processors differ in a bit: {', '.join(differ)} round otherwise on {hosts[kind]} than "
                f"on {hosts[kinds[0]]}; so may the last digits of what was measured there."
            )
    if len(said) == 1:
        said.append(f"They agree bit for bit in {', '.join(BITS)}, as far as it was tried.")
    return said
