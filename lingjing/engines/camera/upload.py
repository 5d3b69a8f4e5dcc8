"""Meshes on the GPU: vertices, indices, space for instances, and the vertex arrays that draw them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from lingjing.engines.camera.effects.particles import Rows
from lingjing.engines.camera.instances import ROW, matrix, row
from lingjing.engines.camera.mesh_rows import VertexIndex
from lingjing.engines.camera.meshes import Mesh

VERTEX = (("3f", "in_position"), ("3f", "in_normal"), ("4f", "in_colour"))
"""A vertex of `meshes` as attributes: formats and names."""
INSTANCE = (("4f", "in_row0"), ("4f", "in_row1"), ("4f", "in_row2"), ("1f", "in_plane"), ("1u", "in_id"))
"""A row of `instances.ROW` as attributes."""


@dataclass(frozen=True, slots=True)
class Model:
    """An indexed mesh with space for instances."""

    buffers: tuple[moderngl.Buffer, ...]
    """Vertices and indices."""
    instances: moderngl.Buffer
    """Buffer of the instances."""
    lit: moderngl.VertexArray
    """Vertex array that draws it."""
    shadow: moderngl.VertexArray
    """Vertex array that draws its planar shadow."""
    capacity: int
    """Most instances."""

    def place(self, rows: Rows) -> None:
        """Write the instances of the next drawing."""
        self.instances.write(rows.tobytes())

    def release(self) -> None:
        """Free the GL objects."""
        for array in (self.lit, self.shadow):
            array.release()
        for buffer in (*self.buffers, self.instances):
            buffer.release()


def upload(
    context: moderngl.Context,
    programs: tuple[moderngl.Program, moderngl.Program],
    mesh: tuple[Mesh, VertexIndex],
    capacity: int,
) -> Model:
    """Return a model of a mesh (vertices, indices) for (lit, shadow) programs."""
    vertices = context.buffer(np.ascontiguousarray(mesh[0], np.float32).tobytes())
    indices = context.buffer(np.ascontiguousarray(mesh[1], np.uint32).tobytes())
    instances = context.buffer(reserve=capacity * ROW.itemsize)
    lit, shadow = (
        context.vertex_array(
            program,
            [(vertices, *_layout(program, VERTEX, "")), (instances, *_layout(program, INSTANCE, "/i"))],
            index_buffer=indices,
            index_element_size=4,
        )
        for program in programs
    )
    return Model((vertices, indices), instances, lit, shadow, capacity)


def upload_still(
    context: moderngl.Context,
    programs: tuple[moderngl.Program, moderngl.Program],
    mesh: tuple[Mesh, VertexIndex],
    plane: float,
    number: int,
) -> Model:
    """Return a model of a mesh in world coordinates.

    It has one instance with the id `number`; its shadow falls on `plane` (m).
    """
    model = upload(context, programs, mesh, 1)
    model.place(row(matrix((0.0, 0.0, 0.0), 0.0, 0.0, 0.0), plane, number))
    return model


def rows_array(context: moderngl.Context, program: moderngl.Program, model: Model) -> moderngl.VertexArray:
    """Return a vertex array of a model's instances for another program."""
    vertices, indices = model.buffers
    return context.vertex_array(
        program,
        [(vertices, *_layout(program, VERTEX, "")), (model.instances, *_layout(program, INSTANCE, "/i"))],
        index_buffer=indices,
        index_element_size=4,
    )


def _layout(program: moderngl.Program, parts: Sequence[tuple[str, str]], rate: str) -> tuple[str, ...]:
    """Return buffer format and names, with padding for attributes that the program does not read."""
    sizes = [size if name in program else f"{4 * int(size[0])}x" for size, name in parts]
    return (" ".join(sizes) + rate, *(name for _, name in parts if name in program))
