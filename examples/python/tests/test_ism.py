"""The package from outside: what it returns, what it refuses, threads and signals."""

import gc
import os
import pathlib
import signal
import sys
import threading
import time
import types

import ism
import numpy as np
import pytest

DATA = pathlib.Path(__file__).resolve().parents[3] / "data"


def sheet(n, height=0.0, flipped=False):
    """A square of n×n vertices with a hill."""
    y, x = np.mgrid[:n, :n] / (n - 1.0)
    z = height * np.exp(-9 * ((x - 0.6) ** 2 + (y - 0.4) ** 2))
    v = np.arange(n * n).reshape(n, n)
    p, q, r, s = v[:-1, :-1], v[:-1, 1:], v[1:, 1:], v[1:, :-1]
    two = [(p, q, s), (q, r, s)] if flipped else [(p, q, r), (p, r, s)]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in two])
    return np.stack([x, y, z], -1).reshape(-1, 3), faces


FAST = {"candidates": False}  # from one start only
QUICK = {"max_iterations": 1, "candidates": False}  # of little quality
A, B = sheet(13), sheet(15, 0.5, flipped=True)
CORNERS = [(0, 0), (12, 14), (156, 210), (168, 224)]


@pytest.fixture(scope="module")
def m():
    return ism.map(A, B, CORNERS, boundary="slide", **FAST)


def endless(**options):
    """A run that does not end by itself for a while."""
    return ism.Run(sheet(40), sheet(45, 0.5), tolerance=0, max_iterations=10**6, **FAST, **options)


# ---- Results ----


def test_maps_points_in_both_directions(m):
    there = m.a_to_b()
    assert there.covered.all() and there.faces.dtype == np.int32
    corners = B[0][B[1][there.faces]]
    np.testing.assert_allclose(
        there.positions, np.einsum("nk,nkx->nx", there.barycentric, corners), atol=1e-12
    )
    back = m.b_to_a(there)
    np.testing.assert_allclose(back.positions, A[0], atol=1e-9)
    one = m.a_to_b(7)
    assert one.positions.shape == (1, 3) and (one.positions[0] == there.positions[7]).all()
    middle = m.a_to_b([3, -1], [[0.2, 0.3, 0.5], [0, 0, 0]])
    assert middle.covered.tolist() == [True, False] and np.isnan(middle.positions[1]).all()


def test_transfers_values_of_any_shape_and_type(m):
    linear = A[0] @ [1.0, 2.0, 0.0]
    image = m.a_to_b.transfer(linear)
    np.testing.assert_allclose(image, m.b_to_a().positions @ [1.0, 2.0, 0.0], atol=1e-9)
    stacked = m.a_to_b.transfer(np.stack([[linear, -linear]] * 4, -1).transpose(1, 2, 0))
    np.testing.assert_allclose(stacked[:, 3, 1], -image, atol=1e-12)
    assert m.a_to_b.transfer(linear.astype("f4")).dtype == np.float32
    colors = np.full((len(A[0]), 3), 255, np.uint8)
    assert (m.a_to_b.transfer(colors) == 255).all()
    largest = np.full(len(A[0]), np.iinfo(np.int64).max)
    assert (m.a_to_b.transfer(largest) > largest[0] - 10**4).all()  # no overflow
    assert m.a_to_b.transfer(linear > 1).dtype == np.float64
    assert m.b_to_a.transfer(np.ones((len(B[1]), 0)), "face", "corner").shape == (3 * len(A[1]), 0)
    area = m.b_to_a.transfer(np.ones(len(B[1])), "face", "face")
    np.testing.assert_allclose(area, 1)


def test_fills_what_is_not_covered():
    part = ism.map(A, B, **QUICK)
    is_empty = np.diff(part.a_to_b.csr()[0]) == 0
    assert is_empty.any() and (part.b_to_a().covered != is_empty).all()
    values = part.a_to_b.transfer(np.ones(len(A[0])), fill=np.nan)
    assert (np.isnan(values) == is_empty).all()
    assert (part.a_to_b.transfer(np.ones(len(A[0]), int), fill=-1)[is_empty] == -1).all()
    with pytest.raises(ValueError):
        part.a_to_b.transfer(np.ones(len(A[0]), int), fill=np.nan)


