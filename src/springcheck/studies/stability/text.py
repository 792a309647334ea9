"""The report of a study of stability as text."""

from __future__ import annotations

from argparse import Namespace

import numpy as np

from springcheck.studies.stability.result import Stability, fastest
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, plain, table


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
            places = [("none" if np.isinf(y) else f"{y:.9f}") for y in (x.limit, x.theory)]
            grown = [
                "-" if np.isnan(x.growth_above) else f"{y:.7f}" for y in (x.growth_above, x.growth_predicted)
            ]
            style = "" if x.agrees else "bold red"
            cells = (
                x.method,
                *places,
                f"{off:.0e}",
                *grown,
                _largest_step(x.theory if x.agrees else x.limit, fastest(study.scene)),
            )
            rows.append([plain(cell, style) for cell in cells])
        titles = ("method", "limit h w", "theory", "off", "growth above", "predicted", "largest h here")
        out += [table(titles, rows), plain()]
    if study.costs:
        costs = [
            (
                x.method, f"{x.ratio:.0e}", str(x.steps), str(x.rejected), str(x.force_calls),
                "-" if np.isnan(x.error) else f"{x.error:.1e}", x.outcome.partition(":")[0],
            )
            for x in study.costs
        ]  # fmt: skip
        titles = ("method", "ratio", "steps", "rejected", "force calls", "error", "outcome")
        out += [table(titles, costs, left=("method", "outcome")), plain()]
    out += [plain(line) for line in study.sentences]
    out += left_out(study.left_out)
    return out


def _of_scene(study: Stability) -> Lines:
    """The scene's fastest motion, its step, and the methods for which that is too long."""
    if not fastest(study.scene):
        return [
            plain("  nothing in this scene oscillates at its start: no step is too long for its stability")
        ]
    turn = abs(study.scene.step) * fastest(study.scene)
    beyond = [x.method for x in study.limits if x.limit < turn]
    said = f"its step h = {study.scene.step:g} makes h w = {turn:.4g}"
    out: Lines = [
        plain(
            f"  fastest angular frequency of this scene, at its start: w = {fastest(study.scene):.6g}; {said}"
        )
    ]
    if beyond:
        out.append(plain(f"  beyond the limit there: {', '.join(beyond)}", "bold yellow"))
    elif study.limits:
        out.append(plain("  within the limit of every method measured here"))
    return out


def _largest_step(limit: float, fastest: float) -> str:
    if limit == 0:
        return "none"
    return "any" if np.isinf(limit) or not fastest else f"{limit / fastest:.4g}"
