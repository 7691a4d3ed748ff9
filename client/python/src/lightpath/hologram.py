"""Holograms: phases, the levels for the display, and what they show."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from lightpath import html, names, png, v1, words
from lightpath.errors import InvalidArgument
from lightpath.units import show_length

if TYPE_CHECKING:
    import os

    import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Hologram:
    """An optimized hologram, held in memory.

    `phase`, `levels` and `reconstruction` are planes [y][x]: the first part, which is the only one unless several
    wavelengths, subframes or distances were asked for. `phases` and `all_levels` [wavelength][subframe][y][x] and
    `reconstructions` [wavelength][plane][y][x] have all parts.
    """

    job: v1.Job = field(repr=False)
    phases: npt.NDArray[np.float32] = field(repr=False)
    """Phases before response, carrier and quantization, in [0, 2π) [rad]."""
    levels_png: list[list[bytes]] = field(repr=False)
    """The PNG files for the display, [wavelength][subframe], as they are sent to it."""
    reconstructions_png: list[list[bytes]] = field(repr=False)
    """The predicted pictures, [wavelength][plane], sRGB grey."""
    colours_png: list[bytes] = field(repr=False)
    """With three wavelengths: one colour picture for each plane. Otherwise empty."""

    def __repr__(self) -> str:
        kernels = ", ".join(_version(used) for used in self.job.kernels)
        quality = f"PSNR {_in_photograph(self.expected)}, kernel {kernels}"
        return f"<Hologram of {self.spec.display}, {self.width_px}x{self.height_px} px, {self._optics()}: {quality}>"

    @property
    def spec(self) -> v1.OptimizeHologram:
        """The request, with all defaults filled in."""
        return self.job.spec.optimize_hologram

    @property
    def result(self) -> v1.OptimizeHologramResult:
        """The result as the server sent it, with the quality for every detector."""
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
        return [each.wavelength_m for each in self.result.wavelengths]

    @property
    def distances_m(self) -> list[float]:
        """Distances of the pictures from the SLM [m]."""
        return [plane.place.distance_m for plane in self.spec.planes]

    @property
    def phase(self) -> npt.NDArray[np.float32]:
        """Phase of the first wavelength and subframe, [y][x], in [0, 2π) [rad]."""
        first: npt.NDArray[np.float32] = self.phases[0, 0]
        return first

    @property
    def levels(self) -> npt.NDArray[Any]:
        """Grey levels for the display of the first wavelength and subframe, [y][x], uint8 or (above 8 bits) uint16."""
        return png.decode(self.levels_png[0][0])

    @property
    def all_levels(self) -> npt.NDArray[Any]:
        """Grey levels of all wavelengths and subframes, [wavelength][subframe][y][x]."""
        return np.array([[png.decode(pattern) for pattern in patterns] for patterns in self.levels_png])

    @property
    def reconstruction(self) -> npt.NDArray[np.uint8]:
        """What the display should show in the first plane: sRGB, [y][x], or with three wavelengths [y][x][3]."""
        return png.decode(self._shown())

    @property
    def reconstructions(self) -> npt.NDArray[np.uint8]:
        """What the display should show, sRGB grey, [wavelength][plane][y][x]."""
        return np.array([[png.decode(plane) for plane in planes] for planes in self.reconstructions_png])

    @property
    def loss(self) -> float:
        """Loss of the last iteration, of the first wavelength."""
        return self.result.wavelengths[0].loss

    @property
    def expected(self) -> v1.Judgement:
        """What a photograph of the first plane is expected to show, by the best model of the display.

        That is the kernel that was active when the job was submitted, whatever the kernel of the hologram. If none was
        active it is the kernel of the hologram, and `expected.kernel_version` is empty.

        `expected.psnr_db` includes the error that the kernel had on its own test photographs, and `expected.stage` is
        `STAGE_PHOTOGRAPHED`. If the kernel has none, the stage is `STAGE_DISPLAYED`, and a photograph will show less.
        """
        return next(each for each in self.result.wavelengths[0].planes[0].judgements if each.headline)

    @property
    def quality(self) -> v1.Judgement:
        """Quality in the first plane with the levels that the display shows, for the detector of the job.

        It is that by the kernel of the hologram. A photograph may show less: `expected`.
        """
        return self.judgement("displayed", cast("words.Detector", words.name_of(v1.Detector, self.spec.detector)))

    def judgement(self, stage: words.Stage, detector: words.Detector) -> v1.Judgement:
        """Return how well the hologram shows its first plane, by its own kernel: as optimized or as displayed."""
        wanted = (
            v1.Judgement.MODEL_ENGINE,
            words.number("stage", v1.Judgement.Stage, stage),
            words.number("detector", v1.Detector, detector),
            v1.Judgement.ORDERS_OWN,
            "",
        )
        for each in self.result.wavelengths[0].planes[0].judgements:
            found = (each.model, each.stage, each.detector, each.orders, each.kernel_version)
            # Those on some rows are for the comparison with the independent model.
            if found == wanted and not each.HasField("rows"):
                return each
        raise InvalidArgument("detector", f"is {detector}, which was not judged", "see result.wavelengths[0].planes[0]")

    @property
    def notes(self) -> list[str]:
        """Why the figures may say less than they seem to, as sentences: a dark target, planes without pixels."""
        return list(dict.fromkeys(note for each in self.result.wavelengths for note in each.notes))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the hologram: `.png` for the display as it is, or `.npy` of the phase in radians.

        Raises `InvalidArgument` if the hologram has several parts; `save_all` writes those.
        """
        if len(self.levels_png) * len(self.levels_png[0]) > 1:
            parts = f"{len(self.levels_png)} wavelengths with {len(self.levels_png[0])} subframes"
            raise InvalidArgument("path", f"is one file, but the hologram has {parts}", "use save_all(folder)")
        self._save_part(Path(path), 0, 0)

    def save_all(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write a PNG for each wavelength and subframe into a folder, and return their paths."""
        Path(folder).mkdir(parents=True, exist_ok=True)
        paths = []
        for i, wavelength_m in enumerate(self.wavelengths_m):
            for subframe in range(len(self.levels_png[i])):
                path = Path(folder) / f"{show_length(wavelength_m).replace(' ', '')}-subframe{subframe + 1}.png"
                self._save_part(path, i, subframe)
                paths.append(path)
        return paths

    def _save_part(self, path: Path, wavelength: int, subframe: int) -> None:
        if path.suffix == ".png":
            path.write_bytes(self.levels_png[wavelength][subframe])
        elif path.suffix == ".npy":
            np.save(path, self.phases[wavelength, subframe], allow_pickle=False)
        else:
            raise InvalidArgument("path", f'is "{path}"', "end it with .png (levels) or .npy (radians)")

    def _shown(self) -> bytes:
        return self.colours_png[0] if self.colours_png else self.reconstructions_png[0][0]

    def _optics(self) -> str:
        wavelengths = ", ".join(show_length(each) for each in self.wavelengths_m)
        return f"{wavelengths} at {', '.join(show_length(each) for each in self.distances_m)}"

    def _repr_png_(self) -> bytes:
        return png.thumbnail(self._shown(), html.PICTURE_SIDE_PX)

    def _repr_html_(self) -> str:
        pictures = html.picture("levels for the display", self.levels_png[0][0])
        shown = self.colours_png or [planes for each in self.reconstructions_png for planes in each]
        for i, picture in enumerate(shown):
            pictures += html.picture(f"what it shows{f', {i + 1}' if len(shown) > 1 else ''}", picture)
        seen = self.expected
        by = f", by {seen.kernel_version}" if seen.kernel_version else ""
        rows: list[tuple[str, object]] = [
            ("display", f"{self.spec.display}, {self._optics()}"),
            ("PSNR", f"{_in_photograph(seen)}{by}"),
            ("SSIM", f"{seen.ssim:.3f}" if seen.HasField("ssim") else "not measured"),
            ("diffraction efficiency", f"{seen.diffraction_efficiency:.1%}"),
            *(("note", note) for note in self.notes),
            ("job", self.job.name),
        ]
        return pictures + html.table("Hologram", rows)


def _version(used: v1.UsedKernel) -> str:
    return f"version {names.last_part(used.kernel_version)}" if used.kernel_version else "ideal"


def _in_photograph(judged: v1.Judgement) -> str:
    """Return what a photograph is expected to show, for example `40.3 ± 1.5 dB expected in a photograph`."""
    psnr = judged.psnr_db
    if judged.stage != v1.Judgement.STAGE_PHOTOGRAPHED:
        return f"{psnr.value:.1f} dB at most in a photograph"
    # A smaller deviation would be shown as 0.0.
    std = f" ± {psnr.std:.1f}" if psnr.std >= 0.05 else ""  # noqa: PLR2004
    return f"{psnr.value:.1f}{std} dB expected in a photograph"
