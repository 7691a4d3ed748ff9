# %% [markdown]
# # Learn a display
#
# A real display has aberrations, an uneven beam and undiffracted light. Lightpath learns them from photographs. Here
# the display and its camera are simulated; with your own, replace `display.photograph` by your camera.
# It needs a running server: `lightpathd serve`.

# %%
import numpy as np
import numpy.typing as npt

import lightpath
from lightpath import plot

DISTANCE = "30mm"
lab = lightpath.connect()
display = lab.create_display("notebook-learn", resolution="160x96", pixel_pitch="8um", wavelength="515nm", simulated=3)

# %% [markdown]
# Targets with edges and greys everywhere teach most.


# %%
def blocks(seed: int) -> npt.NDArray[np.uint8]:
    """Return a picture of random blocks, [y][x]."""
    random = np.random.default_rng(seed)
    picture = np.full((96, 160), 40, np.uint8)
    for _ in range(60):
        top, left, height, width = random.integers((0, 0, 6, 6), (88, 152, 32, 40))
        picture[top : top + height, left : left + width] = random.integers(0, 256)
    return picture


holograms = display.optimize_all([blocks(seed) for seed in range(8)], distance=DISTANCE, iterations=40)

# %% [markdown]
# A dataset is a set of pairs: a hologram, and its photograph.

# %%
dataset = display.create_dataset("notebook-pairs", distance=DISTANCE)
dataset.add_all((hologram, display.photograph(hologram)) for hologram in holograms)
dataset.finalize()
dataset

# %% [markdown]
# Learning gives a version of the kernel. The losses are those of photographs that it has not seen.

# %%
version = dataset.learn(epochs=3, refinement_evaluations=8, degree=5)
version

# %%
plot.loss(version.learning().loss_history).figure.savefig("figure-loss.png")
learned = version.fetch()
plot.transfer_function(learned).savefig("figure-transfer-function.png")
plot.source(learned).savefig("figure-source.png")

# %% [markdown]
# Nothing uses a version before it is promoted. Then holograms are optimized through it.

# %%
version.promote(reason="the first one")
wanted = blocks(100)
scores = {}
for kernel in ("ideal", "active"):
    hologram = display.optimize(wanted, distance=DISTANCE, kernel=kernel, iterations=80)
    scores[kernel] = lab.score(display.photograph(hologram), wanted)
    print(kernel, scores[kernel])

# %% [markdown]
# `aligned` is the photograph as the target's pixels see it, in the target's own encoding.

# %%
figure = plot.pictures(
    {
        "target": wanted,
        "photograph, ideal optics": scores["ideal"].aligned,
        "photograph, learned display": scores["active"].aligned,
    },
    pixel_pitch_m=display.pixel_pitch_m,
)
figure.savefig("figure-photographs.png")
scores["active"]

# %%
lab.close()
