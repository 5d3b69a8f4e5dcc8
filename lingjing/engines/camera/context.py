"""The GL context: headless, through EGL, software where there is no GPU. The only place that opens one."""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt

from lingjing.errors import InfrastructureError

APT_LINE = "apt-get install -y libegl1 libgl1"


def open_context() -> moderngl.Context:
    """A standalone OpenGL 3.3 context. Raises `InfrastructureError` with the line that installs what is missing."""
    try:
        return moderngl.create_context(standalone=True, backend="egl", require=330)  # type: ignore[arg-type] # its stub
    except Exception as error:
        raise InfrastructureError(f"the camera cannot open an OpenGL context through EGL: {error}",
                                  hint=f"on Debian or Ubuntu: {APT_LINE}") from error  # fmt: skip


def renderer_name(context: moderngl.Context) -> str:
    """The GL renderer and version, part of an episode's fingerprint."""
    return f"{context.info['GL_RENDERER']} / {context.info['GL_VERSION']}"


def mipmapped(context: moderngl.Context, pixels: npt.NDArray[np.uint8]) -> moderngl.Texture:
    """A repeating, mipmapped texture of (rows, columns, components) bytes."""
    texture = context.texture(pixels.shape[1::-1], pixels.shape[2], pixels.tobytes())
    texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
    texture.build_mipmaps()
    return texture
