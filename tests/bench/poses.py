"""Makes figures with limbs in several poses, and pairs of them for tests/table.py:

    blender --background --python tests/bench/poses.py -- FOLDER

Each figure is a surface around bones (Blender's metaballs) with triangles of its own, so the two
surfaces of a pair have no vertices in common.
"""
import math
import os
import sys

import bmesh
import bpy
from mathutils import Vector


def point(start, turn, lift, length):
    """The end of a bone: `turn` degrees from +x towards +z, `lift` towards +y."""
    t, u = math.radians(turn), math.radians(lift)
    return Vector(start) + length * Vector((math.cos(t) * math.cos(u), math.sin(u),
                                            math.sin(t) * math.cos(u)))


def person(shoulders=(0, 0), elbows=(0, 0), hips=(-90, -90), knees=(-90, -90), arms_lift=0,
           forearms_lift=0, thighs_lift=(0, 0)):
    """Bones as (from, to, radius, radius); angles of the two sides, 0 is sideways."""
    pelvis, chest, neck = (0, 0, 0), (0, 0, 1), (0, 0, 1.35)
    bones = [(pelvis, chest, .34, .38), (chest, neck, .25, .14),
             (neck, point(neck, 90, 0, .4), .16, .27)]
    for side, x in enumerate((1, -1)):
        def mirrored(turn, x=x):
            return turn if x > 0 else 180 - turn
        shoulder, hip = (x * .42, 0, 1.15), (x * .2, 0, -.12)
        elbow = point(shoulder, mirrored(shoulders[side]), arms_lift, .6)
        hand = point(elbow, mirrored(elbows[side]), forearms_lift, .6)
        knee = point(hip, mirrored(hips[side]), thighs_lift[side], .8)
        ankle = point(knee, mirrored(knees[side]), 0, .75)
        bones += [(chest, shoulder, .22, .17), (shoulder, elbow, .15, .12), (elbow, hand, .12, .09),
                  (pelvis, hip, .25, .2), (hip, knee, .2, .14), (knee, ankle, .14, .1),
                  (ankle, ankle + Vector((0, -.3, -.05)), .1, .1)]
    return bones


def animal(spread=0, tail=30, neck=45, rise=0, legs=(0, 0, 0, 0), girth=1):
    hip, shoulder = (-.9, 0, 0), (.9, 0, rise)
    head = point(shoulder, neck, 0, .8)
    bones = [(hip, shoulder, .36 * girth, .4 * girth), (shoulder, head, .28, .2),
             (head, point(head, neck - 60, 0, .5), .22, .15),
             (hip, point(hip, 180 - tail, 0, .9), .14, .08)]
    for (at, y), swing in zip(((shoulder, .25), (shoulder, -.25), (hip, .25), (hip, -.25)), legs):
        top = (at[0], y, at[2] - .1)
        knee = point(top, -90 + swing, math.copysign(spread, y), .6)
        bones += [(at, top, .3, .22), (top, knee, .2, .14),
                  (knee, point(knee, -90 - 1.2 * swing, 0, .6), .14, .11)]
    return bones


FIGURES = {  # bones, and the resolution in their unit
    "person": (person(), .06),
    "person_down": (person((-70, -70), (-80, -80)), .06),
    "person_steps": (person((-70, 60), (-80, 100), (-85, -70), (-90, -95), 0, 0, (-70, 0)), .054),
    "person_sits": (person((-50, -50), (-20, -20), (-60, -60), (-90, -90), -30, -60, (-80, -80)),
                    .066),
    "animal": (animal(), .06),
    "animal_walks": (animal(8, -30, 10, 0, (30, -20, 20, -30)), .066),
    "animal_sits": (animal(0, -10, 80, .9, (-10, 10, 60, 60)), .054),
    "animal_fat": (animal(0, 60, 70, 0, (0, 0, 0, 0), 1.5), .072),
}
PAIRS = (("person", "person_down"), ("person", "person_steps"), ("person_steps", "person"),
         ("person", "person_sits"), ("person_down", "person_sits"), ("person_steps", "person_down"),
         ("animal", "animal_walks"), ("animal", "animal_sits"), ("animal_walks", "animal_fat"),
         ("animal_sits", "animal_fat"))


def triangles_around(bones, resolution):
    balls = bpy.data.metaballs.new("balls")
    balls.resolution = resolution
    balls.threshold = 0.3
    figure = bpy.data.objects.new("figure", balls)
    bpy.context.scene.collection.objects.link(figure)
    for start, end, first, last in bones:
        start, end = Vector(start), Vector(end)
        n = max(2, int((end - start).length / (0.35 * min(first, last))) + 1)
        for i in range(n + 1):
            ball = balls.elements.new()
            ball.co = start.lerp(end, i / n)
            ball.radius = 1.5 * (first + (last - first) * i / n)
    bpy.context.view_layer.update()
    mesh = bmesh.new()
    mesh.from_mesh(bpy.data.meshes.new_from_object(
        figure.evaluated_get(bpy.context.evaluated_depsgraph_get())))
    bmesh.ops.remove_doubles(mesh, verts=mesh.verts, dist=1e-5)
    bmesh.ops.triangulate(mesh, faces=mesh.faces)
    bpy.data.objects.remove(figure)
    return mesh


def write(mesh, path):
    with open(path, "w", encoding="ascii") as out:
        for v in mesh.verts:
            out.write("v %.6f %.6f %.6f\n" % tuple(v.co))
        for f in mesh.faces:
            out.write("f %d %d %d\n" % tuple(v.index + 1 for v in f.verts))


folder = sys.argv[sys.argv.index("--") + 1]
for ball in list(bpy.data.objects):
    bpy.data.objects.remove(ball)
meshes = {name: triangles_around(*figure) for name, figure in FIGURES.items()}
for a, b in PAIRS:
    pair = os.path.join(folder, a + "-" + b)
    os.makedirs(pair, exist_ok=True)
    write(meshes[a], os.path.join(pair, "A.obj"))
    write(meshes[b], os.path.join(pair, "B.obj"))
