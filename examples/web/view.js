// Draws one surface, or the plane with both embeddings, by WebGL 2. A corner of the overlay, as
// session.cpp packs it, has its place on A, on B and in the plane, so one buffer and one shader
// serve all three views.
'use strict';

const kCornerBytes = 60;

const kOverlayVertexShader = `#version 300 es
layout(location = 0) in vec3 on_a;
layout(location = 1) in vec3 on_b;
layout(location = 2) in vec2 plane;
layout(location = 3) in vec2 weights_a;
layout(location = 4) in vec2 weights_b;
layout(location = 5) in vec4 normal_a;
layout(location = 6) in vec4 normal_b;
layout(location = 7) in float density;
uniform int where;       // 0: on A, 1: on B, 2: in the plane
uniform mat4 matrix;     // to clip space
uniform mat3 turn;       // of normals
uniform mat4 to_texture; // of A
out vec3 weights;        // in the triangle of the other surface
out vec2 texture_at;
out vec3 normal;
flat out float heat;
void main() {
  vec3 p = where == 0 ? on_a : where == 1 ? on_b : vec3(plane, 0);
  vec2 w = where == 0 ? weights_b : weights_a;
  weights = vec3(w, 1.0 - w.x - w.y);
  texture_at = (to_texture * vec4(on_a, 1)).xy;
  normal = where == 2 ? vec3(0, 0, 1) : turn * (where == 0 ? normal_a : normal_b).xyz;
  heat = log(density / 2.0) / log(4.0);  // 2 to 8
  gl_Position = matrix * vec4(p, 1);
}`;

const kOverlayFragmentShader = `#version 300 es
precision highp float;
in vec3 weights;
in vec2 texture_at;
in vec3 normal;
flat in float heat;
uniform int paint;       // 0: texture, 1: distortion
uniform float edges;     // how much of the other surface's edges shows
uniform vec3 edge_color;
uniform sampler2D heat_colors;
out vec4 color;
vec3 hue(float t) { return 0.5 + 0.5 * cos(6.2832 * (t + vec3(0.0, 0.33, 0.67))); }
void main() {
  vec3 c;
  if (paint == 1) {
    c = texture(heat_colors, vec2(clamp(heat, 0.0, 1.0), 0.5)).rgb;
  } else {
    vec2 cell = floor(texture_at * 12.0);
    float odd = mod(cell.x + cell.y, 2.0);
    vec3 tint = hue(0.45 * texture_at.x + 0.25 * texture_at.y);
    c = mix(mix(vec3(1), tint, 0.25), mix(vec3(0.55), tint, 0.65), odd);
  }
  vec3 slope = weights / max(fwidth(weights), 1e-9);
  float line = 1.0 - smoothstep(0.0, 0.9, min(slope.x, min(slope.y, slope.z)));
  c = mix(c, edge_color, edges * line);
  float light = 0.45 + 0.55 * abs(dot(normalize(normal), normalize(vec3(-0.3, 0.4, 0.85))));
  color = vec4(c * light, 1);
}`;

