# %% [markdown]
# # A first hologram
#
# A hologram is the phase of each pixel of a display. This notebook makes one that shows a picture, and looks at it.
# It needs a running server: `lightpathd serve`.

# %%
import numpy as np

import lightpath
from lightpath import plot

lab = lightpath.connect()
display = lab.create_display("notebook", resolution="320x192", pixel_pitch="8um", wavelength="515nm", simulated=1)
display

# %% [markdown]
# Any picture can be the target: a file, a Pillow image, an array or a tensor. This one is an array of rings and bars.

# %%
y, x = np.mgrid[:192, :320]
rings = np.hypot(x - 110, y - 96) % 24 < 12
bars = (x // 6) % 2 == 0
target = np.where(x < 200, rings & (np.hypot(x - 110, y - 96) < 72), bars & (y > 40) & (y < 152) & (x < 290))

# %% [markdown]
# The server optimizes the phase. While it works, this cell shows the loss and the time left.

# %%
hologram = display.optimize(target, distance="50mm", iterations=60)
hologram

# %% [markdown]
# `phase` is in radians. `reconstruction` is what the display should show: the picture, and around the region of
# interest, in the dark here, the light that the picture does not need.

# %%
plot.hologram(hologram, pixel_pitch_m=display.pixel_pitch_m).savefig("figure-hologram.png")
figure = plot.pictures(
    {"target": np.uint8(255) * target, "what it shows": hologram.reconstruction}, pixel_pitch_m=display.pixel_pitch_m
)
figure.savefig("figure-reconstruction.png")
seen = hologram.quality.pixel
print(f"PSNR {seen.psnr_db:.1f} dB as displayed, efficiency {seen.diffraction_efficiency:.0%}; {hologram.expected}")

# %% [markdown]
# The file goes to the display as it is.

# %%
hologram.save("hologram.png")
lab.close()
