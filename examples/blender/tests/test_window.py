"""Tests of the add-on in Blender with a window: the modal operator, Esc, undo, the panel.

    xvfb-run -a blender --factory-startup --enable-event-simulate -P test_window.py -- ADDON.zip

The zip is installed into BLENDER_USER_SCRIPTS. The last line is "window: ok"; --picture FILE.png
after the zip writes what the window shows during a run.
"""

import os
import pathlib
import sys
import time
import traceback

import bpy
import numpy as np

ARGUMENTS = sys.argv[sys.argv.index("--") + 1 :]
ADDON = pathlib.Path(ARGUMENTS[0]).resolve()
PICTURE = pathlib.Path(ARGUMENTS[2]).resolve() if "--picture" in ARGUMENTS else None
PERIOD = 0.01
bpy.ops.preferences.addon_install(filepath=str(ADDON))
bpy.ops.preferences.addon_enable(module="map_surface")
from map_surface import job, panel  # noqa: E402

bpy.context.preferences.view.show_splash = False
bpy.context.preferences.system.viewport_aa = "OFF"  # one picture instead of eight
bpy.utils.unregister_class(panel.MAP_SURFACE_PT_main)
panel.MAP_SURFACE_PT_main.bl_category = "Item"  # the tab that is open
panel.MAP_SURFACE_PT_main.bl_order = -1
bpy.utils.register_class(panel.MAP_SURFACE_PT_main)
OPS = bpy.ops.map_surface


def view():
    """A window, its 3D view and the region of that."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return {"window": window, "area": area, "region": region}


def press(operator):
    """As by a button: with a step of undo, which calls from Python do not make."""
    return call(operator, "EXEC_DEFAULT", True)


def call(operator, *arguments, **options):
    with bpy.context.temp_override(**view()):
        return operator(*arguments, **options)


def settings():
    return view()["window"].scene.map_surface


def spheres(subdivisions):
    for object in list(bpy.data.objects):
        bpy.data.objects.remove(object)
    for k, name in enumerate(("Source", "Target")):
        call(
            bpy.ops.mesh.primitive_ico_sphere_add, subdivisions=subdivisions, location=(5 * k, 0, 0)
        )
        object = bpy.data.objects["Icosphere"]
        object.name = name
        for vertex in object.data.vertices:
            vertex.co.x *= 2 + 0.5 * k
            vertex.co.z *= 1 + 0.4 * np.sin(5 * vertex.co.y + k)
    bpy.data.objects["Source"].vertex_groups.new(name="G").add([0, 1, 2], 1.0, "REPLACE")
    settings().source, settings().target = (bpy.data.objects[x] for x in ("Source", "Target"))
    call(bpy.ops.ed.undo_push, message="Spheres")


def invoke_map():
    assert call(OPS.map, "INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    assert job.current is not None


def run_to_end():
    while job.current is not None:
        yield


def wait(seconds):
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        yield


def measure(gaps, seconds):
    """Fills a list with the times between two looks of the window at its timers."""
    while sum(gaps) < seconds:
        start = time.perf_counter()
        yield
        gaps.append(time.perf_counter() - start)


def escape():
    window = view()["window"]
    window.event_simulate(type="ESC", value="PRESS", x=300, y=300)
    window.event_simulate(type="ESC", value="RELEASE", x=300, y=300)


def has_map():
    return job.kept(settings().map_name) is not None


def script():
    """The test: it goes on at each yield when the window has handled its events."""
    view()["area"].spaces.active.show_region_ui = True
    spheres(3)
    invoke_map()
    assert not OPS.map.poll()  # one at a time
    yield from run_to_end()
    assert has_map()
    press(OPS.vertex_groups)
    assert "G" in bpy.data.objects["Target"].vertex_groups
    press(OPS.wrap)
    assert bpy.data.objects["Source"].data.shape_keys
    call(bpy.ops.ed.undo)
    assert not bpy.data.objects["Source"].data.shape_keys
    call(bpy.ops.ed.undo)
    assert "G" not in bpy.data.objects["Target"].vertex_groups
    assert has_map()
    call(bpy.ops.ed.undo)
    assert not has_map()
    call(bpy.ops.ed.redo)
    assert has_map()
    press(OPS.wrap)  # the map that undo and redo found
    yield

    spheres(6)
    settings().map_name = ""
    invoke_map()
    yield from wait(2)  # the first pictures take longest
    gaps = []
    yield from measure(gaps, 2)
    print(
        f"while it runs, the window waits {1000 * np.median(gaps):.0f} ms in the median, "
        f"{1000 * max(gaps):.0f} ms at most"
    )
    assert max(gaps) < 5  # the run takes longer
    assert job.current.what
    if PICTURE:
        call(bpy.ops.screen.screenshot, filepath=str(PICTURE))
    start = time.perf_counter()
    escape()
    yield from run_to_end()
    print(f"Esc: {1000 * (time.perf_counter() - start):.0f} ms")
    yield

    spheres(3)
    invoke_map()
    yield
    call(bpy.ops.ed.undo)  # replaces all data during the run
    call(bpy.ops.ed.redo)
    yield from run_to_end()
    assert has_map()

    spheres(3)
    settings().map_name = ""
    invoke_map()
    yield
    bpy.data.objects.remove(bpy.data.objects["Target"])
    yield from run_to_end()
    assert not has_map()

    spheres(6)
    invoke_map()
    yield
    call(bpy.ops.wm.read_homefile)  # another file ends the run
    yield
    assert job.current is None

    spheres(6)
    invoke_map()
    yield
    print("window: ok", flush=True)
    bpy.ops.wm.quit_blender()  # during a run


steps = script()


def step():
    try:
        next(steps)
    except StopIteration:
        return None
    except BaseException:
        traceback.print_exc()
        os._exit(1)  # a window would stay
    return PERIOD


bpy.app.timers.register(step, first_interval=1, persistent=True)
