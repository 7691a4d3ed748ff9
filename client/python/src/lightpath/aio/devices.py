"""Asynchronous devices: displays in the field, with the kernels that they use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from lightpath import html, names, v1
from lightpath.aio.resource import Resource
from lightpath.presence import if_set
from lightpath.times import utc_if_set

if TYPE_CHECKING:
    import datetime as dt

    from lightpath import words
    from lightpath.aio.connection import Connection


@dataclass(frozen=True)
class InstalledKernel:
    """What a device reported about a kernel."""

    kernel: str
    """Resource name of the kernel."""
    version: int | None
    """Number of the version in use; None: it uses none."""
    format: str
    """Format of the file in use, such as `compact`."""
    digest: str
    generation: int
    """Generation of the manifest that the device accepted last."""
    tried_version: int | None
    """Number of a version that the device tried and gave up; None: it gave up none."""
    message: str
    """Why it gave up, or what else it had to say."""
    self_test_loss: float | None
    """Loss of a test photograph. None: not measured."""
    report_time: dt.datetime | None


class Device(Resource):
    """A device that fetches kernels of a display. `Display.devices` lists them."""

    message: v1.Device

    def __repr__(self) -> str:
        used = ", ".join(f"{names.last_part(each.kernel)} version {each.version or 'none'}" for each in self.kernels)
        return f"<Device {self.name}: {used or 'no report'}>"

    @property
    def group(self) -> str:
        """Group for rollouts; empty: none."""
        return self.message.group

    @property
    def agent(self) -> str:
        """Program of the device and its version, as it reported."""
        return self.message.agent

    @property
    def report_time(self) -> dt.datetime | None:
        """Time of the last report; None: it has not reported yet."""
        return utc_if_set(self.message, "report_time")

    @property
    def kernels(self) -> list[InstalledKernel]:
        """What it uses, by kernel."""
        return [
            InstalledKernel(
                kernel=each.kernel,
                version=if_set(each, "version"),
                format=each.format,
                digest=each.digest,
                generation=each.generation,
                tried_version=if_set(each, "tried_version"),
                message=each.message,
                self_test_loss=if_set(each, "self_test_loss"),
                report_time=utc_if_set(each, "report_time"),
            )
            for each in self.message.kernels
        ]

    async def set_group(self, group: str) -> Device:
        """Put the device into a group for rollouts, or take it out of its group with `""`."""
        self.message = await _set_group(self._connection, self.name, group)
        return self

    async def delete(self) -> None:
        """Forget the device and its reports."""
        request = v1.DeleteDeviceRequest(name=self.name)
        await self._connection.call(self._connection.devices.DeleteDevice, request, repeatable=False)

    def _repr_html_(self) -> str:
        rows: list[tuple[str, object]] = [("group", self.group or "none"), ("agent", self.agent)]
        for each in self.kernels:
            text = f"version {each.version or 'none'}"
            if each.tried_version:
                text += f", gave up version {each.tried_version}: {each.message}"
            rows.append((names.last_part(each.kernel), text))
        return html.table(self.name, rows)


class DisplayDevices(Resource):
    """What a display knows about its devices."""

    async def devices(
        self, *, version: int | Literal["none"] | None = None, kernel: str | Resource = "", group: str | None = None
    ) -> list[Device]:
        """Return the devices of the display, in the order of their ids.

        - `version`: only devices that use this version; `"none"`: only those that use none
        - `kernel`: only devices that reported about this kernel: a `Kernel`, or its id such as `515nm-150mm`
        - `group`: only devices of this group; `""`: only those without one

        ```python
        for device in display.devices(version=2):
            print(device.id, device.report_time)
        ```
        """
        request = v1.ListDevicesRequest(display=self.name, page_size=1000)
        devices: list[Device] = []
        async for page in self._connection.pages(self._connection.devices.ListDevices, request):
            devices += [Device(self._connection, each) for each in page.devices]
        name = self._kernel_name(kernel)
        return [each for each in devices if _uses(each, version, name) and group in {None, each.group}]

    async def set_device_group(self, device_id: str, group: str) -> Device:
        """Put a device into a group for rollouts, or out of its group with `""`. It need not have reported yet."""
        message = await _set_group(self._connection, f"{self.name}/devices/{device_id}", group)
        return Device(self._connection, message)

    async def report_device(
        self,
        device_id: str,
        kernel: str | Resource,
        *,
        version: int | None = None,
        format: words.KernelFormat | None = None,
        digest: str = "",
        generation: int = 0,
        tried_version: int | None = None,
        message: str = "",
        self_test_loss: float | None = None,
        agent: str = "",
    ) -> None:
        """Report which version of a kernel a device uses, as firmware and `lightpath-agent` do.

        - `kernel`: a `Kernel`, or its id such as `515nm-150mm`
        - `version`, `format`, `digest`: the file in use; None: it uses none
        - `generation`: that of the manifest that the device accepted last
        - `tried_version`, `message`: a version that the device gave up, and why. In a rollout it counts as a failure
        - `self_test_loss`: loss of a test photograph
        - `agent`: program of the device and its version
        """
        request = v1.ReportDeviceRequest(
            name=f"{self.name}/devices/{device_id}",
            kernel=names.last_part(self._kernel_name(kernel)),
            version=version,
            format=format or "",
            digest=digest,
            generation=generation,
            tried_version=tried_version,
            message=message,
            self_test_loss=self_test_loss,
            agent=agent,
        )
        await self._connection.call(self._connection.devices.ReportDevice, request)

    def _kernel_name(self, kernel: str | Resource) -> str:
        name = kernel if isinstance(kernel, str) else kernel.name
        return name if not name or "/" in name else f"{self.name}/kernels/{name}"


async def _set_group(connection: Connection, name: str, group: str) -> v1.Device:
    request = v1.SetDeviceGroupRequest(name=name, group=group)
    return await connection.call(connection.devices.SetDeviceGroup, request)


def _uses(device: Device, version: int | Literal["none"] | None, kernel: str) -> bool:
    versions = {each.version or "none" for each in device.kernels if kernel in {"", each.kernel}}
    if version is None:
        return not kernel or bool(versions)
    return version in versions or (version == "none" and not versions)
