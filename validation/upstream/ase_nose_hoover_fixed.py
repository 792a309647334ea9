"""ASE's Nose-Hoover chain heats momenta of fixed atoms, unseen, and freezes the rest.  pip install ase"""

import numpy as np
from ase import units
from ase.build import fcc111
from ase.calculators.emt import EMT
from ase.constraints import FixAtoms
from ase.md.nose_hoover_chain import NoseHooverChainNVT, NoseHooverChainThermostat

T, H, STEPS = 300.0, 2 * units.fs, 2000
slab = fcc111("Cu", (2, 2, 4), vacuum=8, periodic=True)  # its two lower layers are held
free = slab.positions[:, 2] > slab.positions[:, 2].mean()
slab.set_constraint(FixAtoms(mask=~free))
slab.calc, m = EMT(), slab.get_masses()[:, None]
slab.set_momenta(np.random.default_rng(1).standard_normal((len(m), 3)) * np.sqrt(2 * m * units.kB * T))
x, p, seen = slab.get_positions(), slab.get_momenta(), np.empty((2, STEPS))
run = NoseHooverChainNVT(slab, H, temperature_K=T, tdamp=100 * H)
for n in range(STEPS):
    run.step()
    seen[0, n] = slab.get_temperature()
slab.set_positions(x)
heat = NoseHooverChainThermostat(len(m), m, T, 100 * H)
for n in range(STEPS):  # velocity Verlet within the chain, the fixed atoms' momenta growing with the others
    p = heat.integrate_nhc(p, H / 2) + H / 2 * slab.get_forces(apply_constraint=False)
    x[free] += H * p[free] / m[free]
    slab.set_positions(x)
    p = heat.integrate_nhc(p + H / 2 * slab.get_forces(apply_constraint=False), H / 2)
    seen[1, n] = np.sum(p[free] ** 2 / m[free]) / (3 * free.sum() * units.kB)
measured, law = seen[:, STEPS // 2 :].mean(1) / T
print(f"measured {measured:.8f} law {law:.8f} uncertainty 1e-8 promised 1")
