// What must hold for the module of examples/web/module/, in node and in a browser:
//   const failures = await runCases({map, IsmError}, {starfish: {a, b, landmarks, native}}, say);
// `native` is what the program in C++ prints; say(text) reports.

function assert(holds, what) {
  if (!holds) throw new Error(what);
}

function assertNear(x, y, tolerance, what) {
  assert(Math.abs(x - y) <= tolerance, `${what}: ${x}, not ${y}`);
}

// Rejects as it should: with an IsmError whose status, sentence and ids are these.
async function refusalOf(work, IsmError) {
  try {
    await work();
  } catch (error) {
    assert(error instanceof IsmError, `not an IsmError: ${error.stack || error}`);
    return error;
  }
  throw new Error('it is not refused');
}

const timeOf = async work => {
  const begin = performance.now();
  return [await work(), (performance.now() - begin) / 1000];
};

const sum = values => values.reduce((x, y) => x + y, 0);
const kQuick = {maxIterations: 0, candidates: false};  // the start, undecimated

// ---- meshes ----

// A square of n × n cells, with a wave.
function sheet(n, height) {
  const positions = [], triangles = [];
  for (let j = 0; j <= n; ++j)
    for (let i = 0; i <= n; ++i) positions.push(i / n, j / n, height * Math.sin(6 * i / n));
  for (let j = 0; j < n; ++j)
    for (let i = 0; i < n; ++i) {
      const v = j * (n + 1) + i;
      triangles.push(v, v + 1, v + n + 2, v, v + n + 2, v + n + 1);
    }
  return {positions, triangles};
}

const cases = [];
const test = (name, run) => cases.push({name, run});

// ---- maps ----

test('maps the starfish as the program in C++ does', async t => {
  const {a, b, landmarks, native} = t.data.starfish;
  const told = [];
  const onProgress = (fraction, what) => told.push([fraction, what]);
  const [m, seconds] = await timeOf(() => t.map(a, b, {landmarks, onProgress}));
  t.starfish = m;
  t.say(`starfish: ${seconds.toFixed(1)} s, natively ${native.seconds.toFixed(1)} s`);
  assert(m.status === 'converged' && m.message !== '' && m.warnings.length === 0, m.status);
  assertNear(m.distortion.mean, native.distortion, 1e-5, 'distortion');
  assertNear(m.coverage[0], native.coverage[0], 1e-5, 'coverage');
  assertNear(m.coverage[1], native.coverage[1], 1e-5, 'coverage');
  assert(m.iterations > 0 && m.seconds > 0, 'figures');
  assert(told.length > 3 && told.every(([, what]) => typeof what === 'string'), 'progress');
  assert(told.every(([x], i) => x >= 0 && x <= 1 && (i === 0 || x >= told[i - 1][0])), 'fractions');
});

test('finds images of vertices, points and images', async t => {
  const m = t.starfish, {a, b} = t.data.starfish;
  const n = a.positions.length / 3;
  const [all, seconds] = await timeOf(() => m.aToB.images());
  t.say(`images of ${n} vertices: ${(1000 * seconds).toFixed(1)} ms`);
  assert(all.faces.length === n && all.positions.length === 3 * n, 'all vertices');
  for (let v = 0; v < n; ++v) {
    const face = all.faces[v];
    for (let k = 0; k < 3; ++k) {
      const corners = [0, 1, 2].map(i => b.positions[3 * b.triangles[3 * face + i] + k]);
      const x = sum(corners.map((c, i) => c * all.barycentric[3 * v + i]));
      const y = all.positions[3 * v + k];
      assert(face < 0 ? Number.isNaN(y) : Math.abs(x - y) < 1e-12, `vertex ${v}`);
    }
  }
  const some = await m.aToB.images(new Uint16Array([7, 3]));
  assert(some.faces.join() === `${all.faces[7]},${all.faces[3]}`, 'some vertices');
  assert((await m.aToB.images(3)).faces[0] === all.faces[3], 'a vertex');
  assert((await m.aToB.images([])).faces.length === 0, 'no vertices');
  const back = await m.bToA.images(all);
  for (let v = 0; v < n; ++v)
    for (let k = 0; k < 3 && all.faces[v] >= 0; ++k)
      assertNear(back.positions[3 * v + k], a.positions[3 * v + k], 1e-9, `vertex ${v}, and back`);
  const corner = await m.aToB.images([0, -1], [1, 0, 0, 0, 0, 0]);
  assert(corner.faces[0] === all.faces[a.triangles[0]] && corner.faces[1] === -1, 'points');
});

