// Draws the particles of a body over a period, each as the piece of the body that it stands for, coloured by stress.

// Viridis at ten steps: light is high.
const VIRIDIS = ['#440154', '#482878', '#3e4a89', '#31688e', '#26828e', '#1f9e89', '#35b779', '#6ece58', '#b5de2b', '#fde725']
  .map((colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16)));
const STEPS = 64;
const PALETTE = Array.from({ length: STEPS }, (_, n) => {
  const at = (n / (STEPS - 1)) * (VIRIDIS.length - 1);
  const low = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return VIRIDIS[low].map((part, i) => part + (VIRIDIS[low + 1][i] - part) * (at - low));
});
const colour = (step, light = 1) => `rgb(${PALETTE[step].map((part) => Math.round(part * light)).join(' ')})`;

/** Reads the numbers of the module. */
export function unpack(bytes) {
  const numbers = new Float32Array(bytes.buffer, bytes.byteOffset, bytes.byteLength / 4);
  const [D, count, frames, period] = numbers;
  const own = count * (D + D * D);
  const each = count * (D + 2 * D * D);
  return { D, count, frames, period, numbers, places: 4, states: 4 + own, each, entry: D + 2 * D * D };
}

const AXES = ['X', 'Y', 'Z'];

/** What colours may show: a name, and the value from u, F and P of a particle. */
export function quantities(D) {
  const at = (values, base, i, j) => values[base + D + i * D + j];
  const P = (values, base, i, j) => values[base + D + D * D + i * D + j];
  const determinant = (values, base) => {
    const F = (i, j) => at(values, base, i, j);
    if (D === 1) return F(0, 0);
    if (D === 2) return F(0, 0) * F(1, 1) - F(0, 1) * F(1, 0);
    return F(0, 0) * (F(1, 1) * F(2, 2) - F(1, 2) * F(2, 1)) - F(0, 1) * (F(1, 0) * F(2, 2) - F(1, 2) * F(2, 0))
      + F(0, 2) * (F(1, 0) * F(2, 1) - F(1, 1) * F(2, 0));
  };
  // Cauchy stress: P F^T / J.
  const cauchy = (i, j) => (values, base) => {
    let sum = 0;
    for (let k = 0; k < D; k += 1) sum += P(values, base, i, k) * at(values, base, j, k);
    return sum / determinant(values, base);
  };
  const size = (values, base) => {
    let sum = 0;
    for (let i = 0; i < D; i += 1) for (let j = 0; j < D; j += 1) sum += cauchy(i, j)(values, base) ** 2;
    return Math.sqrt(sum);
  };
  const list = [];
  if (D > 1) list.push(['size of the Cauchy stress', size]);
  for (let i = 0; i < D; i += 1) for (let j = i; j < D; j += 1) {
    list.push([`Cauchy stress ${(AXES[i] + AXES[j]).toLowerCase()}`, cauchy(i, j)]);
  }
  list.push(['volume ratio J', determinant]);
  list.push(['size of the displacement', (values, base) => Math.hypot(...values.subarray(base, base + D))]);
  return list;
}

