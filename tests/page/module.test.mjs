// The page's module beside the command: node tests/page/module.test.mjs MODULE MMS [--quick]
//
// Fields of all solutions at 1,000 points beside `mms eval`, the file of every host beside `mms gen`, and specifications with mistakes
// beside the messages of the terminal.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { Module } from './module.mjs';

const [file, mms, how] = process.argv.slice(2);
const isQuick = how === '--quick';
const module = new Module(file);
const folder = mkdtempSync(path.join(tmpdir(), 'mmsmith-page-'));
const run = (...words) => execFileSync(mms, words, { stdio: ['ignore', 'ignore', 'ignore'], maxBuffer: 1 << 28 });
const specifications = (...folders) => folders.flatMap((own) => readdirSync(own, { withFileTypes: true })
  .filter((entry) => entry.isFile() && entry.name.endsWith('.toml')).map((entry) => path.join(own, entry.name)));

assert.equal(WebAssembly.Module.imports(module.module).length, 0, 'the module asks nothing of its host');

// Fields, to the bit: no formula calls a function of the system's own.
const POINTS = 1000;
/** At fewer where each takes the history of a particle. */
const POINTS_OF_HISTORIES = 8;
const RATIOS = [0.6180339887498949, 0.7548776662466927, 0.8191725133961645, 0.5698402909980532];
const library = specifications('mms-specs', 'mms-specs/incompressible', 'mms-specs/revolution');
const flat = (value) => [value].flat(9);
const withMemory = specifications('mms-specs/with-memory');
let values = 0;
for (const specification of [...library, ...(isQuick ? [] : withMemory)]) {
  const name = path.basename(specification, '.toml');
  const about = module.open(`${name}.toml`, readFileSync(specification, 'utf8'));
  assert.equal(about.error, undefined, name);
  const isOfRevolution = about.coordinates === 'axisymmetric';
  const dimension = isOfRevolution ? 2 : about.dimension;
  const points = Array.from({ length: withMemory.includes(specification) ? POINTS_OF_HISTORIES : POINTS }, (_, n) => Array.from({ length: dimension + 1 }, (_, i) => (i < dimension ? 0.05 + 0.9 * (((n + 1) * RATIOS[i]) % 1) : 0.04 * (((n + 1) * RATIOS[3]) % 1))));
  writeFileSync(path.join(folder, 'points.json'), JSON.stringify(points.map((point) => ({ X: point.slice(0, -1), t: point.at(-1) }))));
  const out = path.join(folder, 'fields.json');
  // Fails where a place of these lies outside of the motion; fields are written all the same.
  try { run('eval', specification, '--points', path.join(folder, 'points.json'), '--json', out); } catch { /* null stands for what is no number */ }
  const { rows } = JSON.parse(readFileSync(out));
  const own = module.ask({ ask: 'fields', points }).rows;
  for (const field of ['u', 'v', 'a', 'H', 'F', 'J', 'P', 'b']) {
    rows.forEach((row, n) => {
      const found = flat(own[n][field]);
      flat(row[field]).forEach((value, entry) => {
        values += 1;
        assert.ok(Object.is(value, found[entry]), `${name}, ${field}, point ${n}: ${found[entry]} for ${value}`);
      });
    });
  }
}
console.log(`fields: ${values} values equal to the bit`);

// Files of hosts.
let files = 0;
const hosts = module.open('swirl.toml', readFileSync('mms-specs/swirl.toml', 'utf8')).hosts.map((host) => host.name);
const withTables = ['mms-specs/with-memory/bar-j2.toml', 'mms-specs/with-memory/ring-simo.toml'];
// Each file takes a process: quickly, those of all hosts for some solutions, and of one host for all.
const ofAllHosts = ['swirl', 'torsion', 'thick-cylinder', 'bar-j2'];
for (const specification of [...library, ...withTables]) {
  const name = path.basename(specification);
  const isWhole = !isQuick || ofAllHosts.includes(name.replace('.toml', ''));
  module.open(name, readFileSync(specification, 'utf8'));
  for (const host of isWhole ? hosts : ['cpp']) {
    const written = module.ask({ ask: 'source', host });
    const out = path.join(folder, host);
    rmSync(out, { recursive: true, force: true });
    let refused = false;
    try { run('gen', specification, '--target', host, '--out', out); } catch { refused = true; }
    assert.equal(Boolean(written.error), refused, `${name}, ${host}: ${written.error?.message}`);
    if (refused) continue;
    assert.deepEqual(written.files.map((own) => own.name).sort(), readdirSync(out).sort(), `${name}, ${host}`);
    for (const own of written.files) {
      // A table has numbers of the system's own functions.
      if (own.name.endsWith('.table') || written.files.length > 1) continue;
      assert.ok(own.text === readFileSync(path.join(out, own.name), 'utf8'), `${name}: ${own.name} differs`);
      files += 1;
    }
  }
}
console.log(`files of hosts: ${files} equal, byte for byte`);

