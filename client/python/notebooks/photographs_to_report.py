# %% [markdown]
# # From photographs to a report
#
# In a lab, holograms and photographs are files. This notebook begins with two folders of them, as your own experiment
# would, and ends with a report. It needs a running server: `lightpathd serve`.

# %%
from pathlib import Path

import numpy as np

import lightpath
from lightpath import plot

DISTANCE = "30mm"
lab = lightpath.connect()
display = lab.create_display("notebook-files", resolution="160x96", pixel_pitch="8um", wavelength="515nm", simulated=5)

# %% [markdown]
# The files come from a simulated display here. Skip this cell if you have your own.

# %%
holograms, photos = Path("holograms"), Path("photos")
for folder in (holograms, photos):
    folder.mkdir(exist_ok=True)
for i in range(8):
    coarse = np.random.default_rng(i).random((12, 20))
    hologram = display.optimize(np.kron(coarse, np.ones((8, 8))), distance=DISTANCE, iterations=40)
    hologram.save(holograms / f"{i:02}.png")
    display.photograph(hologram, seed=i).save(photos / f"{i:02}.png")

# %% [markdown]
# Each photograph has the name of its hologram. The server checks every pair: its light, its contrast, and whether the
# photograph shows its hologram.

# %%
dataset = display.create_dataset("notebook-files", distance=DISTANCE)
for path in sorted(holograms.glob("*.png")):
    dataset.add(path, photos / path.name, pair_id=path.stem)
for pair in dataset.pairs():
    print(pair.id, f"correlation {pair.checks.correlation:.2f}, {pair.checks.saturated:.1%} saturated")
dataset.finalize()
dataset

# %%
version = dataset.learn(epochs=3, refinement_evaluations=8, degree=5)
kernel = version.promote()
for part in version.metrics.parts:
    print(part.title, f"explains {part.cost_db.value:.1f} dB")

# %% [markdown]
# How well the kernel predicts each photograph, beside ideal optics.

# %%
learned, ideal = dataset.evaluate("active"), dataset.evaluate("ideal")
axes = plot.loss(list(ideal.losses.values()), label="ideal optics")
plot.loss(list(learned.losses.values()), axes=axes, label="learned display")
axes.set_xlabel("pair")
axes.figure.savefig("figure-losses.png")
learned

# %% [markdown]
# The report is one HTML file, for colleagues without this notebook.

# %%
report = version.report()
report.save("report.html")
kernel.save("kernel.safetensors")
print([title for title, _ in report.figures])
lab.close()
