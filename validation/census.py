"""Which integrator every installed engine really runs, as a table in Markdown.

Claim: the same engine is explicit, semi-implicit or implicit Euler depending on how the spring is attached;
every scheme is named by its states alone, and agrees with the one that the engine is declared with.
Run:   python validation/census.py        (about a minute; with the extra `established`)
"""

import sys

import numpy as np

from arguments import arguments
from springcheck import engines
from springcheck.studies.census.measure import measure
from springcheck.studies.census.result import Census, title


def table(found: Census) -> list[str]:
    """The census in Markdown, grouped by scheme."""
    out = [
        "| scheme, from the states | engine and attachment | amplitude | det - 1 | arithmetic "
        "| forces a step | time a step | same bits as |",
        "|---|---|---:|---:|---|---:|---:|---|",
    ]
    partners = found.partners
    for name, members in found.grouped.items():
        for x in members:
            area = "" if np.isnan(x.area) else "0" if abs(x.area) < 1e-13 else f"{x.area:+.2e}"
            same = ", ".join(f"`{y}`" for y in partners[x.method][:2]) + (
                f" and {len(partners[x.method]) - 2} more" if len(partners[x.method]) > 2 else ""
            )
            out.append(
                f"| {title(name)} | `{x.method}` | {x.amplitude:.4f} | {area} | {x.precision} "
                f"| {x.force_calls:.3g} | {x.seconds * 1e6:.3g} us | {same} |"
            )
    versions = sorted({(x.method.partition(":")[0], x.version) for x in found.entries})
    return [*out, "", "; ".join(f"{engines.engine(name).title}: {version}" for name, version in versions)]


def main() -> int:
    """Print the table; the exit status says whether every engine is what it is declared as."""
    arguments(__doc__)
    found = measure()
    for line in table(found):
        print(line)
    return found.status


if __name__ == "__main__":
    sys.exit(main())