test('carries values over', async t => {
  const m = t.starfish, {a, b} = t.data.starfish;
  const nA = a.positions.length / 3, nB = b.positions.length / 3;
  const {offsets, sources, weights, columns} = await m.aToB.matrix();
  assert(columns === nA && offsets.length === nB + 1, 'matrix');
  assert(sources.length === weights.length && sources.length === offsets[nB], 'its elements');
  const covered = i => offsets[i] < offsets[i + 1];
  const [moved, seconds] =
      await timeOf(() => m.aToB.transfer(a.positions, 3, {fill: -7}));
  t.say(`three columns of ${nA} vertices: ${(1000 * seconds).toFixed(2)} ms`);
  assert(moved instanceof a.positions.constructor && moved.length === 3 * nB, 'the type');
  for (let i = 0; i < nB; ++i)
    for (let c = 0; c < 3; ++c) {
      let x = covered(i) ? 0 : -7;
      for (let k = offsets[i]; k < offsets[i + 1]; ++k)
        x += weights[k] * a.positions[3 * sources[k] + c];
      assertNear(moved[3 * i + c], x, 1e-12, `vertex ${i}`);
    }
  const bytes = await m.aToB.transfer(new Uint8Array(nA).fill(200));
  assert(bytes instanceof Uint8Array, 'bytes');
  assert(bytes.every((x, i) => x === (covered(i) ? 200 : 0)), 'they are rounded');
  const full = await m.aToB.transfer(new Int8Array(nA).fill(-128), 1, {fill: 1000});
  assert(full.every((x, i) => x === (covered(i) ? -128 : 127)), 'integers are clamped');
  const faces = new Array(a.triangles.length / 3).fill(1);
  const corners = await m.aToB.transfer(faces, 1, {source: 'face', target: 'corner'});
  assert(corners instanceof Float64Array && corners.length === b.triangles.length, 'corners');
  assert(corners.every(x => x === 0 || Math.abs(x - 1) < 1e-12), 'constants');
});

test('has the common refinement', async t => {
  const m = t.starfish, meta = await m.meta, n = meta.faceA.length;
  assert(await m.meta === meta, 'it is made once');
  assert(meta.offsets.length === n + 1 && meta.distortion.length === 5 * n, 'polygons');
  assert(meta.offsets[n] === meta.corners.length && 3 * meta.corners.length === meta.cornerA.length,
         'corners');
  assert(meta.onA.length === meta.onB.length && 2 * meta.onA.length === 3 * meta.plane.length,
         'vertices');
  const column = k => meta.distortion.filter((_, i) => i % 5 === k);
  assertNear(sum(column(0)), m.distortion.areaA, 1e-9, 'area of A');
  assertNear(sum(column(1)), m.distortion.areaB, 1e-9, 'area of B');
  assert(column(4).every(x => x >= 2) && column(2).every(x => x > 0), 'distortion');
});

test('takes any type of numbers, landmarks in triangles and options', async t => {
  const {a, b} = t.data.starfish;
  const meanOf = async (...input) => {
    const m = await t.map(...input);
    m.free();
    return m.distortion.mean;
  };
  const plain = ({positions, triangles}) => ({
    positions: Array.from(positions),
    triangles: Int16Array.from(triangles)
  });
  const mean = await meanOf(a, b, kQuick);
  assert(mean === await meanOf(plain(a), plain(b), kQuick), 'arrays');
  assert(a.positions.length > 0 && a.triangles.length > 0, 'the arrays given stay');
  const [v, w] = [a.triangles[0], b.triangles[0]];
  const onVertex = await meanOf(a, b, {...kQuick, landmarks: [[v, w]]});
  const onCorner = {face: 0, barycentric: new Float32Array([1, 0, 0])};
  assertNear(await meanOf(a, b, {...kQuick, landmarks: [[onCorner, onCorner, 8]]}), onVertex, 1e-6,
             'points');
  const m = await t.map(sheet(8, 0.1), sheet(9, 0.2), {
    measure: 'arap',
    boundary: 'slide',
    maxIterations: 2,
    tolerance: 0,
    maxSeconds: Infinity,
    pinsA: [40],
    keepScale: true,
    coarsest: undefined
  });
  m.free();
  assert(m.status === 'iteration limit' && m.iterations === 2, m.message);
  assert(m.coverage.every(x => x > 0.999), 'boundaries are mapped onto each other');
});

test('runs several maps at once', async t => {
  const {a, b, landmarks} = t.data.starfish;
  const maps = await Promise.all([1, 2, 3].map(() => t.map(a, b, {...kQuick, landmarks})));
  const means = maps.map(m => m.distortion.mean);
  assert(means.every(x => x === means[0]), `${means}`);
  const [m] = maps, many = await Promise.all([...Array(20)].map((_, i) => m.aToB.images([i])));
  const all = await m.aToB.images();
  assert(many.every(({faces}, i) => faces[0] === all.faces[i]), 'questions at once');
  maps.forEach(one => one.free());
});

