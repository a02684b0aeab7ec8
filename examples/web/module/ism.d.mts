// ism.hpp as an ES module: injective maps of low distortion between triangle meshes.

/** Any typed array except those of BigInt, or a plain array of numbers. */
export type Numbers = Int8Array | Uint8Array | Uint8ClampedArray | Int16Array | Uint16Array |
    Int32Array | Uint32Array | Float32Array | Float64Array | number[];

/** A surface without handles, open or closed; defects are repaired. Arrays are read, not kept. */
export interface Mesh {
  /** #V×3, x0, y0, z0, x1, ..., in any unit. */
  positions: Numbers;
  /** #F×3 vertex ids from 0, counter-clockwise seen from outside. */
  triangles: Numbers;
}

/** A point in a triangle: coordinates are at least 0 with sum 1. */
export interface Point {
  face: number;
  barycentric: ArrayLike<number>;
}

/** A vertex of A and one of B, or points, that should correspond; 8 is the usual weight. */
export type Landmark = [a: number | Point, b: number | Point, weight?: number];

/** The options of `ism::Options`; ism.hpp explains them and their defaults. */
export interface Options {
  landmarks?: Iterable<Landmark>;
  /** Called several times a second with the finished fraction, 0 to 1, and a few words. An exception
   *  ends the run. */
  onProgress?: (fraction: number, what: string) => void;
  /** Cancels: the promise resolves to the best map so far, with the status "cancelled". Before there
   *  is a map, it is rejected with the reason of the signal. */
  signal?: AbortSignal;
  /** dirichlet: symmetric Dirichlet, the default. */
  measure?: 'dirichlet' | 'arap' | 'sarap' | 'asap';
  boundary?: 'free' | 'fixed' | 'slide';
  /** Images of landmarks coincide; else they pull softly. */
  exactLandmarks?: boolean;
  /** A larger weight gives more coverage and more distortion; default 0.2. */
  coverageWeight?: number;
  /** For meshes in the same unit, which keep their sizes. */
  keepScale?: boolean;
  maxIterations?: number;
  tolerance?: number;
  maxSeconds?: number;
  candidates?: boolean;
  coarsest?: number;
  refine?: number;
  weld?: boolean;
  /** A vertex on the boundary loop that is the outline; -1, the default: the longest loop. */
  outerA?: number;
  outerB?: number;
  /** Vertices that keep their images from the start. */
  pinsA?: Numbers;
  pinsB?: Numbers;
  historyLength?: number;
  omegaStart?: number;
  asPublished?: boolean;
}

/** An element of a given mesh. */
export interface ElementId {
  side: 'a' | 'b';
  element: ElementKind;
  id: number;
}

/** Corner k of triangle f is 3 f + k. */
export type ElementKind = 'vertex' | 'face' | 'corner';

/** A call failed. `message` is a sentence for the user. */
export class IsmError extends Error {
  /** In words: "invalid input", "invalid mesh", "invalid landmarks", "failed call", ... */
  readonly status: string;
  /** The elements that the sentence names. */
  readonly ids: ElementId[];
}

/** Points of a surface, in the order of the arguments. */
export interface Points {
  /** The triangles of the points; -1: the map does not cover the point. */
  faces: Int32Array;
  /** #×3, coordinates in these triangles; zeros where there is none. */
  barycentric: Float64Array;
  /** #×3, in the unit of the mesh; NaN where there is none. */
  positions: Float64Array;
}

/** A sparse matrix by rows: value i is the sum of weights[k] times value sources[k], for k from
 *  offsets[i] to offsets[i + 1] - 1. Rows that are not covered are empty. */
export interface Matrix {
  offsets: Int32Array;
  sources: Int32Array;
  weights: Float64Array;
  columns: number;
}

/** The kinds of elements; vertices by default. */
export interface Elements {
  source?: ElementKind;
  target?: ElementKind;
}

/** The map from one mesh to the other. */
export interface Direction {
  /** Images of vertices; of all, if none are given. */
  images(vertices?: Numbers | number): Promise<Points>;
  /** Images of points in triangles; triangle -1 is no point. */
  images(faces: Numbers | number, barycentric: Numbers): Promise<Points>;
  /** Images of images, e.g. of the other direction. */
  images(points: Pick<Points, 'faces' | 'barycentric'>): Promise<Points>;
  /** Carries values to the other mesh, `columns` numbers per element, to an array of the same type;
   *  integers are rounded. Uncovered elements get `fill`, or 0. */
  transfer<T extends Numbers>(values: T, columns?: number, options?: Elements & {fill?: number}):
      Promise<T extends number[] ? Float64Array : T>;
  /** The matrix of `transfer`. */
  matrix(elements?: Elements): Promise<Matrix>;
}

/** Symmetric Dirichlet energy per area, 2 for an isometry, over both surfaces, weighted by area;
 *  the extreme singular values; the covered areas. Surfaces are scaled to area 1, unless landmarks
 *  or `keepScale` determine other sizes. */
export interface Distortion {
  mean: number;
  median: number;
  p95: number;
  largest: number;
  sigmaMin: number;
  sigmaMax: number;
  areaA: number;
  areaB: number;
}

/** The common refinement of A and B: polygons of 3 to 6 corners, with two geometries. */
export interface Meta {
  /** #M×3, positions of the vertices on either surface. */
  onA: Float64Array;
  onB: Float64Array;
  /** #M×2, their positions in the common plane. */
  plane: Float64Array;
  /** Per polygon, the triangles of A and of B that contain it. */
  faceA: Int32Array;
  faceB: Int32Array;
  /** Polygon p has the corners offsets[p] to offsets[p + 1] - 1, counter-clockwise. */
  offsets: Int32Array;
  /** Vertices of the refinement. */
  corners: Int32Array;
  /** #C×3, barycentric coordinates of the corners in faceA, in faceB. */
  cornerA: Float64Array;
  cornerB: Float64Array;
  /** #P×5, per polygon: area on A, area on B, smallest and largest singular value, distortion. */
  distortion: Float64Array;
}

/** An injective map between A and B. */
export interface SurfaceMap {
  readonly aToB: Direction;
  readonly bToA: Direction;
  /** How the run ended: "converged", "iteration limit", "time limit", "cancelled", "stalled". */
  readonly status: string;
  /** The same as a sentence. */
  readonly message: string;
  /** Findings that may make the map useless. */
  readonly warnings: {message: string, ids: ElementId[]}[];
  readonly distortion: Distortion;
  /** The covered shares of the areas of A and of B, 0 to 1. */
  readonly coverage: [a: number, b: number];
  readonly iterations: number;
  readonly seconds: number;
  /** Computed at the first access. */
  readonly meta: Promise<Meta>;
  /** Ends the worker of the map and gives its memory back. Later calls are refused. */
  free(): void;
}

/** Maps A onto B: injective, continuous, of low distortion. Calls may overlap. */
export function map(a: Mesh, b: Mesh, options?: Options): Promise<SurfaceMap>;
