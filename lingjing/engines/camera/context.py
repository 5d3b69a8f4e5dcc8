"""The OpenGL context, opened headless through EGL. No other module opens one.

EGL's first device draws: a graphics card where its driver offers one, otherwise Mesa's software renderer. The variable
`DEVICE` chooses another. What holds on a card is in docs/engines.md ("A graphics card").
"""

from __future__ import annotations

import os
from pathlib import Path

import moderngl
import numpy as np
import numpy.typing as npt

from lingjing.data import cache_folder
from lingjing.errors import InfrastructureError, UsageError

APT_LINE = "apt-get install -y libegl1 libgl1"
"""Command that installs the libraries of EGL on Debian and Ubuntu."""

DEVICE = "LINGJING_GL_DEVICE"
"""Environment variable with the device that draws: `software`, or the number of an EGL device."""
_SOFTWARE = "LIBGL_ALWAYS_SOFTWARE"
"""Mesa's variable that rules out graphics cards."""

_SHADER_FOLDER, _SHADERS_OFF = "MESA_SHADER_CACHE_DIR", "MESA_SHADER_CACHE_DISABLE"
"""Mesa's environment variables (docs.mesa3d.org/envvars.html). Mesa reads them when a context is opened."""

_INDEX = Path("mesa_shader_cache", "index")
_INDEX_BYTES = 8 + 65_536 * 20
"""Size of Mesa's table of compiled shaders: a header and 65,536 SHA-1 keys (`src/util/disk_cache_os.c`)."""


def place_shader_cache() -> None:
    """Let Mesa keep compiled shaders in this project's cache folder, or nowhere if the folder has no room.

    Mesa maps its index into memory as a sparse file. On a full disk the first write to a block that the file does not
    have yet kills the process (SIGBUS), so the blocks are reserved before a context is opened. A folder that the user
    has chosen is reserved in the same way. Compilation of all shaders takes about 1.8 s of processor time.
    """
    if os.environ.get(_SHADERS_OFF):
        return
    folder = Path(os.environ.get(_SHADER_FOLDER) or os.path.join(cache_folder(), "shaders"))  # noqa: PTH118
    try:
        _reserve(folder / _INDEX)
    except OSError:
        os.environ[_SHADERS_OFF] = "true"
    else:
        os.environ[_SHADER_FOLDER] = str(folder)


def _reserve(index: Path) -> None:
    index.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(index, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        os.posix_fallocate(descriptor, 0, _INDEX_BYTES)
    finally:
        os.close(descriptor)


def open_context() -> moderngl.Context:
    """Open an OpenGL 3.3 context without a window.

    Raises `InfrastructureError` with the command that installs EGL, and `UsageError` for a device that does not exist.
    """
    place_shader_cache()
    device = os.environ.get(DEVICE, "")
    if device == "software":
        os.environ[_SOFTWARE] = "true"
    elif device and not (device.isascii() and device.isdecimal() and len(device) < 4):
        raise UsageError(f"{DEVICE}={device[:40]} names no device", hint="write `software`, or a number such as 0")
    chosen = {"device_index": int(device)} if device.isdecimal() else {}
    try:
        return moderngl.create_context(standalone=True, backend="egl", require=330, **chosen)  # type: ignore[arg-type] # its stub
    except Exception as error:
        if chosen and "device index" in str(error):
            hint = f"the first one is 0; without {DEVICE} that one draws"
            raise UsageError(f"{DEVICE}={device}: EGL says: {error}", hint=hint) from error
        raise InfrastructureError(f"the camera cannot open an OpenGL context through EGL: {error}",
                                  hint=f"on Debian or Ubuntu: {APT_LINE}") from error  # fmt: skip


def renderer_name(context: moderngl.Context) -> str:
    """Return the GL renderer and version, a part of an episode's fingerprint."""
    return f"{context.info['GL_RENDERER']} / {context.info['GL_VERSION']}"


def mipmapped(context: moderngl.Context, pixels: npt.NDArray[np.uint8]) -> moderngl.Texture:
    """Return a repeating texture with mipmaps from (rows, columns, components) bytes."""
    texture = context.texture(pixels.shape[1::-1], pixels.shape[2], pixels.tobytes())
    texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
    texture.build_mipmaps()
    return texture
