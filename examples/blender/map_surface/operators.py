"""The operators. Each is a thin layer over functions that need no window."""

from typing import Any, Callable, Optional

import bpy
from bpy.props import BoolProperty, EnumProperty

from . import carry, ism, job, landmarks, layers
from .surface import UserError, object_in, read_surface, topology_of

PERIOD = 0.1  # seconds between two looks at the run
PATIENCE = 0.3  # seconds that Esc waits for the run to end; the next look may be a slow picture away


def _objects(scene: bpy.types.Scene) -> tuple[bpy.types.Object, bpy.types.Object]:
    settings = scene.map_surface
    source = object_in(scene, settings.source, "source")
    target = object_in(scene, settings.target, "target")
    if source == target:
        raise UserError(f"The source and the target are the same object, {source.name}")
    return source, target


def _sentence(error: Exception, names: tuple[str, str]) -> str:
    """The library's sentence, which calls the meshes A and B."""
    return f"{error} (A is {names[0]}, B is {names[1]})"


class MAP_SURFACE_OT_map(bpy.types.Operator):
    """Computes the map from the source to the target. Esc stops it, with the map so far"""

    bl_idname = "map_surface.map"
    bl_label = "Map"
    bl_options = {"UNDO"}

    _timer: Any = None

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        if job.current is not None:
            cls.poll_message_set("A map is being computed")
        return job.current is None

    def _start(self, context: bpy.types.Context) -> bool:
        """Reads the objects and starts the job; keeps their names, which undo cannot harm."""
        settings = context.scene.map_surface
        context.view_layer.update()
        names = "", ""
        try:
            source, target = _objects(context.scene)
            names = source.name, target.name
            a = read_surface(source, settings.use_modifiers, settings.use_mirror)
            b = read_surface(target, settings.use_modifiers)
            if b.topology != topology_of(target.data):
                raise UserError(
                    f"The modifiers of {target.name} change its faces, so that nothing can be "
                    "carried to them: apply them, or turn Modifiers off"
                )
            pairs, sentences = landmarks.pairs_of(settings, a, b)
            options = {
                "exact_landmarks": settings.use_exact,
                "keep_scale": settings.use_scale,
                "boundary": settings.boundary,
            }
            self._job = job.start(a, b, pairs, options)
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return False
        except ism.Error as error:
            self.report({"ERROR"}, _sentence(error, names))
            return False
        for sentence in sentences:
            self.report({"WARNING"}, sentence)
        self._scene = context.scene.name
        self._how = settings.use_modifiers, settings.use_mirror
        return True

    def _finish(self) -> set[str]:
        """Gives the map to the scene, unless the objects have changed or there is none."""
        done = self._job
        job.end()
        names = done.source.name, done.target.name
        if done.map is None:
            is_stopped = getattr(done.error, "status", "") == "no map yet"
            if is_stopped:
                self.report({"INFO"}, str(done.error))
            else:
                self.report({"ERROR"}, _sentence(done.error, names))
            return {"CANCELLED"}
        mapped = job.Mapped(done.map, done.source, done.target, *self._how)
        scene = bpy.data.scenes.get(self._scene)
        found = [scene.objects.get(name) if scene else None for name in names]
        for name, object in zip(names, found):
            if object is None:
                self.report({"ERROR"}, f"{name} was deleted or renamed: its map is lost")
                return {"CANCELLED"}
        try:
            layers.read_again(mapped, *found)
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for sentence in done.map.warnings:
            self.report({"WARNING"}, sentence)
        for name, n in zip(names, carry.dropped(done.map, done.source, done.target)):
            if n > 0:
                self.report({"WARNING"}, f"{name}: {n} vertices of loose parts are not mapped")
        a, b = done.map.coverage
        settings = scene.map_surface
        settings.map_name = job.keep(mapped)
        settings.summary = (
            f"{done.map.status}, distortion {done.map.distortion.mean:.3f}, "
            f"{a:.1%} and {b:.1%} covered"
        )
        self.report({"INFO"}, f"{names[0]} to {names[1]}: {settings.summary}")
        return {"FINISHED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._start(context):
            return {"CANCELLED"}
        try:
            while self._job.wait(PERIOD):
                pass
        except BaseException:  # Ctrl-C
            job.end()
            raise
        return self._finish()

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if not self._start(context):
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(PERIOD, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        is_stopped = event.type == "ESC" and event.value == "PRESS"
        if is_stopped:
            self._job.cancel()
        elif event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._job.wait(PATIENCE if is_stopped else 0):
            _show_progress(context, f"Map Surface: {progress()} (Esc stops)")
            return {"RUNNING_MODAL"} if is_stopped else {"PASS_THROUGH"}
        self._end_modal(context)
        return self._finish()

    def cancel(self, context: bpy.types.Context) -> None:
        """Called when Blender ends, or loads another file."""
        self._end_modal(context)
        job.end()

    def _end_modal(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        _show_progress(context, None)


def progress() -> str:
    """What the current job does; nothing, if there is none."""
    return f"{job.current.fraction:.0%}, {job.current.what}" if job.current else ""


def _show_progress(context: bpy.types.Context, text: Optional[str]) -> None:
    if context.workspace is not None:
        context.workspace.status_text_set(text)
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                if area.type == "VIEW_3D" and region.type == "UI":  # not the scene
                    region.tag_redraw()


class _Carry:
    """An operator that applies a function of layers.py to the map of the scene."""

    bl_options = {"REGISTER", "UNDO"}
    carry: Callable[..., layers.Result]
    what: str  # it writes

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("It works in object mode")
            return False
        if job.kept(context.scene.map_surface.map_name) is None:
            cls.poll_message_set("There is no map yet in this session: map first")
            return False
        return True

    def arguments(self) -> dict[str, Any]:
        return {}

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()
        try:
            source, target = _objects(context.scene)
            mapped = job.kept(context.scene.map_surface.map_name)
            layers.read_again(mapped, source, target)
            n, sentences = self.carry(mapped, source, target, **self.arguments())
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for sentence in sentences:
            self.report({"WARNING"}, sentence)
        self.report({"INFO"}, f"{source.name} to {target.name}: {n} {self.what}")
        return {"FINISHED"}


class MAP_SURFACE_OT_vertex_groups(_Carry, bpy.types.Operator):
    """Carries all vertex groups; those of the same names are replaced"""

    bl_idname = "map_surface.vertex_groups"
    bl_label = "Vertex Groups"
    carry = staticmethod(layers.vertex_groups)
    what = "vertex groups"


class MAP_SURFACE_OT_shape_keys(_Carry, bpy.types.Operator):
    """Carries all shape keys, turned and stretched as the map is at each vertex"""

    bl_idname = "map_surface.shape_keys"
    bl_label = "Shape Keys"
    carry = staticmethod(layers.shape_keys)
    what = "shape keys"


class MAP_SURFACE_OT_uv_maps(_Carry, bpy.types.Operator):
    """Carries all UV maps; a face at a seam gets the island on which most of it lies"""

    bl_idname = "map_surface.uv_maps"
    bl_label = "UV Maps"
    carry = staticmethod(layers.uv_maps)
    what = "UV maps"

    marks_seams: BoolProperty(
        name="Mark Seams",
        description="Mark the edges of the target between islands of the active UV map",
        default=True,
    )

    def arguments(self) -> dict[str, Any]:
        return {"marks_seams": self.marks_seams}


class MAP_SURFACE_OT_color_attributes(_Carry, bpy.types.Operator):
    """Carries all color attributes; those of the same names are replaced"""

    bl_idname = "map_surface.color_attributes"
    bl_label = "Color Attributes"
    carry = staticmethod(layers.color_attributes)
    what = "color attributes"


class MAP_SURFACE_OT_wrap(_Carry, bpy.types.Operator):
    """Gives the source a shape key in which it has the shape of the target"""

    bl_idname = "map_surface.wrap"
    bl_label = "Wrap"
    carry = staticmethod(layers.wrap)
    what = "shape key"

    place: EnumProperty(
        name="Place",
        items=[
            ("TARGET", "On the Target", "The source appears where the target is"),
            ("SOURCE", "In Place", "The source appears at its own origin"),
        ],
    )

    def arguments(self) -> dict[str, Any]:
        return {"is_in_place": self.place == "SOURCE"}


class MAP_SURFACE_OT_landmark_add(bpy.types.Operator):
    """Makes landmarks of the selected vertices of both objects: one of each, or several, clicked in
    the same order"""

    bl_idname = "map_surface.landmark_add"
    bl_label = "Add Landmarks"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            _objects(context.scene)
            n = landmarks.add_pairs(context.scene.map_surface, context.scene)
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{n} landmarks added")
        return {"FINISHED"}


class MAP_SURFACE_OT_landmark_remove(bpy.types.Operator):
    """Removes the active landmark, and its empties if Add Landmarks made them"""

    bl_idname = "map_surface.landmark_remove"
    bl_label = "Remove Landmark"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.map_surface.landmarks)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.map_surface
        i = min(settings.active_landmark, len(settings.landmarks) - 1)
        landmarks.remove_empties(settings.landmarks[i])
        settings.landmarks.remove(i)
        settings.active_landmark = max(0, i - 1)
        return {"FINISHED"}


CARRIERS = (
    MAP_SURFACE_OT_vertex_groups,
    MAP_SURFACE_OT_shape_keys,
    MAP_SURFACE_OT_uv_maps,
    MAP_SURFACE_OT_color_attributes,
)
classes = (
    MAP_SURFACE_OT_map,
    MAP_SURFACE_OT_wrap,
    MAP_SURFACE_OT_landmark_add,
    MAP_SURFACE_OT_landmark_remove,
    *CARRIERS,
)
