// Mutated specifications thrown at the page's module: node tests/page/fuzz.mjs MODULE SECONDS [SEED]
//
// Every question has to end without a trap, within the time that the page waits, and no text of a specification may become an element of the
// page. What fails is printed with its seed and number, and ends the search with status 1.
import { readFileSync, readdirSync } from 'node:fs';
import path from 'node:path';
import { Module } from './module.mjs';

const [file, seconds, seed = '1'] = process.argv.slice(2);
const module = new Module(file);

/** As long as the page waits for an answer to an edit, in milliseconds of this process. */
const LONGEST = 2000;
/** The module is started anew after so many specifications, as a page is that has been opened again. */
const BETWEEN_STARTS = 2000;

const FOLDERS = ['mms-specs', 'mms-specs/incompressible', 'mms-specs/revolution', 'mms-specs/with-memory', 'tests/data/specs',
  ...['across', 'attack', 'attack/open', 'conditions', 'digits', 'histories', 'materials', 'motions', 'revolution', 'told'].map((own) => `tests/data/specs/${own}`),
  'crates/spec/tests/data/ok', 'crates/spec/tests/data/err'];
const texts = FOLDERS.flatMap((own) => readdirSync(own).filter((name) => name.endsWith('.toml')).map((name) => readFileSync(path.join(own, name), 'utf8')));
const lines = texts.flatMap((text) => text.split('\n')).filter((line) => line.trim());
const words = [...new Set(texts.flatMap((text) => text.match(/[A-Za-z_][\w-]*|[0-9.e+-]+/g) ?? []))];
const ELEMENT = '<img src=x onerror=alert(1)>';
const bits = ['(', ')', '^', '/0', '**', '\u0000', '\u202e', '1e400', 'sqrt(', "'", '"', '[[', '\n', '\ud83d\ude00', '-', '9'.repeat(50), '^0.5', '^(1/3)', '1e-300',
  '0*', 'NaN', 'inf', 'X', 't', 'Pi', 'sin(', 'exp(exp(', 'log(', 'erf(', 'tan(X)', ELEMENT, '</math><script>', '&lt;', "'''", '\\', '#', '=', ',', ']', '}'];

let state = Number(seed) >>> 0;
function random(below) {
  state = (state + 0x6d2b79f5) >>> 0;
  let mixed = Math.imul(state ^ (state >>> 15), state | 1);
  mixed ^= mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61);
  return Math.floor((((mixed ^ (mixed >>> 14)) >>> 0) / 2 ** 32) * below);
}
const one = (list) => list[random(list.length)];

/** Each takes a text and gives another. */
const mutations = [
  (text) => { const at = random(text.length); return text.slice(0, at) + one(bits) + text.slice(at + random(12)); },
  (text) => { const own = text.split('\n'); own.splice(random(own.length), random(3), one(lines)); return own.join('\n'); },
  (text) => { const own = text.split('\n'); [own[0], own[random(own.length)]] = [one(own), one(own)]; return own.join('\n'); },
  (text) => text.replaceAll(one(words), one(words)),
  (text) => { const found = [...text.matchAll(/[A-Za-z_]\w*|[0-9.]+/g)]; if (!found.length) return text; const { index, 0: word } = one(found); return text.slice(0, index) + one(words) + text.slice(index + word.length); },
  (text) => { const found = [...text.matchAll(/'([^'\n]+)'/g)]; if (!found.length) return text; const { index, 1: own } = one(found); const nested = one(['sin', 'sqrt', 'exp', '-', '1/', 'cosh']); return `${text.slice(0, index)}'${`${nested}(`.repeat(random(40))}${own}${')'.repeat(random(40))}'${text.slice(index + own.length + 2)}`; },
  (text) => text.replace(/title = '[^']*'/, `title = '${ELEMENT}'`),
];

/** The elements that the page makes of a formula, as page/web/dom.js has them. */
const ELEMENTS = new Set(['mrow', 'mi', 'mn', 'mo', 'mfrac', 'msup', 'msub', 'msqrt', 'mroot', 'mspace']);
const isTree = (value) => typeof value === 'string' || (Array.isArray(value) && ELEMENTS.has(value[0]) && value.slice(1).every(isTree));

function questions(about) {
  const asked = ['u', 'F', 'P', 'b', one(['v', 'a', 'H', 'J', 'nonsense'])].map((field) => ({ ask: 'formulas', field }));
  const dimension = about.coordinates === 'axisymmetric' ? 2 : about.dimension;
  const points = [...Array(4)].map(() => [...Array(dimension + 1)].map(() => one([0, 1, -1, 0.3, 1e-300, 1e300, 0.5])));
  return [...asked, { ask: 'fields', points }, { ask: 'source', host: one(about.hosts).name }];
}

const counts = { thrown: 0, opened: 0, asked: 0 };
let slowest = 0;
const began = Date.now();
while (Date.now() - began < 1000 * Number(seconds)) {
  if (counts.thrown % BETWEEN_STARTS === 0) module.start();
  let text = one(texts);
  for (let left = 1 + random(4); left > 0; left -= 1) text = one(mutations)(text);
  counts.thrown += 1;
  const ask = (question) => {
    const before = process.cpuUsage();
    let answer;
    try { answer = module.ask(question); } catch (error) {
      console.error(`${text}\n-- number ${counts.thrown} of seed ${seed}: ${JSON.stringify(question).slice(0, 200)}: ${error}`);
      process.exit(1);
    }
    const { user, system } = process.cpuUsage(before);
    const took = (user + system) / 1000;
    slowest = Math.max(slowest, took);
    if (took > LONGEST) {
      console.error(`${text}\n-- number ${counts.thrown} of seed ${seed}: ${JSON.stringify({ ...question, text: undefined })} took ${took.toFixed(0)} ms`);
      process.exitCode = 1;
    }
    counts.asked += 1;
    return answer;
  };
  const about = ask({ ask: 'open', file: 'a.toml', text, set: {} });
  if (about.error) continue;
  counts.opened += 1;
  // Histories have a run of their own on the page, which can be cancelled.
  const hasHistory = /flow|branches|internal|maxwell/.test(text);
  for (const question of questions(about).filter(({ ask: what }) => what === 'formulas' || !hasHistory)) {
    const answer = ask(question);
    if (question.ask === 'formulas' && !answer.error && !answer.fields.every(isTree)) {
      console.error(`${text}\n-- number ${counts.thrown} of seed ${seed}: a text becomes an element: ${JSON.stringify(answer).slice(0, 400)}`);
      process.exit(1);
    }
  }
}
console.log(`fuzz: ${counts.thrown} specifications of seed ${seed}, ${counts.opened} opened, ${counts.asked} questions, no trap; the longest answer took ${(slowest / 1000).toFixed(2)} s`);