def test_has_matrices_of_scipy(m):
    pytest.importorskip("scipy")
    values = np.random.default_rng(1).random((len(A[0]), 2))
    assert m.matrix.shape == (len(B[0]), len(A[0])) and m.matrix.format == "csr"
    np.testing.assert_allclose(m.matrix @ values, m.a_to_b.transfer(values), atol=1e-12)
    np.testing.assert_allclose(m.b_to_a.matrix_of("face", "corner").sum(axis=1), 1)


def test_meta_mesh_and_distortion_agree(m):
    meta, distortion = m.meta, m.distortion
    assert meta.offsets[-1] == len(meta.corners) and len(meta.face_a) == len(distortion.polygons)
    corners = A[0][A[1][meta.face_a.repeat(np.diff(meta.offsets))]]
    on_a = np.einsum("nk,nkx->nx", meta.corner_a, corners)
    np.testing.assert_allclose(on_a, meta.on_a[meta.corners], atol=1e-9)
    areas = distortion.polygons[:, :2].sum(axis=0)
    np.testing.assert_allclose(areas, [distortion.area_a, distortion.area_b])
    assert 2 <= distortion.median <= distortion.p95 <= distortion.largest
    assert m.coverage == pytest.approx((1, 1)) and m.status == "converged" and m.seconds > 0


def test_arrays_outlive_the_map_and_are_read_only():
    small = ism.map(A, B, **QUICK)
    plane, polygons = small.meta.plane, small.distortion.polygons
    before = plane.copy()
    del small
    gc.collect()
    assert (plane == before).all() and polygons.min() > 0
    with pytest.raises(ValueError):
        plane[0] = 0


def test_same_numbers_make_the_same_map_in_any_array():
    x, f = A[0].astype(np.float32), A[1]
    wide = np.zeros((len(x), 7), np.float32)
    wide[:, 2:5] = x
    open3d = types.SimpleNamespace(vertices=x.tolist(), triangles=f.astype(np.uint64).tolist())
    trimesh = types.SimpleNamespace(vertices=x.astype(">f8"), faces=f[::-1].astype(np.int8)[::-1])
    trimesh.faces = f.astype(np.uint16)
    given = [
        (x, f),
        [np.asfortranarray(x), np.asfortranarray(f)],
        (wide[:, 2:5], f.astype(np.int32)),
        (x[::-1][::-1], np.repeat(f.astype(np.int32), 2, axis=0)[::2]),
        (x.astype(np.longdouble), f.astype(np.uint32)),
        open3d,
        trimesh,
    ]
    results = [ism.map(mesh, B, **QUICK).distortion.mean for mesh in given]
    assert len(set(results)) == 1


def test_integers_are_positions_too():
    x = np.round(A[0] * 12).astype(np.int16)
    assert ism.map((x, A[1]), B, **QUICK).status == "iteration limit"


def test_landmarks_as_vertices_and_as_points():
    face = int(np.nonzero((A[1] == 84).any(axis=1))[0][0])
    point = (face, (A[1][face] == 84).astype(float))
    given = [[(84, 112)], [(point, 112, 8)], np.array([[84, 112]], np.uint8)]
    results = [ism.map(A, B, x, exact_landmarks=True, **QUICK) for x in given]
    for result in results:
        np.testing.assert_allclose(result.a_to_b(84).positions[0], B[0][112], atol=1e-9)


# ---- What is refused ----


@pytest.mark.parametrize(
    "a, words",
    [
        ((A[0][:, :2], A[1]), r"vertices of a must have shape \(#, 3\), not \(169, 2\)"),
        ((A[0], A[1][:, [0, 1, 2, 2]]), "triangulate"),
        ((A[0].ravel(), A[1]), "shape"),
        ((A[0], A[1].astype(float)), "faces of a must be integers, not float64"),
        ((A[0] > 0, A[1]), "numbers, not bool"),
        ((A[0].astype(complex), A[1]), "numbers, not complex128"),
        ((A[0].astype(str), A[1]), "numbers, not"),
        ((A[0], A[1] + 2**40), "the id 1099511627776 is out of range"),
        ((np.zeros((0, 3)), A[1]), "no vertices"),
        ((A[0], []), "shape"),
    ],
)
def test_refuses_wrong_arrays(a, words):
    with pytest.raises(ism.InputError, match=words):
        ism.map(a, B)


@pytest.mark.parametrize("a", [None, 3, A[0], (A[0],), types.SimpleNamespace(vertices=A[0])])
def test_refuses_what_is_no_mesh(a):
    with pytest.raises(TypeError, match="must be"):
        ism.map(a, B)


