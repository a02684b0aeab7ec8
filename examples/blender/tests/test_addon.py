"""Tests of the add-on, in Blender without a window.

    blender -b --factory-startup --python-exit-code 1 -P test_addon.py -- ADDON.zip DATA

The zip is installed into BLENDER_USER_SCRIPTS, which should be a new folder.
"""

import pathlib
import random
import sys
import time
import unittest

import bpy
import numpy as np
from mathutils import Euler, Matrix

ADDON, DATA = (pathlib.Path(path).resolve() for path in sys.argv[sys.argv.index("--") + 1 :][:2])
bpy.ops.preferences.addon_install(filepath=str(ADDON))
bpy.ops.preferences.addon_enable(module="map_surface")
from map_surface import carry, ism, job  # noqa: E402
from map_surface.surface import read_surface  # noqa: E402

OPS = bpy.ops.map_surface
TURNED = Matrix.LocRotScale((3, -1, 2), Euler((0.4, -0.7, 1.1)), (1.5, 1.5, 1.5))
MIRRORED = Matrix.LocRotScale((-2, 0, 1), Euler((0.1, 0.9, -0.3)), (-0.7, 0.7, 0.7))


def make(name, vertices, faces, matrix=None):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(v) for v in vertices], [], [tuple(f) for f in faces])
    result = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(result)
    result.matrix_world = matrix or Matrix()
    return result


def read_obj(path):
    rows = [line.split() for line in path.read_text().splitlines()]
    vertices = [[float(x) for x in row[1:4]] for row in rows if row[:1] == ["v"]]
    faces = [[int(x.split("/")[0]) - 1 for x in row[1:4]] for row in rows if row[:1] == ["f"]]
    return np.array(vertices), np.array(faces)


def bumps(n, triangulated=False):
    """A grid of n × n quads over [-1, 1]², with bumps that have no symmetry."""
    x, y = np.meshgrid(*[np.linspace(-1, 1, n + 1)] * 2, indexing="ij")
    z = 0.35 * np.exp(-6 * ((x - 0.4) ** 2 + (y + 0.2) ** 2)) + 0.1 * x - 0.15 * x * y
    i, j = np.meshgrid(range(n), range(n), indexing="ij")
    k = (i * (n + 1) + j).ravel()
    faces = np.column_stack([k, k + n + 1, k + n + 2, k + 1])
    if triangulated:
        faces = np.concatenate([faces[:, [0, 1, 3]], faces[:, [1, 2, 3]]])
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces


def moved(vertices, matrix):
    m = np.array(matrix)
    return vertices @ m[:3, :3].T + m[:3, 3]


def coordinates(items):
    result = np.empty(3 * len(items), np.float32)
    items.foreach_get("co", result)
    return result.reshape(-1, 3)


def world(object):
    return moved(coordinates(object.data.vertices), object.matrix_world)


def weights(object, name):
    group = object.vertex_groups[name].index
    result = np.zeros(len(object.data.vertices))
    for vertex in object.data.vertices:
        for element in vertex.groups:
            if element.group == group:
                result[vertex.index] = element.weight
    return result


def uv_of(object, name):
    result = np.empty(2 * len(object.data.loops), np.float32)
    object.data.uv_layers[name].data.foreach_get("uv", result)
    return result.reshape(-1, 2)