const kPlainVertexShader = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal_in;
uniform mat4 matrix;
uniform mat3 turn;
out vec3 normal;
void main() {
  normal = turn * normal_in;
  gl_Position = matrix * vec4(position, 1);
}`;

const kPlainFragmentShader = `#version 300 es
precision highp float;
in vec3 normal;
uniform vec4 plain;
uniform float lit;
out vec4 color;
void main() {
  float light = 0.45 + 0.55 * abs(dot(normalize(normal), normalize(vec3(-0.3, 0.4, 0.85))));
  color = vec4(plain.rgb * mix(1.0, light, lit) * plain.a, plain.a);
}`;

// ---- small matrices, by columns as WebGL wants them ----

function multiply(a, b) {  // 4×4
  const c = new Float32Array(16);
  for (let i = 0; i < 4; ++i)
    for (let j = 0; j < 4; ++j)
      for (let k = 0; k < 4; ++k) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  return c;
}

function multiply3(a, b) {
  const c = new Float32Array(9);
  for (let i = 0; i < 3; ++i)
    for (let j = 0; j < 3; ++j)
      for (let k = 0; k < 3; ++k) c[3 * j + i] += a[3 * k + i] * b[3 * j + k];
  return c;
}

// The rotation about x by `pitch`, after that about y by `yaw`.
function rotation(yaw, pitch) {
  const [c, s, d, t] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return new Float32Array([c, s * t, -s * d, 0, d, t, s, -c * t, c * d]);
}

// Turns, then scales about a centre: x -> scale · turn (x - center).
function affine(turn, scale, center) {
  const m = new Float32Array(16);
  for (let i = 0; i < 3; ++i) {
    for (let j = 0; j < 3; ++j) {
      m[4 * j + i] = scale * turn[3 * j + i];
      m[12 + i] -= scale * turn[3 * j + i] * center[j];
    }
  }
  m[15] = 1;
  return m;
}

// ---- a ball around points, for what fits on the screen ----

function ballOf(points, dimension) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; ++i) {
    low[i % dimension] = Math.min(low[i % dimension], points[i]);
    high[i % dimension] = Math.max(high[i % dimension], points[i]);
  }
  const center = [0, 0, 0];
  let square = 0;
  for (let k = 0; k < dimension; ++k) {
    center[k] = (low[k] + high[k]) / 2;
    square += (high[k] - low[k]) ** 2;
  }
  return {center, radius: Math.sqrt(square) / 2 || 1};
}

class View {
  // where: 0 for A, 1 for B, 2 for the plane.
  constructor(canvas, where, heatColors) {
    this.canvas = canvas;
    this.where = where;
    this.yaw = this.pitch = 0;
    this.zoom = 1;
    this.heatColors = heatColors;
    this.edges = [];  // of both meshes in the plane: {of: triangles, list}
    this.build();
    canvas.addEventListener('webglcontextlost', event => event.preventDefault());
    canvas.addEventListener('webglcontextrestored', () => this.rebuild());
  }

  build() {
    const {canvas} = this;
    const gl = canvas.getContext('webgl2', {antialias: true, premultipliedAlpha: true});
    if (!gl) throw new Error('This browser has no WebGL 2, which the page needs to draw.');
    this.gl = gl;
    this.overlayProgram = this.program(kOverlayVertexShader, kOverlayFragmentShader);
    this.plainProgram = this.program(kPlainVertexShader, kPlainFragmentShader);
    this.overlayBuffer = gl.createBuffer();
    this.overlayArray = this.overlayAttributes();
    this.corners = 0;
    this.plains = [];  // what is drawn in one colour: {array, count, kind, color, lit}
    this.setHeatColors(this.heatColors);
  }

  // Once more all that is drawn, as when a phone has taken the processor of graphics away.
  rebuild() {
    const {mesh, plane, bytes, yaw, pitch, zoom} = this;
    this.build();
    if (mesh) this.setMesh(mesh);
    if (plane) this.setPlane(...plane);
    if (bytes) this.setOverlay(bytes);
    Object.assign(this, {yaw, pitch, zoom});
  }

  program(vertexText, fragmentText) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [
             [gl.VERTEX_SHADER, vertexText], [gl.FRAGMENT_SHADER, fragmentText]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS))
      throw new Error(gl.getProgramInfoLog(program));
    return {program, at: name => gl.getUniformLocation(program, name)};
  }

  overlayAttributes() {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.overlayBuffer);
    const layout = [
      [3, gl.FLOAT, 0], [3, gl.FLOAT, 12], [2, gl.FLOAT, 24], [2, gl.FLOAT, 32], [2, gl.FLOAT, 40],
      [4, gl.BYTE, 48], [4, gl.BYTE, 52], [1, gl.FLOAT, 56]
    ];
    layout.forEach(([size, type, offset], i) => {
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, type, type === gl.BYTE, kCornerBytes, offset);
    });
    gl.bindVertexArray(null);
    return array;
  }

  setHeatColors(colors) {
    const gl = this.gl;
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(
        gl.TEXTURE_2D, 0, gl.RGB, colors.length / 3, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, colors);
    for (const [name, value] of [
             [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE]])
      gl.texParameteri(gl.TEXTURE_2D, name, value);
  }

  // An array of vertices in space or in the plane, drawn as triangles or as lines.
  plain(positions, dimension, normals, indices, kind, color, lit) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const attribute = (i, data, size) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, gl.FLOAT, false, 0, 0);
      return buffer;
    };
    const buffers = [attribute(0, positions, dimension)];
    if (normals) buffers.push(attribute(1, normals, 3));
    buffers.push(gl.createBuffer());
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[buffers.length - 1]);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return {array, buffers, count: indices.length, kind, color, lit};
  }

  setPlains(plains) {
    for (const p of this.plains) {
      this.gl.deleteVertexArray(p.array);
      p.buffers.forEach(buffer => this.gl.deleteBuffer(buffer));
    }
    this.plains = plains;
  }

  // The mesh of this view: what the map does not cover is drawn of it.
  setMesh(mesh) {
    this.mesh = mesh;
    this.ball = mesh.ball;
    this.yaw = this.pitch = 0;
    this.zoom = 1;
    this.corners = 0;
    this.setPlains([this.plain(
        mesh.vertices, 3, mesh.normals, mesh.triangles, this.gl.TRIANGLES, [0.62, 0.64, 0.68, 1],
        1)]);
  }

  // Both embeddings as lines. The picture keeps its place as long as that fits.
  setPlane(f, g, colors) {
    const gl = this.gl;
    this.plane = [f, g, colors];
    const {center, radius} = ballOf(f.positions, 2);
    const reach = Math.max(radius, ballOf(g.positions, 2).radius);
    if (!this.ball || !(this.isShifted || this.fits(center, reach)))
      this.ball = {center, radius: reach};
    this.edges = [f, g].map(
        (x, i) => this.edges[i] && areEqual(this.edges[i].of, x.triangles) ?
            this.edges[i] :
            {of: x.triangles, list: edgesOf(x.triangles)});
    this.setPlains([f, g].map(
        (x, i) => this.plain(
            x.positions, 2, null, this.edges[i].list, gl.LINES, [...colors[i], 0.4], 0)));
  }

  // Does what lies about a center fill the picture, and no more?
  fits([x, y], reach) {
    const {center, radius} = this.ball;
    return reach <= 1.15 * radius && reach >= 0.7 * radius &&
        Math.hypot(x - center[0], y - center[1]) <= 0.2 * reach;
  }

  setOverlay(bytes) {
    const gl = this.gl;
    this.bytes = bytes;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.overlayBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STREAM_DRAW);
    this.corners = bytes.length / kCornerBytes;
  }

  clearOverlay() {
    this.corners = 0;
    this.bytes = this.plane = null;
    if (this.where === 2) {
      this.setPlains([]);
      this.ball = null;
      this.isShifted = false;
    }
  }

  // Moves the plane by parts of what is seen of it; from then on it stays where it is put.
  shift(x, y) {
    if (!this.ball) return;
    const reach = this.ball.radius / this.zoom, [cx, cy] = this.ball.center;
    this.ball = {...this.ball, center: [cx - x * reach, cy + y * reach, 0]};
    this.isShifted = true;
  }

  // Rows: right, up, towards the viewer, of what is seen.
  turn() {
    return this.where === 2 ? new Float32Array([1, 0, 0, 0, 1, 0, 0, 0, 1]) :
                              multiply3(rotation(this.yaw, this.pitch), this.mesh.axes);
  }

  // To clip space, without perspective.
  matrix() {
    const {width, height} = this.canvas, side = Math.min(width, height);
    const fit = new Float32Array(16);
    fit[0] = side / width, fit[5] = side / height, fit[10] = -0.25 / this.zoom, fit[15] = 1;
    const center = this.ball.center;
    return multiply(fit, affine(this.turn(), 0.95 * this.zoom / this.ball.radius, center));
  }

  resize() {
    const scale = Math.min(devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * scale));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * scale));
    if (this.canvas.width !== width || this.canvas.height !== height)
      Object.assign(this.canvas, {width, height});
  }

  // look: {paint, edges, colors: of A and B, toTexture}
  draw(look) {
    const gl = this.gl;
    this.resize();
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!this.ball) return;
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const is_plane = this.where === 2;
    if (is_plane)
      gl.disable(gl.DEPTH_TEST);
    else
      gl.enable(gl.DEPTH_TEST);
    const matrix = this.matrix(), turn = this.turn();
    if (!is_plane) this.drawPlains(matrix, turn);
    if (this.corners) this.drawOverlay(matrix, turn, look);
    if (is_plane) this.drawPlains(matrix, turn);
  }

  // What is not covered lies a little behind what is.
  drawPlains(matrix, turn) {
    const gl = this.gl, {program, at} = this.plainProgram;
    gl.useProgram(program);
    gl.uniformMatrix4fv(at('matrix'), false, matrix);
    gl.uniformMatrix3fv(at('turn'), false, turn);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(2, 2);
    gl.vertexAttrib3f(1, 0, 0, 1);
    for (const p of this.plains) {
      gl.uniform4fv(at('plain'), p.color);
      gl.uniform1f(at('lit'), p.lit);
      gl.bindVertexArray(p.array);
      gl.drawElements(p.kind, p.count, gl.UNSIGNED_INT, 0);
    }
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.bindVertexArray(null);
  }

  drawOverlay(matrix, turn, look) {
    const gl = this.gl, {program, at} = this.overlayProgram;
    gl.useProgram(program);
    gl.uniform1i(at('where'), this.where);
    gl.uniformMatrix4fv(at('matrix'), false, matrix);
    gl.uniformMatrix3fv(at('turn'), false, turn);
    gl.uniformMatrix4fv(at('to_texture'), false, look.toTexture);
    gl.uniform1i(at('paint'), look.paint === 'heat' ? 1 : 0);
    gl.uniform1f(at('edges'), look.edges && this.where !== 2 ? 0.7 : 0);
    gl.uniform3fv(at('edge_color'), look.colors[this.where === 0 ? 1 : 0]);
    gl.uniform1i(at('heat_colors'), 0);
    gl.bindVertexArray(this.overlayArray);
    gl.drawArrays(gl.TRIANGLES, 0, this.corners);
    gl.bindVertexArray(null);
  }

  // Where a vertex is seen, in pixels of the page from the canvas' corner, and whether it faces us.
  place(v) {
    const {vertices, normals} = this.mesh, m = this.matrix(), turn = this.turn();
    const x = vertices.subarray(3 * v, 3 * v + 3), n = normals.subarray(3 * v, 3 * v + 3);
    const at = [0, 1, 2].map(i => m[i] * x[0] + m[4 + i] * x[1] + m[8 + i] * x[2] + m[12 + i]);
    const facing = turn[2] * n[0] + turn[5] * n[1] + turn[8] * n[2];
    return {
      x: (1 + at[0]) / 2 * this.canvas.clientWidth,
      y: (1 - at[1]) / 2 * this.canvas.clientHeight,
      isInFront: facing > 0
    };
  }

  // The vertex next to where the surface is seen at a pixel of the page; -1: there is none.
  pick(px, py) {
    const {triangles, vertices} = this.mesh, n = vertices.length / 3;
    const places = new Float64Array(3 * n), m = this.matrix();
    for (let v = 0; v < n; ++v)
      for (let i = 0; i < 3; ++i)
        places[3 * v + i] = m[i] * vertices[3 * v] + m[4 + i] * vertices[3 * v + 1] +
            m[8 + i] * vertices[3 * v + 2] + m[12 + i];
    const x = 2 * px / this.canvas.clientWidth - 1, y = 1 - 2 * py / this.canvas.clientHeight;
    let best = -1, depth = Infinity;
    for (let t = 0; t < triangles.length; t += 3) {
      const hit = hitOf(places, triangles.subarray(t, t + 3), x, y);
      if (hit && hit.depth < depth) {
        depth = hit.depth;
        best = hit.vertex;
      }
    }
    return best;
  }
}

// Where a line of sight meets a triangle, and the corner next to that.
function hitOf(places, [a, b, c], x, y) {
  const area = (u, v) =>
      (places[3 * u] - x) * (places[3 * v + 1] - y) - (places[3 * v] - x) * (places[3 * u + 1] - y);
  const weights = [area(b, c), area(c, a), area(a, b)];
  const sum = weights[0] + weights[1] + weights[2];
  if (sum === 0 || weights.some(w => w * sum < 0)) return null;
  const corners = [a, b, c];
  const depth = corners.reduce((z, v, k) => z + weights[k] / sum * places[3 * v + 2], 0);
  const largest = weights.map(w => w / sum).reduce((k, w, i, all) => w > all[k] ? i : k, 0);
  return {depth, vertex: corners[largest]};
}

function areEqual(a, b) {
  return a.length === b.length && a.every((x, i) => x === b[i]);
}

// Every edge of some triangles, once.
function edgesOf(triangles) {
  const seen = new Set(), edges = [];
  for (let i = 0; i < triangles.length; ++i) {
    const u = triangles[i], v = triangles[i % 3 === 2 ? i - 2 : i + 1];
    const key = Math.min(u, v) * 16777216 + Math.max(u, v);
    if (seen.has(key)) continue;
    seen.add(key);
    edges.push(u, v);
  }
  return new Uint32Array(edges);
}