def broken(what, index, value):
    mesh = A[0].copy(), A[1].copy()
    mesh[what][index] = value
    return mesh


@pytest.mark.parametrize(
    "a, element",
    [
        (broken(1, (5, 1), 169), ism.Id("a", "face", 5)),
        (broken(1, (5, 1), -1), ism.Id("a", "face", 5)),
        (broken(0, (9, 2), np.nan), ism.Id("a", "vertex", 9)),
        (broken(0, (9, 0), -np.inf), ism.Id("a", "vertex", 9)),
    ],
)
def test_names_what_is_wrong_with_a_mesh(a, element):
    with pytest.raises(ism.InputError) as caught:
        ism.map(a, B)
    assert caught.value.status == "invalid mesh" and element in caught.value.ids
    assert str(element.id) in str(caught.value)


@pytest.mark.parametrize(
    "landmarks, words",
    [
        ([(0, 225)], "225"),
        ([(-1, 0)], "landmark"),
        ([(0, 0, -1)], "weight"),
        ([(0, 0, np.nan)], "weight"),
        ([(0, 2**40)], "out of range"),
        ([(0.5, 0)], "must be a vertex"),
        ([(0, (0, (0.5, 0.5)))], "must be a vertex"),
        ([(0, (0, (np.nan, 0.5, 0.5)))], "landmark"),
        ([3], r"must be \(a, b\)"),
        ([(0, 1, 2, 3)], r"must be \(a, b\)"),
    ],
)
def test_refuses_landmarks(landmarks, words):
    with pytest.raises(ism.InputError, match=words):
        ism.map(A, B, landmarks)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"tolerance": np.nan}, "tolerance"),
        ({"max_iterations": -1}, "max_iterations"),
        ({"measure": "mips"}, "symmetric_dirichlet, arap"),
        ({"boundary": 1}, "free, fixed, slide"),
        ({"pins_a": [169]}, "169"),
        ({"pins_a": [0.5]}, "integers"),
        ({"threads": 2**40}, "out of range"),
    ],
)
def test_refuses_options(options, words):
    with pytest.raises(ism.InputError, match=words):
        ism.map(A, B, **options)


def test_lists_the_options_there_are():
    with pytest.raises(TypeError, match="no option 'coarse'.* coarsest"):
        ism.map(A, B, coarse=5)
    with pytest.raises(TypeError):
        ism.map(A, B, max_iterations="many")


@pytest.mark.parametrize(
    "points, barycentric",
    [
        ([169], None),
        ([-1], None),
        ([2**40], None),
        ([0.5], None),
        ([[0, 1]], None),
        ([0], [[np.nan, 0, 1]]),
        ([0], [[1, 1, 1]]),
        ([0], [[1, 0]]),
        ([0, 1], [[1, 0, 0]]),
        ([288], [[1, 0, 0]]),
    ],
)
def test_refuses_points(m, points, barycentric):
    with pytest.raises(ism.InputError):
        m.a_to_b(points, barycentric)


def test_refuses_values(m):
    for values in (np.ones(3), 5, ["a"] * len(A[0]), np.ones((2, len(A[0])))):
        with pytest.raises(ism.InputError, match="values must be"):
            m.a_to_b.transfer(values)
    with pytest.raises(ism.InputError, match="vertex, face, corner"):
        m.a_to_b.transfer(np.ones(len(A[0])), "edge")


# ---- Progress, threads and signals ----


def test_reports_progress_and_obeys():
    seen = []
    ism.map(A, B, progress=lambda fraction, what: seen.append((fraction, what)), **FAST)
    assert seen == sorted(seen, key=lambda x: x[0]) and 0 <= seen[0][0] <= seen[-1][0] <= 1
    result = ism.map(A, B, progress=lambda fraction, what: fraction < 0.5, **FAST)
    assert result.status == "cancelled"
    with pytest.raises(ism.Error) as caught:
        ism.map(A, B, progress=lambda fraction, what: False, **FAST)
    assert caught.value.status == "no map yet"


def test_exceptions_of_progress_reach_the_caller():
    def fail(fraction, what):
        raise KeyError("mine")

    run = ism.Run(A, B, progress=fail, **FAST)
    with pytest.raises(KeyError, match="mine"):
        run.advance()
    run._teller.progress = None
    assert not run.advance() and run.state().status == "converged"


def test_shows_a_bar(capfd):
    pytest.importorskip("tqdm")
    ism.map(A, B, progress=True, **FAST)
    assert "%" in capfd.readouterr().err