class Case(unittest.TestCase):
    def setUp(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.preferences.addon_enable(module="map_surface")

    def choose(self, source, target, **options):
        settings = bpy.context.scene.map_surface
        settings.source, settings.target = source, target
        for name, value in options.items():
            setattr(settings, name, value)
        return settings

    def map(self, source, target, **options):
        """Runs the operator, and returns its map."""
        settings = self.choose(source, target, **options)
        self.assertEqual(OPS.map(), {"FINISHED"})
        return job.kept(settings.map_name)

    def landmark(self, source, a, target, b):
        for object, vertex in ((source, a), (target, b)):
            for v in object.data.vertices:
                v.select = v.index == int(vertex)
        self.assertEqual(OPS.landmark_add(), {"FINISHED"})

    def assert_close(self, a, b, tolerance, what=""):
        self.assertLessEqual(float(np.abs(np.asarray(a) - b).max()), tolerance, what)

    def refuses(self, sentence, operator, **options):
        with self.assertRaisesRegex(RuntimeError, sentence):
            operator(**options)


class Starfish(Case):
    """Two shapes, one of them mirrored, against the library called directly."""

    def setUp(self):
        super().setUp()
        (va, fa), (vb, fb) = (read_obj(DATA / "starfish" / f"{x}.obj") for x in "AB")
        self.source = make("Source", va, fa, TURNED)
        inverse = np.linalg.inv(np.array(MIRRORED))
        self.target = make("Target", moved(vb, inverse), fb[:, ::-1], MIRRORED)
        self.pairs = np.loadtxt(DATA / "starfish" / "landmarks.txt", dtype=int, usecols=(0, 1))
        bpy.context.view_layer.update()
        self.choose(self.source, self.target)
        for a, b in self.pairs[:4]:
            self.landmark(self.source, a, self.target, b)
        self.direct = ism.map(
            (world(self.source), fa), (world(self.target), fb), self.pairs[:4].tolist()
        )

    def test_carries_what_the_library_does(self):
        mesh, n = self.source.data, len(self.source.data.vertices)
        rng = np.random.default_rng(1)
        values = rng.random((n, 2)) * (rng.random((n, 2)) > 0.3)
        for name, column in zip(("Arm", "Leg"), values.T):
            group = self.source.vertex_groups.new(name=name)
            for i in np.flatnonzero(column):
                group.add([int(i)], column[i], "REPLACE")
        smooth = 0.5 + 0.5 * np.sin(3 * coordinates(mesh.vertices))
        colors = np.column_stack([smooth, np.ones(n)])
        for kind, domain in (("FLOAT_COLOR", "POINT"), ("BYTE_COLOR", "CORNER")):
            data = mesh.color_attributes.new(domain, kind, domain).data
            at = colors if domain == "POINT" else colors[[x.vertex_index for x in mesh.loops]]
            data.foreach_set("color", at.astype(np.float32).ravel())
        turn = Euler((0.1, 0.2, 0.3)).to_matrix().to_4x4()
        plane = moved(coordinates(mesh.vertices), turn)[:, :2]
        layer = mesh.uv_layers.new(name="Plane")
        at = plane[[x.vertex_index for x in mesh.loops]]
        layer.data.foreach_set("uv", at.astype(np.float32).ravel())

        mapped = self.map(self.source, self.target)
        images, expected = mapped.map.a_to_b(), self.direct.a_to_b()
        covered = images.covered & expected.covered
        self.assertGreater(covered.mean(), 0.8)
        self.assertLess(abs(mapped.map.distortion.mean - self.direct.distortion.mean), 1e-3)
        self.assert_close(images.positions[covered], expected.positions[covered], 1e-3)

        m = mapped.map.a_to_b
        known = np.diff(m.csr()[0]) > 0
        self.assertEqual(OPS.vertex_groups(), {"FINISHED"})
        on_target = m.transfer(values)
        for k, name in enumerate(("Arm", "Leg")):
            self.assert_close(weights(self.target, name)[known], on_target[known, k], 2e-5)
            self.assertGreater(weights(self.target, name)[~known].min(initial=1), 0)

        self.assertEqual(OPS.color_attributes(), {"FINISHED"})
        for domain, tolerance in (("POINT", 1e-6), ("CORNER", 0.02)):
            data = self.target.data.color_attributes[domain].data
            got = np.empty(4 * len(data), np.float32)
            data.foreach_get("color", got)
            at = m.transfer(colors)
            is_known = known
            if domain == "CORNER":
                vertices = [x.vertex_index for x in self.target.data.loops]
                at, is_known = at[vertices], known[vertices]
            self.assert_close(got.reshape(-1, 4)[is_known], at[is_known], tolerance)

        self.assertEqual(OPS.uv_maps(), {"FINISHED"})
        vertices = np.array([x.vertex_index for x in self.target.data.loops])
        whole = np.repeat(known[vertices].reshape(-1, 3).all(axis=1), 3)
        got, at = uv_of(self.target, "Plane"), m.transfer(plane)[vertices]
        self.assert_close(got[whole], at[whole], 1e-5)

        self.assertEqual(OPS.wrap(), {"FINISHED"})
        key = self.source.data.shape_keys.key_blocks["Target"]
        at = moved(coordinates(key.data), self.source.matrix_world)
        self.assert_close(at[images.covered], images.positions[images.covered], 1e-5)
        size = np.ptp(world(self.target), axis=0).max()
        edges = np.array([e.vertices[:] for e in mesh.edges])
        length = np.linalg.norm(at[edges[:, 0]] - at[edges[:, 1]], axis=1)
        self.assertLess(length.max(), 0.2 * size)  # what is not covered has no spikes

        self.assertEqual(OPS.wrap(place="SOURCE"), {"FINISHED"})
        local = moved(images.positions, np.linalg.inv(np.array(self.target.matrix_world)))
        self.assert_close(coordinates(key.data)[images.covered], local[images.covered], 1e-5)


class Copies(Case):
    """A copy that is turned, scaled and perhaps mirrored: what is carried is known."""

    def with_shape(self, source):
        co = coordinates(source.data.vertices).astype(float)
        source.shape_key_add(name="Basis")
        out = 0.3 * np.exp(-4 * (co**2).sum(axis=1))[:, None] * [0.3, -0.4, 1]
        self.moves = {}
        for name, move in (("Out", out), ("More", 2 * out + 0.1 * co)):
            key = source.shape_key_add(name=name)
            key.data.foreach_set("co", (co + move).astype(np.float32).ravel())
            self.moves[name] = move
        key.relative_key = source.data.shape_keys.key_blocks["Out"]
        key.slider_max = 3

    def check_shapes(self, target, linear):
        base = coordinates(target.data.shape_keys.key_blocks["Basis"].data)
        for name, move in self.moves.items():
            key = target.data.shape_keys.key_blocks[name]
            expected = move @ np.array(linear).T
            self.assert_close(
                coordinates(key.data) - base, expected, 0.02 * np.abs(expected).max(), name
            )
        self.assertEqual(key.relative_key.name, "Out")
        self.assertEqual(key.slider_max, 3)

    def test_shape_keys_turn_with_the_surface(self):
        v, f = bumps(16)
        linear = Euler((0.5, 0.8, -1.2)).to_matrix() * 1.7
        for matrix in (TURNED, MIRRORED):
            source = make("Source", v, f, TURNED)
            self.with_shape(source)
            faces = bumps(16, True)[1]
            if matrix is MIRRORED:  # the same shape in the world
                local = np.array(MIRRORED.inverted()) @ np.array(TURNED)
                faces = faces[:, ::-1]
                target = make("Target", moved(v, local), faces, MIRRORED)
                inner = local[:3, :3]
            else:
                inner = np.array(linear)
                target = make("Target", v @ inner.T, faces, TURNED)
            mapped = self.map(source, target, boundary="slide")
            self.assertLess(mapped.map.distortion.mean, 2.001)
            self.assertEqual(OPS.shape_keys(), {"FINISHED"})
            self.check_shapes(target, inner)
            OPS.shape_keys()  # again: replaced
            self.assertEqual(len(target.data.shape_keys.key_blocks), 3)

    def test_wrap_follows_objects_that_moved_since(self):
        source, target = make("Source", *bumps(8), TURNED), make("Target", *bumps(11), MIRRORED)
        mapped = self.map(source, target)
        target.matrix_world = Matrix.Translation((5, 0, 0)) @ target.matrix_world
        source.matrix_world = Matrix.Scale(2, 4)
        OPS.wrap()
        images = mapped.map.a_to_b()
        key = source.data.shape_keys.key_blocks["Target"]
        at = moved(coordinates(key.data), source.matrix_world) - (5, 0, 0)
        self.assert_close(at[images.covered], images.positions[images.covered], 1e-5)

    def test_mirror_maps_a_left_hand_to_a_right_one(self):
        v, f = bumps(12, True)
        source = make("Left", v, f, TURNED)
        self.with_shape(source)
        target = make("Right", v * [-1, 1, 1], f[:, ::-1], TURNED.inverted())
        self.choose(source, target)
        for vertex in (0, 12, 100):
            self.landmark(source, vertex, target, vertex)
        mapped = self.map(source, target, boundary="slide", use_mirror=True)
        self.assertLess(mapped.map.distortion.mean, 2.001)
        OPS.shape_keys()
        self.check_shapes(target, np.diag([-1, 1, 1]))
        OPS.wrap(place="SOURCE")
        key = source.data.shape_keys.key_blocks["Right"]
        self.assert_close(coordinates(key.data), v, 0.02)

    def test_loose_parts(self):
        v, f = bumps(12)
        w, g = bumps(3)
        source = make("Source", np.vstack([0.2 * w + [4, 0, 0], v]), [*g, *(f + len(w))])
        target = make("Target", np.vstack([v, 0.1 * w - [4, 0, 0]]), [*f, *(g + len(v))], TURNED)
        group = source.vertex_groups.new(name="G")
        for i, x in enumerate([*w, *v]):
            group.add([i], 0.5 + 0.4 * x[0], "REPLACE")
        mapped = self.map(source, target, boundary="slide")
        OPS.vertex_groups()
        got = weights(target, "G")
        self.assert_close(got[: len(v)], 0.5 + 0.4 * v[:, 0], 0.02)
        self.assertEqual(got[len(v) :].max(), 0)  # the loose part was not mapped
        self.assertEqual(carry.dropped(mapped.map, mapped.source, mapped.target), (16, 16))
        OPS.wrap()


class Textures(Case):
    def cylinder(self, n, m, turn=0.0):
        """An open cylinder of n × m quads; quad i spans the angles i to i + 1."""
        angle = 2 * np.pi * (np.arange(n) + turn) / n
        ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
        v = np.vstack([ring + [0, 0, 3 * k / m] for k in range(m + 1)])
        i, k = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
        a, b = k * n + i, k * n + (i + 1) % n
        return v, np.stack([a, b, b + n, a + n], axis=-1).reshape(-1, 4)

    def test_islands_stay_whole_along_a_seam(self):
        v, f = self.cylinder(24, 12)
        source = make("Source", v, f)
        layer = source.data.uv_layers.new(name="Around")
        i = np.repeat(np.repeat(np.arange(24), 12)[:, None], 4, axis=1) + [0, 1, 1, 0]
        uv = np.column_stack([i.ravel() / 24, v[f.ravel(), 2] / 3])
        layer.data.foreach_set("uv", uv.astype(np.float32).ravel())
        v, f = self.cylinder(31, 17, 0.37)
        target = make("Target", v, f, TURNED)
        self.map(source, target)
        OPS.uv_maps()
        got = uv_of(target, "Around").astype(float)
        per_face = got.reshape(-1, 4, 2)
        self.assertLess(np.ptp(per_face[..., 0], axis=1).max(), 0.1)  # none reaches over the image
        across = per_face[:, 2:] - per_face[:, :2]
        area = np.abs(np.cross(across[:, 0], across[:, 1])) / 2
        self.assertLess(abs(area.sum() - 1), 0.03)
        seams = [e for e in target.data.edges if e.use_seam]
        self.assertGreaterEqual(len(seams), 17)
        self.assertLess(len(seams), len(target.data.edges) / 10)

    def test_closed_surfaces_keep_a_continuous_map(self):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=20, ring_count=12)
        source = bpy.context.object
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, location=(3, 0, 0))
        target = bpy.context.object
        for object in (source, target):
            for w in object.data.vertices:
                w.co.x *= 1.7
                w.co.z *= 1.2 if w.co.x > 0 else 0.8
        mapped = self.map(source, target)
        self.assert_close(mapped.map.coverage, 1, 1e-6)
        OPS.uv_maps()
        per_face = uv_of(target, "UVMap").reshape(-1, 3, 2)
        self.assertLess(np.ptp(per_face[..., 0], axis=1).max(), 0.3)
        self.assertGreater(sum(e.use_seam for e in target.data.edges), 5)
        OPS.wrap()
        radii = np.linalg.norm(world(source), axis=1)
        self.assertGreater(radii.min(), 0.5)

    def test_planar_map_is_exact_on_polygons(self):
        v, f = bumps(10)
        source = make("Source", v, f)
        source.data.uv_layers.new(name="Plane").data.foreach_set(
            "uv", (v[f.ravel(), :2] / 2 + 0.5).astype(np.float32).ravel()
        )
        hexagons = [[0, 11, 22, 23, 12, 1], [13, 24, 25, 14]]
        rest = [q for q in f.tolist() if not any(set(q) <= set(h) for h in hexagons)]
        target = make("Target", v, hexagons + rest, MIRRORED @ Matrix.Scale(-1, 4))
        self.map(source, target, boundary="slide")
        OPS.uv_maps()
        at = v[[x.vertex_index for x in target.data.loops], :2] / 2 + 0.5
        self.assert_close(uv_of(target, "Plane"), at, 0.02)
        self.assertFalse(any(e.use_seam for e in target.data.edges))


