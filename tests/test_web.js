// The page of examples/web/ in a browser without a screen, by WebDriver:
//   node tests/test_web.js PAGE ISM_MAP DATA OUT
// PAGE is the built index.html; ISM_MAP the native program, for the distortion to compare with; the
// pictures of desktop and phone, and the downloads, go to OUT. Needs chromium and chromedriver.
'use strict';

const assert = require('assert');
const {execFileSync, spawn} = require('child_process');
const fs = require('fs');
const http = require('http');
const os = require('os');
const path = require('path');

const [page, ismMap, data, out] = process.argv.slice(2).map(p => path.resolve(p));
const sleep = milliseconds => new Promise(resolve => setTimeout(resolve, milliseconds));

// ---- the browser ----

class Browser {
  static async start(port, width, height) {
    const browser = new Browser();
    browser.root = `http://127.0.0.1:${port}`;
    const args = [
      '--headless=new', '--no-sandbox', '--disable-dev-shm-usage', '--hide-scrollbars',
      '--enable-unsafe-swiftshader', `--window-size=${width},${height}`
    ];
    const {sessionId} = await browser.call('POST', '/session', {
      capabilities: {
        alwaysMatch: {
          browserName: 'chrome',
          'goog:loggingPrefs': {browser: 'ALL'},
          'goog:chromeOptions': {
            args,
            prefs: {
              'download.default_directory': out,
              'profile.default_content_setting_values': {automatic_downloads: 1}
            }
          }
        }
      }
    });
    browser.root += `/session/${sessionId}`;
    return browser;
  }

  async call(method, to, body) {
    const response = await fetch(this.root + to, {method, body: body && JSON.stringify(body)});
    const {value} = await response.json();
    if (value && value.error) throw new Error(`${value.error}: ${value.message}`);
    return value;
  }

  open(url) {
    return this.call('POST', '/url', {url});
  }
  close() {
    return this.call('DELETE', '');
  }
  run(script, ...args) {
    return this.call('POST', '/execute/sync', {script, args});
  }
  wait(script, ...args) {
    return this.call('POST', '/execute/async', {script, args});
  }
  async find(selector) {
    const found = await this.call('POST', '/element', {using: 'css selector', value: selector});
    return Object.values(found)[0];
  }
  async click(selector) {
    return this.call('POST', `/element/${await this.find(selector)}/click`, {});
  }
  async type(selector, text) {
    return this.call('POST', `/element/${await this.find(selector)}/value`, {text});
  }
  press(keys) {
    const actions = [...keys].flatMap(value => [{type: 'keyDown', value}, {type: 'keyUp', value}]);
    return this.call('POST', '/actions', {actions: [{type: 'key', id: 'keys', actions}]});
  }
  drag([x, y], [toX, toY], pointerType = 'mouse') {
    const move = (mx, my) =>
        ({type: 'pointerMove', x: Math.round(mx), y: Math.round(my), duration: 50});
    return this.call('POST', '/actions', {
      actions: [{
        type: 'pointer',
        id: pointerType,
        parameters: {pointerType},
        actions: [
          move(x, y), {type: 'pointerDown', button: 0}, move((x + toX) / 2, (y + toY) / 2),
          move(toX, toY), {type: 'pointerUp', button: 0}
        ]
      }]
    });
  }
  async picture(name) {
    fs.writeFileSync(path.join(out, name), await this.call('GET', '/screenshot'), 'base64');
  }
  async errors() {
    const log = await this.call('POST', '/se/log', {type: 'browser'});
    return log.filter(entry => entry.level === 'SEVERE').map(entry => entry.message);
  }

  // ---- this page ----

