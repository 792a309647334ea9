"""The reference numbers of the stiff scenes, by a route of their own: matrix exponentials in mpmath.

Claim: the true motions of the stiff scenes that springcheck uses agree with exp(A t) z to the digits of
the extended precision, and its r-RESPA map with the product of the maps of its parts.

Command: python validation/stiff_references.py            (compares with data/reference/stiff/)
         python validation/stiff_references.py --write    (writes data/reference/stiff/ anew)

Expected: every file agrees; nothing differs.

Nothing of springcheck is imported.  A scene file is read as TOML; every float in it stands for its
double.  The state z = (q1 .. qn, p1 .. pn) obeys z' = A z, and z(t) = exp(A t) z(0) is taken with 120
digits, so that the ratio of the scales (1e12, and 1e6 in the damping) costs none of those kept.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath as mp

from arguments import arguments, script

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "data" / "reference" / "stiff"
DIGITS = 30

mp.mp.dps = 120


def scene(name: str) -> dict[str, Any]:
    """A scene file as nested tables."""
    return tomllib.loads((ROOT / "data" / "scenes" / f"{name}.toml").read_text(encoding="utf-8"))


def stiffness(table: dict[str, Any], *, fast: bool | None = None) -> mp.matrix:
    """Second derivatives of the springs' energy; of the fast or the slow ones alone where asked."""
    n = len(table["particle"])
    out = mp.zeros(n)
    for spring in table["spring"]:
        if fast is not None and spring.get("fast", False) != fast:
            continue
        ends = [end for end in spring["ends"] if end != "wall"]
        for a in ends:
            for b in ends:
                out[a, b] += mp.mpf(spring["stiffness"]) * (1 if a == b else -1)
    return out


def start(table: dict[str, Any]) -> mp.matrix:
    """(q1 .. qn, p1 .. pn) of the start."""
    of = table["particle"]
    return mp.matrix([mp.mpf(x["position"]) for x in of] + [mp.mpf(x["momentum"]) for x in of])


def generator(table: dict[str, Any]) -> mp.matrix:
    """A of z' = A z."""
    n = len(table["particle"])
    k = stiffness(table)
    out = mp.zeros(2 * n)
    for i, particle in enumerate(table["particle"]):
        out[i, n + i] = 1 / mp.mpf(particle["mass"])
        for j in range(n):
            out[n + i, j] = -k[i, j]
    for damping in table.get("damping", ()):
        i = damping["particle"]
        out[n + i, n + i] -= mp.mpf(damping["coefficient"]) / mp.mpf(table["particle"][i]["mass"])
    return out


def text(x: Any) -> str:
    """A number with the digits that are kept."""
    return str(mp.nstr(x, DIGITS, strip_zeros=False))


def motion(table: dict[str, Any], steps: list[int], **given: str) -> list[dict[str, Any]]:
    """States after numbers of steps."""
    a, z, h = generator(table), start(table), mp.mpf(table["time"]["step"])
    n = len(table["particle"])
    rows = []
    for j in steps:
        moved = mp.expm(a * (h * j)) * z
        rows.append(
            {
                **given,
                "steps": j,
                "q": [text(x) for x in moved[:n]],
                "p": [text(x) for x in moved[n:]],
            }
        )
    return rows


def plain(name: str, steps: list[int]) -> dict[str, Any]:
    """Reference of a scene as it is shipped."""
    return {"scene": name, "motion": motion(scene(name), steps)}


def two_scales() -> dict[str, Any]:
    """The soft and the stiff spring with stiffness ratios 1 to 1e12, and the two frequencies."""
    table = scene("two-scales")
    soft = table["spring"][0]["stiffness"]
    rows, frequencies = [], []
    for power in range(0, 13, 2):
        ratio = 10.0**power
        table["spring"][1]["stiffness"] = soft * ratio
        rows += motion(table, [1, 137, 20000], ratio=f"{ratio:g}")
        k = stiffness(table)
        m = [mp.mpf(x["mass"]) for x in table["particle"]]
        trace = k[0, 0] / m[0] + k[1, 1] / m[1]
        product = (k[0, 0] * k[1, 1] - k[0, 1] ** 2) / (m[0] * m[1])
        root = mp.sqrt(trace**2 - 4 * product)
        squares = (2 * product / (trace + root), (trace + root) / 2)
        frequencies.append({"ratio": f"{ratio:g}", "w2": [text(x) for x in squares]})
    return {"scene": "two-scales", "motion": rows, "frequencies": frequencies}


def overdamped() -> dict[str, Any]:
    """Damping from critical to 1e6 times critical, and a little to both sides of critical."""
    table = scene("overdamped")
    m, k = (mp.mpf(x) for x in (table["particle"][0]["mass"], table["spring"][0]["stiffness"]))
    rows = []
    for ratio in (0.3, 1 - 1e-9, 1.0, 1 + 1e-9, 1.01, 10.0, 1e3, 1e6):
        # the double nearest to c = 2 ratio sqrt(k m) is what the scene would hold
        c = float(2 * mp.mpf(ratio) * mp.sqrt(k * m))
        table["damping"][0]["coefficient"] = c
        rows += motion(table, [1, 10, 300, 2000, 200000], ratio=repr(ratio), coefficient=repr(c))
    return {"scene": "overdamped", "motion": rows}


