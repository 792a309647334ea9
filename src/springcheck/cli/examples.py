"""Examples of every command, as its help shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

EXAMPLES: Mapping[str, Sequence[str]] = {
    "run": (
        "spring",
        "spring-uneven --method 'own:*' --step 0.05 --thorough",
        "spring --temperature 300K --seed 1",
        "spring --stepper mine.py:step",
        "spring --vary time.step=0.01:1:40:log",
    ),
    "ensemble": ("spring --vary time.step=0.01:1:40:log --method own:rk4",),
    "faults": ("", "-o faults.h5"),
    "precision": ("spring --budget 20 --method own:rk4",),
    "stability": ("spring", "multiple-time-steps --method 'openmm:*'"),
    "extremes": ("--quick",),
    "census": ("--method 'own:*' --page engines.html",),
    "sampling": ("--method 'own:*' --method 'openmm:*'",),
    "inspect": ("spring.h5 --verdicts", "spring.h5 --trajectory own:euler --rows 5"),
    "plot": ("spring.h5 -o figures", "orbit.csv"),
    "report": ("spring.h5 -o spring.html",),
    "show": ("spring -o my.toml",),
    "explain": ("velocity-verlet", "step-defect", "openmm:verlet"),
    "identify": ("orbit.csv --mass 3.7", "--stepper mine.py:step"),
    "judge": ("orbit.csv --scene spring --scheme velocity-verlet",),
    "check": ("spring.h5",),
    "export": ("spring.h5 own:euler out.h5md",),
    "list": ("",),
    "doctor": ("",),
    "completion": ("bash",),
}
"""By command, without its name."""