  text(id) {
    return this.run('return document.getElementById(arguments[0]).textContent', id);
  }
  async number(id) {
    return Number(
        await this.run('return document.querySelector(`#${arguments[0]} data`).value', id));
  }
  async until(what, script, seconds, ...args) {
    for (let i = 0; i < 10 * seconds; ++i) {
      if (await this.run(script, ...args)) return;
      await sleep(100);
    }
    throw new Error(
        `${what}: not within ${seconds} s; ` +
        `the page says "${await this.text('status')}"`);
  }
  async load(url) {
    await this.open(url);
    await this.until('loading', 'return Boolean(document.documentElement.dataset.ready)', 60);
    return Number(await this.run('return document.documentElement.dataset.ready'));
  }
  says(pattern, seconds = 20) {
    return this.until(
        `a sentence like ${pattern}`,
        'return new RegExp(arguments[0]).test(' +
            'document.getElementById("status").textContent)',
        seconds, pattern.source);
  }
  async choose(name) {
    await this.run(
        'const s = document.getElementById("pair"); s.value = arguments[0];' +
            's.dispatchEvent(new Event("change"))',
        name);
    await this.says(/^Ready/);
  }
  async set(id, value) {
    await this.run(
        'const s = document.getElementById(arguments[0]); s.value = arguments[1];' +
            's.dispatchEvent(new Event("change"))',
        id, value);
  }
  // One iteration, with its last picture: on a slow machine the map of the start is shown before.
  async step() {
    const count = '(parseInt(document.getElementById("iterations").textContent) || 0)';
    const before = await this.run(`return ${count}`);
    await this.click('#step');
    await this.until('an iteration', `return ${count} > arguments[0]`, 30, before);
  }
  async finish(seconds = 120) {
    await this.until(
        'the end of a run',
        'return document.getElementById("play").disabled &&' +
            '/prove|refute/.test(document.getElementById("proof").textContent)',
        seconds);
  }
  // The middle of an element, which is scrolled into sight.
  async middle(selector) {
    return this.run(
        'const e = document.querySelector(arguments[0]);' +
            'e.scrollIntoView({block: "center"}); const r = e.getBoundingClientRect();' +
            'return [r.left + r.width / 2, r.top + r.height / 2]',
        selector);
  }
  // What a canvas shows, small.
  async pixels(id) {
    return this.run(
        `thePage.draw();
      const copy = Object.assign(document.createElement('canvas'), {width: 90, height: 90});
      const g = copy.getContext('2d');
      g.drawImage(document.getElementById(arguments[0]), 0, 0, 90, 90);
      return g.getImageData(0, 0, 90, 90).data.join();`,
        id);
  }
}

// ---- what must hold ----

const tests = [];
const test = (name, run) => tests.push({name, run});

// What the native program finds and writes.
function runNatively(pair) {
  const folder = path.join(data, pair), to = fs.mkdtempSync(path.join(os.tmpdir(), 'ism_web_'));
  execFileSync(
      ismMap,
      [
        path.join(folder, 'A.obj'), path.join(folder, 'B.obj'), '--landmarks',
        path.join(folder, 'landmarks.txt'), '--threads', '1', '-o', to
      ],
      {stdio: 'ignore'});
  const report = JSON.parse(fs.readFileSync(path.join(to, 'report.json')));
  const aOnB = fs.readFileSync(path.join(to, 'A_on_B.obj'), 'utf8');
  fs.rmSync(to, {recursive: true});
  const {embedding, optimization} = report.seconds;
  return {distortion: report.final.mean_distortion, seconds: embedding + optimization, aOnB};
}

test('loads from the file system, with no error', async (b, {fromFile, note}) => {
  note(`seconds to the first picture, from a file: ${await b.load(fromFile) / 1000}`);
  assert.match(await b.text('status'), /^Ready/);
  assert.match(await b.text('name_a'), /starfish A.obj, [\d,.]+ triangles/);
});

test('loads from a server', async (b, {fromServer, note}) => {
  note(`seconds to the first picture, from a local server: ${await b.load(fromServer) / 1000}`);
  assert.match(await b.text('status'), /^Ready/);
});

