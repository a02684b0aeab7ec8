// Algorithm 1 of the paper as the page shows it: which lines run at what time, their equations in
// words, and what the last iteration made of them.
'use strict';

// The energy of a polygon by the measure; σ: the singular values of J, the Jacobian of Φ.
const kEnergies = {
  dirichlet: '∫ ‖J‖² + ‖J⁻¹‖²',
  sarap: '½ ∫ (1 − 1/σ<sub>min</sub>)² + (1 − σ<sub>max</sub>)²',
  arap: '∫ (1 − σ<sub>min</sub>)² + (1 − σ<sub>max</sub>)²',
  asap: '∫ (σ<sub>max</sub> − σ<sub>min</sub>)²'
};
const derivativesOf = measure =>
    `E<sub>ρ</sub> = ${kEnergies[measure]}, g<sub>ρ</sub>, H<sub>ρ</sub>`;

// `phase` names the part of IterationLog's seconds that a line belongs to; some have none.
const kLines = [
  {
    at: '',
    phase: 'embedding',
    formula: 'x<sup>(0)</sup>',
    words: 'The start: injective embeddings of both surfaces in the plane, landmarks close to ' +
        'each other.'
  },
  {
    at: '1',
    phase: 'setup',
    formula: 'L, M',
    words: 'Once: a measure of smooth motion over both surfaces (Laplacian L, areas M).'
  },
  {
    at: '3',
    phase: 'overlay',
    formula: 'M(x) = f(A) ∩ g(B)',
    words:
        'Intersect the triangles of both surfaces, exactly. The last line search has done so ' +
        'already.',
    last: it => `${it.polygons.toLocaleString()} polygons`
  },
  {
    at: '4–6',
    phase: 'derivatives',
    formula: derivativesOf('dirichlet'),
    words:
        'Φ is affine on each polygon. Compute its energy there, with first and second derivatives ' +
        'in the six corners of both triangles.',
    last: it => `distortion ${it.distortion.toFixed(4)}`
  },
  {
    at: '7',
    phase: 'derivatives',
    formula: 'H<sub>ρ</sub> → V D<sub>+</sub> V<sup>T</sup>',
    words: 'Raise negative eigenvalues, so that every direction curves upwards.'
  },
  {
    at: '8',
    phase: 'assembly',
    formula: 'g<sup>(i)</sup> = Σ g<sub>ρ</sub>, H<sup>(i)</sup> = Σ H<sub>ρ</sub>',
    words: 'Add all of them up to one gradient and one sparse matrix.',
    last: it => `E = ${it.energy.toPrecision(5)}`
  },
  {
    at: '9',
    phase: 'assembly',
    formula: 'H = Σ<sub>j</sub> λ<sup>j</sup> H<sup>(i−j)</sup>, g likewise',
    words:
        'Memory: blend in the last ones, as curvature jumps wherever a vertex crosses an edge.'
  },
  {
    at: '10–12',
    phase: 'solve',
    formula: '(H + ω<sub>L</sub> L<sup>T</sup>ML) d = −g',
    words: 'Newton’s direction, smoothed: while ω<sub>L</sub> is large, all vertices move as one ' +
        'sheet. Try a smaller, the same and a larger ω<sub>L</sub>.',
    last: it => `ω = ${Number(it.omega.toPrecision(2))}`
  },
  {
    at: '13–14',
    phase: 'reset',
    formula: 'd<sup>T</sup>g<sup>(i)</sup> &gt; 0 ?',
    words: 'If the memory points uphill, forget it and solve again.',
    last: it => it.historyReset ? 'forgotten' : 'it points downhill'
  },
  {
    at: '15–16',
    phase: 'search',
    formula: 's ≤ 0.99 s<sub>max</sub>',
    words: 'The longest step before some triangle collapses.',
    last: it => `at most ${Number(it.maxStep.toPrecision(3))}`
  },
  {
    at: '17–23',
    phase: 'search',
    formula: 'E(x + s d) ≤ E(x) + 10⁻⁴ s d<sup>T</sup>g',
    words: 'Shorten the step until the map of the moved vertices, with its own overlay, is better.',
    last: it => `s = ${it.step.toPrecision(3)}`
  },
  {
    at: '24–25',
    phase: 'accept',
    formula: 'x<sup>(i+1)</sup> = best trial',
    words: 'Take the best of all trials. Exact predicates have checked that it is injective.'
  },
  {
    at: '+',
    phase: 'quasiNewton',
    formula: 'd = −H<sub>old</sub>⁻¹ g',
    words: 'Beyond the paper: a few cheap steps with the last factor, as long as they pay.',
    last: it => it.quasiNewton ? `s = ${it.step.toPrecision(3)}` : ''
  },
];

