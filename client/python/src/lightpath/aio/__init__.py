"""Asynchronous client. It has the same classes and methods as the package itself.

```python
async with lightpath.aio.connect() as lab:
    display = await lab.display("pluto")
    hologram = await display.optimize("photo.png", distance="150mm")
```
"""

from lightpath.aio.connection import Connection
from lightpath.aio.datasets import Dataset
from lightpath.aio.displays import Display
from lightpath.aio.jobs import Job
from lightpath.aio.kernels import Kernel, KernelVersion
from lightpath.aio.lab import Lab, connect

__all__ = ["Connection", "Dataset", "Display", "Job", "Kernel", "KernelVersion", "Lab", "connect"]