test('converges on a pair of data/, with the distortion of the native program', async (b, t) => {
  await b.click('#play');
  await b.finish();
  const here = await b.number('distortion'), there = t.starfish.distortion;
  const seconds = await b.run('return thePage.seconds'), n = await b.text('iterations');
  t.note(`starfish: distortion ${here}, natively ${there}`);
  t.note(
      `${n} iterations and the embedding: ${seconds.toFixed(1)} s, natively on one thread ` +
      `${t.starfish.seconds.toFixed(1)} s`);
  assert.ok(Math.abs(here / there - 1) < 1e-3, `${here}, natively ${there}`);
  assert.strictEqual(await b.text('proof'), 'proved');
  assert.match(await b.text('status'), /^Converged/);
});

test('shows the distortion, and the edges of the other surface', async b => {
  await b.picture('desktop.png');
  const plain = await b.pixels('canvas_b');
  await b.click('input[value=heat]');
  const heat = await b.pixels('canvas_b');
  await b.click('#edges');
  const edges = await b.pixels('canvas_b');
  assert.ok(await b.run('return !document.getElementById("legend").hidden'));
  await b.picture('desktop_heat.png');
  await b.click('input[value=texture]');
  await b.click('#edges');
  assert.ok(plain !== heat && heat !== edges && plain === await b.pixels('canvas_b'));
});

test('turns surfaces by mouse and by keys', async b => {
  const before = await b.pixels('canvas_a'), [x, y] = await b.middle('#canvas_a');
  await b.drag([x - 40, y + 60], [x + 40, y + 80]);
  const turned = await b.pixels('canvas_a');
  await b.run('document.getElementById("canvas_a").focus()');
  await b.press(['\uE012', '+']);
  assert.ok(before !== turned && turned !== await b.pixels('canvas_a'));
  assert.strictEqual(await b.run('return document.querySelectorAll("#marks_a .mark").length'), 6);
});

test('downloads the map as OBJ and PLY', async (b, t) => {
  await b.click('#save');
  const names = ['A_on_B.obj', 'B_on_A.obj', 'distortion_on_A.ply', 'distortion_on_B.ply'];
  await b.says(/^Saved A_on_B.obj/);
  for (let i = 0; i < 100 && !names.every(n => fs.existsSync(path.join(out, n))); ++i)
    await sleep(100);
  const elements = text => text.split('\n').filter(line => /^[vf] /.test(line));
  const here = elements(fs.readFileSync(path.join(out, 'A_on_B.obj'), 'utf8'));
  const there = elements(t.starfish.aOnB);
  assert.strictEqual(here.length, there.length);
  here.forEach((line, i) => line.split(' ').slice(1).forEach((x, k) => {
    const expected = Number(there[i].split(' ')[k + 1].split('/')[0]);
    assert.ok(Math.abs(Number(x) - expected) < 1e-3, `${line}, natively ${there[i]}`);
  }));
  assert.match(fs.readFileSync(path.join(out, names[2])).subarray(0, 4).toString(), /^ply\n/);
});

test('goes step by step', async b => {
  await b.click('#restart');
  await b.says(/^Ready/);
  for (let i = 1; i <= 3; ++i) {
    await b.click('#step');
    await b.until(
        `step ${i}`, 'return document.getElementById("iterations").textContent === arguments[0]',
        30, String(i));
  }
  await b.until('a line that runs', 'return Boolean(document.querySelector("#lines .now"))', 5);
  await b.picture('step.png');
});

test('is played and paused by keys', async b => {
  await b.run('document.activeElement.blur()');
  await b.press(' ');
  await b.until('playing', 'return document.getElementById("play").textContent === "Pause"', 5);
  await b.press(' ');
  await b.until('a pause', 'return document.getElementById("play").textContent === "Play"', 5);
});