class Modifiers(Case):
    def test_evaluated_meshes(self):
        v, f = bumps(8)
        source, target = make("Source", v, f), make("Target", *bumps(12), TURNED)
        group = source.vertex_groups.new(name="G")
        for i, x in enumerate(v):
            group.add([i], 0.5 + 0.4 * x[0], "REPLACE")
        source.modifiers.new("S", "SUBSURF").levels = 1
        bend = target.modifiers.new("B", "SIMPLE_DEFORM")
        bend.deform_method, bend.angle = "BEND", 0.7
        plain = self.map(source, target)
        self.assertEqual(len(plain.source.positions), len(v))
        mapped = self.map(source, target, use_modifiers=True)
        self.assertGreater(len(mapped.source.positions), 2 * len(v))
        self.assertFalse(np.allclose(mapped.target.positions, world(target)))
        target.shape_key_add(name="Basis")
        target.shape_key_add(name="Up").data[0].co.z += 1
        target.data.shape_keys.key_blocks["Up"].value = 1.0
        before = mapped.target.positions
        moved_one = read_surface(target, True).positions - before
        self.assertGreater(np.abs(moved_one[0]).max(), 0.5)  # evaluated: as shown
        self.assert_close(read_surface(target, False).positions, world(target), 1e-6)
        OPS.vertex_groups()
        self.assert_close(weights(target, "G"), 0.5 + 0.4 * bumps(12)[0][:, 0], 0.15)
        self.refuses("modifiers of Source change its vertices", OPS.wrap)
        target.modifiers.new("S", "SUBSURF")
        self.refuses("modifiers of Target change its faces", OPS.map)
        target.modifiers.clear()
        target.modifiers.new("T", "TRIANGULATE")
        self.refuses("modifiers of Target change its faces", OPS.map)