export class Motion {
  constructor(canvas, scale) {
    this.canvas = canvas;
    this.scale = scale;
    this.body = null;
    this.turn = 0.6;
    this.tilt = 0.45;
    let from = null;
    canvas.addEventListener('pointerdown', (event) => {
      if (this.body?.D === 3) { from = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); }
    });
    canvas.addEventListener('pointermove', (event) => {
      if (!from) return;
      this.turn += (event.clientX - from[0]) / 150;
      this.tilt = Math.max(-1.4, Math.min(1.4, this.tilt + (event.clientY - from[1]) / 150));
      from = [event.clientX, event.clientY];
      this.draw(this.at);
    });
    canvas.addEventListener('pointerup', () => { from = null; });
    canvas.addEventListener('pointercancel', () => { from = null; });
  }

  /** Takes the numbers of a body; `value` is what its colours show. */
  show(body, value) {
    this.body = body;
    const { numbers, count, frames, states, each, entry } = body;
    this.values = new Float32Array(count * frames);
    let [least, most] = [Infinity, -Infinity];
    for (let frame = 0; frame < frames; frame += 1) {
      for (let n = 0; n < count; n += 1) {
        const found = value(numbers, states + frame * each + n * entry);
        this.values[frame * count + n] = found;
        if (Number.isFinite(found)) { least = Math.min(least, found); most = Math.max(most, found); }
      }
    }
    // What rounding alone tells apart is one colour.
    if (!(most - least > 1e-6 * Math.max(Math.abs(most), Math.abs(least)))) most = least;
    [this.least, this.most] = [least, most];
    this.measure();
    this.legend();
  }

  /** The box that the body stays in, in the directions of the eye for the plane. */
  measure() {
    const { D, numbers, count, frames, places, states, each, entry } = this.body;
    const own = D + D * D;
    const [low, high] = [Array(D).fill(Infinity), Array(D).fill(-Infinity)];
    for (let n = 0; n < count; n += 1) {
      for (let i = 0; i < D; i += 1) {
        let reach = 0;
        for (let j = 0; j < D; j += 1) reach += Math.abs(numbers[places + n * own + D + j * D + i]) / 2;
        for (let frame = 0; frame < frames; frame += 1) {
          const x = numbers[places + n * own + i] + numbers[states + frame * each + n * entry + i];
          if (!Number.isFinite(x)) continue;
          low[i] = Math.min(low[i], x - reach);
          high[i] = Math.max(high[i], x + reach);
        }
      }
    }
    this.middle = low.map((value, i) => (value + high[i]) / 2);
    this.half = Math.max(...low.map((value, i) => (high[i] - value) / 2)) || 1;
    if (D === 3) this.half *= 1.45;
  }

  legend() {
    const { scale } = this;
    const width = Math.max(1, Math.round(scale.clientWidth * devicePixelRatio));
    scale.width = width;
    scale.height = 1;
    const pen = scale.getContext('2d');
    for (let x = 0; x < width; x += 1) {
      pen.fillStyle = colour(Math.min(STEPS - 1, Math.floor((x / width) * STEPS)));
      pen.fillRect(x, 0, 1, 1);
    }
  }

  step(value) {
    if (!Number.isFinite(value)) return 0;
    if (this.most === this.least) return STEPS >> 1;
    return Math.max(0, Math.min(STEPS - 1, Math.floor(((value - this.least) / (this.most - this.least)) * STEPS)));
  }

  /** Draws the moment `at`, a share of the period. */
  draw(at) {
    this.at = at;
    const { canvas, body } = this;
    if (!body) return;
    const side = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
    const height = Math.max(1, Math.round(canvas.clientHeight * devicePixelRatio));
    if (canvas.width !== side || canvas.height !== height) { canvas.width = side; canvas.height = height; }
    const pen = canvas.getContext('2d');
    pen.clearRect(0, 0, side, height);
    this.pen = pen;
    this.zoom = (0.46 * Math.min(side, height)) / this.half;
    this.origin = [side / 2, height / 2];
    const frame = Math.min(body.frames - 1, Math.floor(at * body.frames));
    if (body.D === 3) this.drawSpace(frame);
    else this.drawPlane(frame);
  }

  /** Place and deformed edges of a particle. */
  piece(frame, n) {
    const { D, numbers, places, states, each, entry } = this.body;
    const own = places + n * (D + D * D);
    const state = states + frame * each + n * entry;
    const x = [];
    const edges = Array.from({ length: D }, () => Array(D).fill(0));
    for (let i = 0; i < D; i += 1) {
      x.push(numbers[own + i] + numbers[state + i] - this.middle[i]);
      for (let k = 0; k < D; k += 1) {
        const F = numbers[state + D + i * D + k];
        for (let j = 0; j < D; j += 1) edges[j][i] += F * numbers[own + D + j * D + k];
      }
    }
    return [x, edges];
  }

  drawPlane(frame) {
    const { pen, zoom, origin, body } = this;
    const bar = 0.12 * this.half;
    for (let n = 0; n < body.count; n += 1) {
      const [x, edges] = this.piece(frame, n);
      const [a, b] = body.D === 1 ? [[edges[0][0], 0], [0, 2 * bar]] : edges;
      const [px, py] = [x[0], x[1] ?? 0];
      pen.fillStyle = colour(this.step(this.values[frame * body.count + n]));
      pen.beginPath();
      for (const [s, t] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
        pen.lineTo(origin[0] + zoom * (px + 0.47 * (s * a[0] + t * b[0])), origin[1] - zoom * (py + 0.47 * (s * a[1] + t * b[1])));
      }
      pen.closePath();
      pen.fill();
    }
  }

  drawSpace(frame) {
    const { pen, zoom, origin, body } = this;
    const [c, s, ct, st] = [Math.cos(this.turn), Math.sin(this.turn), Math.cos(this.tilt), Math.sin(this.tilt)];
    const seen = ([x, y, z]) => {
      const [across, away] = [c * x + s * y, -s * x + c * y];
      return [across, ct * z + st * away, ct * away - st * z];
    };
    const pieces = [];
    for (let n = 0; n < body.count; n += 1) {
      const [x, edges] = this.piece(frame, n);
      pieces.push([seen(x), edges.map(seen), this.step(this.values[frame * body.count + n])]);
    }
    // The farthest first.
    pieces.sort((one, other) => other[0][2] - one[0][2]);
    for (const [x, edges, step] of pieces) {
      for (let face = 0; face < 3; face += 1) {
        const [a, b, out] = [edges[(face + 1) % 3], edges[(face + 2) % 3], edges[face]];
        const normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        const inward = normal[0] * out[0] + normal[1] * out[1] + normal[2] * out[2] < 0 ? -1 : 1;
        const length = Math.hypot(...normal) || 1;
        // The side that looks at the eye.
        const towards = inward * normal[2] < 0 ? 1 : -1;
        const light = 0.72 + 0.28 * Math.abs(normal[2] / length);
        pen.fillStyle = colour(step, light);
        pen.beginPath();
        for (const [p, q] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
          const corner = (i) => x[i] + 0.46 * (towards * out[i] + p * a[i] + q * b[i]);
          pen.lineTo(origin[0] + zoom * corner(0), origin[1] - zoom * corner(1));
        }
        pen.closePath();
        pen.fill();
      }
    }
  }
}