test('lets a landmark be dragged, and the map follows', async b => {
  await b.choose('face');
  await b.click('#play');
  await b.finish();
  const before = await b.number('distortion'), n = Number(await b.text('iterations'));
  const from = await b.middle('#marks_b .mark:nth-child(1)');
  const label =
      await b.run('return document.querySelector("#marks_b .mark").getAttribute("aria-label")');
  await b.drag(from, [from[0] + 15, from[1] + 10]);
  const moved =
      await b.run('return document.querySelector("#marks_b .mark").getAttribute("aria-label")');
  assert.notStrictEqual(moved, label);
  await b.until(
      'more iterations',
      'return Number(document.getElementById("iterations").textContent) > arguments[0]', 30, n);
  await b.finish();
  assert.ok(Number.isFinite(await b.number('distortion')) && before > 2);
});

test('sets landmarks by click, by touch and by keys, and removes them', async b => {
  await b.choose('starfish');
  const count = side => b.run(`return document.querySelectorAll("#marks_${side} button").length`);
  await b.click('#clear');
  await b.says(/^Ready/);
  for (const [i, pointer] of ['mouse', 'touch'].entries()) {
    for (const side of ['a', 'b']) {
      const [x, y] = await b.middle(`#canvas_${side}`);
      await b.drag([x, y - 30 * i], [x, y - 30 * i], pointer);
    }
    assert.deepStrictEqual([await count('a'), await count('b')], [i + 1, i + 1]);
  }
  await b.run('document.querySelector("#marks_b button").focus()');
  await b.press(['\uE017']);  // delete
  assert.deepStrictEqual([await count('a'), await count('b')], [1, 1]);
  await b.run('document.querySelector("#marks_a button").focus()');
  await b.press(['\uE017']);
  for (const side of ['a', 'b']) {
    await b.run(`document.getElementById("canvas_${side}").focus()`);
    await b.press(['\uE007']);  // enter
  }
  assert.deepStrictEqual([await count('a'), await count('b')], [1, 1]);
});

test('meets landmarks exactly', async b => {
  await b.choose('starfish');
  await b.step();
  await b.run('document.getElementById("exact").click()');
  await b.says(/^Changed/);
  await b.click('#play');
  await b.says(/^(Converged|Stalled)/, 60);
  const distances = await b.wait(`
    const done = arguments[arguments.length - 1];
    thePage.enqueue(async () => {
      const {files} = await thePage.solver.ask('save');
      const file = files.find(f => f.name === 'A_on_B.obj');
      const text = new TextDecoder().decode(file.bytes);
      const images = text.split('\\n').filter(line => line.startsWith('v '))
          .map(line => line.split(' ').slice(1).map(Number));
      const there = thePage.views[1].mesh.vertices;
      done(thePage.landmarks.pairs.map(
          ([a, b]) => Math.hypot(...[0, 1, 2].map(k => images[a][k] - there[3 * b + k]))));
    });`);
  assert.strictEqual(distances.length, 6);
  distances.forEach(d => assert.ok(d < 1e-5, `${distances}`));
});

test('begins anew where a run cannot change, and takes back what is refused', async b => {
  await b.choose('starfish');
  await b.step();
  for (const variant of ['spn', 'pn', 'full']) {
    await b.set('variant', variant);
    await b.says(/^Ready/);
  }
  await b.step();
  await b.run(
      'const marks = thePage.landmarks; marks.set([...marks.pairs, [0, 1e6]]); thePage.change()');
  await b.says(/^Not changed: /);
  assert.strictEqual(await b.run('return thePage.landmarks.pairs.length'), 6);
});

