"""Pictures side by side with captions, and what all pictures are made with."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import lightpath
    import numpy.typing as npt
    from matplotlib.figure import Figure

GAP_PX = 12
CAPTION_PX = 15
COLOURS = 160


@dataclass(frozen=True, eq=False)
class Studio:
    """What pictures are made with."""

    lab: lightpath.Lab
    targets: Any
    """The module docs/learn/targets.py."""
    folder: Path
    """A temporary folder."""
    output: Path

    def display(self, name: str, **properties: Any) -> lightpath.Display:
        """Return a display of the pages' usual size, or with other properties."""
        usual: dict[str, Any] = {"resolution": "256x160", "pixel_pitch": "8um", "wavelength": "515nm", "simulated": 1}
        return self.lab.create_display(name, **{**usual, **properties})

    def training(self) -> list[npt.NDArray[np.uint8]]:
        """Return the pictures that the pages learn from."""
        return [np.asarray(self.targets.shapes(seed, 256, 160)) for seed in range(1, 13)]

    def scene(self, width: int = 256, height: int = 160) -> npt.NDArray[np.uint8]:
        """Return the colour scene, [y][x][3]."""
        return np.asarray(self.targets.scene(width, height)[0])

    def depth(self, width: int = 256, height: int = 160) -> npt.NDArray[np.uint8]:
        """Return the depth of the scene, [y][x]."""
        return np.asarray(self.targets.scene(width, height)[1])


def as_seen(linear: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Return linear light of full scale 255 in sRGB, in which screens show it."""
    light = np.asarray(linear, float) / 255
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)  # noqa: PLR2004
    return np.round(255 * encoded).clip(0, 255).astype(np.uint8)


def grey(colour: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return the mean of the colours, as the server takes it."""
    return colour if colour.ndim == 2 else np.round(colour.mean(axis=2)).astype(np.uint8)  # noqa: PLR2004


def strip(
    named: Mapping[str, npt.NDArray[np.uint8] | Image.Image],
    *,
    columns: int = 0,
    zoom: float = 1,
    colours: int = COLOURS,
) -> Image.Image:
    """Put pictures side by side, each above its caption. Without a limit on the colours the file is larger."""
    pictures = [each if isinstance(each, Image.Image) else Image.fromarray(each) for each in named.values()]
    if zoom != 1:
        sizes = [(round(each.width * zoom), round(each.height * zoom)) for each in pictures]
        kind = Image.Resampling.NEAREST if zoom > 1 else Image.Resampling.BOX
        pictures = [each.resize(to, kind) for each, to in zip(pictures, sizes, strict=True)]
    font = ImageFont.load_default(CAPTION_PX)
    columns = columns or len(pictures)
    width = max(each.width for each in pictures)
    lines = max(caption.count("\n") + 1 for caption in named)
    heights = [max(each.height for each in pictures[i : i + columns]) for i in range(0, len(pictures), columns)]
    below = lines * (CAPTION_PX + 4) + GAP_PX
    size = (columns * (width + GAP_PX) + GAP_PX, sum(heights) + len(heights) * below + GAP_PX)
    page = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(page)
    for i, (caption, picture) in enumerate(zip(named, pictures, strict=True)):
        row = i // columns
        left, top = GAP_PX + i % columns * (width + GAP_PX), GAP_PX + sum(heights[:row]) + row * below
        page.paste(picture.convert("RGB"), (left, top))
        # Bright light at the edge of a picture must not run into the white of the page. A gap has no caption.
        if caption:
            draw.rectangle((left - 1, top - 1, left + picture.width, top + picture.height), outline="#888")
        for line, text in enumerate(caption.split("\n")):
            if font.getlength(text) > width:
                message = f"the caption {text!r} is too long"
                raise ValueError(message)
            draw.text((left, top + picture.height + 3 + line * (CAPTION_PX + 4)), text, "#222", font)
    return page.quantize(colours, dither=Image.Dither.NONE) if colours else page


def drawn(figure: Figure, dots_per_inch: int = 100) -> Image.Image:
    """Return a figure as a picture."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=dots_per_inch, bbox_inches="tight")
    return Image.open(file).convert("RGB")
