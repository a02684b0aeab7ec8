// The types of the installed package: this compiles, and each line below an @ts-expect-error does
// not.
import {IsmError, map, type Landmark, type Mesh, type Meta, type Points} from 'ism-hpp';

const mesh: Mesh = {positions: new Float32Array(12), triangles: [0, 1, 2, 0, 2, 3]};
const landmarks: Landmark[] = [[1, 2], [{face: 0, barycentric: [1, 0, 0]}, 2, 8]];
const {signal} = new AbortController();
const onProgress = (fraction: number, what: string) => console.log(`${100 * fraction}%: ${what}`);
const m = await map(mesh, mesh, {landmarks, onProgress, signal, measure: 'arap', pinsA: [3]});
const points: Points = await m.aToB.images([0, 1]);
const back: Points = await m.bToA.images(points);
const bytes: Uint8Array = await m.aToB.transfer(new Uint8Array(12), 3, {fill: 255});
const sums: Float64Array = await m.bToA.transfer([1, 2, 3], 1, {source: 'face', target: 'corner'});
const meta: Meta = await m.meta;
const figures: number[] = [m.distortion.mean, ...m.coverage, meta.onA[0], back.faces[0], sums[0]];
console.log(figures, bytes, m.status, m.warnings.map(w => w.ids.map(id => id.element)));
m.free();
try {
  // @ts-expect-error there is no such option
  await map(mesh, mesh, {steps: 3});
  // @ts-expect-error positions are numbers
  await map({positions: 'abc', triangles: []}, mesh);
} catch (error) {
  if (error instanceof IsmError) console.log(error.status, error.ids.length);
}