test('takes other options on the way', async b => {
  await b.choose('starfish');
  await b.click('#step');
  await b.until('a map', 'return document.getElementById("distortion").textContent !== "–"', 30);
  const formulas = {
    asap: /σmax − σmin/,
    sarap: /½ ∫ \(1 − 1\/σmin/,
    arap: /∫ \(1 − σmin/,
    dirichlet: /‖J‖² \+ ‖J⁻¹‖²/
  };
  for (const [id, value] of [
           ['measure', 'asap'], ['measure', 'sarap'], ['measure', 'arap'], ['measure', 'dirichlet'],
           ['coverage_weight', '0.5'], ['memory', '3']]) {
    await b.set(id, value);
    await b.says(/^Changed/);
    if (id === 'measure') {
      const formula = await b.run('return document.querySelectorAll("#lines .formula")[3].innerText');
      assert.match(formula, formulas[value]);
    }
    await b.click('#step');
    await b.until(
        'a step', 'return !/^Changed/.test(document.getElementById("status").textContent)', 30);
  }
  assert.ok(await b.number('distortion') >= 2);
});

test('says what is wrong with a broken file, and goes on', async b => {
  const file = path.join(out, 'broken.obj');
  fs.writeFileSync(file, 'v 0 0 0\nv 1 0 0\nv 0 1 zero\nf 1 2 3\n');
  await b.type('#file_a', file);
  await b.says(/broken.obj was not opened: .*line 3/);
  await b.choose('starfish');
});

test('mends what can be mended, and says so', async b => {
  const text = fs.readFileSync(path.join(data, 'starfish', 'A.obj'), 'utf8');
  const file = path.join(out, 'twice.obj');
  fs.writeFileSync(file, `${text}\n${text.split('\n').find(line => line.startsWith('f '))}\n`);
  await b.type('#file_a', file);
  await b.says(/It was mended: /);
});

test('takes a file that is dropped on a surface, and none beside them', async b => {
  const drop = (selector, text) => b.run(
      `const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File([arguments[1]], 'dropped.obj'));
      const drop = new DragEvent('drop', {dataTransfer, bubbles: true, cancelable: true});
      document.querySelector(arguments[0]).dispatchEvent(drop);
      return drop.defaultPrevented;`,
      selector, text);
  await b.choose('starfish');
  const text = fs.readFileSync(path.join(data, 'starfish', 'A.obj'), 'utf8');
  assert.ok(await drop('#canvas_plane', text));
  await b.says(/^Ready/);
  assert.ok(await drop('#canvas_b', text));
  await b.says(/dropped.obj is an open surface/);
});

// Two closed surfaces, each uploaded by itself.
test('maps closed surfaces that were uploaded', async b => {
  const texts = await b.run('return [blob(2, 1), blob(2, 1.4)]');
  for (const [i, side] of ['a', 'b'].entries()) {
    const file = path.join(out, `closed_${side}.obj`);
    fs.writeFileSync(file, texts[i]);
    await b.type(`#file_${side}`, file);
    await b.says(new RegExp(`closed_${side}.obj is a closed surface`));
  }
  await b.click('#play');
  await b.finish(180);
  assert.strictEqual(await b.text('coverage'), '100.0%, 100.0%');
  assert.strictEqual(await b.text('proof'), 'proved');
});

test('never freezes while it computes', async (b, t) => {
  await b.choose('hand');
  await b.click('#play');
  await b.until('iterations', 'return document.getElementById("rate").textContent !== "–"', 60);
  const times = await b.wait(`
    const done = arguments[arguments.length - 1], times = [];
    let last = performance.now();
    const tick = now => {
      times.push(now - last);
      last = now;
      times.length < 150 ? requestAnimationFrame(tick) : done(times);
    };
    requestAnimationFrame(tick);`);
  times.sort((x, y) => x - y);
  t.note(
      `hand, while it runs: a frame takes ${times[75].toFixed(0)} ms (median), ` +
      `${times[142].toFixed(0)} ms (95%); ${await b.text('rate')} iterations a second`);
  assert.ok(times[75] < 100, `median ${times[75]} ms`);
  await b.click('#play');
});

test('draws the same again after the graphics was taken away', async b => {
  await b.choose('starfish');
  await b.step();
  for (const id of ['canvas_a', 'canvas_plane']) {
    const before = await b.pixels(id);
    await b.wait(
        `const done = arguments[arguments.length - 1], canvas = document.getElementById(arguments[0]);
        const context = canvas.getContext('webgl2').getExtension('WEBGL_lose_context');
        canvas.addEventListener('webglcontextlost', () => setTimeout(() => context.restoreContext()));
        canvas.addEventListener('webglcontextrestored', () => setTimeout(done));
        context.loseContext();`,
        id);
    assert.strictEqual(await b.pixels(id), before, id);
  }
});

test('keeps still where less motion is asked for', async b => {
  const media = features =>
      b.call('POST', '/goog/cdp/execute', {cmd: 'Emulation.setEmulatedMedia', params: {features}});
  const marked = () => b.run('return document.querySelectorAll("#lines .now").length');
  await b.choose('starfish');
  await b.click('#step');
  await b.until('a line', 'return document.querySelectorAll("#lines .now").length > 0', 30);
  await media([{name: 'prefers-reduced-motion', value: 'reduce'}]);
  await b.choose('starfish');
  await b.step();
  assert.strictEqual(await marked(), 0);
  await media([]);
});

test('is readable for those who do not see it', async b => {
  const unnamed = await b.run(`return [...document.querySelectorAll(
      'button, input, select, canvas, progress')].filter(e => !(e.getAttribute('aria-label') ||
      e.getAttribute('aria-hidden') || e.closest('label') || e.textContent.trim())).map(e => e.outerHTML)`);
  assert.deepStrictEqual(unnamed, []);
  assert.strictEqual(
      await b.run('return document.getElementById("status").getAttribute("role")'), 'status');
});

test('fits a phone, in the dark', async (b, t) => {
  await b.call('POST', '/goog/cdp/execute', {
    cmd: 'Emulation.setDeviceMetricsOverride',
    params: {width: 390, height: 844, deviceScaleFactor: 2, mobile: true}
  });
  await b.call('POST', '/goog/cdp/execute', {
    cmd: 'Emulation.setEmulatedMedia',
    params: {features: [{name: 'prefers-color-scheme', value: 'dark'}]}
  });
  await b.load(t.fromFile);
  await b.click('#play');
  await b.finish();
  assert.strictEqual(await b.run('return document.documentElement.scrollWidth'), 390);
  await b.run('scrollTo(0, 0)');
  await sleep(300);
  await b.picture('phone.png');
  await b.run('document.getElementById("lines").scrollIntoView()');
  await sleep(300);
  await b.picture('phone_algorithm.png');
});

// ---- run them ----

async function main() {
  fs.mkdirSync(out, {recursive: true});
  const server = http.createServer((request, response) => {
                       response.setHeader('Content-Type', 'text/html');
                       response.end(fs.readFileSync(page));
                     })
                     .listen(0);
  const port = 20000 + process.pid % 20000;
  const driver = spawn('chromedriver', [`--port=${port}`], {stdio: 'ignore'});
  const context = {
    fromFile: `file://${page}`,
    fromServer: `http://127.0.0.1:${server.address().port}/`,
    note: text => console.log(`  ${text}`),
    starfish: runNatively('starfish')
  };
  let failed = 0, browser;
  try {
    for (let i = 0; !browser; ++i) {
      await sleep(200);
      browser = await Browser.start(port, 1440, 1000).catch(error => {
        if (i > 50) throw error;
      });
    }
    const only = process.env.ONLY;
    for (const {name, run} of tests) {
      if (only && !new RegExp(only).test(name)) continue;
      try {
        await run(browser, context);
        assert.deepStrictEqual(await browser.errors(), []);
        console.log(`passed: ${name}`);
      } catch (error) {
        ++failed;
        console.log(`FAILED: ${name}\n  ${error.stack}`);
        await browser.picture('failed.png').catch(() => {});
      }
    }
  } finally {
    if (browser) await browser.close().catch(() => {});
    driver.kill();
    server.close();
  }
  console.log(failed ? `${failed} failed` : 'all passed');
  process.exit(failed ? 1 : 0);
}

main();