// ---- the end of a run ----

test('is cancelled by a signal, with the best map so far', async t => {
  const {a, b, landmarks} = t.data.starfish;
  const abort = new AbortController();
  let aborted = 0;
  const onProgress = fraction => {
    if (fraction > 0.105 && !aborted) {  // on the given meshes
      aborted = performance.now();
      abort.abort();
    }
  };
  const m = await t.map(a, b, {landmarks, onProgress, signal: abort.signal, tolerance: 0});
  t.say(`from the signal to the map: ${(performance.now() - aborted).toFixed(0)} ms`);
  assert(m.status === 'cancelled' && m.distortion.mean > 2, m.status);
  assert((await m.aToB.images()).faces.some(face => face >= 0), 'images');
  m.free();
});

test('is rejected by the reason of the signal before there is a map', async t => {
  const {a, b} = t.data.starfish;
  const rejected = async signal => {
    try {
      await t.map(a, b, {signal});
    } catch (error) {
      return error;
    }
    throw new Error('there is a map');
  };
  assert((await rejected(AbortSignal.abort())).name === 'AbortError', 'before the call');
  const reason = {own: true};
  assert(await rejected(AbortSignal.abort(reason)) === reason, 'a reason');
  const early = new AbortController();
  const rejection = rejected(early.signal);
  early.abort(reason);
  assert(await rejection === reason, 'at the start');
});

test('ends with what onProgress throws', async t => {
  const {a, b} = t.data.starfish;
  const mine = new Error('mine');
  const onProgress = () => {
    throw mine;
  };
  let caught = null;
  await t.map(a, b, {onProgress}).catch(error => caught = error);
  assert(caught === mine, `${caught}`);
});

// ---- what is refused ----

test('refuses input that cannot be used', async t => {
  const a = sheet(4, 0), b = sheet(4, 0.1), {positions, triangles} = a;
  const cut = (array, i, x) => array.map((y, j) => j === i ? x : y);
  const point = (face, ...barycentric) => ({face, barycentric});
  const mesh = (p, f) => [{positions: p, triangles: f}, b];
  const options = o => [a, b, o];
  const landmark = (...l) => options({landmarks: [l]});
  const refused = [
    [[], /positions of a must be/],
    [[a], /positions of b must be/],
    [[null, b], /positions of a must be/],
    [mesh('abc', triangles), /positions of a must be/],
    [mesh(new DataView(new ArrayBuffer(9)), triangles), /positions of a must be/],
    [mesh(new BigInt64Array(9), triangles), /positions of a must be/],
    [mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles), /element 0 is not a number/],
    [mesh(positions, [[0, 1, 2]]), /element 0 is not a number/],
    [mesh(positions.slice(1), triangles), /positions of a has 74 numbers/],
    [mesh(positions, triangles.slice(1)), /triangles of a has 95 numbers/],
    [mesh(positions, cut(triangles, 4, 0.5)), /element 4 is 0.5, which is no id/],
    [mesh(positions, cut(triangles, 4, NaN)), /element 4 is NaN, which is no id/],
    [mesh(positions, cut(triangles, 4, 2 ** 32)), /element 4 is 4294967296, which is no id/],
    [mesh(cut(positions, 5, NaN), triangles), /vertex 1 has a/, 'invalid mesh', 'vertex'],
    [mesh(cut(positions, 5, Infinity), triangles), /not finite/, 'invalid mesh', 'vertex'],
    [mesh(positions, cut(triangles, 4, 25)), /refers to vertex 25/, 'invalid mesh', 'face'],
    [mesh(positions, cut(triangles, 4, -1)), /refers to vertex -1/, 'invalid mesh', 'face'],
    [mesh([], []), /no vertices/, 'invalid mesh'],
    [landmark(1), /landmark 0 must be/],
    [landmark(1, 2, 3, 4), /landmark 0 must be/],
    [landmark(1, 2, 'x'), /landmark 0 must be/],
    [landmark(1, 0.5), /b of landmark 0 must be/],
    [landmark(point(0, 1, 0), 2), /a of landmark 0 must be/],
    [options({landmarks: [3]}), /landmark 0 must be/],
    [options({landmarks: 3}), /landmarks must be a list/],
    [options({landmarks: null}), /landmarks must be a list/],
    [options({onProgress: 1}), /onProgress must be a function/],
    [options({signal: {}}), /signal must be an AbortSignal/],
    [landmark(1, 25), /no vertex 25/, 'invalid landmarks', 'vertex'],
    [landmark(point(32, 1, 0, 0), 2), /triangle 32/, 'invalid landmarks', 'face'],
    [landmark(point(0, 1, 1, 0), 2), /./, 'invalid landmarks', 'face'],
    [landmark(1, 2, NaN), /./, 'invalid landmarks'],
    [options({steps: 1}), /there is no option steps; there are measure/],
    [options({measure: 'area'}), /measure must be one of dirichlet/],
    [options({boundary: 1}), /boundary must be one of free/],
    [options({maxIterations: '3'}), /maxIterations must be an integer/],
    [options({maxIterations: 2 ** 31}), /maxIterations must be an integer/],
    [options({tolerance: null}), /tolerance must be a number/],
    [options({weld: 0}), /weld must be true or false/],
    [options({pinsA: [0.5]}), /pinsA: element 0 is 0.5/],
    [options({maxIterations: -1}), /max_iterations/, 'invalid options'],
    [options({tolerance: NaN}), /tolerance/, 'invalid options'],
    [options({pinsA: [25]}), /25/, 'invalid pins', 'vertex'],
    [[sheet(250, 0), b], /memory for 120,000 triangles/]
  ];
  for (const [input, sentence, status = 'invalid input', element] of refused) {
    const error = await refusalOf(() => t.map(...input), t.IsmError);
    const named = error.ids.map(id => id.element).join();
    assert(sentence.test(error.message) && error.status === status, `${sentence}: ` +
           `${error.status}: ${error.message}`);
    assert(!element || named.startsWith(element), `${sentence}: names ${named}`);
  }
});

