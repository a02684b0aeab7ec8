"""Maps the surface of one object onto another, and carries data over."""

bl_info = {
    "name": "Map Surface",
    "description": "Carries weights, shapes, UV maps and colors between different meshes",
    "author": "ism.hpp",
    "version": (1, 0, 0),
    "blender": (3, 3, 0),
    "location": "3D View > Sidebar > Map Surface",
    "category": "Mesh",
}

import bpy  # noqa: E402  # Blender reads what is above without running it

from . import job, operators, panel, settings  # noqa: E402

classes = settings.classes + operators.classes + panel.classes


def register() -> None:
    for item in classes:
        bpy.utils.register_class(item)
    bpy.types.Scene.map_surface = bpy.props.PointerProperty(type=settings.MapSurfaceSettings)


def unregister() -> None:
    job.forget()  # also when Blender ends: no thread may outlive it
    del bpy.types.Scene.map_surface
    for item in reversed(classes):
        bpy.utils.unregister_class(item)
