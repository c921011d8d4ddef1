"""Road profiles: random ones by their spectral density, or measured ones, under wheels that follow each other.

Random profiles have the spectral density of [ISO8608], G(n) = G(n0) (n / n0)^-2 with n0 = 0.1 cycles per metre. They are sums of
sines of random phase, so that velocities and accelerations are exact. A wheel behind another one meets the same profile
later. Two tracks are coherent as on an isotropic road: the coherence at a width b is x K1(x) with x = 2 pi n b
[Kamash1978].
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import k1

from paramreduce_cli.excitation.input_signals import Harmonics

ROUGHNESS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
"""Spectral densities G(n0) of the classes, geometric means, m^3."""
_REFERENCE = 0.1
"""Spatial frequency n0 that the classes refer to, 1/m."""
_LONGEST, _SHORTEST = 100.0, 0.2
"""Wavelengths of the longest and the shortest wave, m."""
_WAVES = 200


def draw_road(
    roughness: float,
    speed: float,
    distances: Sequence[float],
    width: float | None,
    rng: np.random.Generator,
) -> Harmonics:
    """Return the heights of a random road under all wheels.

    Args:
        roughness: Spectral density G(n0), m^3.
        speed: Speed of the vehicle, m/s.
        distances: Distances of the wheels of a track behind the first wheel, m.
        width: Distance between two tracks, m; None for one track.
        rng: Random generator.

    Returns:
        Heights of the wheels of the first track, then those of the second, m.
    """
    edges = np.geomspace(1 / _LONGEST, 1 / _SHORTEST, _WAVES + 1)
    n = np.sqrt(edges[:-1] * edges[1:])
    amplitudes = np.sqrt(2 * roughness * (n / _REFERENCE) ** -2 * np.diff(edges))
    first, second = rng.uniform(0, 2 * np.pi, size=(2, n.size))
    tracks = [amplitudes * np.exp(1j * first)]
    if width is not None:
        x = 2 * np.pi * n * width
        coherence = x * k1(x)
        other = np.sqrt(1 - coherence**2) * np.exp(1j * second)
        tracks.append(amplitudes * (coherence * np.exp(1j * first) + other))
    delays = np.exp(-2j * np.pi * np.outer(distances, n))
    waves = np.vstack([track * delays for track in tracks])
    return Harmonics(2 * np.pi * n * speed, waves)
