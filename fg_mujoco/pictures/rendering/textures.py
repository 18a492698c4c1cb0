"""Textures, drawn with numpy from a fixed seed: shape (height, width, 3) uint8, to be laid side by side.

Those that take long to draw are drawn once in a process; they are read-only.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...messages import FloatArray

Image = NDArray[np.uint8]

_DIGITS = (  # seven rows of five pixels each, from above
    "01110 10001 10001 10001 10001 10001 01110", "00100 01100 00100 00100 00100 00100 01110",
    "01110 10001 00001 00110 01000 10000 11111", "11111 00010 00100 00010 00001 10001 01110",
    "00010 00110 01010 10010 11111 00010 00010", "11111 10000 11110 00001 00001 10001 01110",
    "00110 01000 10000 11110 10001 10001 01110", "11111 00001 00010 00100 01000 01000 01000",
    "01110 10001 10001 01110 10001 10001 01110", "01110 10001 10001 01111 00001 00010 01100",
)  # fmt: skip


@cache
def asphalt(size: int = 512) -> Image:
    """Return asphalt with seams along the edges and a lighter patch or two, for a tile of 2 m."""
    rng = np.random.default_rng(1)
    grain = (
        rng.normal(0.0, 3.0, (size, size)) + _blurred_noise(rng, size, 3) * 3.0 + _blurred_noise(rng, size, 40) * 2.5
    )
    image = 88.0 + grain
    chips = rng.random((size, size)) > 0.996
    image[chips] += 26.0
    seam = max(size // 170, 1)
    for axis in (0, 1):
        lines = np.moveaxis(image, axis, 0)
        lines[:seam] = 0.45 * lines[:seam] + 78.0
        half = size // 2
        lines[half : half + seam] = 0.7 * lines[half : half + seam] + 42.0
    return _tinted(image, (0.98, 1.0, 1.04))


@cache
def hall_floor(size: int = 256) -> Image:
    """Return a light floor in slabs of 1 m, for a tile of 2 m."""
    rng = np.random.default_rng(2)
    image = 196.0 + _blurred_noise(rng, size, 30) * 4.0 + rng.normal(0.0, 1.5, (size, size))
    half, joint = size // 2, max(size // 128, 1)
    image[:half, :half] += 5.0
    image[half:, half:] += 5.0
    for start in (0, half):
        image[start : start + joint] -= 26.0
        image[:, start : start + joint] -= 26.0
    return _tinted(image, (0.97, 1.0, 0.985))


def wall_face(size: int = 128) -> Image:
    """Return the face of a wall, for a tile of 1 m and its height: white, a blue band, a joint; row 0 is its foot."""
    image = np.full((size, size, 3), (232.0, 230.0, 224.0))
    image[: size // 10] = (70.0, 72.0, 78.0)
    image[int(0.62 * size) : int(0.82 * size)] = (38.0, 92.0, 168.0)
    joint = max(size // 64, 1)
    image[:, :joint] *= 0.72
    return image.clip(0, 255).astype(np.uint8)


def wall_top(size: int = 64) -> Image:
    """Return the top of a wall, for a tile of 1 m: red and white by halves."""
    image = np.full((size, size, 3), (236.0, 234.0, 230.0))
    image[:, : size // 2] = (196.0, 44.0, 38.0)
    return image.astype(np.uint8)


def chequers(size: int = 128) -> Image:
    """Return two by two fields of black and white."""
    row = np.arange(size) // (size // 2)
    fields = (row[:, None] + row[None, :]) % 2
    return np.repeat(np.where(fields[..., None] == 0, 28, 240), 3, axis=2).astype(np.uint8)


def car_number(number: int, colour: tuple[float, ...], width: int = 96, height: int = 160) -> Image:
    """Return a side of the box of a car: its colour, and its number in a white disc; row 0 is its foot."""
    image = np.empty((height, width, 3))
    image[:] = 255.0 * np.array(colour[:3])
    rows, columns = np.mgrid[:height, :width]
    image[(rows - 0.5 * height + 0.5) ** 2 + (columns - 0.5 * width + 0.5) ** 2 < (0.44 * width) ** 2] = 244.0
    digits = [np.array([list(row) for row in _DIGITS[int(digit)].split()]) == "1" for digit in str(number)]
    text = np.concatenate([np.pad(digit, ((0, 0), (0, 1))) for digit in digits], axis=1)[:, :-1]
    size = width // (10 if len(digits) == 1 else 16)  # [px] of a digit's pixel
    ink = text.repeat(size, axis=0).repeat(size, axis=1)
    top, left = (height - ink.shape[0]) // 2, (width - ink.shape[1]) // 2
    image[top : top + ink.shape[0], left : left + ink.shape[1]][ink] = 24.0
    return image[::-1].clip(0, 255).astype(np.uint8)


def _blurred_noise(rng: np.random.Generator, size: int, width: int) -> FloatArray:
    """Return noise of unit spread, smooth over `width` pixels, that goes on at the opposite edge."""
    frequency = np.fft.fftfreq(size)
    low_pass = np.exp(-0.5 * ((frequency[:, None] ** 2 + frequency[None, :] ** 2) * (2.0 * np.pi * width) ** 2))
    noise = np.fft.ifft2(np.fft.fft2(rng.normal(size=(size, size))) * low_pass).real
    result: FloatArray = noise / noise.std()
    return result


def _tinted(grey: FloatArray, tint: tuple[float, float, float]) -> Image:
    image: Image = (grey[..., None] * np.array(tint)).clip(0, 255).astype(np.uint8)
    image.flags.writeable = False
    return image
