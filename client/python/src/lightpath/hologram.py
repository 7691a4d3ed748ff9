"""Holograms, from a server or from `lightpath.local`: phases, levels for the display, and what they show."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from lightpath import html, names, png
from lightpath.errors import InvalidArgument
from lightpath.units import show_length

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    import numpy.typing as npt

    from lightpath import v1
    from lightpath.local.display import DisplayModel
    from lightpath.quality import Expected, Quality, SecondOpinion, ShownPicture

Value = TypeVar("Value")
_NOT_JUDGED = "not judged (judge none)"


@dataclass(frozen=True, eq=False, repr=False)
class Hologram:
    """An optimized hologram, held in memory.

    `phase`, `levels` and `reconstruction` are [y][x] if the hologram has one part. With several wavelengths, subframes
    or distances they have an axis for each of those, in this order. `phases`, `all_levels`
    [wavelength][subframe][y][x] and `reconstructions` [wavelength][plane][y][x] always have all axes.

    What is measured of a single picture, such as `quality` and `expected`, stands in `pictures` [wavelength][plane] if
    there are several.
    """

    phases: npt.NDArray[np.float32]
    """Phases before response, carrier and quantization, [wavelength][subframe][y][x], in [0, 2π) [rad]."""
    levels_png: Sequence[Sequence[bytes]]
    """The PNG files for the display, [wavelength][subframe], as they are sent to it."""
    reconstructions_png: Sequence[Sequence[bytes]]
    """The predicted pictures, [wavelength][plane], sRGB grey."""
    colours_png: Sequence[bytes]
    """With three wavelengths: one colour picture for each plane. Otherwise empty."""
    pictures: Sequence[Sequence[ShownPicture]]
    """How well the hologram shows each picture, [wavelength][plane]."""
    losses: Sequence[float]
    """Loss of the last iteration, of each wavelength."""
    intensity_scales: Sequence[float]
    """Of each wavelength: factor from the light of a display's model to the brightness of the target."""
    region: tuple[int, int, int, int]
    """Region in which the picture counts: x, y, width, height [px]. The light around it is not needed."""
    notes: Sequence[str] = ()
    """Why the figures may say less than they seem to, as sentences: a dark target, planes without pixels."""
    server_job: v1.Job | None = None
    """The job of the server that optimized the hologram; `job` is the same. None: this process optimized it."""
    models: Sequence[Sequence[DisplayModel]] = ()
    """Models of the display, [wavelength][plane], if this process optimized the hologram. Otherwise empty."""
    loss_histories: Sequence[Sequence[float]] = ()
    """Loss of each iteration, of each wavelength, before it changed the phase. Empty if a server optimized it."""
    lights: Sequence[Sequence[npt.NDArray[np.float32]]] = field(default=())
    """Linear light of the reconstructions, [wavelength][plane], if this process optimized the hologram."""

    def __repr__(self) -> str:
        name = f"<Hologram of {self.spec.display}" if self.server_job else "<Hologram"
        return f"{name}, {self.width_px}x{self.height_px} px, {self._optics()}: {self._headline()}, {self._kernels()}>"

    @property
    def job(self) -> v1.Job:
        """The job of the server that optimized the hologram, with all that the server said."""
        if self.server_job is None:
            fix = "see pictures, losses and region, which every hologram has"
            raise InvalidArgument("job", "does not exist: this process optimized the hologram", fix)
        return self.server_job

    @property
    def spec(self) -> v1.OptimizeHologram:
        """The request to the server, with all defaults filled in."""
        return self.job.spec.optimize_hologram

    @property
    def result(self) -> v1.OptimizeHologramResult:
        """The result as the server sent it."""
        return self.job.result.optimize_hologram

    @property
    def height_px(self) -> int:
        """Number of rows."""
        return int(self.phases.shape[2])

    @property
    def width_px(self) -> int:
        """Number of columns."""
        return int(self.phases.shape[3])

    @property
    def wavelengths_m(self) -> list[float]:
        """Wavelengths of the holograms [m]."""
        return [each[0].wavelength_m for each in self.pictures]

    @property
    def distances_m(self) -> list[float]:
        """Distances of the pictures from the SLM [m]."""
        return [each.distance_m for each in self.pictures[0]]

    @property
    def phase(self) -> npt.NDArray[np.float32]:
        """Phase in [0, 2π) [rad]: [y][x], with axes before for several wavelengths and subframes."""
        return _without_single_axes(self.phases)

    @property
    def levels(self) -> npt.NDArray[Any]:
        """Grey levels for the display, uint8 or (above 8 bits) uint16: [y][x], with axes before as `phase`."""
        return _without_single_axes(self.all_levels)

    @property
    def all_levels(self) -> npt.NDArray[Any]:
        """Grey levels of all wavelengths and subframes, [wavelength][subframe][y][x]."""
        return np.array([[png.decode(pattern) for pattern in patterns] for patterns in self.levels_png])

    @property
    def reconstruction(self) -> npt.NDArray[np.uint8]:
        """What the display should show, sRGB: [y][x], with three wavelengths [y][x][3]; [plane] first, if several."""
        if self.colours_png:
            pictures = np.array([png.decode(picture) for picture in self.colours_png])
            return pictures[0] if len(pictures) == 1 else pictures
        return _without_single_axes(self.reconstructions)

    @property
    def reconstructions(self) -> npt.NDArray[np.uint8]:
        """What the display should show, sRGB grey, [wavelength][plane][y][x]."""
        return np.array([[png.decode(plane) for plane in planes] for planes in self.reconstructions_png])

    @property
    def light(self) -> npt.NDArray[np.float32]:
        """Linear light of the reconstruction in the brightness of the target: [y][x], with axes before for several.

        A server sends pictures of 8 bits, so that its light has 256 steps and ends at 1.
        """
        if self.lights:
            return _without_single_axes(np.array(self.lights))
        values = self.reconstructions / np.float32(255)
        linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)  # noqa: PLR2004 - sRGB
        return _without_single_axes(linear.astype(np.float32))

    @property
    def field(self) -> npt.NDArray[np.complex64]:
        """The field behind an ideal modulator, exp(i phase)."""
        return np.asarray(np.exp(1j * self.phase), np.complex64)

    @property
    def quality(self) -> Quality:
        """Quality of the grey levels, as the display shows them, by the kernel of the hologram.

        A photograph may show less: `expected`.
        """
        return _judged("quality", self._picture("quality").quality)

    @property
    def optimized_quality(self) -> Quality:
        """Quality of the phases, before they were rounded to grey levels."""
        return _judged("optimized_quality", self._picture("optimized_quality").optimized_quality)

    @property
    def expected(self) -> Expected:
        """What a photograph is expected to show, by the best model of the display.

        On a server that is the kernel that was active when the job was submitted, whatever the kernel of the hologram.
        It includes the error that the kernel had on its own test photographs. If those are not known,
        `expected.std_db` is None, and a photograph will show less.
        """
        return _judged("expected", self._picture("expected").expected)

    @property
    def second_opinion(self) -> SecondOpinion | None:
        """What an independent model says, on some rows; None where it would take too long, or `judge` leaves it out."""
        return self._picture("second_opinion").second_opinion

    @property
    def loss(self) -> float:
        """Loss of the last iteration."""
        return self._only("loss", self.losses, "losses[wavelength]")

    @property
    def loss_history(self) -> Sequence[float]:
        """Loss of each iteration, before it changed the phase. A server keeps the last one alone: `loss`."""
        if self.server_job:
            raise InvalidArgument(
                "loss_history", "is not kept by a server", "see loss, or use lightpath.local.optimize"
            )
        return self._only("loss_history", self.loss_histories, "loss_histories[wavelength]")

    @property
    def intensity_scale(self) -> float:
        """Factor from the light of a display's model to the brightness of the target."""
        return self._only("intensity_scale", self.intensity_scales, "intensity_scales[wavelength]")

    @property
    def kernel(self) -> DisplayModel:
        """Model of the display in this process. A server has it as a version: `pictures[0][0].kernel`."""
        if not self.models:
            fix = "see pictures[0][0].kernel, and lightpath.local.DisplayModel.load for its file"
            raise InvalidArgument("kernel", "is on the server that optimized the hologram", fix)
        return self._only("kernel", [each for row in self.models for each in row], "models[wavelength][plane]")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the hologram: `.png` for the display as it is, or `.npy` of the phase in radians.

        Raises `InvalidArgument` for the PNG of a hologram with several parts; `save_all` writes those. The array of
        `.npy` has an axis for each of several wavelengths and subframes.
        """
        path = Path(path)
        if path.suffix == ".npy":
            np.save(path, self.phase, allow_pickle=False)
        elif path.suffix != ".png":
            raise InvalidArgument("path", f'is "{path}"', "end it with .png (levels) or .npy (radians)")
        elif len(self.levels_png) * len(self.levels_png[0]) > 1:
            parts = f"{len(self.levels_png)} wavelengths with {len(self.levels_png[0])} subframes"
            raise InvalidArgument("path", f"is one picture, but the hologram has {parts}", "use save_all(folder)")
        else:
            path.write_bytes(self.levels_png[0][0])

    def save_all(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write a PNG for each wavelength and subframe into a folder, and return their paths."""
        Path(folder).mkdir(parents=True, exist_ok=True)
        paths = []
        for wavelength_m, patterns in zip(self.wavelengths_m, self.levels_png, strict=True):
            for subframe, pattern in enumerate(patterns, 1):
                name = f"{show_length(wavelength_m).replace(' ', '')}-subframe{subframe}.png"
                paths.append(Path(folder) / name)
                paths[-1].write_bytes(pattern)
        return paths

    def save_reconstruction(self, path: str | os.PathLike[str], *, plane: int = 0) -> None:
        """Write what the display should show at one of its distances as an sRGB PNG, of three wavelengths in colour."""
        path = Path(path)
        if path.suffix != ".png":
            raise InvalidArgument("path", f'is "{path}"', "end it with .png")
        if not self.colours_png and len(self.reconstructions_png) > 1:
            problem = f"is one picture, but the hologram has {len(self.reconstructions_png)} wavelengths"
            raise InvalidArgument("path", problem, "write reconstructions[wavelength][plane]")
        path.write_bytes((self.colours_png or self.reconstructions_png[0])[plane])

    def _only(self, name: str, values: Sequence[Value], all_of_them: str) -> Value:
        if len(values) != 1:
            raise InvalidArgument(name, f"is that of one picture, but the hologram has {self._parts()}", all_of_them)
        return values[0]

    def _picture(self, name: str) -> ShownPicture:
        shown = [each for row in self.pictures for each in row]
        return self._only(name, shown, f"use pictures[wavelength][plane].{name}")

    def _parts(self) -> str:
        return f"{len(self.pictures)} wavelengths and {len(self.pictures[0])} distances"

    def _optics(self) -> str:
        wavelengths = ", ".join(show_length(each) for each in self.wavelengths_m)
        frames = f", {self.phases.shape[1]} subframes" if self.phases.shape[1] > 1 else ""
        return f"{wavelengths} at {', '.join(show_length(each) for each in self.distances_m)}{frames}"

    def _headline(self) -> str:
        """Return what photographs are expected to show; of several pictures the worst."""
        shown = [each.expected for row in self.pictures for each in row if each.expected]
        if not shown:
            return _NOT_JUDGED
        worst = min(shown, key=lambda each: each.psnr_db)
        return f"{worst}" if len(shown) == 1 else f"{worst} in the worst of {len(shown)} pictures"

    def _kernels(self) -> str:
        used = dict.fromkeys(names.kernel_text(each.kernel) for row in self.pictures for each in row)
        return ", ".join(used)

    def _repr_png_(self) -> bytes:
        return png.thumbnail(self._shown()[0], html.PICTURE_SIDE_PX)

    def _shown(self) -> Sequence[bytes]:
        return self.colours_png or [plane for each in self.reconstructions_png for plane in each]

    def _repr_html_(self) -> str:
        pictures = html.picture("levels for the display", self.levels_png[0][0])
        shown = self._shown()
        for i, picture in enumerate(shown):
            caption = f"what it shows{f', {i + 1}' if len(shown) > 1 else ''}"
            pictures += html.picture_of_region(caption, picture, self.region)
        rows: list[tuple[str, object]] = [
            ("display", f"{self.spec.display}, {self._optics()}" if self.server_job else self._optics()),
            ("PSNR in a photograph", f"{self._headline()}, {self._kernels()}"),
        ]
        if len(shown) == 1 and self.pictures[0][0].quality:
            seen = self.pictures[0][0].quality.pixel
            rows += [
                ("SSIM", "not measured" if seen.ssim is None else f"{seen.ssim:.3f}"),
                ("diffraction efficiency", f"{seen.diffraction_efficiency:.1%}"),
            ]
        rows += [("note", note) for note in self.notes]
        if self.server_job:
            rows.append(("job", self.job.name))
        return pictures + html.table("Hologram", rows)


def _judged(name: str, value: Value | None) -> Value:
    if value is None:
        raise InvalidArgument(name, f"is unknown: {_NOT_JUDGED}", "optimize with judge quick or full")
    return value


def _without_single_axes(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Remove those of the first two axes that have one element."""
    without: npt.NDArray[Any] = values.reshape(*(side for side in values.shape[:2] if side > 1), *values.shape[2:])
    return without
