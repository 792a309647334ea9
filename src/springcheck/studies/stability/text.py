"""The report of a study of stability as text."""

from __future__ import annotations

from argparse import Namespace

import numpy as np

from springcheck.physics.exact import has_true_motion
from springcheck.physics.exact.mathieu import floquet
from springcheck.studies.choose import LeftOut
from springcheck.studies.stability.longest import fastest, is_modulated
from springcheck.studies.stability.result import Stability
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, plain, table
from springcheck.text.wording import number


def lines(study: Stability, options: Namespace | None = None) -> Lines:
    """The whole report."""
    out: Lines = [
        plain(f"{study.scene.title}: limits of stability, measured on one step", "bold"),
        *_of_scene(study),
        *resumed(study.resumed, "measurement"),
        plain(),
    ]
    if study.limits:
        rows = []
        for x in study.limits:
            off = 0.0 if x.limit == x.theory else abs(x.limit - x.theory)
            predicted = np.nan if np.isnan(x.growth_above) else x.growth_predicted
            largest = study.largest(x)
            cells = (
                x.method, *(number(y, ".9f", "none") for y in (x.limit, x.theory)), f"{off:.0e}",
                *(number(y, ".7f") for y in (x.growth_above, predicted)),
                "none" if largest == 0 else number(largest, ".4g", "any"),
            )  # fmt: skip
            rows.append([plain(cell, "" if x.agrees else "bold red") for cell in cells])
        titles = ("method", "limit h w", "theory", "off", "growth above", "predicted", "largest h here")
        out += [table(titles, rows), plain()]
    if study.multipliers and (exact := floquet(study.scene.system)):
        count = study.multipliers[0].steps
        step = exact[1] / count
        out.append(plain(f"Floquet multipliers of a period of the modulation, by {count} x {step:.6g}"))
        found = [("exact motion", f"{exact[0]:.9f}", f"{exact[2]:.9f}", "")]
        found += [(x.method, f"{x.grown:.9f}", f"{x.turned:.9f}", f"{x.off:.0e}") for x in study.multipliers]
        out += [table(("method", "grows by", "turns by", "off its scheme's"), found), plain()]
    out += [plain(line) for line in study.sentences]
    refused = [LeftOut(method=x.method, reason=why) for x in study.limits if (why := study.refusal(x))]
    out += left_out(refused, "No largest step here by")
    out += left_out(study.left_out)
    return out


def _of_scene(study: Stability) -> Lines:
    """The scene's fastest motion, its step, and the methods for which it is too long."""
    scene, w, field = study.scene, fastest(study.scene), "magnetic" in study.scene.system.acting
    if not w and not scene.system.is_damped:
        said = " at its start, which says nothing of where it goes"
        if field:
            said = " but by its magnetic field, with which no largest step is worked out"
        elif scene.system.is_linear:
            said = ": no step is too long for its stability"
        return [plain(f"  nothing in this scene oscillates{said}")]
    most = ", its modulated springs at their stiffest" * is_modulated(scene)
    there = ", where its motion is stiffest" if has_true_motion(scene) else f", at its start{most}"
    straight = scene.system.without("drive").without("magnetic").is_linear
    where = "" if straight else there
    left = {"friction": scene.system.is_damped, "field": field}
    where += "".join(f", without its {name}" for name, acts in left.items() if acts)
    here = f"its step h = {scene.step:g} makes h w = {abs(scene.step) * w:.4g}"
    out: Lines = [plain(f"  fastest angular frequency of this scene{where}: w = {w:.6g}; {here}")]
    beyond = [x.method for x in study.limits if study.largest(x) < abs(scene.step)]
    if beyond:
        out.append(plain(f"  beyond the limit there: {', '.join(beyond)}", "bold yellow"))
    elif any(study.largest(x) >= abs(scene.step) for x in study.limits):
        out.append(plain("  within the limit of every method measured here"))
    if modulated := floquet(scene.system):
        grown, period, _ = modulated
        changes = "grows" if grown > 1 else "decays"
        bounded = "stays bounded" if grown == 1 else f"{changes} by a factor of {grown:.6g}"
        said = f"the exact motion {bounded} (Floquet)"
        out.append(plain(f"  in each period of its modulation, {period:.4g}, {said}"))
    if is_modulated(scene):
        said = "no largest step is known: one may resonate with the modulation below its limit on a spring"
        out.append(plain(f"  {said}", "dim"))
    elif field:
        out.append(plain("  no largest step is worked out with a magnetic field", "dim"))
    elif not straight:
        said = "limits of small oscillations there; an anharmonic motion may be lost below them"
        out.append(plain(f"  {said}", "dim"))
    return out
