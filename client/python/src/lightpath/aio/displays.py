"""Asynchronous displays: holograms, simulated photographs, plans, datasets and kernels of a display."""

from __future__ import annotations

import uuid
from typing import TYPE_CHECKING, cast

from google.protobuf.field_mask_pb2 import FieldMask

from lightpath import html, names, png, v1, words
from lightpath.aio.datasets import Dataset
from lightpath.aio.devices import DisplayDevices
from lightpath.aio.display_kernels import DisplayKernels
from lightpath.aio.jobs import submit, submit_all
from lightpath.aio.kernel_choice import find_kernel, of_hologram
from lightpath.aio.kernels import Kernel, KernelVersion, list_kernels
from lightpath.aio.results import read_hologram, read_photograph
from lightpath.errors import InvalidArgument
from lightpath.hologram import Hologram
from lightpath.options import HologramOptions, SubmitOptions, check, label_of, optimize_message
from lightpath.pictures import Phase, Picture, file_bytes, phase_bytes, picture_bytes
from lightpath.progress import Progress, shows_pictures
from lightpath.units import Length, metres, place, show_length

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Sequence

    import numpy as np
    import numpy.typing as npt
    from typing_extensions import Unpack

    from lightpath.aio.jobs import Job
    from lightpath.photograph import Photograph


