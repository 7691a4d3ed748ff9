"""Asynchronous entry: the server of a lab, with its displays, datasets, kernels and jobs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lightpath import names, v1, words
from lightpath.address import address
from lightpath.aio.connection import Connection
from lightpath.aio.datasets import Dataset, learn
from lightpath.aio.displays import Display
from lightpath.aio.jobs import Job, job_name
from lightpath.aio.kernels import Kernel, KernelVersion, list_kernels, read_learned
from lightpath.aio.operations import Operations
from lightpath.aio.results import read_evaluation, read_hologram, read_photograph, read_preparation, read_report
from lightpath.declared import AllOrders, OrderFilter, SimulatedBench
from lightpath.errors import InvalidArgument, ProtocolError
from lightpath.options import LearnOptions, Region, check_type, region_message
from lightpath.photograph import Photograph, PhotoScore
from lightpath.pictures import Picture, picture_bytes
from lightpath.signature import with_options
from lightpath.units import Length, metres, resolution_px, several

if TYPE_CHECKING:
    import os
    from collections.abc import Awaitable, Callable, Sequence
    from types import TracebackType

    import numpy.typing as npt
    from typing_extensions import Self, Unpack

    from lightpath.progress import Progress


def connect(
    url: str | None = None,
    *,
    token: str | None = None,
    token_file: str | os.PathLike[str] | None = None,
    ca_file: str | os.PathLike[str] | None = None,
    client_certificate: tuple[str | os.PathLike[str], str | os.PathLike[str]] | None = None,
    token_over_http: bool | None = None,
) -> Lab:
    """Return the server at `url`, by default `LIGHTPATH_SERVER` or http://127.0.0.1:7070. The first call connects.

    - `token`, `token_file`: the access token, or a file with it, for a server that requires one. Default:
      `LIGHTPATH_TOKEN`, or the file that `LIGHTPATH_TOKEN_FILE` names
    - `ca_file`: PEM file of the authority that signed the server's certificate, if the system does not trust it.
      Default: `LIGHTPATH_CA_FILE`
    - `client_certificate`: PEM files of certificate and key. Default: `LIGHTPATH_CLIENT_CERT`, `LIGHTPATH_CLIENT_KEY`
    - `token_over_http`: send the token unencrypted, over http://, to another machine, if nobody else is on the network.
      Default: whether `LIGHTPATH_TOKEN_OVER_HTTP` is `true`
    """
    return Lab(
        Connection(address(url, token, token_file, ca_file, client_certificate, token_over_http=token_over_http))
    )


class Lab(Operations):
    """A Lightpath server. Use it in a `with` block, which closes the connection at its end."""

    def __repr__(self) -> str:
        return f"<Lab {self.connection.url}>"

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connection. Jobs go on."""
        await self.connection.close()

    async def create_display(
        self,
        display_id: str,
        *,
        resolution: str | tuple[int, int],
        pixel_pitch: Length,
        wavelength: Length | Sequence[Length],
        bit_depth: int | None = None,
        phase_response_rad: Sequence[float] | npt.NDArray[Any] | None = None,
        carrier: words.Carrier | None = None,
        orders: AllOrders | OrderFilter | None = None,
        camera_fill_factor: float | None = None,
        notes: str = "",
        simulated: int | SimulatedBench | None = None,
    ) -> Display:
        """Declare a display. A repeated request with the same properties returns the existing display.

        - `resolution`: columns and rows, such as `"1920x1080"`
        - `pixel_pitch`, `wavelength`: metres, or text such as `"8um"` and `"515nm"`; several wavelengths for colour
        - `bit_depth`: bits of a grey level. Default: 8
        - `phase_response_rad`: phase of each grey level [rad], such as `numpy.loadtxt("response.txt")`. Default:
          linear, one turn
        - `carrier`: grating that moves the image away from the undiffracted light
        - `orders`: diffraction orders that reach the image: `AllOrders()`, or `OrderFilter(width=0.8)`. Default: the
          whole first order, and nothing else
        - `camera_fill_factor`: side of the part of a pixel in which the camera sees light, in pixel pitches, 0.1 to 1.
          Default: 1, all of the pixel
        - `simulated`: a seed, or a `SimulatedBench(strength=0.5, …)`, for a display that exists only as a simulation
        """
        for name, value, kind in (("bit_depth", bit_depth, "int"), ("camera_fill_factor", camera_fill_factor, "float")):
            if value is not None:
                check_type(name, value, kind)
        width_px, height_px = resolution_px(resolution)
        bench = SimulatedBench(seed=simulated) if isinstance(simulated, int) else simulated
        message = v1.Display(
            name=names.with_collection("displays", display_id),
            modulator=v1.Modulator(
                width_px=width_px,
                height_px=height_px,
                pixel_pitch_x_m=metres("pixel_pitch", pixel_pitch),
                bit_depth=bit_depth,
                phase=_response(phase_response_rad) if phase_response_rad is not None else None,
            ),
            wavelengths_m=[metres("wavelength", each) for each in several(wavelength)],
            carrier=words.number("carrier", v1.Carrier, carrier),
            notes=notes,
            all_orders=orders.message() if isinstance(orders, AllOrders) else None,
            order_filter=orders.message() if isinstance(orders, OrderFilter) else None,
            camera_fill_factor=camera_fill_factor,
            simulated_bench=None if bench is None else bench.message(),
        )
        request = v1.CreateDisplayRequest(display=message)
        return Display(self.connection, await self.connection.call(self.connection.displays.CreateDisplay, request))

    async def display(self, display_id: str) -> Display:
        """Return a display."""
        request = v1.GetDisplayRequest(name=names.with_collection("displays", display_id))
        return Display(self.connection, await self.connection.call(self.connection.displays.GetDisplay, request))

    async def displays(self) -> list[Display]:
        """Return all displays, in the order of their ids."""
        request, displays = v1.ListDisplaysRequest(page_size=1000), []
        async for page in self.connection.pages(self.connection.displays.ListDisplays, request):
            displays += [Display(self.connection, each) for each in page.displays]
        return displays

    async def rigs(self) -> list[v1.Rig]:
        """Return the rigs at the benches that are connected to the server, in the order of their displays."""
        answer: v1.ListRigsResponse = await self.connection.call(self.connection.rigs.ListRigs, v1.ListRigsRequest())
        return list(answer.rigs)

    async def dataset(self, dataset_id: str) -> Dataset:
        """Return a dataset. `Display.create_dataset` creates one."""
        request = v1.GetDatasetRequest(name=names.with_collection("datasets", dataset_id))
        return Dataset(self.connection, await self.connection.call(self.connection.datasets.GetDataset, request))

    async def datasets(self) -> list[Dataset]:
        """Return all datasets, in the order of their ids."""
        request, datasets = v1.ListDatasetsRequest(page_size=1000), []
        async for page in self.connection.pages(self.connection.datasets.ListDatasets, request):
            datasets += [Dataset(self.connection, each) for each in page.datasets]
        return datasets

    async def kernels(self) -> list[Kernel]:
        """Return the kernels of all displays, in the order of their names."""
        return await list_kernels(self.connection, "")

    @with_options(LearnOptions)
    async def learn(
        self, datasets: Sequence[Dataset | str], *, progress: Progress = True, **options: Unpack[LearnOptions]
    ) -> list[KernelVersion]:
        """Learn one model from datasets of several distances, and return a version for each. See `Dataset.learn`."""
        found = [
            each.name if isinstance(each, Dataset) else names.with_collection("datasets", each) for each in datasets
        ]
        return await learn(self.connection, found, progress, options)

    async def score(
        self,
        photo: Photograph | Picture,
        target: Picture,
        *,
        photo_encoding: words.Encoding | None = None,
        target_encoding: words.Encoding | None = None,
        region: Region | None = None,
    ) -> PhotoScore:
        """Measure how well a photograph shows a target. It needs no display and no dataset.

        The target is found wherever the photograph shows it. `photo_encoding` is `linear` by default, `target_encoding`
        is `srgb`. `region` is the part of the target that counts: x, y, width, height [px]. Raises `InvalidRequest` if
        the photograph does not show the target.
        """
        request = v1.ScorePhotoRequest(
            photo=await self.connection.upload(
                photo.file if isinstance(photo, Photograph) else picture_bytes("photo", photo)
            ),
            target=await self.connection.upload(picture_bytes("target", target)),
            photo_encoding=words.number("photo_encoding", v1.Encoding, photo_encoding),
            target_encoding=words.number("target_encoding", v1.Encoding, target_encoding),
            region=region_message(region),
        )
        score = await self.connection.call(self.connection.photos.ScorePhoto, request)
        aligned = await self.connection.download(score.aligned)
        return PhotoScore(score, aligned, await self.connection.download(score.error))

    async def job(self, job_id: str) -> Job[Any]:
        """Return a job, for example one that an earlier program submitted."""
        request = v1.GetJobRequest(name=job_name(job_id))
        return Job(self.connection, await self.connection.call(self.connection.jobs.GetJob, request), _read_result)

    async def jobs(
        self,
        *,
        state: words.State | None = None,
        display: Display | str = "",
        batch: str = "",
        limit: int = 50,
    ) -> list[Job[Any]]:
        """Return jobs, the newest first."""
        if limit < 1:
            raise InvalidArgument("limit", f"is {limit}", "give a number above 0")
        name = display.name if isinstance(display, Display) else display and names.with_collection("displays", display)
        request = v1.ListJobsRequest(
            state=words.number("state", v1.Job.State, state),
            display=name,
            batch=batch,
            page_size=min(limit, 1000),
        )
        jobs: list[Job[Any]] = []
        async for page in self.connection.pages(self.connection.jobs.ListJobs, request):
            jobs += [Job(self.connection, each, _read_result) for each in page.jobs]
            if len(jobs) >= limit:
                break
        return jobs[:limit]


