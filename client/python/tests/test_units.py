"""Lengths as text and as numbers."""

from __future__ import annotations

import pytest

from lightpath import InvalidArgument
from lightpath.names import last_part, with_collection
from lightpath.units import metres, resolution_px, show_length


@pytest.mark.parametrize(
    ("field", "length", "length_m"),
    [
        ("distance", "150mm", 0.15),
        ("distance", "0.15m", 0.15),
        ("distance", "0.15", 0.15),
        ("distance", 0.15, 0.15),
        ("distance", "15 cm", 0.15),
        ("distance", "-12.5mm", -0.0125),
        ("distance", "1.5e-1m", 0.15),
        ("distance", "+.5m", 0.5),
        ("pixel_pitch", "3.74µm", 3.74e-6),
        ("wavelength", "515nm", 515e-9),
        ("wavelength", "632.8nm", 632.8e-9),
    ],
)
def test_lengths_are_the_nearest_float(field: str, length: float | str, length_m: float) -> None:
    assert metres(field, length) == length_m


@pytest.mark.parametrize(
    ("field", "length", "problem"),
    [
        ("distance", "far", 'distance is "far": give a number with a unit, such as "150mm"'),
        ("distance", "15inch", 'unknown unit "inch": use m, cm, mm'),
        ("distance", 150, 'distance is 150 without a unit, which is 150 m: write "150mm"'),
        ("distance", "150", 'write "150mm"'),
        ("distance", float("nan"), "distance is nan: give a finite number"),
        ("pixel_pitch", 8, 'write "8um"'),
        ("wavelength", "515", 'write "515nm"'),
        ("wavelength", "650e-3", 'write "0.65um"'),
        ("wavelength", "650e-6um", "a power of ten and a unit, which make 6.5e-10 m: write it without the power"),
    ],
)
def test_bad_lengths_are_refused_with_the_fix(field: str, length: float | str, problem: str) -> None:
    with pytest.raises(InvalidArgument, match=problem) as caught:
        metres(field, length)
    assert caught.value.field == field


def test_lengths_names_and_resolutions_are_written_as_people_and_the_server_do() -> None:
    assert [show_length(x) for x in (0.15, 8e-6, 515e-9, -0.0125, 0, 2.0)] == [
        "150 mm", "8 µm", "515 nm", "-12.5 mm", "0 m", "2 m",
    ]  # fmt: skip
    assert with_collection("jobs", "jobs-1") == "jobs/jobs-1"
    assert with_collection("jobs", "jobs/1") == "jobs/1"
    assert last_part("displays/a/kernels/k/versions/3") == "3"
    assert resolution_px("1920x1080") == resolution_px((1920, 1080)) == (1920, 1080)
    with pytest.raises(InvalidArgument, match="1920x1080"):
        resolution_px("1920")
