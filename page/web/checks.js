import { make } from './dom.js';

const short = (value) => (value === null ? '' : value === 0 ? '0' : Number(value).toExponential(1));
const WORDS = { passed: 'passed', failed: 'FAILED', inconclusive: 'cannot judge' };

function table(head, rows) {
  const cell = (name, own) => make(name, typeof own === 'object' && own.class ? { class: own.class } : {}, own.parts ?? own);
  return make('div', { class: 'wide' }, make('table', {}, make('thead', {}, make('tr', {}, head.map((own) => cell('th', own)))),
    make('tbody', {}, rows.map((row) => make('tr', {}, row.map((own) => cell('td', own)))))));
}

const number = (text) => ({ class: 'number', parts: [text] });

/** The checks of a solution, for people. */
export function checks(found) {
  const verdict = found.passed ? 'All fields agree with the ones that they follow from.' : 'A field differs from the one that it follows from.';
  const findings = table(
    ['field', 'compared with', 'verdict', number('difference'), number('allowed')],
    found.findings.map((own) => {
      const unit = own.scale > 0 ? own.scale : 1;
      return [own.what, own.against, { class: own.verdict === 'failed' ? 'bad' : 'good', parts: [WORDS[own.verdict]] },
        number(short(own.difference / unit)), number(short(own.allowed / unit))];
    }),
  );
  const parts = [
    make('p', { class: found.passed ? 'good' : 'bad' }, `${verdict} ${found.points} points, with these parameters.`),
    findings,
    make('h3', {}, 'Blind spots'),
    found.blind.length ? make('ul', {}, found.blind.map((line) => make('li', {}, line))) : make('p', { class: 'soft' }, 'None was found.'),
  ];
  if (found.shares.length) {
    parts.push(make('h3', {}, 'Terms of the balance that are exercised'), table(['part', 'share'], found.shares.map((own) => {
      const meter = make('span', { class: 'meter' });
      meter.style.width = `${Math.min(own.share, 1) * 8}rem`;
      return [own.part, { class: 'share', parts: [meter, ` ${own.share === 0 ? 'vanishes' : `${(100 * own.share).toFixed(own.share < 0.1 ? 1 : 0)} %`}`] }];
    })));
  }
  return parts;
}
