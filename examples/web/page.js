// The page: what is shown, set and asked for. The worker computes; see worker.js.
'use strict';

const $ = id => document.getElementById(id);
const kSides = ['a', 'b'];

// ---- what comes with the page ----

// Files packed by build.sh: compressed, as text.
async function asset(name) {
  const bytes = Uint8Array.from(atob($(`asset_${name}`).textContent), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Response(stream).arrayBuffer();
}

// A sphere of 8 · 4^levels triangles with bumps, closed, as the text of an OBJ file.
function blob(levels, seed) {
  let vertices = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]];
  let triangles =
      [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
  for (let level = 0; level < levels; ++level) {
    const middles = new Map();
    const middle = (u, v) => {
      const key = `${Math.min(u, v)} ${Math.max(u, v)}`;
      if (!middles.has(key)) {
        const p = vertices[u].map((x, k) => x + vertices[v][k]);
        middles.set(key, vertices.push(p.map(x => x / Math.hypot(...p))) - 1);
      }
      return middles.get(key);
    };
    triangles = triangles.flatMap(([a, b, c]) => {
      const [p, q, r] = [middle(a, b), middle(b, c), middle(c, a)];
      return [[a, p, r], [p, b, q], [r, q, c], [p, q, r]];
    });
  }
  vertices = vertices.map(([x, y, z]) => {
    const r = 1 + 0.25 * Math.sin(3 * x + seed) * Math.cos(2 * y + 2 * seed) +
        0.15 * Math.sin(5 * z * seed);
    return [r * x, r * y, r * z];
  });
  return vertices.map(p => `v ${p.join(' ')}\n`).join('') +
      triangles.map(t => `f ${t.map(v => v + 1).join(' ')}\n`).join('');
}

