"""What the panel shows, kept with the scene."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)


def _is_mesh(_settings: bpy.types.PropertyGroup, object: bpy.types.Object) -> bool:
    return object.type == "MESH"


def _is_empty(_landmark: bpy.types.PropertyGroup, object: bpy.types.Object) -> bool:
    return object.type == "EMPTY"


class MapSurfaceLandmark(bpy.types.PropertyGroup):
    source: PointerProperty(
        name="Source",
        description="An empty at a point of the source",
        type=bpy.types.Object,
        poll=_is_empty,
    )
    target: PointerProperty(
        name="Target",
        description="An empty at the same point of the target",
        type=bpy.types.Object,
        poll=_is_empty,
    )


class MapSurfaceSettings(bpy.types.PropertyGroup):
    source: PointerProperty(
        name="Source",
        description="The object from which data are carried",
        type=bpy.types.Object,
        poll=_is_mesh,
    )
    target: PointerProperty(
        name="Target",
        description="The object to which data are carried",
        type=bpy.types.Object,
        poll=_is_mesh,
    )
    landmarks: CollectionProperty(type=MapSurfaceLandmark)
    active_landmark: IntProperty()
    use_modifiers: BoolProperty(
        name="Modifiers",
        description="Map the surfaces as shown, with modifiers and shape keys, instead of the "
        "meshes as in edit mode. Modifiers of the target must not change its faces",
    )
    use_mirror: BoolProperty(
        name="Mirror",
        description="Map the mirror image of the source, along its X axis, e.g. a left hand onto "
        "a right one",
    )
    use_exact: BoolProperty(
        name="Exact Landmarks",
        description="Landmarks are met exactly; else they pull softly",
    )
    use_scale: BoolProperty(
        name="Keep Scale",
        description="Both surfaces keep their sizes, where one is a part of the other; else they "
        "are scaled to the same area for the map",
    )
    boundary: EnumProperty(
        name="Boundary",
        items=[
            ("free", "Free", "Boundaries may lie anywhere; the map covers what overlaps"),
            ("slide", "Slide", "The boundary goes to the boundary, and slides along it"),
            ("fixed", "Fixed", "The boundary goes to the boundary, where the start puts it"),
        ],
    )
    map_name: StringProperty(options={"HIDDEN"})
    summary: StringProperty(options={"HIDDEN"})


classes = (MapSurfaceLandmark, MapSurfaceSettings)
