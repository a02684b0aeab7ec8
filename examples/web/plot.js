// Energies over the iterations.
'use strict';

// Values over the iterations; the scale of energies is logarithmic, and shared.
class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.clear();
  }

  clear() {
    this.series = [
      {name: 'distortion of Φ', of: it => it.distortion, color: '--ink', values: []},
      {name: 'E_f, of A in the plane', of: it => it.energyF, color: '--a', values: []},
      {name: 'E_g, of B in the plane', of: it => it.energyG, color: '--b', values: []},
    ];
  }

  add(log) {
    this.series.forEach(s => s.values.push(s.of(log)));
  }

  draw() {
    const scale = devicePixelRatio || 1, {clientWidth: width, clientHeight: height} = this.canvas;
    Object.assign(this.canvas, {width: width * scale, height: height * scale});
    const g = this.canvas.getContext('2d'), style = getComputedStyle(document.documentElement);
    const color = name => style.getPropertyValue(name).trim();
    g.scale(scale, scale);
    g.font = '12px system-ui, sans-serif';
    this.legend(g, color, width);
    const all = this.series.flatMap(s => s.values).filter(x => x > 0 && isFinite(x));
    if (!all.length) return;
    const box = {left: 40, right: width - 10, top: 24, bottom: height - 22};
    const low = Math.min(...all) * 0.98, high = Math.max(...all) * 1.05;
    const n = this.series[0].values.length;
    const x = i => box.left + (box.right - box.left) * i / Math.max(n - 1, 1);
    const y = v => box.bottom - (box.bottom - box.top) * Math.log(v / low) / Math.log(high / low);
    this.grid(g, color, box, low, high, y, n);
    for (const s of this.series) {
      g.strokeStyle = color(s.color);
      g.lineWidth = 2;
      g.beginPath();
      s.values.forEach((v, i) => v > 0 && isFinite(v) && g.lineTo(x(i), y(v)));
      g.stroke();
    }
  }

  legend(g, color, width) {
    let at = 8;
    for (const s of this.series) {
      const words = width > 420 ? s.name : s.name.split(/[ ,]/)[0];
      g.fillStyle = color(s.color);
      g.fillRect(at, 10, 12, 3);
      g.fillText(words, at + 16, 15);
      at += g.measureText(words).width + 30;
    }
  }

  grid(g, color, box, low, high, y, n) {
    g.strokeStyle = color('--line');
    g.fillStyle = color('--quiet');
    g.lineWidth = 1;
    let last = Infinity;
    for (const v of [1, 2, 2.5, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 100, 200, 500, 1000, 1e4, 1e5]) {
      if (v < low || v > high || last - y(v) < 16) continue;
      last = y(v);
      g.beginPath();
      g.moveTo(box.left, last);
      g.lineTo(box.right, last);
      g.stroke();
      g.textAlign = 'right';
      g.fillText(String(v), box.left - 4, last + 4);
    }
    g.fillText(`iterations: ${n}, coarse levels included`, box.right, box.bottom + 16);
    g.textAlign = 'left';
  }
}
