"""
Pressure and shape at a state
=============================

The same penetration on loading and on unloading: the deformed surface and the stress under it. On
unloading the patches are held together by adhesion.
"""

import matplotlib.pyplot as plt

from adhesis import HalfSpace, Problem, make_method, run_loop, self_affine_profile

profile = self_affine_profile(0.8, period=2e-3, n0=4, ratio=25, seed=3, h_rms=1e-6)
problem = Problem(profile, HalfSpace(young=1e6, poisson=0.5), work_of_adhesion=0.04)
method = make_method("sharp", problem)

# %%
# Every state of the path is handed to ``on_state``; one of each branch is kept.
kept = {}


def keep(branch, state):
    """Keep the first state on loading, the last on unloading, beyond 0.4 h_max."""
    deep = problem.penetration(state.separation) >= 0.4
    if deep and (branch == "unloading" or branch not in kept):
        kept[branch] = state


run_loop(method, max_penetration=0.7, load_steps=28, on_state=keep)
for branch, state in kept.items():
    print(f"{branch}: {state.patches} patches, A/A0 = {state.contact_fraction:.3f}")

# %%
# Fields on 8192 nodes; lengths in µm, stress in kPa (compression positive; it has a square-root
# singularity at every edge, so the axis is cut).
figure, panels = plt.subplots(2, 2, figsize=(9, 5), sharex=True, sharey="row", layout="constrained")
for (upper, lower), (branch, state) in zip(panels.T, kept.items(), strict=True):
    fields = method.fields(state, 8192)
    x = 1e3 * fields.x
    upper.plot(x, 1e6 * fields.height, "0.5", lw=0.8, label="rigid profile")
    shape = 1e6 * (fields.displacement + state.separation)
    upper.plot(x, shape, "C0", lw=1, label="deformed surface")
    penetration = problem.penetration(state.separation)
    upper.set(title=f"{branch}, $\\Delta/h_{{max}}$ = {penetration:.2f}")
    lower.plot(x, fields.stress / 1e3, "C3", lw=0.7)
    lower.set(xlabel="x (mm)", ylim=(-300, 120))
panels[0, 0].set(ylabel="height (µm)")
panels[0, 0].legend(frameon=False, fontsize=8)
panels[1, 0].set(ylabel="stress (kPa)")
plt.show()
