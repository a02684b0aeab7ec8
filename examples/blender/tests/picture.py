"""Renders carried.png: a hand with a texture and weights, and another hand that got them.

    blender -b --factory-startup --python-exit-code 1 -P picture.py -- ADDON.zip DATA FILE.png

The zip is installed into BLENDER_USER_SCRIPTS.
"""

import pathlib
import sys

import bpy
import numpy as np

ADDON, DATA, FILE = (
    pathlib.Path(path).resolve() for path in sys.argv[sys.argv.index("--") + 1 :][:3]
)
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.preferences.addon_install(filepath=str(ADDON))
bpy.ops.preferences.addon_enable(module="map_surface")


def read_hand(name):
    path = DATA / "hand" / f"{name}.obj"
    rows = [line.split() for line in path.read_text().splitlines()]
    vertices = np.array([[float(x) for x in row[1:4]] for row in rows if row[:1] == ["v"]])
    faces = [[int(x.split("/")[0]) - 1 for x in row[1:4]] for row in rows if row[:1] == ["f"]]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(((vertices - (low + high) / 2) / (high - low)[1]).tolist(), [], faces)
    mesh.polygons.foreach_set("use_smooth", [True] * len(faces))
    hand = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(hand)
    return hand


def material(kind, **inputs):
    """Of a node that gives a color."""
    result = bpy.data.materials.new(kind)
    result.use_nodes = True
    nodes, links = result.node_tree.nodes, result.node_tree.links
    node = nodes.new(kind)
    for name, value in inputs.items():
        setattr(node, name, value)
    shader = nodes["Principled BSDF"]
    links.new(node.outputs[0], shader.inputs["Base Color"])
    return result


def show(hand, x, y, how):
    copy = hand.copy()
    copy.data = hand.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    copy.location = (x, y, 0)
    copy.data.materials.clear()
    copy.data.materials.append(how)
    return copy


def paint_weights(hand):
    """Colors from two vertex groups: red, blue, and gray for none."""
    colors = np.full((len(hand.data.vertices), 4), 0.35)
    for vertex in hand.data.vertices:
        for element in vertex.groups:
            color = [(0.8, 0.05, 0.02, 1), (0.02, 0.1, 0.8, 1)][element.group]
            colors[vertex.index] += element.weight * (np.array(color) - 0.35)
    data = hand.data.color_attributes.new("Weights", "FLOAT_COLOR", "POINT").data
    data.foreach_set("color", colors.astype(np.float32).ravel())


a, b = read_hand("A"), read_hand("B")
pairs = np.loadtxt(DATA / "hand" / "landmarks.txt", dtype=int, usecols=(0, 1)).tolist()
settings = bpy.context.scene.map_surface
settings.source, settings.target = a, b
for pair in pairs:
    for hand, vertex in zip((a, b), pair):
        hand.data.vertices.foreach_set("select", np.arange(len(hand.data.vertices)) == vertex)
    bpy.ops.map_surface.landmark_add()

for name, tip in zip(("Thumb", "Middle"), (pairs[4][0], pairs[1][0])):
    group = a.vertex_groups.new(name=name)
    for vertex in a.data.vertices:
        distance = (vertex.co - a.data.vertices[tip].co).length
        group.add([vertex.index], max(0.0, min(1.0, 1.6 - 4 * distance)), "REPLACE")
bpy.context.view_layer.objects.active = a
bpy.ops.object.mode_set(mode="EDIT")
bpy.ops.mesh.select_all(action="SELECT")
bpy.ops.uv.smart_project(island_margin=0.01)
bpy.ops.object.mode_set(mode="OBJECT")

for name in ("map", "uv_maps", "vertex_groups", "wrap"):
    getattr(bpy.ops.map_surface, name)()

grid = bpy.data.images.new("Grid", 1024, 1024)
grid.generated_type = "COLOR_GRID"
texture = material("ShaderNodeTexImage", image=grid)
weights = material("ShaderNodeVertexColor", layer_name="Weights")
lines = material("ShaderNodeWireframe", use_pixel_size=True)
lines.node_tree.nodes["Wireframe"].inputs["Size"].default_value = 1.2
key = a.data.shape_keys.key_blocks["B"]
for x, hand in ((-0.4, a), (0.4, b)):
    key.value = 0
    paint_weights(hand)
    show(hand, x - 1.7, 0, texture)
    show(hand, x, 0, weights)
    copy = show(a, x + 1.7, 0, lines)
    copy.data.shape_keys.key_blocks["B"].value = float(hand is b)
a.hide_render = b.hide_render = True

scene = bpy.context.scene
sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
sun.data.energy, sun.rotation_euler = 3, (0.5, 0.4, 0)
camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 5.0, (0, 0, 5)
for object in (sun, camera):
    scene.collection.objects.link(object)
scene.camera = camera
scene.world = bpy.data.worlds.new("World")
scene.world.color = (0.6, 0.6, 0.6)
scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 64, False
scene.view_settings.view_transform = "Standard"
scene.render.resolution_x, scene.render.resolution_y = 1120, 264
scene.render.image_settings.color_mode, scene.render.image_settings.compression = "RGB", 100
scene.render.filepath = str(FILE)
bpy.ops.render.render(write_still=True)
