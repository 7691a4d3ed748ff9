"""Asynchronous displays: plans, datasets and kernels of a display; holograms have a file of their own."""

from __future__ import annotations

import uuid
from typing import TYPE_CHECKING

from google.protobuf.field_mask_pb2 import FieldMask

from lightpath import html, names, png, v1, words
from lightpath.aio.datasets import Dataset
from lightpath.aio.devices import DisplayDevices
from lightpath.aio.display_holograms import DisplayHolograms
from lightpath.aio.display_kernels import DisplayKernels
from lightpath.aio.kernel_choice import find_kernel
from lightpath.aio.kernels import Kernel, KernelVersion, list_kernels
from lightpath.pictures import file_bytes
from lightpath.plans import Plan, plan_of_server
from lightpath.units import Length, metres, place, show_length

if TYPE_CHECKING:
    import os

    import numpy as np
    import numpy.typing as npt


class Display(DisplayHolograms, DisplayKernels, DisplayDevices):
    """A display: a phase-only spatial light modulator (SLM) and the optics behind it."""

    message: v1.Display

    def __repr__(self) -> str:
        return f"<Display {self.id}: {self.width_px}x{self.height_px} px of {show_length(self.pixel_pitch_m)}>"

    @property
    def name(self) -> str:
        """Resource name, `displays/{id}`."""
        return self.message.name

    @property
    def id(self) -> str:
        """The id in the name."""
        return names.last_part(self.name)

    @property
    def width_px(self) -> int:
        """Number of columns."""
        return self.message.modulator.width_px

    @property
    def height_px(self) -> int:
        """Number of rows."""
        return self.message.modulator.height_px

    @property
    def pixel_pitch_m(self) -> float:
        """Distance between the centres of neighbouring pixels [m]."""
        return self.message.modulator.pixel_pitch_x_m

    @property
    def wavelengths_m(self) -> list[float]:
        """Wavelengths that light the display [m]."""
        return list(self.message.wavelengths_m)

    @property
    def notes(self) -> str:
        """Notes of people."""
        return self.message.notes

    async def update(self, *, notes: str, expected_revision: int | None = None) -> Display:
        """Change the notes of the display. A display with other optics is a new display.

        With `expected_revision`, such as `display.message.revision`, raises `Aborted` if somebody changed the display
        since.
        """
        request = v1.UpdateDisplayRequest(
            display=v1.Display(name=self.name, notes=notes),
            update_mask=FieldMask(paths=["notes"]),
            expected_revision=expected_revision,
        )
        call = self._connection.displays.UpdateDisplay
        self.message = await self._connection.call(call, request, repeatable=expected_revision is None)
        return self

    async def plan(
        self,
        distance: Length,
        *,
        wavelength: Length | None = None,
        method: words.Propagation | None = None,
    ) -> Plan:
        """Return how light gets from the display to a distance: the method, the reason, and all alternatives."""
        request = v1.PlanPropagationRequest(
            display=self.name,
            place=place(distance),
            wavelength_m=None if wavelength is None else metres("wavelength", wavelength),
            method=words.number("method", v1.PropagationMethod, method),
        )
        return plan_of_server(await self._connection.call(self._connection.displays.PlanPropagation, request))

    async def create_dataset(
        self,
        dataset_id: str,
        *,
        distance: Length,
        wavelength: Length | None = None,
        photo_encoding: words.Encoding | None = None,
        photo_bit_depth: int | None = None,
    ) -> Dataset:
        """Create an open dataset of photographs of this display.

        `photo_encoding` says what the photographs' values mean: `linear` light (default) or `srgb`. `photo_bit_depth`
        is the camera's, if the files have more bits.
        """
        message = v1.Dataset(
            name=names.with_collection("datasets", dataset_id),
            display=self.name,
            place=place(distance),
            wavelength_m=None if wavelength is None else metres("wavelength", wavelength),
            photo_encoding=words.number("photo_encoding", v1.Encoding, photo_encoding),
            photo_bit_depth=photo_bit_depth,
        )
        request = v1.CreateDatasetRequest(dataset=message)
        created = await self._connection.call(self._connection.datasets.CreateDataset, request, repeatable=False)
        return Dataset(self._connection, created)

    async def calibration_target(self) -> npt.NDArray[np.uint8]:
        """Return a picture of a grid of dots, [y][x], sRGB. `Dataset.align` takes the photograph of its hologram."""
        request = v1.CreateCalibrationTargetRequest(display=self.name)
        target = await self._connection.call(self._connection.datasets.CreateCalibrationTarget, request)
        return png.decode(await self._connection.download(target.target))

    async def kernel(self, *, distance: Length, wavelength: Length | None = None) -> Kernel:
        """Return the kernel for a distance.

        Raises `MissingKernel` if there is none, and `InvalidArgument` if several wavelengths have one.
        """
        wavelength_m = None if wavelength is None else metres("wavelength", wavelength)
        return Kernel(self._connection, await find_kernel(self._connection, self.name, place(distance), wavelength_m))

    async def kernels(self) -> list[Kernel]:
        """Return all kernels of the display, in the order of their names."""
        return await list_kernels(self._connection, self.name)

    async def import_kernel(
        self,
        path: str | os.PathLike[str],
        *,
        distance: Length,
        wavelength: Length | None = None,
        from_another_display: bool = False,
    ) -> KernelVersion:
        """Store a file of `Kernel.save`, or the paper's `kernel.pt`, as the next version for a distance."""
        request = v1.ImportKernelRequest(
            # A call whose answer was lost is made again, and stores no second version.
            request_id=str(uuid.uuid4()),
            display=self.name,
            place=place(distance),
            wavelength_m=None if wavelength is None else metres("wavelength", wavelength),
            artifact=await self._connection.upload(file_bytes("path", path)),
            from_another_display=from_another_display,
        )
        call = self._connection.kernels.ImportKernel
        return KernelVersion(self._connection, await self._connection.call(call, request))

    async def delete(self) -> None:
        """Delete the display. It must have no datasets, kernels or jobs."""
        request = v1.DeleteDisplayRequest(name=self.name)
        await self._connection.call(self._connection.displays.DeleteDisplay, request, repeatable=False)

    def _repr_html_(self) -> str:
        message = self.message
        rows: list[tuple[str, object]] = [
            ("resolution", f"{self.width_px}×{self.height_px} px"),
            ("pixel pitch", show_length(self.pixel_pitch_m)),
            ("wavelengths", ", ".join(show_length(each) for each in message.wavelengths_m)),
            ("grey levels", 1 << message.modulator.bit_depth),
        ]
        if message.HasField("simulated_bench"):
            rows.append(("simulated", f"seed {message.simulated_bench.seed}"))
        if message.notes:
            rows.append(("notes", message.notes))
        return html.table(self.name, rows)