def _response(phase_rad: Sequence[float] | npt.NDArray[Any]) -> v1.PhaseModulator:
    """Return the message of a measured response. The server checks that the numbers can be radians."""
    phases = np.asarray(phase_rad, dtype=np.float64)
    if phases.ndim != 1:
        problem, fix = f"has the shape {phases.shape}", "give one phase for each grey level, such as table[:, 1]"
        raise InvalidArgument("phase_response_rad", problem, fix)
    return v1.PhaseModulator(response_rad=phases.tolist())


_READERS: dict[str, Callable[[Connection, v1.Job], Awaitable[Any]]] = {
    "optimize_hologram": read_hologram,
    "learn_kernel": read_learned,
    "simulate_capture": read_photograph,
    "evaluate_kernel": read_evaluation,
    "report_kernel": read_report,
    "prepare_dataset": read_preparation,
}
_READ_AS_MESSAGES = {"verify_hologram", "suggest_holograms", "capture_photos"}


async def _read_result(connection: Connection, job: v1.Job) -> Any:
    """Return what a job of any kind made."""
    kind = job.result.WhichOneof("kind") or ""
    if kind in _READ_AS_MESSAGES:
        return getattr(job.result, kind)
    if kind not in _READERS:
        raise ProtocolError(f"{job.name} has a result that this package does not know")
    return await _READERS[kind](connection, job)
