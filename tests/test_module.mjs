// The cases of module_cases.mjs in node, and in a browser without a screen if there is one:
//   node tests/test_module.mjs MODULE DATA QUICK_START [CHROMIUM]
// MODULE is the folder of the built module; QUICK_START the program in C++ to compare with.

import assert from 'node:assert';
import {execFileSync, spawn} from 'node:child_process';
import fs from 'node:fs';
import http from 'node:http';
import os from 'node:os';
import path from 'node:path';
import {fileURLToPath, pathToFileURL} from 'node:url';

import {runCases} from './module_cases.mjs';

const [module, data, quickStart, chromium] = process.argv.slice(2);
const cases = fileURLToPath(new URL('./module_cases.mjs', import.meta.url));

const rowsIn = text => text.split('\n').map(line => line.replace(/#.*/, '').trim().split(/\s+/));

function meshIn(file) {
  const rows = rowsIn(fs.readFileSync(file, 'utf8'));
  const of = (kind, convert) => rows.filter(([key]) => key === kind).flatMap(
      row => row.slice(1, 4).map(convert));
  return {
    positions: of('v', Number),
    triangles: of('f', corner => parseInt(corner, 10) - 1)
  };
}

// The pair as plain arrays, which also pass as JSON, and what C++ makes of it.
function starfish() {
  const files = ['A.obj', 'B.obj', 'landmarks.txt'].map(name => path.join(data, 'starfish', name));
  const begin = performance.now();
  const printed = execFileSync(quickStart, files, {encoding: 'utf8'});
  const seconds = (performance.now() - begin) / 1000;
  const [, distortion] = /distortion: (\S+)/.exec(printed);
  const [, a, b] = /coverage: +(\S+) of A, (\S+) of B/.exec(printed);
  return {
    a: meshIn(files[0]),
    b: meshIn(files[1]),
    landmarks: rowsIn(fs.readFileSync(files[2], 'utf8')).filter(row => row.length > 1)
                   .map(row => row.slice(0, 2).map(Number)),
    native: {seconds, distortion: Number(distortion), coverage: [a, b].map(Number)}
  };
}

// As the page of the browser does, see below.
function typed({a, b, ...others}) {
  const of = ({positions, triangles}) =>
      ({positions: Float64Array.from(positions), triangles: Uint32Array.from(triangles)});
  return {a: of(a), b: of(b), ...others};
}

// A module without its program or its worker, or with others, says so, and maps when it has them.
async function testMissingFiles() {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'ism_module_'));
  for (const file of ['ism.mjs', 'engine.mjs']) fs.copyFileSync(
      path.join(module, file), path.join(folder, file));
  const load = query => import(pathToFileURL(path.join(folder, 'ism.mjs')) + query);
  const square = {positions: [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0], triangles: [0, 1, 2, 0, 2, 3]};
  const refuses = (sentence, {map}) => assert.rejects(
      map(square, square),
      error => error.name === 'IsmError' && error.status === 'failed call' &&
          sentence.test(error.message));
  const library = await load('');
  await refuses(/ism.wasm/, library);
  fs.writeFileSync(path.join(folder, 'ism.wasm'), 'no program');
  await refuses(/WebAssembly/, library);
  fs.copyFileSync(path.join(module, 'ism.wasm'), path.join(folder, 'ism.wasm'));
  await refuses(/worker.js/, library);
  fs.copyFileSync(path.join(module, 'worker.js'), path.join(folder, 'worker.js'));
  const emptyProgram = Buffer.from([0, 0x61, 0x73, 0x6d, 1, 0, 0, 0]);
  fs.writeFileSync(path.join(folder, 'ism.wasm'), emptyProgram);
  await refuses(/./, await load('?again'));
  const m = await library.map(square, square, {maxIterations: 2});  // it has the right one
  assert.ok(m.distortion.mean < 2.01);
  fs.rmSync(folder, {recursive: true});
  console.log('passed: says which file is missing');  // m is not freed: node ends nevertheless
}

// All options are declared, with the types that they have.
async function testTypes(library) {
  const types = fs.readFileSync(path.join(module, 'ism.d.mts'), 'utf8');
  const refusal = await library.map(
      {positions: [], triangles: []}, {positions: [], triangles: []}, {x: 1}).catch(e => e.message);
  const names = refusal.replace(/.*there are /, '').split(', ');
  for (const name of names) assert.match(types, new RegExp(`\\n  ${name}\\?: `));
  for (const name of Object.keys(library)) assert.match(types, new RegExp(`export .* ${name}\\b`));
  console.log(`passed: declares ${names.length} options`);
}

const kPage = `<!DOCTYPE html><link rel="icon" href="data:,"><script type="module">
import * as library from '/module/ism.mjs';
import {runCases} from '/module_cases.mjs';
const post = (to, text) => fetch(to, {method: 'POST', body: text});
const typed = ${typed};
const starfish = typed(await (await fetch('/starfish')).json());
const lines = [];
const failures = await runCases(library, {starfish}, line => lines.push(line));
post('/end', JSON.stringify({failures, lines}));
</script>`;

// Serves the module with a policy that forbids scripts from text, and collects what a page reports.
function serve(pair) {
  const types = {'.mjs': 'text/javascript', '.js': 'text/javascript', '.wasm': 'application/wasm'};
  let end;
  const ended = new Promise(resolve => end = resolve);
  const server = http.createServer((request, response) => {
    const send = (type, body) => response.writeHead(200, {'Content-Type': type}).end(body);
    const {url} = request, file = url.replace(/^\/module\//, `${module}/`);
    if (url === '/') {
      response.setHeader(
          'Content-Security-Policy', "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'");
      send('text/html', kPage);
    } else if (url === '/starfish') {
      send('application/json', JSON.stringify(pair));
    } else if (url === '/end') {
      let text = '';
      request.on('data', part => text += part);
      request.on('end', () => (send('text/plain', ''), end(JSON.parse(text))));
    } else {
      // A worker obeys the policy of its own response.
      response.setHeader('Content-Security-Policy', "script-src 'self' 'wasm-unsafe-eval'");
      const path_ = url === '/module_cases.mjs' ? cases : file;
      send(types[path.extname(path_)], fs.readFileSync(path_));
    }
  });
  return {server, ended};
}

async function runInBrowser(pair) {
  const {server, ended} = serve(pair);
  await new Promise(resolve => server.listen(0, '127.0.0.1', resolve));
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'ism_module_'));
  const browser = spawn(
      chromium,
      [
        '--headless=new', '--no-sandbox', '--disable-dev-shm-usage', '--disable-gpu',
        `--user-data-dir=${folder}`, `http://127.0.0.1:${server.address().port}/`
      ],
      {stdio: 'ignore'});
  const closed = new Promise(resolve => browser.on('close', resolve));
  const {failures, lines} = await Promise.race([
    ended, closed.then(() => ({failures: 1, lines: ['FAILED: the browser ended']}))
  ]);
  console.log(lines.join('\n'));
  browser.kill();
  await closed;
  server.close();
  fs.rmSync(folder, {recursive: true, force: true, maxRetries: 5});
  return failures;
}

const library = await import(pathToFileURL(path.join(module, 'ism.mjs')));
const pair = starfish();
console.log('In node:');
let failures = await runCases(library, {starfish: typed(pair)}, console.log);
await testMissingFiles();
await testTypes(library);
if (chromium) {
  console.log('In a browser:');
  failures += await runInBrowser(pair);
}
console.log(failures ? `${failures} failed` : 'all passed');
process.exitCode = failures ? 1 : 0;
