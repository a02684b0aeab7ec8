// The engine from outside: it computes in a worker, see worker.js. The page and the module use it.
'use strict';

// A call failed, or has arguments that cannot be used: a sentence, the status in words, and the
// elements that the sentence names, {side, element, id}.
export class IsmError extends Error {
  constructor(message, status = 'invalid input', ids = []) {
    super(message);
    this.name = 'IsmError';
    this.status = status;
    this.ids = ids;
  }
}

export class Engine {
  // Takes a worker of a browser, or of node behind the same face.
  constructor(worker) {
    this.worker = worker;
    this.waiting = new Map();
    this.count = 0;
    this.ended = null;  // why it answers no more
    worker.onmessage = ({data: {id, result, error}}) => {
      const {resolve, reject} = this.waiting.get(id);
      this.waiting.delete(id);
      if (error)
        reject(new IsmError(error, 'failed call'));
      else
        resolve(result);
    };
    worker.onerror = event => this.end(event.message || 'the worker cannot be loaded');
  }

  // Requests are served in their order. Buffers in `transfer` change hands.
  ask(call, values = {}, transfer = []) {
    if (this.ended) return Promise.reject(this.ended);
    const id = ++this.count;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, {resolve, reject});
      this.worker.postMessage({id, call, values}, transfer);
    });
  }

  // Gives all its memory back. Requests that wait, and later ones, are refused by this sentence.
  end(message, status = 'failed call') {
    if (this.ended) return;
    this.ended = new IsmError(message, status);
    this.worker.terminate();
    for (const {reject} of this.waiting.values()) reject(this.ended);
    this.waiting.clear();
  }
}

// Whether x is an id, or, as the library refuses them by itself, another 32-bit integer.
export const isInt32 = x => Number.isInteger(x) && Math.abs(x) < 2 ** 31;

// One end of a landmark, a vertex or {face, barycentric: [u, v, w]}: id and three numbers.
function endOf(end, name) {
  if (isInt32(end)) return [end, 0, 0, 0];
  const {face, barycentric} = Object(end);
  const numbers = Array.from(Object(barycentric));
  if (isInt32(face) && numbers.length === 3 && numbers.every(Number.isFinite))
    return [face, ...numbers];
  throw new IsmError(`${name} must be a vertex, or {face, barycentric: [u, v, w]}`);
}

// Landmarks, [a, b] or [a, b, weight], as session.cpp reads them.
export function landmarkRows(landmarks) {
  if (typeof Object(landmarks)[Symbol.iterator] !== 'function')
    throw new IsmError('landmarks must be a list');
  const rows = Array.from(landmarks, (landmark, i) => {
    const parts = Array.isArray(landmark) ? landmark : [];
    const [a, b, weight = 8] = parts;
    if (parts.length < 2 || parts.length > 3 || typeof weight !== 'number')
      throw new IsmError(`landmark ${i} must be [a, b] or [a, b, weight]`);
    const [idA, ...onA] = endOf(a, `a of landmark ${i}`);
    const [idB, ...onB] = endOf(b, `b of landmark ${i}`);
    return [idA, idB, weight, ...onA, ...onB];
  });
  return Float64Array.from(rows.flat());
}
