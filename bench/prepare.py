"""Reads a picture as a target: intensity in linear light, float32 .npy of the display's size.

    python prepare.py PICTURE TARGET.npy WIDTH HEIGHT srgb|linear

Colours are averaged after decoding; another size is fitted inside with black borders.
"""

import sys

import numpy as np
from PIL import Image


def main():
    source, out, width, height, encoding = sys.argv[1:]
    width, height = int(width), int(height)
    if source.endswith(".npy"):
        light = np.load(source).astype(np.float64)
    else:
        with Image.open(source) as picture:
            levels = np.asarray(picture.convert("I;16") if picture.mode.startswith("I") else picture.convert("RGB"))
        light = levels / float(np.iinfo(levels.dtype).max)
        if encoding == "srgb":
            light = np.where(light <= 0.04045, light / 12.92, ((light + 0.055) / 1.055) ** 2.4)
        if light.ndim == 3:
            light = light.mean(axis=2)
    if light.shape != (height, width):
        scale = min(height / light.shape[0], width / light.shape[1])
        size = (max(round(light.shape[1] * scale), 1), max(round(light.shape[0] * scale), 1))
        small = np.asarray(Image.fromarray(light.astype(np.float32)).resize(size, Image.Resampling.BOX))
        light = np.zeros((height, width))
        top, left = (height - size[1]) // 2, (width - size[0]) // 2
        light[top : top + size[1], left : left + size[0]] = small
    np.save(out, np.clip(light, 0, 1).astype(np.float32))


if __name__ == "__main__":
    main()
