"""The surface of the sea for pictures: two periodic patches of a wind-sea spectrum.

They are functions of weather, seed and time alone. Waves are linear (Airy): each wave number has a random amplitude and
phase and rotates by the deep-water dispersion relation. An inverse FFT sums them (Tessendorf, "Simulating Ocean Water",
2001). `swell` (160 m) holds the waves of `wave_height_m` (significant, four standard deviations) and `wave_period_s`,
with a JONSWAP shape. `ripple` (23 m) holds the short waves of the wind, with half the mean-square slope of Cox and Munk
(1954): 0.003 + 0.00512 U. Waves travel downwind. Whitecaps cover 3.84e-6 U^3.41 of the sea (Monahan and
O'Muircheartaigh, 1980), on the sharpest crests.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from math import pi, radians

import numpy as np
import numpy.typing as npt

from lingjing.mission.instance import Weather

GRAVITY = 9.81
"""Gravity, m/s^2. `engines.sea` has the exact value; a change here would change pictures."""

SIZE = 256
"""Samples along a side of a patch (chosen)."""

SWELL_M = 160.0
"""Side of the patch of the swell, metres (chosen)."""

RIPPLE_M = 23.0
"""Side of the patch of the ripples, metres (chosen)."""
SPLIT = 2.0 * pi / 3.0
"""Wave number that separates the two patches, rad/m (chosen)."""

WaveField = npt.NDArray[np.float64]
Spectrum = npt.NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class SeaSurface:
    """One patch at one time; rows go north, columns go east."""

    length_m: float
    """Side of the patch, metres."""
    height: WaveField
    """Height, metres."""
    slope_x: WaveField
    """Slope towards east."""
    slope_y: WaveField
    """Slope towards north."""
    foam: WaveField
    """Foam, 0..1."""

    def at(self, east: WaveField, north: WaveField) -> tuple[WaveField, WaveField, WaveField]:
        """Return height and slopes at points, from the nearest sample."""
        step = self.length_m / SIZE
        column = np.floor(east / step).astype(np.int64) % SIZE
        row = np.floor(north / step).astype(np.int64) % SIZE
        return self.height[row, column], self.slope_x[row, column], self.slope_y[row, column]

    def packed(self, extra: npt.NDArray[np.uint8] | None = None) -> tuple[npt.NDArray[np.uint8], tuple[float, float]]:
        """Return (SIZE, SIZE, 4) bytes of height, slopes and foam, with the scales (height, slope) of a full
        deflection.

        `extra` replaces foam.
        """
        tall = max(float(np.abs(self.height).max()), 1e-3)
        steep = max(float(np.abs(self.slope_x).max()), float(np.abs(self.slope_y).max()), 1e-3)
        layers = [self.height / tall, self.slope_x / steep, self.slope_y / steep, self.foam * 2.0 - 1.0]
        pixels = np.rint(127.5 + 127.5 * np.stack(layers, axis=-1)).astype(np.uint8)
        if extra is not None:
            pixels[..., 3] = extra
        return pixels, (tall, steep)


@dataclass(frozen=True, slots=True)
class _Waves:
    length_m: float
    """Side of the patch, metres."""
    kx: WaveField
    """Wave numbers towards east, rad/m."""
    ky: WaveField
    """Wave numbers towards north, rad/m."""
    omega: WaveField
    """Angular frequencies, rad/s."""
    onward: Spectrum
    """Amplitudes of waves with positive kx."""
    backward: Spectrum
    """Amplitudes of waves with negative kx."""


class Ocean:
    """The waves of one episode. `surfaces(t)` is deterministic; only the result of the last time is kept."""

    def __init__(self, weather: Weather, seed: int) -> None:
        digest = hashlib.sha256(f"{seed}/camera/ocean".encode()).digest()
        chance = np.random.default_rng(int.from_bytes(digest[:16], "big"))
        self._swell = _swell(weather, chance)
        self._ripple = _ripple(weather, chance)
        self._cover = min(0.06, 3.84e-6 * weather.wind_mps**3.41)
        self._last: tuple[float, tuple[SeaSurface, SeaSurface]] | None = None

    def surfaces(self, time_s: float) -> tuple[SeaSurface, SeaSurface]:
        """Return (swell, ripple) at a time in seconds."""
        if self._last is None or self._last[0] != time_s:
            swell, ripple = self._evaluate(self._swell, time_s, True), self._evaluate(self._ripple, time_s, False)
            self._last = time_s, (swell, ripple)
        return self._last[1]

    def _evaluate(self, waves: _Waves, time_s: float, crests: bool) -> SeaSurface:
        turn = np.exp(-1j * waves.omega * time_s)
        spectrum = waves.onward * turn + waves.backward * np.conj(turn)
        foam = self._whitecaps(waves, spectrum) if crests else np.zeros((SIZE, SIZE))
        return SeaSurface(
            waves.length_m, _field(spectrum), _field(1j * waves.kx * spectrum), _field(1j * waves.ky * spectrum), foam
        )

    def _whitecaps(self, waves: _Waves, spectrum: Spectrum) -> WaveField:
        if self._cover < 2e-5:
            return np.zeros((SIZE, SIZE))
        sharpness = _field(np.hypot(waves.kx, waves.ky) * spectrum)
        if not sharpness.any():
            return np.zeros((SIZE, SIZE))
        limit = float(np.quantile(sharpness, 1.0 - self._cover))
        spread = max(float(sharpness.std()) * 0.5, 1e-9)
        return np.clip((sharpness - limit) / spread + 0.5, 0.0, 1.0)


def _field(spectrum: Spectrum) -> WaveField:
    return np.fft.irfft2(spectrum, s=(SIZE, SIZE)) * SIZE**2


def _grid(length: float) -> tuple[WaveField, WaveField, WaveField]:
    step = 2.0 * pi / length
    ky, kx = np.meshgrid(np.fft.fftfreq(SIZE, 1.0 / SIZE) * step, np.arange(SIZE // 2 + 1) * step, indexing="ij")
    return kx, ky, np.hypot(kx, ky)


def _waves(length: float, density: WaveField, weather: Weather, chance: np.random.Generator) -> _Waves:
    """Return random waves of a relative energy density over the half plane kx >= 0, spread about the wind's
    direction."""
    kx, ky, k = _grid(length)
    downwind = radians(weather.wind_from_deg + 180.0)
    angle = np.arctan2(kx, ky) - downwind
    draws = chance.standard_normal((4, *k.shape))
    energy = np.where((kx > 0) & (kx < kx.max()), density, 0.0)
    onward = np.sqrt(energy * np.cos(angle / 2.0) ** 6) * (draws[0] + 1j * draws[1])
    backward = np.sqrt(energy * np.sin(angle / 2.0) ** 6) * (draws[2] + 1j * draws[3])
    return _Waves(length, kx, ky, np.sqrt(GRAVITY * k), onward, backward)


def _scaled(waves: _Waves, factor: float) -> _Waves:
    return _Waves(waves.length_m, waves.kx, waves.ky, waves.omega, waves.onward * factor, waves.backward * factor)


def _power(waves: _Waves, weight: WaveField | float = 1.0) -> float:
    return float(2.0 * np.sum(weight * (np.abs(waves.onward) ** 2 + np.abs(waves.backward) ** 2)))


def _swell(weather: Weather, chance: np.random.Generator) -> _Waves:
    _, _, k = _grid(SWELL_M)
    safe = np.maximum(k, 1e-6)
    omega = np.sqrt(GRAVITY * safe)
    peak = 2.0 * pi / max(weather.wave_period_s, 1.0)
    width = np.where(omega < peak, 0.07, 0.09)
    ridge = 3.3 ** np.exp(-((omega / peak - 1.0) ** 2) / (2.0 * width**2))
    density = np.exp(-1.25 * np.minimum((peak / omega) ** 4, 500.0)) * ridge / safe**4
    waves = _waves(SWELL_M, np.where((k > 0) & (k < SPLIT), density, 0.0), weather, chance)
    return _scaled(waves, weather.wave_height_m / 4.0 / max(_power(waves), 1e-30) ** 0.5)


def _ripple(weather: Weather, chance: np.random.Generator) -> _Waves:
    _, _, k = _grid(RIPPLE_M)
    density = np.where((k >= SPLIT) & (k < 30.0), 1.0 / np.maximum(k, 1e-6) ** 4, 0.0)
    waves = _waves(RIPPLE_M, density, weather, chance)
    slopes = 0.5 * (0.003 + 0.00512 * weather.wind_mps)
    return _scaled(waves, (slopes / max(_power(waves, waves.kx**2 + waves.ky**2), 1e-30)) ** 0.5)
