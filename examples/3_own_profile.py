"""
A profile of one's own
======================

Any equally spaced heights of one period make a profile. Here: rounded ridges of two heights. How
does the loss depend on the work of adhesion?
"""

import matplotlib.pyplot as plt
import numpy as np

from adhesis import HalfSpace, Problem, make_method, profile_from_heights, run_loop

# %%
# One period of heights in m; the highest points meet the solid first. The profile goes through the
# heights with as few waves as they can hold.
period = 1e-3
x = np.arange(64) / 64
heights = 1e-6 * np.cos(2 * np.pi * 4 * x) + 0.4e-6 * np.cos(2 * np.pi * x)
heights += 0.05e-6 * np.cos(2 * np.pi * 20 * x + 0.3)
profile = profile_from_heights(heights, period)
print(f"h_max = {1e6 * profile.h_max:.3f} µm, mean square slope {profile.m2:.3g}")

# %%
# One loop a work of adhesion. The loss splits into small-scale and large-scale jumps.
solid = HalfSpace(young=1e6, poisson=0.5)
gammas = np.linspace(0.002, 0.05, 9)
small, large = [], []
for gamma in gammas:
    method = make_method("auto", Problem(profile, solid, work_of_adhesion=gamma))
    jumps = run_loop(method, max_penetration=0.8, load_steps=20).jumps
    small.append(1e3 * sum(jump.energy_drop for jump in jumps if jump.small_scale))
    large.append(1e3 * sum(jump.energy_drop for jump in jumps if not jump.small_scale))

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
fine = np.linspace(0, period, 1000)
left.plot(1e3 * fine, 1e6 * profile.at(fine), "0.3")
left.plot(1e3 * period * x, 1e6 * (heights - heights.mean()), ".", color="C0", ms=4)
left.set(xlabel="x (mm)", ylabel="height (µm)")
labels = ["small-scale", "large-scale"]
right.stackplot(1e3 * gammas, small, large, labels=labels, alpha=0.8)
right.set(xlabel="work of adhesion (mJ/m²)", ylabel="loss (mJ/m²)")
right.legend(frameon=False, loc="upper left")
plt.show()
