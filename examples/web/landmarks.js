// Landmarks as marks over the pictures of both surfaces.
'use strict';

// Marks on both surfaces that can be set, dragged, moved by keys and removed.
class Landmarks {
  constructor(views, changed, say) {
    this.views = views;
    this.changed = changed;
    this.say = say;
    this.pairs = [];
    this.pending = null;  // {side, vertex} of the first end
  }

  set(pairs) {
    this.pairs = pairs.map(pair => [...pair]);
    this.pending = null;
    this.render();
  }

  // A place on one side was chosen. `image` finds where it lies on the other one, or -1.
  place(side, vertex, image) {
    if (this.pairs.some(pair => pair[side] === vertex)) return;
    const ends = [-1, -1];
    ends[side] = vertex;
    if (this.pending && this.pending.side !== side)
      ends[1 - side] = this.pending.vertex;
    else
      ends[1 - side] = image();
    if (ends[1 - side] < 0 || this.pairs.some(pair => pair[1 - side] === ends[1 - side])) {
      this.pending = {side, vertex};
      this.say(`Now click the same place on ${side === 0 ? 'B' : 'A'}.`);
    } else {
      this.pending = null;
      this.pairs.push(ends);
      this.changed();
    }
    this.render();
  }

  move(i, side, vertex) {
    if (vertex < 0 || this.pairs.some(pair => pair[side] === vertex)) return;
    this.pairs[i][side] = vertex;
    this.layout();
  }

  remove(i) {
    this.pairs.splice(i, 1);
    this.render();
    this.changed();
  }

  render() {
    for (const side of [0, 1]) {
      const box = $(`marks_${kSides[side]}`);
      box.replaceChildren(...this.pairs.map((pair, i) => this.mark(i, side)));
      if (this.pending && this.pending.side === side) {
        const mark = document.createElement('span');
        mark.className = 'mark pending';
        mark.setAttribute('role', 'img');
        box.append(mark);
      }
    }
    this.layout();
  }

  mark(i, side) {
    const mark = document.createElement('button');
    mark.type = 'button';
    mark.className = 'mark';
    mark.textContent = i + 1;
    mark.addEventListener('keydown', event => this.key(event, i, side));
    mark.addEventListener('pointerdown', event => this.drag(event, mark, i, side));
    return mark;
  }

  drag(event, mark, i, side) {
    const view = this.views[side], before = this.pairs[i][side];
    mark.setPointerCapture(event.pointerId);
    mark.onpointermove = move => {
      const box = view.canvas.getBoundingClientRect();
      this.move(i, side, view.pick(move.clientX - box.left, move.clientY - box.top));
    };
    mark.onpointerup = mark.onpointercancel = () => {
      mark.onpointermove = mark.onpointerup = mark.onpointercancel = null;
      if (this.pairs[i][side] !== before) this.changed();
    };
  }

  key(event, i, side) {
    const directions =
        {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
    if (event.key === 'Delete' || event.key === 'Backspace') {
      this.remove(i);
      const rest = $(`marks_${kSides[side]}`).querySelectorAll('button');
      (rest[Math.min(i, rest.length - 1)] || this.views[side].canvas).focus();
    } else if (directions[event.key]) {
      const next = this.neighbour(side, this.pairs[i][side], directions[event.key]);
      this.move(i, side, next);
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.changed(), 400);
    } else
      return;
    event.preventDefault();
    event.stopPropagation();
  }

  // The neighbour of a vertex that lies farthest in a direction of the screen.
  neighbour(side, v, [dx, dy]) {
    const view = this.views[side], {triangles} = view.mesh, from = view.place(v);
    let best = -1, most = 0;
    for (let t = 0; t < triangles.length; t += 3) {
      const corners = triangles.subarray(t, t + 3);
      if (!corners.includes(v)) continue;
      for (const u of corners) {
        const to = view.place(u), length = Math.hypot(to.x - from.x, to.y - from.y);
        const along = u === v ? 0 : ((to.x - from.x) * dx + (to.y - from.y) * dy) / length;
        if (along > most) [best, most] = [u, along];
      }
    }
    return best;
  }

  layout() {
    for (const side of [0, 1]) {
      const view = this.views[side], marks = $(`marks_${kSides[side]}`).children;
      if (!view.mesh) continue;
      const vertices = this.pairs.map(pair => pair[side]);
      if (this.pending && this.pending.side === side) vertices.push(this.pending.vertex);
      vertices.forEach((v, i) => {
        const at = view.place(v);
        marks[i].style.left = `${at.x}px`;
        marks[i].style.top = `${at.y}px`;
        marks[i].classList.toggle('behind', !at.isInFront);
        marks[i].setAttribute(
            'aria-label', `Landmark ${i + 1} on ${side ? 'B' : 'A'}, vertex ${v}`);
      });
    }
  }
}