function landmarksIn(text) {
  return text.split('\n')
      .map(line => line.replace(/#.*/, '').trim())
      .filter(line => line)
      .map(line => line.split(/\s+/).slice(0, 2).map(Number));
}

// {name: {a, b: OBJ texts, landmarks}}
async function readPairs() {
  const pairs = JSON.parse(new TextDecoder().decode(await asset('data')));
  for (const pair of Object.values(pairs)) pair.landmarks = landmarksIn(pair.landmarks);
  pairs['blobs (closed)'] = {
    a: blob(3, 1),
    b: blob(3, 1.4),
    landmarks: [0, 1, 2, 3, 4, 5].map(v => [v, v])
  };
  return pairs;
}

// ---- the engine ----

function startEngine(script) {
  return new Engine(new Worker(URL.createObjectURL(new Blob([script], {type: 'text/javascript'}))));
}

// What is set, as the engine's options.
function optionsOf({measure, coverage, omega, memory, variant, exact}) {
  const options = {measure, coverageWeight: coverage, exactLandmarks: exact};
  if (variant === 'full')
    Object.assign(options, {omegaStart: omega, historyLength: memory});
  else  // SPN (§5.3), and without its memory PN (§5.1)
    Object.assign(
        options, {omegaStart: 0, coarsest: 0, historyLength: variant === 'pn' ? 1 : memory});
  return options;
}

// ---- the page ----

class Page {
  constructor(solver, heatColors, pairs) {
    this.solver = solver;
    this.pairs = pairs;
    this.views = ['a', 'b', 'plane'].map((name, i) => new View($(`canvas_${name}`), i, heatColors));
    this.plot = new Plot($('plot'));
    this.algorithm = new AlgorithmPanel($('lines'), $('now'));
    this.landmarks = new Landmarks(this.views, () => this.change(), text => this.say(text));
    this.queue = Promise.resolve();  // one request after the other
    this.isPlaying = false;
    this.needsDrawing = true;
    this.colorsOfHeat(heatColors);
    this.listen();
    requestAnimationFrame(() => this.frame());
  }

  colorsOfHeat(colors) {
    const g = $('legend_colors').getContext('2d'), image = g.createImageData(256, 1);
    for (let i = 0; i < 256; ++i)
      for (let k = 0; k < 4; ++k) image.data[4 * i + k] = k < 3 ? colors[3 * i + k] : 255;
    g.putImageData(image, 0, 0);
  }

  // Does work after what was asked for before.
  enqueue(work) {
    this.queue = this.queue.then(work).catch(error => {
      this.pause();
      this.say(error.message, true);
    });
    return this.queue;
  }

  say(text, isRefusal = false) {
    if ($('status').textContent !== text) $('status').textContent = text;  // is read out
    $('status').classList.toggle('refused', isRefusal);
  }

  settings() {
    return {
      measure: $('measure').value,
      coverage: Number($('coverage_weight').value),
      omega: 10 ** Number($('omega').value),
      memory: Number($('memory').value),
      variant: $('variant').value,
      exact: $('exact').checked
    };
  }

  request() {
    return {landmarks: this.landmarks.pairs.map(pair => [...pair]), settings: this.settings()};
  }

  // Begins a run, or changes it.
  send(call, {landmarks, settings}) {
    return this.solver.ask(
        call, {landmarks: landmarkRows(landmarks), options: optionsOf(settings)});
  }

  // ---- meshes ----

  openPair(name) {
    const pair = this.pairs[name];
    this.pause();
    return this.enqueue(async () => {
      this.landmarks.set([]);
      for (const side of [0, 1]) {
        const bytes = new TextEncoder().encode(pair[kSides[side]]).buffer;
        await this.open(side, `${name} ${'AB'[side]}.obj`, bytes);
      }
      this.landmarks.set(pair.landmarks);
      await this.begin();
    });
  }

  // The user's own; landmarks of the other surface alone mean nothing.
  openFile(side, file) {
    this.pause();
    return this.enqueue(async () => {
      if (!await this.open(side, file.name, await file.arrayBuffer())) return;
      this.landmarks.set([]);
      const told = $('status').textContent;
      await this.begin();
      if (this.state.more)
        this.say(`${told} Press Play, or set landmarks first: click the same place on both.`);
    });
  }

  async open(side, name, bytes) {
    const mesh = await this.solver.ask('open', {side, name, bytes}, [bytes]);
    if (!mesh.ok) {
      this.say(`${name} was not opened: ${mesh.message}`, true);
      return false;
    }
    mesh.ball = ballOf(mesh.vertices, 3);
    this.views[side].setMesh(mesh);
    this.clearMap();
    const kind = mesh.isClosed ? 'a closed' : 'an open';
    const n = mesh.triangles.length / 3;
    $(`name_${kSides[side]}`).textContent = `${name}, ${n.toLocaleString()} triangles`;
    const mended = mesh.repairs.length ? ` It was mended: ${mesh.repairs.join('; ')}.` : '';
    this.say(`${name} is ${kind} surface of ${n.toLocaleString()} triangles.${mended}`);
    return true;
  }

  clearMap() {
    this.views.forEach(view => view.clearOverlay());
    this.plot.clear();
    this.times = [];  // of the last iterations: how many, and their seconds
    this.state = null;
    this.hasMap = false;
    this.proof = '';
    $('save').disabled = true;
    this.algorithm.stop();
    this.showNumbers();
  }

  // ---- the run ----

  start() {
    this.pause();
    return this.enqueue(() => this.begin());
  }

  async begin() {
    if (!this.views[0].mesh || !this.views[1].mesh) return;
    this.clearMap();
    this.seconds = 0;  // of all steps
    this.accepted = this.request();
    this.take(await this.send('start', this.accepted));
    for (const id of ['play', 'step']) $(id).disabled = !this.state.more;
    $('restart').disabled = false;
  }

  // Goes on with other landmarks or options.
  change() {
    this.needsDrawing = true;
    return this.enqueue(async () => {
      if (!this.state) return;
      const request = this.request(), {omega, variant} = this.accepted.settings;
      if (!this.hasMap || request.settings.omega !== omega ||
          request.settings.variant !== variant) {
        await this.begin();  // these are about how a run begins
        if (this.wasPlaying) this.play();
        return;
      }
      const outcome = await this.send('change', request);
      if (!outcome.usable) return this.refuse(outcome);
      this.accepted = request;
      this.proof = '';
      this.state.more = true;
      for (const id of ['play', 'step']) $(id).disabled = false;
      this.say('Changed; the map goes on from where it is.');
      if (!this.isPlaying && this.wasPlaying) this.play();
    });
  }

  // A change that the library refuses is taken back.
  refuse(outcome) {
    this.pause();
    this.wasPlaying = false;
    this.landmarks.set(this.accepted.landmarks);
    this.setSettings(this.accepted.settings);
    this.say(`Not changed: ${outcome.message}`, true);
  }

  play() {
    if (this.isPlaying || !this.state || !this.state.more) return;
    this.isPlaying = this.wasPlaying = true;
    $('play').textContent = 'Pause';
    const run = this.playing = {};
    const go = async () => {
      if (this.playing !== run) return;
      await this.enqueue(() => this.advance());
      if (this.playing !== run) return;
      if (this.state && this.state.more)
        setTimeout(go);
      else
        this.pause();
    };
    go();
  }

  pause() {
    this.isPlaying = false;
    this.playing = null;
    $('play').textContent = 'Play';
    this.algorithm.stop();
  }

  step() {
    this.pause();
    this.wasPlaying = false;
    const go = async () => {  // slice by slice, up to the end of an iteration
      await this.enqueue(() => this.advance(true));
      const {state} = this;
      if (state && state.more && state.logs && !state.logs.length && !this.isPlaying)
        setTimeout(go);
    };
    return go();
  }

  async advance(single = false) {
    if (!this.state || !this.state.more) return;
    this.take(await this.solver.ask('advance', {milliseconds: 120, single}));
    const {logs, log, secondsOfSteps} = this.state;
    this.seconds += secondsOfSteps;
    if (logs.length) {
      this.times = [...this.times, [logs.length, secondsOfSteps]].slice(-10);
      this.algorithm.show(log);
      if (single)
        this.algorithm.sweep(2500, false);
      else if (this.isPlaying && !this.algorithm.isSweeping)
        this.algorithm.sweep(1500, true);
    } else if (!this.hasMap) {
      this.algorithm.embedding();
    }
    this.showNumbers();
    if (this.state.more) return;
    this.pause();
    $('play').disabled = $('step').disabled = true;
    if (this.state.usable) await this.prove();
  }

  take(state) {
    this.state = state;
    (state.logs || []).forEach(log => this.plot.add(log));
    if (state.picture) this.takePicture(state.picture);
    $('progress').value = state.more ? state.fraction || 0 : 1;
    this.showNumbers();
    if (state.message && !state.more)
      this.say(this.sentence(state), !state.usable);
    else
      this.say(state.logs ? `${this.capital(state.what)} …` : 'Ready. Press Play.');
    this.needsDrawing = true;
  }

  capital(words) {
    return words.charAt(0).toUpperCase() + words.slice(1);
  }

  sentence(state) {
    const sentences = [state.message, ...state.warnings.map(w => `warning: ${w.message}`)];
    return `${this.capital(state.status)}: ${sentences.join('; ')}.`.replace(/\.\.$/, '.');
  }

  takePicture(picture) {
    this.hasMap = true;
    $('save').disabled = false;
    this.views.forEach(view => view.setOverlay(picture.overlay));
    this.views[2].setPlane(picture.f, picture.g, this.colors());
  }

  async prove() {
    const outcome = await this.solver.ask('verify');
    this.proof = outcome.status === 'done' ? 'proved' : 'refuted: ' + outcome.message;
    this.showNumbers();
  }

  // ---- what is shown ----

  showNumbers() {
    const state = this.state, log = this.hasMap && state ? state.log : null;
    const set = (id, text, value) => {
      const data = document.createElement('data');
      data.value = value;
      data.textContent = text;
      $(id).replaceChildren(data);
    };
    const percent = x => `${(100 * x).toFixed(1)}%`;
    set('distortion', log ? log.distortion.toFixed(4) : '–', log ? log.distortion : '');
    set('coverage', log ? `${percent(log.coverageA)}, ${percent(log.coverageB)}` : '–', '');
    set('iterations', log ? this.plot.series[0].values.length : '–', log ? state.iterations : '');
    set('polygons', log ? log.polygons.toLocaleString() : '–', log ? log.polygons : '');
    set('proof', this.proof || (log ? 'by construction' : '–'), this.proof);
    const [count, seconds] = this.times.reduce(([n, s], [m, t]) => [n + m, s + t], [0, 0]);
    set('rate', count ? (count / seconds).toFixed(1) : '–', count ? count / seconds : '');
    this.views[2].canvas.setAttribute(
        'aria-label',
        log ? `Both embeddings in the plane, ${log.polygons} polygons where they overlap` :
              'Both embeddings in the plane, not there yet');
  }

  colors() {
    const style = getComputedStyle(document.documentElement);
    return ['--a', '--b'].map(name => {
      const hex = style.getPropertyValue(name).trim();
      return [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16) / 255);
    });
  }

  look() {
    const view = this.views[0];
    return {
      paint: document.querySelector('input[name=paint]:checked').value,
      edges: $('edges').checked,
      colors: this.colors(),
      toTexture: view.mesh ? affine(view.mesh.axes, 1 / view.ball.radius, view.ball.center) :
                             new Float32Array(16)
    };
  }

  draw() {
    const look = this.look();
    this.views.forEach(view => view.draw(look));
    this.landmarks.layout();
    this.plot.draw();
    this.needsDrawing = false;
  }

  frame() {
    if (this.needsDrawing) this.draw();
    requestAnimationFrame(() => this.frame());
  }

  async download() {
    await this.enqueue(async () => {
      if (!this.hasMap) return;
      const result = await this.solver.ask('save');
      if (!result.ok) return this.say(result.message, true);
      for (const {name, bytes} of result.files) {
        const link = document.createElement('a');
        link.href = URL.createObjectURL(new Blob([bytes]));
        link.download = name;
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 60000);
      }
      this.say(`Saved ${result.files.map(file => file.name).join(', ')}.`);
    });
  }

  // ---- what the user does ----

  listen() {
    $('play').onclick = () =>
        this.isPlaying ? (this.wasPlaying = false, this.pause()) : this.play();
    $('step').onclick = () => this.step();
    $('restart').onclick = () => this.start();
    $('save').onclick = () => this.download();
    $('clear').onclick = () => (this.landmarks.set([]), this.change());
    $('pair').onchange = () => this.openPair($('pair').value);
    for (const id of ['measure', 'variant', 'coverage_weight', 'omega', 'memory', 'exact'])
      $(id).onchange = () => (this.showSettings(), this.change());
    for (const id of ['coverage_weight', 'omega', 'memory'])
      $(id).oninput = () => this.showSettings();
    for (const input of document.querySelectorAll('input[name=paint], #edges'))
      input.onchange = () => {
        this.needsDrawing = true;
        $('legend').hidden = this.look().paint !== 'heat';
      };
    $('theme').onclick = () => this.toggleTheme();
    matchMedia('(prefers-color-scheme: dark)').onchange = () => this.recolor();
    addEventListener('resize', () => this.needsDrawing = true);
    addEventListener('keydown', event => this.key(event));
    for (const type of ['dragover', 'drop'])  // beside A and B, the browser would leave the page
      addEventListener(type, event => event.preventDefault());
    kSides.forEach((name, side) => {
      $(`file_${name}`).onchange = ({target}) => {
        const [file] = target.files;
        target.value = '';  // so that the same one can be opened again
        if (file) this.openFile(side, file);
      };
      this.acceptDrops(this.views[side].canvas.parentElement, side);
    });
    this.views.forEach((view, i) => this.turnByHand(view, i));
    this.showSettings();
  }

  setSettings({measure, coverage, omega, memory, variant, exact}) {
    Object.assign($('measure'), {value: measure});
    Object.assign($('variant'), {value: variant});
    $('coverage_weight').value = coverage;
    $('omega').value = Math.log10(omega);
    $('memory').value = memory;
    $('exact').checked = exact;
    this.showSettings();
  }

  showSettings() {
    const variant = $('variant').value, isDirichlet = $('measure').value === 'dirichlet';
    $('omega').disabled = variant !== 'full';
    $('memory').disabled = variant === 'pn';
    this.algorithm.setMeasure($('measure').value);
    $('isometry').textContent = `(${isDirichlet ? 2 : 0}: isometry)`;
    $('coverage_out').textContent = Number($('coverage_weight').value).toFixed(2);
    $('omega_out').textContent = `1e${$('omega').value}`;
    $('memory_out').textContent = $('memory').value;
  }

  toggleTheme() {
    const root = document.documentElement;
    const isDark = root.dataset.theme ? root.dataset.theme === 'dark' :
                                        matchMedia('(prefers-color-scheme: dark)').matches;
    root.dataset.theme = isDark ? 'light' : 'dark';
    this.recolor();
  }

  recolor() {
    this.views[2].plains.forEach((p, i) => p.color = [...this.colors()[i], 0.4]);
    this.needsDrawing = true;
  }

  key(event) {
    if (event.target.closest('input, select, button, a') || event.ctrlKey || event.metaKey) return;
    const action = {' ': 'play', '.': 'step', r: 'restart'}[event.key];
    if (!action) return;
    event.preventDefault();
    if (!$(action).disabled) $(action).click();
  }

  acceptDrops(box, side) {
    const stop = event => event.preventDefault();
    box.ondragover = event => (stop(event), box.classList.add('dropping'));
    box.ondragleave = () => box.classList.remove('dropping');
    box.ondrop = event => {
      stop(event);
      box.classList.remove('dropping');
      if (event.dataTransfer.files.length) this.openFile(side, event.dataTransfer.files[0]);
    };
  }

  turnByHand(view, i) {
    const {canvas} = view, pointers = new Map();
    let moved = 0;
    canvas.onpointerdown = event => {
      if (event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      moved = pointers.size ? Infinity : 0;  // two fingers are no click
      pointers.set(event.pointerId, event);
    };
    canvas.onpointermove = event => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
      moved += Math.abs(dx) + Math.abs(dy);
      if (pointers.size === 2)
        this.pinch(view, pointers, event);
      else
        this.turn(i, dx / 150, dy / 150);
      pointers.set(event.pointerId, event);
    };
    canvas.onpointercancel = event => pointers.delete(event.pointerId);
    canvas.onpointerup = event => {
      if (pointers.delete(event.pointerId) && moved < 6 && i < 2) this.click(i, event);
    };
    canvas.onwheel = event => {  // else it scrolls the page
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.scale(view, Math.exp(-event.deltaY / 500));
    };
    canvas.onkeydown = event => {
      const turns =
          {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1]};
      if (turns[event.key])
        this.turn(i, ...turns[event.key]);
      else if (event.key === '+')
        this.scale(view, 1.1);
      else if (event.key === '-')
        this.scale(view, 1 / 1.1);
      else if (event.key === 'Enter' && i < 2)
        this.clickMiddle(i);
      else
        return;
      event.preventDefault();
    };
  }

  pinch(view, pointers, event) {
    const other = [...pointers.values()].find(p => p.pointerId !== event.pointerId);
    const before = pointers.get(event.pointerId);
    const distance = p => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY);
    this.scale(view, distance(event) / Math.max(distance(before), 1));
  }

  // The plane is moved, surfaces are turned.
  turn(i, yaw, pitch) {
    this.needsDrawing = true;
    if (i === 2) return this.views[2].shift(yaw, pitch);
    for (const view of $('together').checked ? this.views.slice(0, 2) : [this.views[i]]) {
      view.yaw += yaw;
      view.pitch = Math.min(Math.max(view.pitch + pitch, -Math.PI / 2), Math.PI / 2);
    }
  }

  scale(view, factor) {
    view.zoom = Math.min(Math.max(view.zoom * factor, 0.3), 20);
    this.needsDrawing = true;
  }

  clickMiddle(side) {
    const box = this.views[side].canvas.getBoundingClientRect();
    this.click(side, {clientX: box.left + box.width / 2, clientY: box.top + box.height / 2});
  }

  click(side, event) {
    const view = this.views[side], box = view.canvas.getBoundingClientRect();
    if (!view.mesh) return;
    const vertex = view.pick(event.clientX - box.left, event.clientY - box.top);
    if (vertex >= 0) this.landmarks.place(side, vertex, () => this.imageOf(side, vertex));
    this.needsDrawing = true;
  }

  // The vertex of the other surface next to where the picture has the image of a vertex; or -1.
  imageOf(side, vertex) {
    const bytes = this.state && this.state.picture && this.state.picture.overlay;
    if (!bytes) return -1;
    const floats = new Float32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4);
    const nearest = (points, stride, offset, p) => {
      let best = -1, least = Infinity;
      for (let i = 0; i * stride < points.length; ++i) {
        const d =
            [0, 1, 2].reduce((sum, k) => sum + (points[i * stride + offset + k] - p[k]) ** 2, 0);
        if (d < least) [best, least] = [i, d];
      }
      return best;
    };
    const at = (points, i) => points.subarray(i, i + 3);
    const stride = kCornerBytes / 4, {vertices} = this.views[side].mesh;
    const corner = nearest(floats, stride, 3 * side, at(vertices, 3 * vertex));
    const image = at(floats, stride * corner + 3 * (1 - side));
    return nearest(this.views[1 - side].mesh.vertices, 3, 0, image);
  }
}

let thePage = null;

async function main() {
  try {
    const solver = startEngine($('worker').textContent);
    await solver.ask('begin', {wasm: await WebAssembly.compile(await asset('wasm'))});
    const heat = await solver.ask('heat'), pairs = await readPairs();
    $('pair').replaceChildren(...Object.keys(pairs).map(name => new Option(name)));
    thePage = new Page(solver, heat, pairs);
    await thePage.openPair(Object.keys(pairs)[0]);
    document.documentElement.dataset.ready = performance.now().toFixed(0);  // ms to first picture
  } catch (error) {
    $('status').textContent = `The page cannot run here: ${error.message}`;
  }
}

main();
