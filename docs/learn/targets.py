"""Draw pictures for a first hologram: twelve pictures to learn a display from, a colour scene, and the scene's depth.

Usage: python3 docs/learn/targets.py FOLDER [WIDTHxHEIGHT]

The size is 256x160 pixels if none is given. The pictures to learn from have edges and greys everywhere, because these
teach most. It needs NumPy and Pillow, which the Python package of Lightpath brings along.
"""

import sys
from pathlib import Path

try:
    import numpy as np
    from PIL import Image, ImageDraw
except ModuleNotFoundError as error:
    sys.exit(
        f"{error}: NumPy and Pillow are needed. Enter the environment with Lightpath's Python package, such as\n"
        "  . ~/lightpath-python/bin/activate"
    )

# Pictures are drawn larger than they become, for smooth edges.
ZOOM = 4
COUNT = 12


def shapes(seed: int, width: int, height: int) -> Image.Image:
    """Draw random rectangles and ellipses in all greys."""
    random = np.random.default_rng(seed)
    picture = Image.new("L", (width, height), 60)
    draw = ImageDraw.Draw(picture)
    for shape in range(60):
        left, top = random.uniform(-0.05, 0.95, 2) * (width, height)
        right, bottom = random.uniform(0.03, 0.25, 2) * (width, height) + (left, top)
        draw_shape = draw.ellipse if shape % 3 == 0 else draw.rectangle
        draw_shape((left, top, right, bottom), fill=int(random.integers(0, 256)))
    return picture


def scene(width: int, height: int) -> tuple[Image.Image, Image.Image]:
    """Draw hills, a house and a tree below the sun, and the depth of each: white is near, black is far."""
    picture = Image.new("RGB", (ZOOM * width, ZOOM * height), (90, 150, 225))
    depth = Image.new("L", picture.size, 0)
    layers = [
        ("ellipse", (0.66, 0.12, 0.80, 0.344), (255, 226, 120), 0),
        ("polygon", (0, 0.62, 0.22, 0.34, 0.42, 0.60, 0.63, 0.30, 1, 0.62, 1, 1, 0, 1), (96, 110, 150), 64),
        ("polygon", (0, 0.70, 0.35, 0.58, 0.70, 0.68, 1, 0.56, 1, 1, 0, 1), (86, 150, 74), 128),
        ("rectangle", (0.18, 0.56, 0.38, 0.80), (214, 178, 140), 190),
        ("polygon", (0.15, 0.56, 0.28, 0.40, 0.41, 0.56), (190, 62, 48), 190),
        ("rectangle", (0.25, 0.66, 0.31, 0.80), (92, 58, 36), 190),
        ("rectangle", (0.70, 0.60, 0.73, 0.88), (110, 72, 44), 255),
        ("ellipse", (0.62, 0.34, 0.81, 0.66), (40, 104, 52), 255),
    ]
    # Clouds, a field with furrows, windows, and a fence: many edges, by which a photograph is found and judged.
    layers[1:1] = [("ellipse", (x, 0.1, x + 0.16, 0.2), (240, 244, 250), 0) for x in (0.12, 0.2, 0.42)]
    layers[6:6] = [("rectangle", (0, y, 1, y + 0.02), (60, 104, 50), 128) for y in (0.84, 0.89, 0.94)]
    layers += [("rectangle", (x, 0.6, x + 0.03, 0.65), (250, 240, 190), 190) for x in (0.2, 0.26, 0.33)]
    layers += [
        ("rectangle", (x, 0.72, x + 0.012, 0.84), (236, 232, 222), 255) for x in np.arange(0.45, 1, 0.035).tolist()
    ]
    for kind, corners, colour, near in layers:
        points = (np.reshape(corners, (-1, 2)) * picture.size).ravel().tolist()
        getattr(ImageDraw.Draw(picture), kind)(points, fill=colour)
        getattr(ImageDraw.Draw(depth), kind)(points, fill=near)
    return picture.resize((width, height), Image.Resampling.BOX), depth.resize(
        (width, height), Image.Resampling.NEAREST
    )


def main() -> None:
    """Write all pictures."""
    folder = Path(sys.argv[1])
    width, height = (int(side) for side in (sys.argv[2] if len(sys.argv) > 2 else "256x160").split("x"))  # noqa: PLR2004
    (folder / "train").mkdir(parents=True, exist_ok=True)
    for number in range(1, COUNT + 1):
        shapes(number, width, height).save(folder / "train" / f"{number:02}.png")
    picture, depth = scene(width, height)
    picture.save(folder / "scene.png")
    depth.save(folder / "depth.png")


if __name__ == "__main__":
    main()
