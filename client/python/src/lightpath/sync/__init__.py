# Written by client/python/generate from ../aio/__init__.py. Change that file, then run the script.
"""Blocking client. It has the same classes and methods as the package itself.

```python
with lightpath.connect() as lab:
    display = lab.display("pluto")
    hologram = display.optimize("photo.png", distance="150mm")
```
"""

from lightpath.sync.connection import Connection
from lightpath.sync.datasets import Dataset
from lightpath.sync.displays import Display
from lightpath.sync.jobs import Job
from lightpath.sync.kernels import Kernel, KernelVersion
from lightpath.sync.lab import Lab, connect

__all__ = ["Connection", "Dataset", "Display", "Job", "Kernel", "KernelVersion", "Lab", "connect"]
