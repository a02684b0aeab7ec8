// Packs the page into one file: node pack.js SOURCES BUILT DATA OUT. Styles and scripts go in as
// they are, the program and the pairs of DATA compressed, as text.
'use strict';

const fs = require('fs');
const path = require('path');
const zlib = require('zlib');

const [sources, built, data, out] = process.argv.slice(2);
const read = (...parts) => fs.readFileSync(path.join(...parts), 'utf8');

function asset(name, bytes) {
  const text = zlib.gzipSync(bytes, {level: 9}).toString('base64');
  return `<script type="text/plain" id="asset_${name}">${text}</script>\n`;
}

const pairs = {};
for (const name of ['starfish', 'hand', 'face'])
  pairs[name] = {
    a: read(data, name, 'A.obj'),
    b: read(data, name, 'B.obj'),
    landmarks: read(data, name, 'landmarks.txt')
  };

const worker = read(built, 'worker.js');
if (worker.includes('</script')) throw new Error('the worker ends its own element');
const assets = asset('wasm', fs.readFileSync(path.join(built, 'ism.wasm'))) +
    asset('data', JSON.stringify(pairs)) +
    `<script type="text/plain" id="worker">${worker}</script>`;

// Scripts of the page see each other's names without exports.
const script = name => read(sources, name).replace(/^export /gm, '');
const page = read(sources, 'index.html')
                 .replace('<!--@assets@-->', () => assets)
                 .replace(/\/\*@([a-z]+\.(css|m?js))@\*\//g, (_, name) => script(name));
fs.mkdirSync(path.dirname(out), {recursive: true});
fs.writeFileSync(out, page);
