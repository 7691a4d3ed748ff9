"""Asynchronous client. It has the same classes and methods as the package itself.

```python
async with lightpath.aio.connect() as lab:
    display = await lab.display("pluto")
    hologram = await display.optimize("photo.png", distance="150mm")
```
"""

from lightpath.aio.connection import Connection
from lightpath.aio.datasets import Dataset
from lightpath.aio.devices import Device
from lightpath.aio.displays import Display
from lightpath.aio.jobs import Job
from lightpath.aio.kernels import Kernel, KernelVersion
from lightpath.aio.lab import Lab, connect
from lightpath.aio.rollouts import Rollout
from lightpath.aio.webhooks import Webhook

__all__ = [
    "Connection",
    "Dataset",
    "Device",
    "Display",
    "Job",
    "Kernel",
    "KernelVersion",
    "Lab",
    "Rollout",
    "Webhook",
    "connect",
]
