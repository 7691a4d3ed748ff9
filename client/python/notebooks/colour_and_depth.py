# %% [markdown]
# # Colour and depth
#
# One job makes a hologram for each of three wavelengths. Each shows its own colour of the picture, and a depth map says
# which part of the picture is at which distance. It needs a running server: `lightpathd serve`.

# %%
import numpy as np

import lightpath
from lightpath import plot

WAVELENGTHS = ["638nm", "520nm", "450nm"]
DISTANCES = ["30mm", "32mm", "34mm"]
lab = lightpath.connect()
display = lab.create_display("notebook-rgb", resolution="192x128", pixel_pitch="8um", wavelength=WAVELENGTHS)

# %% [markdown]
# Three discs in red, green and blue. White in the depth map is at the first distance, black at the last one.

# %%
y, x = np.mgrid[:128, :192]
picture = np.zeros((128, 192, 3), np.uint8)
depth = np.zeros((128, 192), np.uint8)
for i, (left, grey) in enumerate([(50, 255), (96, 128), (142, 0)]):
    disc = np.hypot(x - left, y - 64) < 26
    picture[disc, i] = 255
    depth[disc] = grey

# %%
hologram = display.optimize(picture, distance=DISTANCES, wavelength=WAVELENGTHS, depth_map=depth, iterations=40)
hologram

# %% [markdown]
# `reconstructions` is [wavelength][distance][y][x]. At each distance the disc of that distance is sharp.

# %%
print(hologram.phases.shape, hologram.reconstructions.shape)
shown = {f"at {distance}": np.moveaxis(hologram.reconstructions[:, i], 0, 2) for i, distance in enumerate(DISTANCES)}
plot.pictures({"picture": picture, **shown}, pixel_pitch_m=display.pixel_pitch_m).savefig("figure-colours.png")

# %% [markdown]
# The display needs one file for each wavelength.

# %%
print(hologram.save_all("holograms"))
lab.close()
