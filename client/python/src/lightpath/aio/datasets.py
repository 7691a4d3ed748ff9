"""Asynchronous datasets: pairs of holograms and photographs, from which kernels are learned."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lightpath import html, names, v1, words
from lightpath.aio.connection import PREPARING_TIMEOUT_S
from lightpath.aio.jobs import submit
from lightpath.aio.kernel_choice import of_dataset, start_of_learning
from lightpath.aio.kernels import read_learned
from lightpath.aio.results import read_evaluation, read_preparation
from lightpath.declared import AlignmentPoint
from lightpath.errors import InvalidArgument
from lightpath.hologram import Hologram
from lightpath.options import LearnOptions, Named, Region, SubmitOptions, check, learn_message, region_message
from lightpath.photograph import Photograph
from lightpath.pictures import Phase, Picture, phase_bytes, picture_bytes
from lightpath.signature import with_options
from lightpath.units import show_length

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from typing_extensions import Unpack

    from lightpath.aio.connection import Connection
    from lightpath.aio.kernels import KernelVersion
    from lightpath.progress import Progress
    from lightpath.reports import Evaluation

PAIRS_AT_ONCE = 16
"""Pairs that `add_all` adds with one call. The server measures each before it answers."""


class Dataset:
    """A set of pairs of one display, wavelength and distance. It never changes once it is finalized."""

    def __init__(self, connection: Connection, message: v1.Dataset) -> None:
        self._connection = connection
        self.message = message

    def __repr__(self) -> str:
        state = words.name_of(v1.Dataset.State, self.message.state)
        return f"<Dataset {self.id} of {self.message.display}, {state}, {self.message.pair_count} pairs>"

    @property
    def name(self) -> str:
        """Resource name, `datasets/{id}`."""
        return self.message.name

    @property
    def id(self) -> str:
        """The id in the name."""
        return names.last_part(self.name)

    @property
    def findings(self) -> list[v1.Finding]:
        """Problems of the dataset as a whole, with what to do, when this object was read last (`refresh`).

        Each of the `pairs` has findings of its own.
        """
        return list(self.message.findings)

    async def pairs(self, *, with_findings: bool = False) -> list[v1.Pair]:
        """Read the pairs with their measurements and findings, in the order of their ids.

        `with_findings` leaves out the pairs without findings.
        """
        request = v1.ListPairsRequest(dataset=self.name, page_size=1000, with_findings=with_findings)
        pairs: list[v1.Pair] = []
        async for page in self._connection.pages(self._connection.datasets.ListPairs, request):
            pairs += page.pairs
        return pairs

    async def refresh(self) -> Dataset:
        """Read the dataset again."""
        request = v1.GetDatasetRequest(name=self.name)
        self.message = await self._connection.call(self._connection.datasets.GetDataset, request)
        return self

    async def add(
        self,
        hologram: Hologram | Phase,
        photo: Photograph | Picture,
        *,
        pair_id: str | None = None,
        split: words.Split | None = None,
        black_level: float = 0.0,
        exposure_s: float | None = None,
        camera_gain: float | None = None,
    ) -> Dataset:
        """Add a hologram and its photograph. The same pair again changes nothing.

        - `hologram`: a hologram of this package, a file, grey levels (integers) or a phase in radians (floats)
        - `photo`: a photograph of a simulated display, or a file, image or array of your camera
        - `pair_id`: id of the pair. Default: eight digits of the hologram's digest
        - `split`: use of the pair. Default: finalizing the dataset draws it
        - `black_level`: reading of the camera in the dark, as a fraction of full scale
        - `exposure_s`, `camera_gain`: exposure time [s] and amplification, if known
        """
        pair = v1.Pair(
            id=pair_id or "",
            split=words.number("split", v1.Split, split),
            black_level=black_level,
            exposure_s=exposure_s,
            camera_gain=camera_gain,
        )
        return await self._add([await self._with_files(pair, hologram, photo)])

    async def add_all(
        self,
        pairs: Iterable[tuple[Hologram | Phase, Photograph | Picture]],
        *,
        pair_ids: Iterable[str] | None = None,
        split: words.Split | None = None,
        black_level: float = 0.0,
        exposure_s: float | None = None,
        camera_gain: float | None = None,
    ) -> Dataset:
        """Add holograms, each with its photograph, some at a time. The same pairs again change nothing.

        - `pairs`: a hologram and its photograph, as `add` takes them, for each pair
        - `pair_ids`: an id for each pair. Default: eight digits of each hologram's digest
        - the other arguments are those of `add`, and the same for all pairs
        """
        message = v1.Pair(
            split=words.number("split", v1.Split, split),
            black_level=black_level,
            exposure_s=exposure_s,
            camera_gain=camera_gain,
        )
        ids = None if pair_ids is None else list(pair_ids)
        given = list(pairs)
        if ids is not None and len(ids) != len(given):
            raise InvalidArgument("pair_ids", f"has {len(ids)} ids for {len(given)} pairs", "give one for each pair")
        for start in range(0, len(given), PAIRS_AT_ONCE):
            messages: list[v1.Pair] = []
            for index, (hologram, photo) in enumerate(given[start : start + PAIRS_AT_ONCE], start):
                pair = v1.Pair(id=ids[index] if ids else "")
                pair.MergeFrom(message)
                messages.append(await self._with_files(pair, hologram, photo))
            await self._add(messages)
        return self

    async def _with_files(self, pair: v1.Pair, hologram: Hologram | Phase, photo: Photograph | Picture) -> v1.Pair:
        """Upload the files of a pair, and give it their digests and an id."""
        pair.pattern = await self._pattern_digest(hologram)
        pair.photo = await self._photo_digest(photo)
        # From the hologram's digest, so that the same pair has the same id when a notebook runs again.
        pair.id = pair.id or pair.pattern.removeprefix("sha256-")[:8]
        return pair

    async def _add(self, pairs: list[v1.Pair]) -> Dataset:
        request = v1.AddPairsRequest(dataset=self.name, pairs=pairs)
        call = self._connection.datasets.AddPairs
        answer = await self._connection.call(call, request, timeout_s=PREPARING_TIMEOUT_S)
        self.message = answer.dataset
        return self

    async def _pattern_digest(self, hologram: Hologram | Phase) -> str:
        if not isinstance(hologram, Hologram):
            return await self._connection.upload(phase_bytes("hologram", hologram))
        for i, wavelength_m in enumerate(hologram.wavelengths_m):
            # The server compares wavelengths in picometres.
            if round(wavelength_m * 1e12) == round(self.message.wavelength_m * 1e12):
                return await self._digest_of_part(hologram, i)
        shown = show_length(self.message.wavelength_m)
        raise InvalidArgument("hologram", f"has no part for {shown}", "optimize it for the dataset's wavelength")

    async def _digest_of_part(self, hologram: Hologram, wavelength: int) -> str:
        patterns = hologram.levels_png[wavelength]
        if len(patterns) > 1:
            fix = "add each of all_levels[wavelength][subframe] with its own photograph"
            raise InvalidArgument("hologram", f"has {len(patterns)} subframes", fix)
        return await self._connection.upload(patterns[0])

    async def _photo_digest(self, photo: Photograph | Picture) -> str:
        content = photo.file if isinstance(photo, Photograph) else picture_bytes("photo", photo)
        return await self._connection.upload(content)

    @with_options(SubmitOptions)
    async def align(
        self,
        *,
        dots: Photograph | Picture | None = None,
        points: Sequence[AlignmentPoint | tuple[float, float, float, float]] | None = None,
        photo_size_px: tuple[int, int] | None = None,
        progress: Progress = True,
        **options: Unpack[SubmitOptions],
    ) -> v1.PrepareDatasetResult:
        """Find where the camera sees the display's pixels.

        `dots` is a photograph of the displayed calibration target. `points` are at least four points of your own,
        `AlignmentPoint` or tuples (x and y on the display, x and y in the photograph), with the width and height of the
        photographs. Without both, the pairs themselves refine the alignment.
        """
        check(options, SubmitOptions)
        step = v1.PrepareDataset.Align(pairs=v1.PrepareDataset.Align.ByPairs())
        if dots is not None:
            step = v1.PrepareDataset.Align(dots_photo=await self._photo_digest(dots))
        elif points is not None:
            width_px, height_px = photo_size_px or (0, 0)
            messages = [
                (each if isinstance(each, AlignmentPoint) else AlignmentPoint(*each)).message() for each in points
            ]
            own = v1.AlignmentPoints(photo_width_px=width_px, photo_height_px=height_px, points=messages)
            step = v1.PrepareDataset.Align(points=own)
        return await self._prepare(v1.PrepareDataset(dataset=self.name, align=step), options, progress)

    @with_options(SubmitOptions)
    async def finalize(
        self,
        *,
        validation_fraction: float | None = None,
        test_fraction: float | None = None,
        seed: int = 0,
        keep_alignment: bool = False,
        progress: Progress = True,
        **options: Unpack[SubmitOptions],
    ) -> v1.PrepareDatasetResult:
        """Draw which pairs are held out, and close the dataset for good.

        By default a fifth of the pairs is held out for validation, and a fifth for the test.
        """
        check(options, SubmitOptions)
        step = v1.PrepareDataset.Finalize(
            validation_fraction=validation_fraction,
            test_fraction=test_fraction,
            seed=seed,
            keep_alignment=keep_alignment,
        )
        return await self._prepare(v1.PrepareDataset(dataset=self.name, finalize=step), options, progress)

    async def _prepare(
        self, message: v1.PrepareDataset, options: SubmitOptions, progress: Progress
    ) -> v1.PrepareDatasetResult:
        job = await submit(self._connection, v1.JobSpec(prepare_dataset=message), options, read_preparation)
        result = await job.result(progress=progress)
        await self.refresh()
        return result

    @with_options(LearnOptions)
    async def learn(self, *, progress: Progress = True, **options: Unpack[LearnOptions]) -> KernelVersion:
        """Learn the display from this dataset, and return the new version of its kernel.

        Nothing uses the version before `promote`. `Lab.learn` learns from several distances at once.
        """
        return (await learn(self._connection, [self.name], progress, options))[0]

    @with_options(SubmitOptions)
    async def evaluate(
        self,
        kernel: str | int | Named = "active",
        *,
        region: Region | None = None,
        progress: Progress = True,
        **options: Unpack[SubmitOptions],
    ) -> Evaluation:
        """Measure how well a kernel predicts these photographs.

        `kernel` is `active`, `ideal`, an alias, or a version: itself, its name or its number.
        """
        check(options, SubmitOptions)
        choice = await of_dataset(self._connection, kernel, self.message)
        message = v1.EvaluateKernel(dataset=self.name, kernel=choice, region=region_message(region))
        job = await submit(self._connection, v1.JobSpec(evaluate_kernel=message), options, read_evaluation)
        return await job.result(progress=progress)

    async def delete(self) -> None:
        """Delete the dataset with its pairs, for good. Kernels learned from it are kept."""
        request = v1.DeleteDatasetRequest(name=self.name)
        await self._connection.call(self._connection.datasets.DeleteDataset, request, repeatable=False)

    def _repr_html_(self) -> str:
        message = self.message
        optics = f"{show_length(message.wavelength_m)} at {show_length(message.place.distance_m)}"
        rows: list[tuple[str, object]] = [
            ("display", f"{message.display}, {optics}"),
            ("state", words.name_of(v1.Dataset.State, message.state)),
            ("pairs", message.pair_count),
        ]
        rows += [("finding", finding.message) for finding in message.findings]
        return html.table(self.name, rows)


async def learn(
    connection: Connection, datasets: Sequence[str], progress: Progress, options: LearnOptions
) -> list[KernelVersion]:
    """Learn one model from datasets, and return a version for each of them."""
    check(options, LearnOptions)
    message = learn_message(datasets, options)
    if "start_version" in options:
        message.start_version = await start_of_learning(connection, options["start_version"], datasets[0])
    job = await submit(connection, v1.JobSpec(learn_kernel=message), options, read_learned)
    return await job.result(progress=progress)