// Parameters.
module.open('swirl.toml', readFileSync('mms-specs/swirl.toml', 'utf8'), { A: 0.25 });
run('gen', 'mms-specs/swirl.toml', '--target', 'c', '--out', path.join(folder, 'set'), '--set', 'A=0.25');
assert.equal(module.ask({ ask: 'source', host: 'c' }).files[0].text, readFileSync(path.join(folder, 'set', 'swirl.h'), 'utf8'));
assert.match(module.open('swirl.toml', readFileSync('mms-specs/swirl.toml', 'utf8'), { nu: 0.6 }).error.message, /nu = 0.6 is out of range/);
assert.match(module.open('swirl.toml', readFileSync('mms-specs/swirl.toml', 'utf8'), { nil: 1 }).error.message, /no parameter 'nil'/);

// Mistakes, as the terminal tells them.
let mistakes = 0;
for (const specification of specifications('crates/spec/tests/data/err')) {
  const text = readFileSync(specification, 'utf8');
  const { error } = module.open(path.basename(specification), text);
  assert.ok(error, specification);
  const expected = readFileSync(specification.replace(/toml$/, 'txt'), 'utf8');
  const isComplete = !expected.includes('{functions}') && !expected.includes('{laws}');
  if (isComplete) assert.equal(`${error.rendered}\n`, expected, specification);
  assert.ok(error.start <= error.end && error.end <= text.length, `${specification}: a place outside of the text`);
  mistakes += 1;
}
console.log(`mistakes: ${mistakes} told as the terminal tells them`);

// Whatever is thrown at it, an answer comes.
const texts = [...library, ...specifications('tests/data/specs', 'tests/data/specs/attack', 'tests/data/specs/attack/open', 'tests/data/specs/across',
  'tests/data/specs/conditions', 'tests/data/specs/digits', 'tests/data/specs/materials', 'tests/data/specs/motions', 'tests/data/specs/revolution',
  'crates/spec/tests/data/ok', 'crates/spec/tests/data/err')].map((own) => readFileSync(own, 'utf8'));
let thrown = 0;
const longest = ['', 0];
function hurl(text, alsoFields) {
  const began = performance.now();
  const about = module.open('a.toml', text);
  if (!about.error && alsoFields) {
    for (const field of ['u', 'F', 'P', 'b', 'nonsense']) module.ask({ ask: 'formulas', field });
    module.bytes({ ask: 'motion', particles: 20, frames: 2 });
  }
  const took = performance.now() - began;
  if (took > longest[1]) [longest[0], longest[1]] = [text.slice(0, 80), took];
  thrown += 1;
}
for (const text of texts) hurl(text, !/flow|branches|internal/.test(text));
let seed = 1;
const random = (below) => { seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0; return Math.floor((seed / 2 ** 32) * below); };
const bits = ['(', ')', '^', '/0', '**', '\u0000', '\u202e', '1e400', 'sqrt(', "'", '"', '[[', '\n', '\ud83d\ude00', '-', '9'.repeat(50)];
for (let n = 0; n < 400; n += 1) {
  const text = texts[random(texts.length)];
  const at = random(text.length);
  hurl(text.slice(0, at) + bits[random(bits.length)] + text.slice(at + random(12)), false);
}
hurl(`x = '${'('.repeat(300_000)}'`, false);
hurl('a'.repeat((4 << 20) + 1), false);
for (const question of [null, 1, 'text', {}, { ask: 'open' }, { ask: 'none' }, { ask: 'motion', particles: -1, frames: 1 }, { ask: 'fields', points: [[]] },
  { ask: 'fields', points: [[1]] }, { ask: 'motion', particles: 1e9, frames: 1e9 }, { ask: 'source', host: '<b>' }]) {
  module.bytes(question);
}
console.log(`hurled: ${thrown} specifications, no trap; the longest took ${(longest[1] / 1000).toFixed(2)} s`);
rmSync(folder, { recursive: true });
