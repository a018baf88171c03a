"""
One loop
========

A rough profile is pressed into a half-space and pulled off again: mean stress and contact fraction
against penetration, and how much energy is lost in which kind of jump.
"""

import matplotlib.pyplot as plt

from adhesis import HalfSpace, Problem, make_method, run_loop, self_affine_profile

# %%
# Profile, material and work of adhesion are the problem. The loop runs from first touch to 0.9 of
# the highest crest's height, and back until the last contact is lost.
profile = self_affine_profile(0.8, period=2e-3, n0=4, ratio=25, seed=1, h_rms=1e-6)
problem = Problem(profile, HalfSpace(young=1e6, poisson=0.5), work_of_adhesion=0.04)
loop = run_loop(make_method("auto", problem), max_penetration=0.9, load_steps=40)
print(loop)

# %%
# The area of the loop and the sum of the energy drops are found independently of each other.
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for branch, colour in (("loading", "C0"), ("unloading", "C3")):
    rows = loop.states(branch)
    left.plot(loop.penetration[rows], loop.mean_stress[rows] / 1e3, colour, label=branch)
    right.plot(loop.penetration[rows], loop.contact_fraction[rows], colour, label=branch)
left.axhline(0, color="0.7", lw=0.6)
left.set(xlabel="penetration $\\Delta/h_{max}$", ylabel="mean stress (kPa)")
right.set(xlabel="penetration $\\Delta/h_{max}$", ylabel="contact fraction $A/A_0$")
left.legend(frameon=False)

# %%
# Jumps by kind. Spreading and receding are small-scale: an edge runs inside a patch.
kinds = sorted({jump.kind for jump in loop.jumps})
drops = [1e3 * sum(j.energy_drop for j in loop.jumps if j.kind == kind) for kind in kinds]
figure, axes = plt.subplots(figsize=(6, 2.6), layout="constrained")
axes.barh(kinds, drops, color="C7")
axes.set(xlabel="energy drops together (mJ/m²)")
plt.show()