class BadInput(Case):
    def test_objects(self):
        v, f = bumps(6)
        source, target = make("Source", v, f), make("Target", v, f)
        self.choose(None, target)
        self.refuses("Choose the source object", OPS.map)
        self.choose(source, None)
        self.refuses("Choose the target object", OPS.map)
        self.choose(source, source)
        self.refuses("are the same object, Source", OPS.map)
        points = make("Points", v, [])
        self.choose(points, target)
        self.refuses("Points has no faces", OPS.map)
        flat = make("Flat", v * 0, f)
        self.choose(flat, target)
        self.refuses("no triangle is left .A is (Flat|Thin), B is Target", OPS.map)
        bpy.ops.mesh.primitive_torus_add()
        self.choose(bpy.context.object, target)
        self.refuses("A is Torus, B is Target", OPS.map)
        thin = make("Thin", v, f, Matrix.Scale(0, 4))
        self.choose(thin, target)
        self.refuses("no triangle is left .A is (Flat|Thin), B is Target", OPS.map)
        self.choose(source, target)
        self.refuses("There is no map yet", OPS.wrap)
        self.assertIsNone(job.current)

    def test_objects_that_change_after_the_map(self):
        v, f = bumps(6)
        source, target = make("Source", v, f), make("Target", v, f)
        self.map(source, target)
        self.refuses("has no vertex groups", OPS.vertex_groups)
        self.refuses("has no shape keys", OPS.shape_keys)
        self.refuses("has no UV maps", OPS.uv_maps)
        self.refuses("has no color attributes", OPS.color_attributes)
        twin = bpy.data.objects.new("Twin", source.data)
        bpy.context.scene.collection.objects.link(twin)
        self.choose(source, twin)
        self.refuses("share one mesh", OPS.wrap)
        self.choose(source, make("Other", *bumps(5)))
        self.refuses("Other has other faces", OPS.wrap)
        self.choose(source, target)
        bpy.context.view_layer.objects.active = target
        target.select_set(True)
        bpy.ops.object.delete()
        self.refuses("not in this scene any more|Choose the target", OPS.wrap)

    def test_landmarks(self):
        v, f = bumps(6)
        source, target = make("Source", v, f), make("Target", v, f, TURNED)
        settings = self.choose(source, target)
        bpy.context.view_layer.update()
        self.landmark(source, 24, target, 24)
        for w in source.data.vertices:
            w.select = w.index < 2
        self.refuses("one click after another", OPS.landmark_add)
        for w in source.data.vertices:
            w.select = False
        self.refuses("as many vertices of Source .0. as of Target", OPS.landmark_add)
        self.landmark(source, 24, target, 40)
        mapped = self.map(source, target)  # one vertex, two images
        self.assertIn("may be wrong", " ".join(mapped.map.warnings))
        bpy.data.objects.remove(settings.landmarks[1].source)
        self.assertEqual(OPS.map(), {"FINISHED"})  # it is left out
        OPS.landmark_remove()
        self.assertEqual(len(settings.landmarks), 1)
        self.assertEqual(len([x for x in bpy.data.objects if x.type == "EMPTY"]), 2)
        own = bpy.data.objects.new("Own", None)
        bpy.context.scene.collection.objects.link(own)
        item = settings.landmarks.add()
        item.source = item.target = own
        settings.active_landmark = 1
        OPS.landmark_remove()
        self.assertIn("Own", bpy.data.objects)
        self.assertEqual(settings.landmarks[0].source.name, "Source 1")
        target.matrix_world = MIRRORED  # empties go with their object
        bpy.context.view_layer.update()
        place = settings.landmarks[0].target.matrix_world.translation
        self.assert_close(place, world(target)[24], 1e-5)

    def test_clicks_in_edit_mode_keep_their_order(self):
        import bmesh

        v, f = bumps(6)
        objects = make("Source", v, f), make("Target", v, f, TURNED)
        settings = self.choose(*objects)
        for object in objects:
            bpy.context.view_layer.objects.active = object
            object.select_set(True)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="DESELECT")
        for object in objects:
            mesh = bmesh.from_edit_mesh(object.data)
            mesh.verts.ensure_lookup_table()
            for i in (40, 3, 17):
                mesh.verts[i].select_set(True)
                mesh.select_history.add(mesh.verts[i])
        self.assertEqual(OPS.landmark_add(), {"FINISHED"})
        places = [item.source.location for item in settings.landmarks]
        self.assert_close(places, v[[40, 3, 17]], 1e-6)
        self.assertEqual(OPS.map(), {"FINISHED"})  # in edit mode, too
        self.refuses("object mode", OPS.wrap)