test('refuses questions that cannot be answered', async t => {
  const m = await t.map(sheet(4, 0), sheet(5, 0.1), kQuick);
  const refused = [
    [() => m.aToB.images([25]), /vertex 25 is not one of 0 to 24/],
    [() => m.aToB.images([-1]), /vertex -1 is not one of/],
    [() => m.bToA.images([36]), /vertex 36 is not one of 0 to 35/],
    [() => m.aToB.images([1.5]), /element 0 is 1.5, which is no id/],
    [() => m.aToB.images('x'), /points must be/],
    [() => m.aToB.images([32], [1, 0, 0]), /face 32 is not one of 0 to 31/],
    [() => m.aToB.images([0], [1, 0]), /barycentric has 2 numbers/],
    [() => m.aToB.images([0], [NaN, 0, 1]), /barycentric: those of point 0/],
    [() => m.aToB.images([0], [1, 1, 0]), /barycentric: those of point 0/],
    [() => m.aToB.transfer([1, 2]), /values has 2 numbers, not 1 for each vertex of a: 25/],
    [() => m.bToA.transfer(new Float32Array(72), 3), /of b: 108/],
    [() => m.aToB.transfer('x'), /values must be/],
    [() => m.aToB.transfer(new BigInt64Array(25)), /values must be/],
    [() => m.aToB.transfer(new Float32Array(25), 0), /columns must be/],
    [() => m.aToB.transfer(new Float32Array(25), 1, {source: 'edge'}), /an element must be/],
    [() => m.aToB.transfer(new Float32Array(25), 1, {fill: 'x'}), /fill must be/],
    [() => m.aToB.matrix({target: 3}), /an element must be one of vertex, face, corner/]
  ];
  for (const [work, sentence] of refused) {
    const error = await refusalOf(work, t.IsmError);
    assert(sentence.test(error.message) && error.status === 'invalid input', `${error}`);
  }
  assert((await m.aToB.images()).faces.length === 25, 'it still answers');
  m.free();
});

test('refuses what comes after free()', async t => {
  const m = await t.map(sheet(4, 0), sheet(5, 0.1), kQuick);
  await m.aToB.matrix();
  const pending = refusalOf(() => m.aToB.images(), t.IsmError);
  m.free();
  m.free();
  const works = [
    () => pending.then(error => Promise.reject(error)), () => m.aToB.images(),
    () => m.bToA.images([99]), () => m.aToB.transfer(new Float32Array(25)), () => m.meta
  ];
  for (const work of works)
    assert((await refusalOf(work, t.IsmError)).message === 'the map was freed', 'the sentence');
  assert(m.status === 'iteration limit' && m.distortion.mean >= 2, 'figures stay');
});

export async function runCases(library, data, say) {
  const context = {...library, data, say: text => say(`  ${text}`)};
  let failures = 0;
  for (const {name, run} of cases) {
    try {
      await run(context);
      say(`passed: ${name}`);
    } catch (error) {
      ++failures;
      say(`FAILED: ${name}\n  ${error.stack}`);
    }
  }
  return failures;
}
