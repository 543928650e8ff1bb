// Errors of the solver on some grids: a table and a drawing in logarithms.

import { draw, make } from './dom.js';

const FIELDS = ['u', 'v', 'F', 'P'];
const COLOURS = { u: '#3b82c4', v: '#c2722a', F: '#2f9e6e', P: '#a855b5' };
const NORM = 'l2';
const number = (value, digits = 2) => (Number.isFinite(value) ? value.toExponential(digits) : '-');

/** Rows and orders. */
export function table({ rows, orders }) {
  const head = ['cells', 'particles', ...FIELDS.flatMap((field) => [`L2 error of ${field}`, 'order']), 'ends'];
  const body = rows.map((row, n) => [row.cells, row.particles,
    ...FIELDS.flatMap((field) => [number(row.errors[field][NORM]), n > 0 && orders[field][NORM].local[n - 1] !== null ? orders[field][NORM].local[n - 1].toFixed(2) : '-']),
    row.status]);
  const cell = (name, text) => make(name, { class: 'number' }, String(text));
  return make('div', { class: 'wide', tabindex: '0' }, make('table', {}, make('thead', {}, make('tr', {}, head.map((text) => cell('th', text)))),
    make('tbody', {}, body.map((row) => make('tr', {}, row.map((text) => cell('td', text)))))));
}

/** Errors over the spacing, each as a share of that on the first grid. */
export function plot({ rows, orders }) {
  const [width, height, left, bottom] = [460, 300, 52, 40];
  const points = FIELDS.map((field) => [field, rows.map((row) => [Math.log10(row.h), Math.log10(row.errors[field][NORM] / rows[0].errors[field][NORM])])
    .filter((point) => point.every(Number.isFinite))]).filter(([, own]) => own.length > 0);
  const all = points.flatMap(([, own]) => own);
  const [x0, x1] = [Math.min(...all.map(([x]) => x)) - 0.1, Math.max(...all.map(([x]) => x)) + 0.1];
  const [y0, y1] = [Math.min(...all.map(([, y]) => y), -1) - 0.1, Math.max(...all.map(([, y]) => y)) + 0.1];
  const at = ([x, y]) => [left + ((x - x0) / (x1 - x0)) * (width - left - 80), height - bottom - ((y - y0) / (y1 - y0)) * (height - bottom - 14)];
  const parts = [];
  const word = (text, x, y, more = {}) => { const own = draw('text', { x, y, ...more }); own.textContent = text; parts.push(own); };
  for (let y = Math.ceil(y0); y <= Math.floor(y1); y += 1) {
    const [, py] = at([x0, y]);
    parts.push(draw('line', { class: 'axis', x1: left, x2: width - 80, y1: py, y2: py }));
    word(y === 0 ? '1' : `1e${y}`, left - 6, py + 4, { 'text-anchor': 'end' });
  }
  for (const row of rows) {
    const [px] = at([Math.log10(row.h), y0]);
    parts.push(draw('line', { class: 'axis', x1: px, x2: px, y1: 14, y2: height - bottom }));
    word(String(row.cells), px, height - bottom + 16, { 'text-anchor': 'middle' });
  }
  word('cells', left + (width - left - 80) / 2, height - 6, { 'text-anchor': 'middle' });
  const ends = [];
  for (const [field, own] of points) {
    const path = own.map(at).map(([x, y], n) => `${n ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`).join('');
    parts.push(draw('path', { class: 'curve', d: path, stroke: COLOURS[field] }));
    for (const [x, y] of own.map(at)) parts.push(draw('circle', { cx: x, cy: y, r: 3.5, fill: COLOURS[field] }));
    const fit = orders[field][NORM].fit;
    ends.push([at(own[0])[1], `${field}${fit === null ? '' : `: order ${fit.toFixed(2)}`}`, COLOURS[field]]);
  }
  // The key, from above.
  ends.forEach(([, text, colour], n) => {
    parts.push(draw('rect', { x: left + 8, y: 18 + 17 * n, width: 10, height: 10, fill: colour }));
    word(text, left + 24, 27 + 17 * n);
  });
  return draw('svg', { class: 'plot', viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': 'Errors over the spacing of the grid, as shares of those on the first grid' }, ...parts);
}
