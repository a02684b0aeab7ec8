// The installed package, by its name: a square onto a square.
import {IsmError, map} from 'ism-hpp';

const square = {positions: [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0], triangles: [0, 1, 2, 0, 2, 3]};
const m = await map(square, square);
const {faces} = await m.aToB.images();
const wrong = await map(square, square, {landmarks: [[0, 4]]}).catch(error => error);
const isRight = Math.abs(m.distortion.mean - 2) < 0.01 && faces.length === 4 &&
    wrong instanceof IsmError && wrong.ids[0].id === 4;
console.log(isRight ? 'passed: the package' : `FAILED: ${m.distortion.mean}, ${wrong}`);
process.exitCode = isRight ? 0 : 1;
