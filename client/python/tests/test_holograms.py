"""From a picture to a hologram, with every kind of picture."""

from __future__ import annotations

import inspect
import io
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import DISTANCE, target
from IPython.core.completer import provisionalcompleter
from IPython.core.interactiveshell import InteractiveShell
from PIL import Image

import lightpath
import lightpath.local
from lightpath import v1
from lightpath.pictures import picture_bytes

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt


def test_hologram_has_phases_levels_and_the_picture_that_it_shows(bench: lightpath.Display, tmp_path: Path) -> None:
    estimate = bench.estimate_optimize(target(1), distance=DISTANCE, iterations=40)
    assert (estimate.memory_bytes or 0) > 1e6
    assert (estimate.time_s or 0) > 0
    hologram = bench.optimize(target(1), distance=DISTANCE, iterations=40, area="display")
    assert hologram.phase.dtype == np.float32
    assert hologram.phase.shape == hologram.levels.shape == hologram.reconstruction.shape == (96, 160)
    # The display of 8 bits has a linear response and no carrier.
    expected = np.rint(hologram.phase / (2 * np.pi) * 256).astype(int) % 256
    assert np.array_equal(expected, hologram.levels)
    judgements = hologram.result.wavelengths[0].planes[0].judgements
    assert hologram.quality.pixel.psnr_db in [each.psnr_db.value for each in judgements]
    assert 25 < hologram.quality.pixel.psnr_db < hologram.optimized_quality.pixel.psnr_db
    assert str(hologram.expected) in repr(hologram)
    assert repr(hologram).count("ideal") == 1
    assert hologram.region == (16, 10, 128, 76)
    middle = (slice(10, 86), slice(16, 144))
    seen, wanted = (each[middle].ravel().astype(float) for each in (hologram.reconstruction, target(1)))
    assert np.corrcoef(seen, wanted)[0, 1] > 0.95
    hologram.save(tmp_path / "hologram.png")
    assert np.array_equal(np.asarray(Image.open(tmp_path / "hologram.png")), hologram.levels)
    hologram.save(tmp_path / "phase.npy")
    assert np.array_equal(np.load(tmp_path / "phase.npy"), hologram.phase)
    with pytest.raises(lightpath.InvalidArgument, match="png"):
        hologram.save(tmp_path / "hologram.bmp")


def difference(one: npt.NDArray[np.float32], other: npt.NDArray[np.float32]) -> float:
    """Largest difference of two phases [rad]. Pictures of 8 and of 16 bits become light in different steps."""
    return float(np.abs(np.exp(1j * one) - np.exp(1j * other)).max())


def test_a_picture_gives_the_same_hologram_as_file_image_and_array(bench: lightpath.Display, tmp_path: Path) -> None:
    Image.fromarray(target(2)).save(tmp_path / "target.png")
    kinds: list[lightpath.Picture] = [
        tmp_path / "target.png",
        str(tmp_path / "target.png"),
        Image.open(tmp_path / "target.png"),
        target(2),
        (target(2) / 255).astype(np.float32),
        np.repeat(target(2)[:, :, np.newaxis], 3, axis=2),
    ]
    phases = [bench.optimize(each, distance=DISTANCE, iterations=2).phase for each in kinds]
    for phase in phases[1:]:
        assert difference(phase, phases[0]) < 1e-4


def test_tensors_are_pictures(bench: lightpath.Display) -> None:
    torch = pytest.importorskip("torch")
    tensor = torch.from_numpy(target(2) / 255).float().requires_grad_()
    as_array = bench.optimize(target(2), distance=DISTANCE, iterations=2).phase
    for shape in (tensor, tensor[None], tensor[None, None], tensor.expand(3, -1, -1)):
        assert difference(bench.optimize(shape, distance=DISTANCE, iterations=2).phase, as_array) < 1e-4


def test_colour_depth_and_subframes(lab: lightpath.Lab, tmp_path: Path) -> None:
    wavelengths = ["638nm", "520nm", "450nm"]
    display = lab.create_display("rgb", resolution=(64, 48), pixel_pitch=8e-6, wavelength=wavelengths)
    colours = np.random.default_rng(1).random((48, 64, 3))
    hologram = display.optimize(
        colours,
        distance=["10mm", "12mm"],
        wavelength=wavelengths,
        depth_map=target(3)[:, 16:144],
        subframes=2,
        iterations=3,
    )
    assert hologram.phase.shape == hologram.levels.shape == hologram.phases.shape == (3, 2, 48, 64)
    assert hologram.reconstructions.shape == hologram.light.shape == (3, 2, 48, 64)
    assert hologram.reconstruction.shape == (2, 48, 64, 3)
    assert hologram.distances_m == [0.01, 0.012]
    assert "2 subframes" in repr(hologram)
    with pytest.raises(lightpath.InvalidArgument, match=r"quality is that of one picture.*pictures\[wavelength\]"):
        _ = hologram.quality
    quality = hologram.pictures[2][1].quality
    assert quality
    assert quality.pixel.psnr_db > 0
    with pytest.raises(lightpath.InvalidArgument, match="save_all"):
        hologram.save(tmp_path / "one.png")
    assert len(hologram.save_all(tmp_path / "all")) == 6
    with pytest.raises(lightpath.InvalidArgument, match=r"hologram has 3 wavelengths with 2 subframes"):
        display.photograph(hologram)