class Display(DisplayKernels, DisplayDevices):
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

    async def optimize(
        self,
        target: Picture | Sequence[Picture],
        *,
        distance: Length | Sequence[Length],
        wavelength: Length | Sequence[Length] | None = None,
        progress: Progress = True,
        **options: Unpack[HologramOptions],
    ) -> Hologram:
        """Optimize a hologram that shows a picture, wait for it, and return it.

        - `target`: a file, a PIL image, an array or a tensor. With several distances: one picture for each, or one
          picture for all (with the option `depth_map` for a picture with depth).
        - `distance`: from the SLM to the image, metres or text such as `"150mm"`; or several
        - `wavelength`: one of the display's, or several for a colour hologram. Default: the display's only one
        - `progress`: whether to show progress, or a function that receives every state of the job

        All other options are those of `lightpath.HologramOptions`, such as `iterations=100` or `method="adam"`. Raises
        `InvalidArgument` or `InvalidRequest` for wrong arguments, `JobUnsuccessful` if the job fails, and
        `WaitInterrupted` on Ctrl-C.
        """
        job = await self.submit_optimize(target, distance=distance, wavelength=wavelength, **options)
        first = job.message.spec.optimize_hologram.planes[0].target
        picture = await self._connection.download(first) if shows_pictures(progress) else None
        await job.wait(progress=progress, picture=picture)
        return await job.result()

    async def submit_optimize(
        self,
        target: Picture | Sequence[Picture],
        *,
        distance: Length | Sequence[Length],
        wavelength: Length | Sequence[Length] | None = None,
        **options: Unpack[HologramOptions],
    ) -> Job[Hologram]:
        """Submit the optimization of a hologram, and return its job without waiting. Arguments as for `optimize`."""
        spec = await self._optimization(target, distance, wavelength, options)
        return await submit(self._connection, spec, options, read_hologram)

    async def _optimization(
        self,
        target: Picture | Sequence[Picture],
        distance: Length | Sequence[Length],
        wavelength: Length | Sequence[Length] | None,
        options: HologramOptions,
    ) -> v1.JobSpec:
        """Upload the files of an optimization. Adds a label to the options that have none."""
        check(options, HologramOptions)
        message = optimize_message(options)
        message.display = self.name
        if wavelength is not None:
            message.wavelengths_m.extend(metres("wavelength", each) for each in _several(wavelength))
        distances = [metres("distance", each) for each in _several(distance)]
        targets = _pictures(target)
        if len(targets) not in {1, len(distances)}:
            fix = "give one picture, or one for each distance"
            raise InvalidArgument("target", f"has {len(targets)} pictures for {len(distances)} distances", fix)
        options.setdefault("label", label_of(targets))
        digests = [await self._connection.upload(picture_bytes("target", each)) for each in targets]
        for i, distance_m in enumerate(distances):
            message.planes.add(place=v1.Place(distance_m=distance_m), target=digests[i % len(digests)])
        choice = await of_hologram(self._connection, options.get("kernel"), message)
        if choice is not None:
            message.kernel.CopyFrom(choice)
        await self._upload_files(message, options)
        return v1.JobSpec(optimize_hologram=message)

    async def _upload_files(self, message: v1.OptimizeHologram, options: HologramOptions) -> None:
        if "depth_map" in options:
            message.depth_map = await self._connection.upload(picture_bytes("depth_map", options["depth_map"]))
        if "weight_mask" in options:
            message.weight_mask = await self._connection.upload(picture_bytes("weight_mask", options["weight_mask"]))
        start = options.get("initial_phase")
        if isinstance(start, v1.OptimizeHologram.InitialPhase):
            message.initial_phase.CopyFrom(start)
        elif start is not None:
            digest = await self._connection.upload(phase_bytes("initial_phase", start))
            message.initial_phase.given.phases.append(digest)

    async def optimize_all(
        self,
        targets: Iterable[Picture],
        *,
        distance: Length,
        wavelength: Length | None = None,
        progress: Progress = True,
        **options: Unpack[HologramOptions],
    ) -> list[Hologram]:
        """Optimize one hologram for each picture. All jobs are submitted first, so that the server never waits.

        Up to 200 jobs are submitted together: if one is refused, so are they all.
        """
        submitted: list[tuple[v1.JobSpec, SubmitOptions]] = []
        for target in targets:
            own = options.copy()
            submitted.append((await self._optimization(target, distance, wavelength, own), own))
        jobs = await submit_all(self._connection, submitted, read_hologram)
        return [await job.result(progress=progress) for job in jobs]

    async def photograph(
        self,
        hologram: Hologram | Phase,
        *,
        distance: Length | None = None,
        wavelength: Length | None = None,
        seed: int = 0,
        elapsed_s: float = 0.0,
        progress: Progress = True,
        **options: Unpack[SubmitOptions],
    ) -> Photograph:
        """Photograph a hologram. Only simulated displays have a camera that the server can use.

        `distance` and `wavelength` are those of the hologram by default. `seed` is that of the camera's noise,
        `elapsed_s` the time since the bench was set up [s].
        """
        check(options, SubmitOptions)
        message = v1.SimulateCapture(display=self.name, seed=seed, elapsed_s=elapsed_s)
        if isinstance(hologram, Hologram):
            part = hologram.result.wavelengths[0]
            message.pattern = part.subframes[0].pattern
            message.wavelength_m = part.wavelength_m
            message.place.CopyFrom(hologram.spec.planes[0].place)
        elif distance is None:
            raise InvalidArgument("distance", "is missing", 'give it with a hologram from a file, as distance="150mm"')
        else:
            options.setdefault("label", label_of([hologram]))
            message.pattern = await self._connection.upload(phase_bytes("hologram", hologram))
        if distance is not None:
            message.place.distance_m = metres("distance", distance)
        if wavelength is not None:
            message.wavelength_m = metres("wavelength", wavelength)
        job = await submit(self._connection, v1.JobSpec(simulate_capture=message), options, read_photograph)
        return await job.result(progress=progress)

    async def plan(
        self,
        distance: Length,
        *,
        wavelength: Length | None = None,
        method: words.Propagation | None = None,
    ) -> v1.PlanPropagationResponse:
        """Return how light gets from the display to a distance: the method, the reason, and all alternatives."""
        request = v1.PlanPropagationRequest(
            display=self.name,
            place=place(distance),
            wavelength_m=None if wavelength is None else metres("wavelength", wavelength),
            method=words.number("method", v1.PropagationMethod, method),
        )
        return await self._connection.call(self._connection.displays.PlanPropagation, request)

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


def _pictures(target: Picture | Sequence[Picture]) -> list[Picture]:
    # A text is a sequence, too, and so is an array; only lists and tuples are several pictures.
    return list(target) if isinstance(target, list | tuple) else [cast("Picture", target)]


def _several(lengths: Length | Sequence[Length]) -> Sequence[Length]:
    return [lengths] if isinstance(lengths, str | int | float) else lengths