class Stops(Case):
    def spheres(self):
        result = []
        for k in range(2):
            bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=6, location=(3 * k, 0, 0))
            result.append(bpy.context.object)
            for w in result[k].data.vertices:
                w.co.x *= 2 + 0.5 * k
                w.co.z *= 1 + 0.4 * np.sin(5 * w.co.y + k)
        bpy.context.view_layer.update()
        return result

    def test_cancel_at_any_time(self):
        surfaces = [read_surface(object, False) for object in self.spheres()]
        delays, rng = [], random.Random(1)
        for _ in range(6):
            run = job.start(*surfaces, [], {})
            run.wait(rng.uniform(0, 2))
            self.assertIs(job.current, run)
            start = time.perf_counter()
            run.cancel()
            while run.wait(0.001):
                pass
            delays.append(time.perf_counter() - start)
            if run.map is None:
                self.assertEqual(str(run.error), "cancelled before there was a map")
            else:
                self.assertEqual(run.map.status, "cancelled")
            job.end()
        delays = 1000 * np.array(delays)
        print(
            f"cancel, {len(surfaces[0].positions)} vertices: "
            f"median {np.median(delays):.0f} ms, at most {delays.max():.0f} ms"
        )
        self.assertLess(np.median(delays), 500)

    def test_an_object_is_deleted_during_the_run(self):
        from map_surface.operators import MAP_SURFACE_OT_map

        for name in ("Source", "Target"):
            v, f = bumps(8)
            objects = {x: make(x, v, f) for x in ("Source", "Target")}
            self.choose(*objects.values())
            told = []

            class Driven:
                """The operator's functions without Blender's part of it."""

                report = staticmethod(lambda kind, sentence: told.append((kind, sentence)))
                _start = MAP_SURFACE_OT_map._start
                _finish = MAP_SURFACE_OT_map._finish

            driven = Driven()
            self.assertTrue(driven._start(bpy.context))
            bpy.data.objects.remove(objects.pop(name))
            while driven._job.wait(0.01):
                pass
            self.assertEqual(driven._finish(), {"CANCELLED"})
            self.assertEqual(told, [({"ERROR"}, f"{name} was deleted or renamed: its map is lost")])
            self.assertIsNone(job.current)
            bpy.data.objects.remove(*objects.values())

    def test_the_addon_ends_a_run(self):
        run = job.start(*[read_surface(object, False) for object in self.spheres()], [], {})
        bpy.ops.preferences.addon_disable(module="map_surface")
        self.assertFalse(run.wait(0))
        bpy.ops.preferences.addon_enable(module="map_surface")


if __name__ == "__main__":
    names = sys.argv[sys.argv.index("--") + 3 :]
    result = unittest.main(argv=["test_addon", "-v", *names], exit=False).result
    sys.exit(not result.wasSuccessful())