const sumOf = seconds => Object.values(seconds).reduce((a, b) => a + b, 0) || 1;

class AlgorithmPanel {
  constructor(list, caption) {
    this.caption = caption;
    this.items = kLines.map(line => {
      const item = document.createElement('li');
      item.innerHTML = `<b>${line.at}</b><span class="formula">${line.formula}</span>` +
          `<span class="words">${line.words}</span><span class="last"></span>` +
          '<span class="share"></span>';
      list.append(item);
      return item;
    });
    this.timer = 0;
  }

  // Shows the energy that is minimised.
  setMeasure(measure) {
    const index = kLines.findIndex(line => line.phase === 'derivatives');
    kLines[index].formula = derivativesOf(measure);
    this.items[index].querySelector('.formula').innerHTML = kLines[index].formula;
  }

  // What each phase of an iteration took.
  static seconds(log) {
    const {secondsDerivatives, secondsAssembly, secondsSolve, secondsSearch} = log;
    if (log.quasiNewton) return {quasiNewton: secondsDerivatives + secondsSolve + secondsSearch};
    return {
      derivatives: secondsDerivatives,
      assembly: secondsAssembly,
      solve: secondsSolve,
      search: secondsSearch
    };
  }

  // What the last iteration did, and how long each phase took, at its first line.
  show(log) {
    const seconds = AlgorithmPanel.seconds(log), sum = sumOf(seconds), seen = new Set();
    kLines.forEach((line, i) => {
      const item = this.items[i], runs = this.runs(line, log);
      const took = seen.has(line.phase) ? 0 : seconds[line.phase] || 0;
      seen.add(line.phase);
      const last = runs && line.last ? line.last(log) : '';
      const time = took ? `${(1000 * took).toFixed(0)} ms` : '';
      item.classList.toggle('idle', !runs);
      item.querySelector('.last').textContent = [last, time].filter(x => x).join(', ');
      item.querySelector('.share').style.width = `${100 * took / sum}%`;
    });
    this.log = log;
  }

  runs(line, log) {
    if (line.phase === 'embedding' || line.phase === 'setup') return false;
    return (line.phase === 'quasiNewton') === log.quasiNewton;
  }

  // The line that runs, in the list and beside the picture; -1: none.
  mark(index) {
    this.items.forEach((item, i) => item.classList.toggle('now', i === index));
    const {at, formula, words} = kLines[index] || {at: '', formula: '', words: ''};
    this.caption.innerHTML = index < 0 ? '' : `<b>${at} ${formula}</b> ${words}`;
  }

  embedding() {
    this.stop();
    this.mark(0);
  }

  // Goes through the lines of the last iteration, each for its share of some milliseconds, again
  // and again while it plays, once after a single step.
  sweep(milliseconds, repeats) {
    this.stop();
    if (matchMedia('(prefers-reduced-motion: reduce)').matches) return;
    const visit = [...kLines.keys()].filter(i => this.runs(kLines[i], this.log));
    const seconds = AlgorithmPanel.seconds(this.log), sum = sumOf(seconds);
    const sharing = phase => visit.filter(i => kLines[i].phase === phase).length;
    const shareOf = ({phase}) => (seconds[phase] || 0) / sum / sharing(phase);
    const next = k => {
      if (k === visit.length && !repeats) return;
      const i = visit[k % visit.length];
      this.mark(i);
      const share = 0.3 / visit.length + 0.7 * shareOf(kLines[i]);  // all can be seen
      this.timer = setTimeout(() => next(k % visit.length + 1), milliseconds * share);
    };
    next(0);
    this.isSweeping = repeats;
  }

  stop() {
    clearTimeout(this.timer);
    this.isSweeping = false;
    this.mark(-1);
  }
}
