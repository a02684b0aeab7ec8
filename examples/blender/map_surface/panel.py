"""The panel Map Surface, in the sidebar of the 3D view."""

from typing import Any

import bpy

from . import job, operators


class MAP_SURFACE_UL_landmarks(bpy.types.UIList):
    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: bpy.types.UILayout,
        _data: Any,
        item: Any,
        _icon: int,
        _active_data: Any,
        _active_property: str,
    ) -> None:
        row = layout.row(align=True)
        row.prop(item, "source", text="")
        row.prop(item, "target", text="")


class MAP_SURFACE_PT_main(bpy.types.Panel):
    bl_label = "Map Surface"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Map Surface"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.map_surface
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "source")
        layout.prop(settings, "target")

        layout.label(text="Landmarks")
        row = layout.row()
        row.template_list(
            "MAP_SURFACE_UL_landmarks",
            "",
            settings,
            "landmarks",
            settings,
            "active_landmark",
            rows=3,
        )
        buttons = row.column(align=True)
        buttons.operator("map_surface.landmark_add", icon="ADD", text="")
        buttons.operator("map_surface.landmark_remove", icon="REMOVE", text="")

        column = layout.column(heading="Options")
        for name in ("use_modifiers", "use_mirror", "use_exact", "use_scale"):
            column.prop(settings, name)
        layout.prop(settings, "boundary")

        layout.operator("map_surface.map")
        if job.current is not None:
            layout.label(text=operators.progress())
            layout.label(text="Esc stops, with the map so far")
        elif job.kept(settings.map_name) is not None:
            layout.label(text=settings.summary)

        layout.label(text="Carry to the Target")
        column = layout.column(align=True)
        for operator in operators.CARRIERS:
            column.operator(operator.bl_idname)
        layout.operator("map_surface.wrap")


classes = (MAP_SURFACE_UL_landmarks, MAP_SURFACE_PT_main)
