"""Asynchronous holograms of a display: optimized, and photographed by a simulated camera."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from lightpath import v1
from lightpath.aio.jobs import submit, submit_all
from lightpath.aio.kernel_choice import of_hologram
from lightpath.aio.resource import Resource
from lightpath.aio.results import read_hologram, read_photograph
from lightpath.complex_targets import as_light
from lightpath.errors import InvalidArgument
from lightpath.hologram import Hologram
from lightpath.initial_phases import message_of, named, parts_of
from lightpath.options import HologramOptions, SubmitOptions, check, check_type, given, label_of, optimize_message
from lightpath.pictures import Phase, Picture, is_file, numbers_of, phase_bytes, picture_bytes
from lightpath.plans import Estimate
from lightpath.progress import Progress, shows_pictures
from lightpath.signature import with_options
from lightpath.units import Length, metres, several

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from typing_extensions import Unpack

    from lightpath.aio.jobs import Job
    from lightpath.photograph import Photograph


class DisplayHolograms(Resource):
    """The part of a display that makes holograms."""

    @with_options(HologramOptions)
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
          picture for all (with the option `depth_map` for a picture with depth). With `method="double-phase"` also a
          complex field [y][x], whose amplitude and phase the image gets.
        - `distance`: from the SLM to the image, metres or text such as `"150mm"`; or several
        - `wavelength`: one of the display's, or several for a colour hologram. Default: the display's only one
        - `progress`: whether to show progress, or a function that receives every state of the job

        Raises `InvalidArgument` or `InvalidRequest` for wrong arguments, `JobUnsuccessful` if the job fails, and
        `WaitInterrupted` on Ctrl-C.
        """
        job = await self.submit_optimize(target, distance=distance, wavelength=wavelength, **options)
        first = job.message.spec.optimize_hologram.planes[0].target
        picture = await self._connection.download(first) if shows_pictures(progress) else None
        await job.wait(progress=progress, picture=picture)
        return await job.result()

    @with_options(HologramOptions)
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

    @with_options(HologramOptions)
    async def estimate_optimize(
        self,
        target: Picture | Sequence[Picture],
        *,
        distance: Length | Sequence[Length],
        wavelength: Length | Sequence[Length] | None = None,
        **options: Unpack[HologramOptions],
    ) -> Estimate:
        """Check the optimization of a hologram without submitting it, and return what it would need.

        Arguments and errors as for `optimize`.
        """
        spec = await self._optimization(target, distance, wavelength, options)
        call = self._connection.jobs.EstimateJob
        answer = await self._connection.call(call, v1.EstimateJobRequest(spec=spec))
        return Estimate(
            answer.memory_bytes if answer.HasField("memory_bytes") else None,
            answer.time_s if answer.HasField("time_s") else None,
        )

    async def _optimization(
        self,
        target: Picture | Sequence[Picture],
        distance: Length | Sequence[Length],
        wavelength: Length | Sequence[Length] | None,
        options: HologramOptions,
    ) -> v1.JobSpec:
        """Upload the files of an optimization. Adds a label to the options that have none."""
        check(options, HologramOptions)
        # A complex target adds options, which are not the caller's.
        all_options = {**given(options), "wavelength": wavelength}
        targets = as_light(_pictures(target), all_options)
        own = cast("HologramOptions", all_options)
        message = optimize_message(own)
        message.display = self.name
        if wavelength is not None:
            message.wavelengths_m.extend(metres("wavelength", each) for each in several(wavelength))
        distances = [metres("distance", each) for each in several(distance)]
        if len(targets) not in {1, len(distances)}:
            fix = "give one picture, or one for each distance"
            raise InvalidArgument("target", f"has {len(targets)} pictures for {len(distances)} distances", fix)
        options.setdefault("label", label_of(targets))
        digests = [await self._connection.upload(picture_bytes("target", each)) for each in targets]
        for i, distance_m in enumerate(distances):
            message.planes.add(place=v1.Place(distance_m=distance_m), target=digests[i % len(digests)])
        choice = await of_hologram(self._connection, own.get("kernel"), message)
        if choice is not None:
            message.kernel.CopyFrom(choice)
        await self._upload_files(message, own)
        return v1.JobSpec(optimize_hologram=message)

    async def _upload_files(self, message: v1.OptimizeHologram, options: HologramOptions) -> None:
        if "depth_map" in options:
            message.depth_map = await self._connection.upload(picture_bytes("depth_map", options["depth_map"]))
        if "weight_mask" in options:
            message.weight_mask = await self._connection.upload(picture_bytes("weight_mask", options["weight_mask"]))
        start = named(options.get("initial_phase"))
        found = message_of(start)
        if found is not None:
            message.initial_phase.CopyFrom(found)
        elif start is not None:
            for each in _given_phases(start, max(len(message.wavelengths_m), 1), message.subframes or 1):
                digest = await self._connection.upload(phase_bytes("initial_phase", each))
                message.initial_phase.given.phases.append(digest)

    @with_options(HologramOptions)
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

    @with_options(SubmitOptions)
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

        - `hologram`: a hologram of this package with one pattern, a file, grey levels (integers) or a phase in radians
          (floats) [y][x]
        - `distance`, `wavelength`: by default those of the hologram. Others than a `Hologram` have no distance
        - `seed`: that of the camera's noise; `elapsed_s`: the time since the bench was set up [s]
        """
        check(options, SubmitOptions)
        check_type("seed", seed, "int")
        check_type("elapsed_s", elapsed_s, "float")
        message = v1.SimulateCapture(display=self.name, seed=seed, elapsed_s=elapsed_s)
        if isinstance(hologram, Hologram):
            message.pattern = await self._pattern(hologram)
            message.wavelength_m = hologram.wavelengths_m[0]
            message.place.distance_m = hologram.distances_m[0]
        elif distance is None:
            raise InvalidArgument("distance", "is missing", 'give it with a file or an array, as distance="150mm"')
        else:
            options.setdefault("label", label_of([hologram]))
            message.pattern = await self._connection.upload(phase_bytes("hologram", hologram))
        if distance is not None:
            message.place.distance_m = metres("distance", distance)
        if wavelength is not None:
            message.wavelength_m = metres("wavelength", wavelength)
        job = await submit(self._connection, v1.JobSpec(simulate_capture=message), options, read_photograph)
        return await job.result(progress=progress)

    async def _pattern(self, hologram: Hologram) -> str:
        """Return the digest of the only pattern of a hologram, which may be one of `lightpath.local`."""
        [patterns, *others] = hologram.levels_png
        if others or len(patterns) > 1:
            problem = f"has {len(hologram.levels_png)} wavelengths with {len(patterns)} subframes"
            fix = "photograph each of all_levels[wavelength][subframe], with its wavelength and distance"
            raise InvalidArgument("hologram", problem, fix)
        return await self._connection.upload(patterns[0])


def _pictures(target: Picture | Sequence[Picture]) -> list[Picture]:
    # A text is a sequence, too, and so is an array; only lists and tuples are several pictures.
    return list(target) if isinstance(target, list | tuple) else [cast("Picture", target)]


def _given_phases(phases: Phase, wavelengths: int, subframes: int) -> list[Phase]:
    """Return a file or an array for each wavelength, in which the subframes are below each other."""
    if is_file(phases):
        return [phases]
    parts = parts_of(numbers_of("initial_phase", phases), wavelengths, subframes)
    return list(parts.reshape(wavelengths, -1, parts.shape[-1]))
