// ism.hpp as an ES module, for browsers and node: README.md shows how, ism.d.mts has the reference.
// Every map has a worker of its own, which computes; see engine.mjs.

import {Engine, IsmError, isInt32, landmarkRows} from './engine.mjs';

export {IsmError};

const kSides = ['a', 'b'];
const kElements = ['vertex', 'face', 'corner'];
const kSliceSeconds = 0.03;  // from one look at the signal to the next, unless a step takes longer

const refuse = message => {
  throw new IsmError(message);
};

// ---- arguments ----

const isNumbers = x => Array.isArray(x) ||
    (ArrayBuffer.isView(x) && !(x instanceof DataView) && typeof x[0] !== 'bigint');

// A copy, which the worker may have.
function numbers(values, name) {
  if (!isNumbers(values)) refuse(`${name} must be a typed array or an array of numbers`);
  const wrong = Array.isArray(values) ? values.findIndex(x => typeof x !== 'number') : -1;
  if (wrong >= 0) refuse(`${name}: element ${wrong} is not a number`);
  return Float64Array.from(values);
}

function ids(values, name) {
  const given = numbers(values, name);
  const wrong = given.findIndex(x => !isInt32(x));
  if (wrong >= 0) refuse(`${name}: element ${wrong} is ${given[wrong]}, which is no id`);
  return Int32Array.from(given);
}

function needRows(array, name) {
  if (array.length % 3) refuse(`${name} has ${array.length} numbers, which are no rows of three`);
  return array;
}

function meshOf(mesh, name) {
  const {positions, triangles} = Object(mesh);
  return {
    positions: needRows(numbers(positions, `positions of ${name}`), `positions of ${name}`),
    triangles: needRows(ids(triangles, `triangles of ${name}`), `triangles of ${name}`)
  };
}

const oneOf = (...names) => (x, name) =>
    names.includes(x) ? x : refuse(`${name} must be one of ${names.join(', ')}`);
const aNumber = (x, name) => typeof x === 'number' ? x : refuse(`${name} must be a number`);
const anInteger = (x, name) => isInt32(x) ? x : refuse(`${name} must be an integer`);
const aBoolean = (x, name) => typeof x === 'boolean' ? x : refuse(`${name} must be true or false`);

const kOptions = {
  measure: oneOf('dirichlet', 'arap', 'sarap', 'asap'),
  boundary: oneOf('free', 'fixed', 'slide'),
  maxIterations: anInteger,
  historyLength: anInteger,
  coarsest: anInteger,
  outerA: anInteger,
  outerB: anInteger,
  tolerance: aNumber,
  maxSeconds: aNumber,
  coverageWeight: aNumber,
  refine: aNumber,
  omegaStart: aNumber,
  keepScale: aBoolean,
  exactLandmarks: aBoolean,
  weld: aBoolean,
  candidates: aBoolean,
  asPublished: aBoolean,
  pinsA: ids,
  pinsB: ids
};

function optionsOf(given) {
  const options = {};
  for (const [name, value] of Object.entries(given)) {
    if (!Object.hasOwn(kOptions, name))
      refuse(`there is no option ${name}; there are ${Object.keys(kOptions).join(', ')}`);
    if (value !== undefined) options[name] = kOptions[name](value, name);
  }
  return options;
}

// ---- the worker ----

// A module of node's. Bundlers leave it alone.
const nodes = name => import(/* webpackIgnore: true */ /* @vite-ignore */ `node:${name}`);

// Node's workers, where browsers have their own, with the face of those.
async function startWorker() {
  if (typeof Worker === 'function')
    return new Worker(new URL('./worker.js', import.meta.url), {name: 'ism'});
  const {Worker: NodeWorker} = await nodes('worker_threads');
  const here = import.meta.url;  // bundlers have found the worker above, and need no second one
  const worker = new NodeWorker(new URL('worker.js', here));
  const face = {
    waiting: 0,  // a program may end while its maps wait for questions
    postMessage(message, transfer) {
      if (face.waiting++ === 0) worker.ref();
      worker.postMessage(message, transfer);
    },
    terminate: () => worker.terminate()
  };
  worker.on('message', data => {
    if (--face.waiting === 0) worker.unref();
    face.onmessage({data});
  });
  worker.on('error', error => face.onerror(error));
  return face;
}

