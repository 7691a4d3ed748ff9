"""Reports on kernels, and how well kernels predict photographs."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lightpath import html, v1, words

if TYPE_CHECKING:
    import os

    import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Report:
    """What a kernel version learned of its display, for people."""

    page: bytes = field(repr=False)
    """One HTML file with the whole report."""
    arrays: dict[str, npt.NDArray[Any]] = field(repr=False)
    """The numbers of the figures."""
    figures: list[tuple[str, bytes]] = field(repr=False)
    """Titles and files (PNG or SVG) of the figures, in their order."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the HTML file."""
        Path(path).write_bytes(self.page)

    def _repr_html_(self) -> str:
        # The frame keeps the styles of the report away from the notebook.
        page = escape(self.page.decode("utf-8"))
        return f'<iframe srcdoc="{page}" sandbox width="100%" height="600" style="border:1px solid #ccc"></iframe>'


@dataclass(frozen=True, eq=False)
class Evaluation:
    """How well a kernel predicts each pair of a dataset."""

    dataset: str
    kernel: str
    """Resource name of the version, or `ideal`."""
    result: v1.EvaluateKernelResult = field(repr=False)

    def __repr__(self) -> str:
        return f"<Evaluation of {self.kernel} on {self.dataset}: loss {self.loss():.3g} of the test pairs>"

    def loss(self, split: words.Split = "test") -> float:
        """Return the mean loss of the pairs of a split; NaN if there are none."""
        number = words.number("split", v1.Split, split)
        losses = [pair.loss for pair in self.result.pairs if pair.split == number]
        return sum(losses) / len(losses) if losses else float("nan")

    @property
    def losses(self) -> dict[str, float]:
        """Loss of each pair in the region of interest."""
        return {pair.pair: pair.loss for pair in self.result.pairs}

    def _repr_html_(self) -> str:
        rows = [
            (
                pair.pair,
                words.name_of(v1.Split, pair.split),
                f"{pair.loss:.3g}",
                f"{pair.loss_full_frame:.3g}",
            )
            for pair in self.result.pairs
        ]
        title = f"Kernel {self.kernel} on {self.dataset}"
        return html.grid(title, ["pair", "split", "loss", "loss over the full frame"], rows)
