"""
A campaign in xarray
====================

A small campaign is run and its results file opened: every dataset has labelled dimensions and
units.
"""

import tempfile

import matplotlib.pyplot as plt

import adhesis

# %%
# Two Hurst exponents, two works of adhesion, four realisations: sixteen loops, computed here by one
# process. ``campaign.run(out, ranks=9)`` shares them out, as ``mpirun -n 9 adhesis run`` does.
campaign = adhesis.Campaign(
    {
        "profile": {"period": 2e-3, "n0": 4, "ratio": 8, "h_rms": 1e-6},
        "material": {"young": 1e6, "poisson": 0.5},
        "sweep": {
            "hurst": [0.7, 0.9],
            "work_of_adhesion": [0.01, 0.04],
            "realisations": 4,
            "seed": 1,
        },
        "cycle": {"max_penetration": 0.8, "load_steps": 16},
    }
)
print(campaign)

# %%
# Each quantity has an axis for the Hurst exponent, the work of adhesion and the realisation.
# Selections are xarray's.
with tempfile.TemporaryDirectory() as folder, campaign.run(f"{folder}/small.h5") as results:
    loops = results.dataset.load()
print(loops.loss.mean("realisation").to_dataframe())

# %%
# The branches of every task lie on one axis each, so their mean is a line.
figure, panels = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True, layout="constrained")
for axes, gamma in zip(panels, (0.01, 0.04), strict=True):
    chosen = loops.sel(hurst=0.9, work_of_adhesion=gamma)
    for branch, colour in (("loading", "C0"), ("unloading", "C3")):
        stress = chosen[f"{branch}_mean_stress"] / 1e3
        x = chosen[f"{branch}_penetration"]
        axes.plot(x, stress.T, colour, lw=0.5, alpha=0.5)
        axes.plot(x, stress.mean("realisation"), colour, lw=2, label=branch)
    axes.set(title=f"H = 0.9, $\\gamma$ = {gamma} J/m²", xlim=(-2.5, 0.85))
    axes.set(xlabel="penetration $\\Delta/h_{max}$")
panels[0].set(ylabel="mean stress (kPa)")
panels[0].legend(frameon=False)
plt.show()