async function readProgram() {
  const url = new URL('./ism.wasm', import.meta.url);
  if (url.protocol === 'file:') return (await nodes('fs/promises')).readFile(url);
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status}`);
  return response.arrayBuffer();
}

// What fails without a sentence of the library's, as for want of memory, may leave anything behind.
async function ask(engine, call, values, transfer) {
  try {
    return await engine.ask(call, values, transfer);
  } catch (error) {
    engine.end(error.message);
    throw error;
  }
}

let program = null;  // compiled once, for all workers

async function startEngine() {
  program = program || readProgram().then(bytes => WebAssembly.compile(bytes));
  const wasm = await program.catch(error => {
    program = null;  // the next call tries again
    throw new IsmError(error.message, 'failed call');
  });
  const engine = new Engine(await startWorker());
  await ask(engine, 'begin', {wasm});
  return engine;
}

// ---- maps ----

const buffersOf = arrays => Object.values(arrays).filter(ArrayBuffer.isView).map(x => x.buffer);

const errorOf = ({message, status, ids: named}) => new IsmError(message, status, named);

const isPoint = (x, i) => {
  const [u, v, w] = x.subarray(3 * i, 3 * i + 3);
  return u >= 0 && v >= 0 && w >= 0 && Math.abs(u + v + w - 1) < 1e-6;
};

// An array of the type of `values` from sums; integers are rounded and clamped.
function like(values, sums) {
  if (!ArrayBuffer.isView(values)) return sums;
  const kind = values[Symbol.toStringTag];  // also of subclasses, as node's Buffer
  const Kind = globalThis[kind];
  if (kind.startsWith('Float')) return Kind.from(sums);
  const n = 2 ** (8 * values.BYTES_PER_ELEMENT), low = kind.startsWith('Int') ? -n / 2 : 0;
  return Kind.from(sums, x => Math.min(Math.max(Math.round(x), low), low + n - 1));
}

class Direction {
  #engine;
  #side;
  #sizes;  // of the mesh from which it maps, {vertex, face}
  #matrices = new Map();

  constructor(engine, side, sizes) {
    this.#engine = engine;
    this.#side = side;
    this.#sizes = sizes;
  }

  async images(points, barycentric) {
    if (this.#engine.ended) throw this.#engine.ended;
    if (points && points.faces && barycentric === undefined)
      ({faces: points, barycentric} = points);
    const n = this.#sizes.vertex;
    const values = {side: this.#side};
    values.ids = points === undefined ? Int32Array.from({length: n}, (_, i) => i) :
                                        ids(isInt32(points) ? [points] : points, 'points');
    if (barycentric === undefined) {
      this.#needInRange(values.ids, 0, 'vertex');
    } else {
      this.#needInRange(values.ids, -1, 'face');
      values.barycentric = numbers(barycentric, 'barycentric');
      if (values.barycentric.length !== 3 * values.ids.length)
        refuse(`barycentric has ${values.barycentric.length} numbers, not three for each point`);
      const wrong = values.ids.findIndex((face, i) => face >= 0 && !isPoint(values.barycentric, i));
      if (wrong >= 0) refuse(`barycentric: those of point ${wrong} are not at least 0 with sum 1`);
    }
    return ask(this.#engine, 'images', values, buffersOf(values));
  }

  // In both, elements are named by what they are: 'vertex', 'face', 'corner'.
  async matrix({source = 'vertex', target = 'vertex'} = {}) {
    const {offsets, sources, weights, columns} = await this.#matrix(source, target);
    return {offsets: offsets.slice(), sources: sources.slice(), weights: weights.slice(), columns};
  }

  async transfer(values, columns = 1, {source = 'vertex', target = 'vertex', fill = 0} = {}) {
    const matrix = await this.#matrix(source, target);
    if (!isNumbers(values)) refuse('values must be a typed array or an array of numbers');
    if (!(isInt32(columns) && columns > 0)) refuse('columns must be a positive integer');
    aNumber(fill, 'fill');
    if (values.length !== matrix.columns * columns)
      refuse(`values has ${values.length} numbers, not ${columns} for each ${source} of ` +
             `${kSides[this.#side]}: ${matrix.columns * columns}`);
    const {offsets, sources, weights} = matrix, n = offsets.length - 1;
    const sums = new Float64Array(n * columns);
    for (let i = 0; i < n; ++i) {
      const row = sums.subarray(i * columns, (i + 1) * columns);
      if (offsets[i] === offsets[i + 1]) row.fill(fill);
      for (let k = offsets[i]; k < offsets[i + 1]; ++k)
        for (let c = 0; c < columns; ++c) row[c] += weights[k] * values[sources[k] * columns + c];
    }
    return like(values, sums);
  }

  #needInRange(given, least, element) {
    const n = this.#sizes[element], wrong = given.findIndex(id => id < least || id >= n);
    if (wrong >= 0) refuse(`points: ${element} ${given[wrong]} is not one of 0 to ${n - 1}`);
  }

  // Those that were asked for are kept.
  #matrix(source, target) {
    if (this.#engine.ended) throw this.#engine.ended;
    const [from, to] = [source, target].map(
        name => kElements.indexOf(oneOf(...kElements)(name, 'an element')));
    const key = 3 * from + to;
    if (!this.#matrices.has(key))
      this.#matrices.set(
          key, ask(this.#engine, 'transfer', {side: this.#side, source: from, target: to}));
    return this.#matrices.get(key);
  }
}

class SurfaceMap {
  #engine;
  #meta = null;

  constructor(engine, sizes, summary) {
    this.#engine = engine;
    this.aToB = new Direction(engine, 0, sizes[0]);
    this.bToA = new Direction(engine, 1, sizes[1]);
    this.coverage = [summary.coverageA, summary.coverageB];
    for (const name of ['status', 'message', 'warnings', 'distortion', 'iterations', 'seconds'])
      this[name] = summary[name];
  }

  get meta() {
    if (this.#engine.ended) return Promise.reject(this.#engine.ended);
    this.#meta = this.#meta || ask(this.#engine, 'meta');
    return this.#meta;
  }

  free() {
    this.#engine.end('the map was freed', 'invalid input');
  }
}

export async function map(a, b, given) {
  const {landmarks = [], onProgress, signal, ...options} = Object(given);
  const meshes = [meshOf(a, 'a'), meshOf(b, 'b')];
  const sizes = meshes.map(
      ({positions, triangles}) => ({vertex: positions.length / 3, face: triangles.length / 3}));
  const values = {meshes, landmarks: landmarkRows(landmarks), options: optionsOf(options)};
  if (onProgress && typeof onProgress !== 'function') refuse('onProgress must be a function');
  if (signal && typeof signal.aborted !== 'boolean') refuse('signal must be an AbortSignal');
  const isAborted = () => Boolean(signal && signal.aborted);
  if (isAborted()) throw signal.reason;
  const engine = await startEngine();
  try {
    const begun = await engine.ask('start', values, meshes.flatMap(buffersOf));
    if (!begun.more && !begun.usable) throw errorOf(begun);
    for (let more = begun.more; more;) {
      if (isAborted()) {
        await engine.ask('cancel');
        break;
      }
      const state = await engine.ask('slice', {seconds: kSliceSeconds});
      more = state.more;
      if (onProgress) onProgress(state.fraction, state.what);
    }
    const summary = await engine.ask('map');
    if (summary.usable) return new SurfaceMap(engine, sizes, summary);
    throw isAborted() && summary.status === 'no map yet' ? signal.reason : errorOf(summary);
  } catch (error) {
    engine.end('the run ended');
    throw error;
  }
}
