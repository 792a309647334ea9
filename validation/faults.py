"""How small a mistake is seen, and that nothing else is: the detection limits of springcheck.

Claim: every one of the engines broken on purpose is rejected, by the checks named for it; relative errors
of 1e-12 in stiffness, mass or step are seen with three decades to spare; and over more than 800 runs by
right engines, on random scenes whose masses, stiffnesses and amplitudes are spread over twelve decades and
h w over 0.001 to 1.99, no check raises a false alarm.

Command: python validation/faults.py            (two cores, about a minute)

Expected (smallest relative size that any check sees on one spring, h w = 0.09, 200 steps):
    stiffness, mass, step          1.0e-15, 1.3e-15, 1.0e-15   by the step defect
    friction                       6e-17                       by the rounding law: half a rounding a step
    arithmetic that cuts off       seen by the rounding law alone
    faults rejected                all
    false alarms                   0
"""

import clean
from arguments import arguments, script
from springcheck.studies.faults.measure import record
from springcheck.studies.faults.result import FaultReport
from springcheck.studies.team import Processes

SHARPEST = 5
"""Checks of each fault whose limits are printed, the smallest first."""


def table(found: FaultReport) -> list[str]:
    """The README's table, as Markdown."""
    lines = ["| fault | size | seen from | rejected by |", "|---|---|---|---|"]
    for result in found.results:
        best = sorted(result.limits.items(), key=lambda item: item[1])[:SHARPEST]
        size = "" if result.size is None else f"{result.size:.0e}"
        limits = ", ".join(f"{limit:.1e} {name}" for name, limit in best)
        lines.append(f"| {result.about} | {size} | {limits} | {', '.join(result.rejected_by)} |")
    return lines


def main() -> int:
    """Print the table; the exit status says whether the claim holds."""
    arguments(__doc__)
    team = Processes(2)
    found = record(team=team)
    right = clean.together([one for _, one in team.carried_out(clean.parts())])
    for line in table(found):
        print(line)
    print(f"\n{len(found.results)} faults, {sum(bool(r.rejected_by) for r in found.results)} rejected")
    print(f"{right.runs} clean runs, {right.verdicts} verdicts, {len(right.alarms)} false alarms")
    for alarm in right.alarms:
        print(f"false alarm: {alarm}")
    small = {"stiffness", "mass", "step"}
    limits = [result.limits["step-defect"] for result in found.results if result.name in small]
    seen = found.status == 0 and max(limits) < 1e-12
    return 0 if seen and right.runs >= 800 and not right.alarms else 1


if __name__ == "__main__":
    script(main)
