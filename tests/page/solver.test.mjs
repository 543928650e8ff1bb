// The module with the solver beside the command: node tests/page/solver.test.mjs MODULE MMS
//
// Errors on 8, 16 and 32 cells are those of `mms converge` to the bit, and orders in more digits than anyone prints.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { Module } from './module.mjs';

const [file, mms] = process.argv.slice(2);
const module = new Module(file);
const folder = mkdtempSync(path.join(tmpdir(), 'mmsmith-page-'));
const out = path.join(folder, 'orders.json');
const close = (one, other) => one === other || Math.abs(one / other - 1) < 1e-11;
for (const name of ['axis-aligned', 'bar', 'swirl']) {
  const specification = `mms-specs/${name}.toml`;
  assert.equal(module.open(`${name}.toml`, readFileSync(specification, 'utf8')).error, undefined);
  const own = module.ask({ ask: 'run', cells: [8, 16, 32] });
  assert.equal(own.error, undefined);
  // Ends with status 1 where an order is missed, which is no matter here.
  try { execFileSync(mms, ['converge', specification, '--cells', '8,16,32', '--json', out], { stdio: 'ignore' }); } catch { /* judged below */ }
  const expected = JSON.parse(readFileSync(out));
  for (const field of ['u', 'v', 'F', 'P']) for (const norm of ['linf', 'l2', 'l1']) {
    const pairs = own.rows.map((row, n) => [row.errors[field][norm], expected.rows[n].errors[field][norm]]);
    for (const [found, value] of pairs) assert.equal(found, value, `${name}, ${field}, ${norm}`);
    // A logarithm is one of the system's functions.
    assert.ok(close(own.orders[field][norm].fit, expected.orders[field][norm].fit), `${name}: the order of ${field} in ${norm}`);
  }
  assert.equal(module.ask({ ask: 'check' }).passed, true, name);
  console.log(`${name}: errors as mms converge has them, to the bit, and orders`);
}
rmSync(folder, { recursive: true });