def test_options_reach_the_server(bench: lightpath.Display) -> None:
    hologram = bench.optimize(
        target(1),
        distance=0.02,
        iterations=5,
        method="adam",
        learning_rate=0.2,
        detector="point",
        region=(8, 8, 100, 60),
        target_encoding="linear",
        fit="exact",
        propagation="angular-spectrum",
        loss="amplitude",
        kernel="ideal",
        seed=7,
        initial_phase=np.zeros((96, 160), np.float32),
        weight_mask=np.ones((96, 160)),
        batch="tests",
        priority=5,
    )
    spec = hologram.spec
    assert (spec.iterations, spec.learning_rate, spec.seed, spec.kernel.HasField("ideal")) == (5, 0.2, 7, True)
    assert spec.method == v1.HOLOGRAM_METHOD_ADAM
    assert (spec.region.x_px, spec.region.height_px) == (8, 60)
    assert spec.initial_phase.given.phases
    assert spec.weight_mask
    assert (hologram.job.batch, hologram.job.priority) == ("tests", 5)
    assert hologram.region == (8, 8, 100, 60)


@pytest.mark.parametrize(
    ("picture", "problem"),
    [
        (np.full((96, 160), np.nan), r"target has 15360 values that are not finite, the first at \[0\]\[0\]"),
        (np.full((96, 160), 255.0), "target has values from 255 to 255.*divide by 255"),
        (np.zeros((96, 160, 4), np.uint8), r"target has the shape \(96, 160, 4\)"),
        (np.zeros((0, 5)), "target has the shape"),
        (np.zeros((96, 160), np.int64), "target has values of type int64.*uint8"),
        ({"a": 1}, "target is a dict: give a file, an image, an array or a tensor"),
        ("missing.png", r'target is "missing.png", which cannot be read'),
    ],
)
def test_bad_pictures_are_refused_before_the_server_is_asked(
    bench: lightpath.Display, picture: object, problem: str
) -> None:
    with pytest.raises(lightpath.InvalidArgument, match=problem) as caught:
        bench.optimize(picture, distance=DISTANCE)  # type: ignore[arg-type]
    assert caught.value.field == "target"
    assert caught.value.fix


def test_help_and_completion_show_every_option(bench: lightpath.Display) -> None:
    for function in (bench.optimize, lightpath.local.optimize):
        parameters = inspect.signature(function).parameters
        assert {"iterations", "initial_phase", "region", "weight_mask", "subframes"} <= parameters.keys()
        assert parameters["iterations"].annotation == "int"
        assert "options" not in parameters
        assert "- `iterations`: Number of iterations" in inspect.getdoc(function).replace("\n  ", " ")  # type: ignore[union-attr]
    assert "- `priority`: Lower numbers run first" in str(inspect.getdoc(bench.photograph))
    assert inspect.signature(lightpath.local.plan).parameters["wavelength"].default is inspect.Parameter.empty
    shell = InteractiveShell.instance()
    shell.user_ns["bench"] = bench
    with provisionalcompleter():
        found = [each.text for each in shell.Completer.completions("bench.optimize(iter", 19)]
    assert "iterations=" in found
    InteractiveShell.clear_instance()


def test_values_of_another_type_are_refused_by_their_name(bench: lightpath.Display) -> None:
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"distance": None}, "distance is a NoneType: give one number in metres"),
        ({"distance": "20mm", "iterations": 2.5}, "iterations is 2.5 .float.: give a whole number"),
        ({"distance": "20mm", "total_variation": "much"}, "total_variation is 'much' .str.: give a number"),
        ({"distance": "20mm", "batch": 7}, "batch is 7 .int.: give a text"),
        ({"distance": "20mm", "region": (1, 2)}, "region is .*give x, y, width and height"),
    ]
    for options, text in wrong:
        with pytest.raises(lightpath.InvalidArgument, match=text):
            bench.optimize(target(1), **options)
    with pytest.raises(lightpath.InvalidArgument, match=r"seed is .1. .str.: give a whole number"):
        bench.photograph(target(1), distance="20mm", seed="1")  # type: ignore[arg-type]


def test_unknown_options_are_refused_with_the_list_of_options(bench: lightpath.Display) -> None:
    with pytest.raises(TypeError, match=r"iteration; the options are .*iterations"):
        bench.optimize(target(1), distance=DISTANCE, iteration=5)  # type: ignore[call-arg]
    with pytest.raises(lightpath.InvalidArgument, match='method is "sgd": choose one of lbfgs, adam') as caught:
        bench.optimize(target(1), distance=DISTANCE, method="sgd")  # type: ignore[arg-type]
    assert caught.value.field == "method"


def test_linear_light_of_16_bits_arrives_exactly() -> None:
    # Pillow reads 16-bit grey PNGs exactly, so it can check what this package writes.
    pixels = np.arange(96 * 160, dtype=np.uint16).reshape(96, 160) * 4
    image = Image.open(io.BytesIO(picture_bytes("target", pixels / 65535)))
    assert np.array_equal(np.asarray(image).astype(np.uint16), pixels)
