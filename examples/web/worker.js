// The solver, beside the page's own thread, so that the page never freezes. A request is
// {id, call, values}, the answer {id, result}; arrays change hands without a copy. What stands
// before this text in the worker is ism.js, emscripten's frame for session.cpp.
'use strict';

let ism = null;
let session = null;

const calls = {
  async begin({wasm}) {
    // Sentences of the library's own are in results; what emscripten prints is a fault.
    ism = await createIsm({wasmBinary: wasm, print: console.log, printErr: console.error});
    session = new ism.Session();
    return {heat: ism.heatColors(256)};
  },

  open({side, name, bytes}) {
    const path = '/' + name.replace(/\//g, '_');
    ism.FS.writeFile(path, new Uint8Array(bytes));
    const result = session.open(side, path);
    ism.FS.unlink(path);
    if (!result.ok) result.message = result.message.replace(path, name);
    return result;
  },

  start({landmarks, options}) {
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
};

// The buffers of all typed arrays in a result.
function buffersOf(value, found = []) {
  if (ArrayBuffer.isView(value))
    found.push(value.buffer);
  else if (value && typeof value === 'object')
    Object.values(value).forEach(part => buffersOf(part, found));
  return found;
}

onmessage = async event => {
  const {id, call, values} = event.data;
  try {
    const result = await calls[call](values);
    postMessage({id, result}, buffersOf(result));
  } catch (error) {
    postMessage({id, error: String(error)});
  }
};