def detest_b1() -> dict[str, Any]:
    """B1 from its own four equations in y, not from the scene's q and p; y is then renamed."""
    a = mp.matrix([[-1, 1, 0, 0], [-100, -1, 0, 0], [0, 0, -100, 1], [0, 0, -10000, -100]])
    z = mp.matrix([1, 0, 1, 0])
    h = mp.mpf(scene("detest-b1")["time"]["step"])
    rows = []
    for j in (10, 100, 1000, 4000):
        y = mp.expm(a * (h * j)) * z
        rows.append(
            {"steps": j, "q": [text(y[0]), text(y[2])], "p": [text(y[1] - y[0]), text(y[3] - 100 * y[2])]}
        )
    return {"scene": "detest-b1", "motion": rows}


def multiple_time_steps() -> dict[str, Any]:
    """The one-step map of r-RESPA with 8 inner steps, as the product of its parts, and where it grows."""
    table = scene("multiple-time-steps")
    masses = [mp.mpf(x["mass"]) for x in table["particle"]]
    slow, fast = stiffness(table, fast=False), stiffness(table, fast=True)
    w_fast = mp.sqrt(sum(fast[i, i] / masses[i] for i in range(2)))

    def whole(h: Any) -> mp.matrix:
        inner = kick(fast, h / 16) * drift(masses, h / 8) * kick(fast, h / 16)
        return kick(slow, h / 2) * inner**8 * kick(slow, h / 2)

    def radius(turn: Any) -> Any:
        values = mp.eig(whole(mp.mpf(turn) / w_fast), left=False, right=False)
        return max(abs(x) for x in values)

    rows = []
    for turn in ("2.0", "2.6", "3.0", "3.11", "3.118", "3.15", "4.5", "5.5", "5.6", "6.5"):
        h = float(mp.mpf(turn) / w_fast)
        found = whole(mp.mpf(h))
        values = mp.eig(found, left=False, right=False)
        rows.append(
            {
                "step": repr(h),
                "h_w_fast": turn,
                "matrix": [[text(found[i, j]) for j in range(4)] for i in range(4)],
                "radius": text(max(abs(x) for x in values)),
            }
        )
    # each bracket holds one edge of a band; growth beyond an edge begins as a square root
    bands = [
        [text(_edge(radius, mp.mpf(a), mp.mpf(b))) for a, b in edges]
        for edges in ((("3.0", "3.11"), ("3.15", "3.118")), (("5.3", "5.5"), ("6.0", "5.6")))
    ]
    return {"scene": "multiple-time-steps", "w_fast": text(w_fast), "maps": rows, "bands": bands}


def _edge(radius: Callable[[Any], Any], stable: Any, unstable: Any) -> Any:
    """Between a bounded and a growing h w, to 1e-20."""
    while abs(unstable - stable) > mp.mpf("1e-20"):
        middle = (stable + unstable) / 2
        if radius(middle) > 1 + mp.mpf("1e-30"):
            unstable = middle
        else:
            stable = middle
    return (stable + unstable) / 2


def kick(k: mp.matrix, x: Any) -> mp.matrix:
    """p -= x K q."""
    out = mp.eye(4)
    for i in range(2):
        for j in range(2):
            out[2 + i, j] = -x * k[i, j]
    return out


def drift(m: list[Any], x: Any) -> mp.matrix:
    """q += x p/m."""
    out = mp.eye(4)
    for i in range(2):
        out[i, 2 + i] = x / m[i]
    return out


def references() -> dict[str, dict[str, Any]]:
    """All of them, by file name."""
    return {
        "stiff-spring": plain("stiff-spring", [1, 50, 200]),
        "two-scales": two_scales(),
        "overdamped": overdamped(),
        "detest-b1": detest_b1(),
        "multiple-time-steps": multiple_time_steps(),
    }


def main() -> int:
    """Write or compare; exit status 1 where something differs."""
    write = arguments(__doc__, write=False).write
    origin = f"validation/stiff_references.py, mpmath with {mp.mp.dps} digits, {DIGITS} of them kept"
    differ = 0
    for name, found in references().items():
        path = FOLDER / f"{name}.json"
        whole = json.dumps({"origin": origin, **found}, indent=1) + "\n"
        if write:
            FOLDER.mkdir(parents=True, exist_ok=True)
            path.write_text(whole, encoding="utf-8")
            print(f"{path.relative_to(ROOT)}: written")
        else:
            same = path.is_file() and path.read_text(encoding="utf-8") == whole
            differ += not same
            print(f"{path.relative_to(ROOT)}: {'agrees' if same else 'DIFFERS'}")
    return 1 if differ else 0


if __name__ == "__main__":
    script(main)