def test_warns_of_a_poor_map():
    mirrored = [(0, 14), (12, 0), (156, 224), (168, 210), (84, 112), (30, 40), (100, 140)]
    with pytest.warns(ism.Warning):
        assert ism.map(A, B, mirrored, **FAST).warnings


def test_goes_on_in_steps():
    run = ism.Run(A, B, **FAST)
    with pytest.raises(ism.Error, match="has not come to its end"):
        run.map()
    assert run.advance(steps=1)
    while run.advance(seconds=0.01):
        assert run.state().fraction < 1
    whole = ism.map(A, B, **FAST)
    assert run.state().distortion == pytest.approx(whole.distortion.mean, rel=1e-9)
    assert (run.map().a_to_b().faces == whole.a_to_b().faces).all()
    with pytest.raises(ism.InputError):
        run.advance(seconds=-1)


def test_one_thread_at_a_time_may_use_a_run():
    run, other = endless(), []
    thread = threading.Thread(target=lambda: other.append(run.advance()))
    thread.start()
    time.sleep(0.2)
    for use in (run.state, run.map, lambda: run.advance(steps=1)):
        with pytest.raises(ism.BusyError, match="another call"):
            use()
    run.cancel()
    thread.join(30)
    assert other == [False] and run.state().status in ("cancelled", "no map yet")
    run.cancel(False)
    assert run.advance(steps=1)


def test_cancels_soon_and_lets_other_threads_run():
    run, counted = endless(), 0
    thread = threading.Thread(target=run.advance)
    thread.start()
    end = time.perf_counter() + 0.5
    while time.perf_counter() < end:
        counted += 1
    start = time.perf_counter()
    run.cancel()
    thread.join(30)
    latency = time.perf_counter() - start
    print(f"cancelled after {1e3 * latency:.1f} ms, meanwhile Python counted to {counted}")
    assert latency < 2 and counted > 10000


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill() ends the process there")
@pytest.mark.parametrize("when", ["decimating A", "optimising the map"])
def test_ctrl_c_gives_the_best_map_so_far(when):
    a, b, pressed, has_map = sheet(40), sheet(45, 0.5), [], when == "optimising the map"

    def press():
        pressed.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.1, press)

    def show(fraction, what):
        if what != when or pressed or timer.is_alive():
            return
        if has_map:
            timer.start()  # while the library works
        else:
            press()

    def run():
        return ism.map(a, b, tolerance=0, max_iterations=10**6, progress=show, **FAST)

    if has_map:
        result = run()
        assert result.status == "cancelled" and result.distortion.mean > 2
    else:
        with pytest.raises(KeyboardInterrupt):
            run()
    latency = time.perf_counter() - pressed[0]
    print(f"Ctrl-C took {1e3 * latency:.0f} ms")
    assert latency < 3 and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_any_number_of_threads_may_use_a_map(m):
    expected = m.a_to_b.transfer(A[0], target="corner")
    fresh = ism.map(A, B, CORNERS, boundary="slide", **FAST)
    failures = []

    def use():
        for _ in range(5):
            if not np.array_equal(fresh.a_to_b.transfer(A[0], target="corner"), expected):
                failures.append("values")
            if len(fresh.meta.face_a) != len(m.meta.face_a):
                failures.append("meta")

    threads = [threading.Thread(target=use) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


def test_memory_is_freed():
    resource = pytest.importorskip("resource")
    for _ in range(5):
        ism.map(A, B, **QUICK).distortion
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(30):
        ism.map(A, B, **QUICK).distortion
    growth = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert growth < 10000  # kB; each of the 30 takes about 2000


# ---- The surfaces in data/ ----


def read_obj(path):
    rows = [line.split() for line in path.read_text().splitlines()]
    vertices = [[float(x) for x in row[1:4]] for row in rows if row[:1] == ["v"]]
    faces = [[int(x.split("/")[0]) - 1 for x in row[1:4]] for row in rows if row[:1] == ["f"]]
    return np.array(vertices), np.array(faces)


def test_maps_starfish():
    a, b = (read_obj(DATA / "starfish" / name) for name in ("A.obj", "B.obj"))
    pairs = np.loadtxt(DATA / "starfish" / "landmarks.txt", int, usecols=(0, 1))
    result = ism.map(a, b, pairs)
    assert result.status == "converged" and result.distortion.mean < 2.06
    assert min(result.coverage) > 0.95
