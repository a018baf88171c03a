"""
A jump, looked at closely
=========================

The largest energy drop while other patches hold: the two states at its separation.
"""

import matplotlib.pyplot as plt
import numpy as np

from adhesis import HalfSpace, Problem, make_method, run_loop, self_affine_profile

profile = self_affine_profile(0.8, period=2e-3, n0=4, ratio=25, seed=2, h_rms=1e-6)
problem = Problem(profile, HalfSpace(young=1e6, poisson=0.5), work_of_adhesion=0.02)
method = make_method("sharp", problem)

# %%
# A path holds the states just before and just after a jump, both at its separation.
states = []
loop = run_loop(
    method,
    max_penetration=0.8,
    load_steps=32,
    on_state=lambda branch, state: states.append((branch, state)),
)
jumps = [jump for jump in loop.jumps if jump.patches_after > 0]
jump = max(jumps, key=lambda jump: jump.energy_drop)
here = jump.branch, jump.separation
before, after = (state for branch, state in states if (branch, state.separation) == here)
penetration = problem.penetration(jump.separation)
print(f"{jump.kind} on {jump.branch} at Δ/h_max = {penetration:.3f}")
print(f"contact {before.contact_fraction:.3f} to {after.contact_fraction:.3f}")
print(f"{1e3 * jump.energy_drop:.3f} mJ/m² lost")

# %%
# The energy drop is the difference of the two energies, per nominal area.
drop = (before.energy - after.energy) / profile.period
print(f"{1e3 * drop:.3f} mJ/m² from the states")

figure, (curve, shape) = plt.subplots(2, 1, figsize=(8, 6), layout="constrained")
rows = loop.states(jump.branch)
curve.plot(loop.penetration[rows], loop.mean_stress[rows] / 1e3, ".-", color="0.5", ms=3)
ends = [before.mean_stress / 1e3, after.mean_stress / 1e3]
curve.plot([penetration, penetration], ends, "o-", color="C3")
curve.set(xlabel="penetration $\\Delta/h_{max}$", ylabel="mean stress (kPa)")

x = np.linspace(0, profile.period, 4000)
shape.plot(1e3 * x, 1e6 * profile.at(x), "0.6", lw=0.8, label="rigid profile")
for state, colour, label in ((before, "C0", "before"), (after, "C3", "after")):
    fields = method.fields(state, 8192)
    surface = 1e6 * (fields.displacement + state.separation)
    shape.plot(1e3 * fields.x, surface, colour, lw=1, label=label)
shape.set(xlabel="x (mm)", ylabel="height (µm)")
shape.legend(frameon=False, ncols=3)
plt.show()
