// The solver in a worker, so that the page never freezes; of the page, and of the module, also in
// node. A request is {id, call, values}, the answer {id, result} or {id, error}; arrays change
// hands without a copy. engine.mjs is the other end. What stands before this text in the worker is
// ism.js, emscripten's frame for session.cpp.
'use strict';

let ism = null;
let session = null;

const calls = {
  async begin({wasm}) {
    ism = await new Promise((resolve, reject) => {
      const instantiateWasm = (imports, done) => {
        WebAssembly.instantiate(wasm, imports)
            .then(instance => done(instance, wasm))
            .catch(reject);  // e.g. there is no memory for it
        return {};           // it comes later
      };
      // Sentences of the library's own are in results; what emscripten prints is a fault.
      createIsm({instantiateWasm, print: console.log, printErr: console.error})
          .then(resolve, reject);
    });
    session = new ism.Session();
  },

  heat() {
    return ism.heatColors(256);
  },

  // ---- of the page ----

  open({side, name, bytes}) {
    const path = '/' + name.replace(/\//g, '_');
    ism.FS.writeFile(path, new Uint8Array(bytes));
    const result = session.open(side, path);
    ism.FS.unlink(path);
    if (!result.ok) result.message = result.message.replace(path, name);
    return result;
  },

  // With meshes of the module's; without, those that are open.
  start({meshes = [], landmarks, options}) {
    meshes.forEach(({positions, triangles}, side) => session.take(side, positions, triangles));
    return session.start(landmarks, options);
  },

  change({landmarks, options}) {
    return session.change(landmarks, options);
  },

  // Steps until some milliseconds have passed, at least one, or to the end of one iteration, then
  // draws.
  advance({milliseconds, single}) {
    const logs = [];
    const begin = performance.now();
    let state;
    do {
      state = session.step();
      if (state.isNew) logs.push(state.log);
    } while (state.more && !(single && state.isNew) && performance.now() - begin < milliseconds);
    state.logs = logs;
    state.secondsOfSteps = (performance.now() - begin) / 1000;
    state.picture = session.picture();
    return state;
  },

  verify() {
    return session.verify();
  },

  save() {
    const result = session.save();
    if (result.ok) {
      result.files = ['A_on_B.obj', 'B_on_A.obj', 'distortion_on_A.ply', 'distortion_on_B.ply'].map(
          name => ({name, bytes: ism.FS.readFile('/' + name)}));
    }
    return result;
  },

  // ---- of the module ----

  slice({seconds}) {
    return session.advance(seconds);
  },

  cancel() {
    session.cancel();
  },

  map() {
    return session.map();
  },

  images({side, ids, barycentric}) {
    return session.images(side, ids, barycentric);
  },

  transfer({side, source, target}) {
    return session.transfer(side, source, target);
  },

  meta() {
    return session.meta();
  },
};

// What the engine throws is a number if the library had no memory, as it throws nothing itself.
const sentenceOf = error => typeof error === 'number' ? 'out of memory' : String(error);

// The buffers of all typed arrays in a result.
function buffersOf(value, found = []) {
  if (ArrayBuffer.isView(value))
    found.push(value.buffer);
  else if (value && typeof value === 'object')
    Object.values(value).forEach(part => buffersOf(part, found));
  return found;
}

const port = typeof self === 'object' ? self : require('worker_threads').parentPort;
port.onmessage = async event => {
  const {id, call, values} = event.data;
  try {
    const result = await calls[call](values);
    port.postMessage({id, result}, buffersOf(result));
  } catch (error) {
    port.postMessage({id, error: sentenceOf(error)});
  }
};
