# %% [markdown]
# # Compare propagators
#
# The server plans how light gets from the display to the image, and refuses methods that give no correct image. This
# notebook asks for the plan at several distances, and optimizes the same picture with each possible method. It needs a
# running server: `lightpathd serve`.

# %%
import matplotlib.pyplot as plt
import numpy as np

import lightpath

lab = lightpath.connect()
display = lab.create_display("notebook-plan", resolution="192x128", pixel_pitch="8um", wavelength="515nm")

# %%
for distance in ("10mm", "50mm", "500mm"):
    plan = display.plan(distance)
    print(f"{distance}: {plan.method}, {plan.band_kept_area:.0%} of the band reaches the image")
    print(f"  {plan.explanation}")

# %% [markdown]
# `alternatives` has all methods, with the reason why some are not possible here.

# %%
DISTANCE = "40mm"
methods = []
for alternative in display.plan(DISTANCE).alternatives:
    if alternative.possible and alternative.optimizable:
        methods.append(alternative.method)
    else:
        print(f"not {alternative.method}: {alternative.text}")

# %% [markdown]
# Every result has a second opinion: an independent, exact model judges the hologram. A method that is only approximate
# overestimates itself; the two bars show by how much.

# %%
random = np.random.default_rng(2)
target = np.kron(random.random((16, 24)), np.ones((8, 8)))
own_db, independent_db = [], []
for method in methods:
    hologram = display.optimize(target, distance=DISTANCE, propagation=method, iterations=40)
    # Both models judge the same rows of the picture.
    opinion = hologram.second_opinion
    own_db.append(opinion.engine_psnr_db)
    independent_db.append(opinion.independent_psnr_db)
    print(f"{method}: {own_db[-1]:.1f} dB by its own model, {independent_db[-1]:.1f} dB by the independent one")

# %%
figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
places = np.arange(len(methods))
axes.barh(places - 0.2, own_db, 0.4, label="its own model")
axes.barh(places + 0.2, independent_db, 0.4, label="independent model")
axes.set_yticks(places, labels=methods)
axes.invert_yaxis()
axes.set_xlabel(f"PSNR at {DISTANCE} [dB]")
axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
figure.savefig("figure-methods.png")
lab.close()
