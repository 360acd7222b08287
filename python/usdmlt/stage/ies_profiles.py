"""IES photometric profiles: files of ANSI/IESNA LM-63 (1986 to 2019), and UsdLux's use of them.

Decisions where UsdLux leaves them open (those of OpenUSD's hdEmbree, November 2026):

* The file's vertical angle 0 is the light's -z, its horizontal angle 0 the light's +x as light
  comes from there.
* Without ``ies:normalize`` the radiance is multiplied by the file's candelas as bare numbers, lamp
  and ballast factors applied. A SphereLight with ``normalize`` and intensity 4 then has just the
  file's intensities, in candela for lengths in metres.
* With ``ies:normalize`` it is divided by the mean over the sphere, so that a SphereLight keeps its
  power; by that over the hemisphere for files that end at 90 degrees.
"""

from __future__ import annotations

import math

import numpy as np

from usdmlt.scene import IesProfile

HEMISPHERE_DEGREES = 90.5  # files that end here are of a hemisphere


class Malformed(Exception):
    """A file that is no photometric profile; the message says why."""


def parse_ies(text: str) -> IesProfile:
    """Type C photometry in candela, from the text of a file. Raises :class:`Malformed`.

    Planes that the file leaves out by symmetry are there in the result: ``horizontal_degrees`` goes
    from 0 to 360, or is one angle for a profile that is the same all around.
    """
    lines = text.splitlines()
    tilt = next((i for i, line in enumerate(lines) if line.strip().startswith("TILT=")), None)
    if tilt is None:
        raise Malformed("there is no line TILT=")
    numbers = _Numbers(" ".join(lines[tilt + 1 :]).replace(",", " ").split())
    if lines[tilt].split("=", 1)[1].strip() == "INCLUDE":
        numbers.take(1)  # how the lamp is mounted
        numbers.take(2 * numbers.count())  # angles and factors
    _, _, multiplier = numbers.take(3)
    vertical_count, horizontal_count = numbers.count(), numbers.count()
    photometry, *_ = numbers.take(5)  # units, width, length, height
    ballast, lamp, _ = numbers.take(3)
    if photometry != 1:
        raise Malformed(f"photometry of type {'?CBA'[int(photometry) % 4]}, not C")
    vertical = numbers.take(vertical_count)
    horizontal = numbers.take(horizontal_count)
    candela = numbers.take(vertical_count * horizontal_count)
    candela = candela.reshape(horizontal_count, vertical_count) * multiplier * ballast
    if lamp > 0:  # since 2002 "future use", mostly 1
        candela = candela * lamp
    if (np.diff(vertical) <= 0).any() or (np.diff(horizontal) <= 0).any():
        raise Malformed("its angles do not ascend")
    if not (np.isfinite(candela).all() and (candela >= 0).all()):
        raise Malformed("its intensities are not all positive")
    return IesProfile(vertical, *_all_around(horizontal, candela))


class _Numbers:
    """The numbers of a file, in order."""

    def __init__(self, words: list[str]):
        self._words = words
        self._next = 0

    def take(self, count: int) -> np.ndarray:
        words = self._words[self._next : self._next + count]
        if len(words) < count:
            raise Malformed("it ends too early")
        self._next += count
        try:
            return np.array([float(word) for word in words])
        except ValueError as error:
            raise Malformed(str(error)) from None

    def count(self) -> int:
        number = float(self.take(1)[0])
        if not (number.is_integer() and 1 <= number <= 100_000):
            raise Malformed(f"{number:g} is no number of angles")
        return int(number)


def _all_around(horizontal: np.ndarray, candela: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The planes from 0 to 360 degrees, mirrored as LM-63's type C has it."""
    first, last = horizontal[0], horizontal[-1]
    if len(horizontal) == 1:
        return np.zeros(1), candela
    if first == 90 and last == 270:  # symmetric about the plane of 90 degrees
        angles = np.concatenate([horizontal, 540 - horizontal[-2:0:-1]]) % 360
        values = np.concatenate([candela, candela[-2:0:-1]])
        order = np.argsort(angles)
        return _closed(angles[order], values[order])
    if first != 0:
        raise Malformed(f"its planes start at {first:g} degrees")
    if last == 90:
        horizontal = np.concatenate([horizontal, 180 - horizontal[-2::-1]])
        candela = np.concatenate([candela, candela[-2::-1]])
        last = 180
    if last == 180:
        horizontal = np.concatenate([horizontal, 360 - horizontal[-2::-1]])
        candela = np.concatenate([candela, candela[-2::-1]])
    return _closed(horizontal, candela)


def _closed(angles: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From 0 to 360 degrees inclusive; between the last plane and the first it is linear too."""
    if angles[0] > 0:
        fraction = angles[0] / (angles[0] + 360 - angles[-1])
        start = values[0] * (1 - fraction) + values[-1] * fraction
        angles, values = np.append(0, angles), np.concatenate([start[None], values])
    if angles[-1] < 360:
        angles, values = np.append(angles, 360), np.concatenate([values, values[:1]])
    return angles, values


def mean_factor(profile: IesProfile) -> float:
    """The mean over the sphere, or over the hemisphere where the profile ends there.

    ∫ (a + b θ) sinθ dθ = [b sinθ - (a + b θ) cosθ] between the vertical angles, where the profile
    is linear; between planes it is linear too.
    """
    theta = np.radians(profile.vertical_degrees)
    low, high = theta[:-1], theta[1:]
    slope = np.diff(profile.factors, axis=1) / (high - low)
    start = profile.factors[:, :-1]
    upper = slope * np.sin(high) - (start + slope * (high - low)) * np.cos(high)
    lower = slope * np.sin(low) - start * np.cos(low)
    by_plane = (upper - lower).sum(axis=1)
    if len(by_plane) == 1:
        around = 2 * math.pi * by_plane[0]
    else:
        phi = np.radians(profile.horizontal_degrees)
        around = float(np.sum(np.diff(phi) * (by_plane[1:] + by_plane[:-1]) / 2))
    span = profile.vertical_degrees[-1] - profile.vertical_degrees[0]
    return around / (2 * math.pi if span <= HEMISPHERE_DEGREES else 4 * math.pi)


def shaped(profile: IesProfile, angle_scale: float, normalize: bool) -> IesProfile:
    """The profile as UsdLux's ``ies:angleScale`` and ``ies:normalize`` change it.

    With θ the light's vertical angle, the profile is read at θ / scale for scale > 0, and at
    (θ - π) / -scale + π for scale < 0; 0 leaves it as it is. The file's own angles go the other
    way.
    """
    factors, degrees = profile.factors, profile.vertical_degrees
    if normalize:
        mean = mean_factor(profile)
        factors = factors / mean if mean > 0 else factors
    if angle_scale > 0:
        degrees = degrees * angle_scale
    elif angle_scale < 0:
        degrees = (degrees - 180) * -angle_scale + 180
    return IesProfile(degrees, profile.horizontal_degrees, factors)
