import { Desk, GivenUp, read } from './desk.js';
import { formula, make } from './dom.js';
import { fragment, state } from './link.js';
import { Motion, quantities, unpack } from './motion.js';
import { checks } from './checks.js';
import { plot, table } from './orders.js';

const SYMBOLIC = 'mmsmith.wasm';
const SOLVER = 'mmsmith-solver.wasm';
const FIRST = 'swirl';
/** A pause of the typist. */
const PAUSE_MS = 120;
/** Seconds after which a worker is let go. */
const LIMIT = { open: 10, formulas: 10, files: 120, motion: 120, checks: 120, orders: 300 };
/** Grids of the solver. */
const GRIDS = [8, 16, 32];
const PARTICLES = [60, 900, 900];
const FRAMES = 60;

const by = (id) => document.getElementById(id);
const desks = {
  open: new Desk(SYMBOLIC),
  files: new Desk(SYMBOLIC),
  motion: new Desk(SYMBOLIC),
  checks: new Desk(SOLVER),
  orders: new Desk(SOLVER),
};

const now = { text: '', file: '', set: {}, tab: 'b', host: 'c', about: null, edition: 0 };
let library = [];

const opening = () => ({ ask: 'open', file: now.file, text: now.text, set: now.set });
const stated = () => library.find((own) => own.text === now.text);

// What is wrong, in words and at its place.

function fault(message) {
  return make('div', { class: 'fault' }, make('p', {}, message));
}

function tell(error) {
  const box = by('message');
  box.replaceChildren();
  mark(null);
  if (!error) return;
  if (!error.rendered) { box.append(fault(error.message)); return; }
  mark(error);
  const go = make('button', { type: 'button' }, `Go to line ${error.line}`);
  go.addEventListener('click', () => {
    const text = by('text');
    text.focus();
    text.setSelectionRange(error.start, Math.max(error.end, error.start + 1));
    const line = text.scrollHeight / (text.value.split('\n').length || 1);
    text.scrollTop = Math.max(0, (error.line - 4) * line);
  });
  box.append(make('div', { class: 'fault' }, make('pre', {}, error.rendered), go));
}

/** Marks the place of a mistake behind the text. */
function mark(error) {
  const mirror = by('mirror');
  const { value } = by('text');
  if (!error) mirror.replaceChildren(value + '\n');
  else {
    const end = Math.max(error.end, error.start + 1);
    mirror.replaceChildren(value.slice(0, error.start), make('mark', {}, value.slice(error.start, end) || ' '), `${value.slice(end)}\n`);
  }
  follow();
}

function follow() {
  const [mirror, text] = [by('mirror'), by('text')];
  mirror.scrollTop = text.scrollTop;
  mirror.scrollLeft = text.scrollLeft;
}

// Opening.

async function open() {
  const edition = ++now.edition;
  remember();
  let about;
  const field = ['u', 'F', 'P', 'b'].includes(now.tab) ? now.tab : null;
  try {
    about = await desks.open.asked([opening()], LIMIT.open);
  } catch (error) {
    if (!(error instanceof GivenUp)) refuse({ message: `the derivation was ${error.message}` });
    return;
  }
  if (edition !== now.edition) return;
  if (about.error) { refuse(about.error); return; }
  now.about = about;
  tell(null);
  document.title = `${about.name} \u2013 mmsmith`;
  by('version').textContent = `mmsmith ${about.version}`;
  values();
  if (field) await formulas(edition);
  else show();
  move();
}

function refuse(error) {
  now.about = null;
  tell(error);
  for (const desk of [desks.files, desks.motion, desks.checks, desks.orders]) desk.cancel();
  by('panel').replaceChildren(make('p', { class: 'soft' }, 'The specification has a mistake, which is told beside it.'));
}

let typing = 0;
function edited() {
  now.text = by('text').value;
  mark(null);
  clearTimeout(typing);
  // A motion that is still computed is not of this text, and holds a core.
  desks.motion.cancel();
  typing = setTimeout(open, PAUSE_MS);
}

/** A solution of the library, as it is. */
function take(own) {
  now.text = own.text;
  now.file = own.file;
  by('text').value = own.text;
  by('text').scrollTop = 0;
  mark(null);
}

async function remember() {
  const own = stated();
  by('library').value = own ? own.file : '';
  const hash = await fragment({ solution: own?.name, text: now.text, set: now.set, tab: now.tab });
  history.replaceState(null, '', hash);
}

// Parameters.

function values() {
  const { parameters } = now.about;
  const told = ({ description, unit, range }) => [description, unit && `[${unit}]`, range].filter(Boolean).join(' ');
  const names = JSON.stringify(parameters.map((own) => [own.name, told(own)]));
  const box = by('values');
  if (box.dataset.names === names) {
    for (const own of parameters) {
      const field = by(`value-${own.name}`);
      if (document.activeElement !== field) field.value = own.value;
      field.setAttribute('aria-invalid', 'false');
    }
    return;
  }
  box.dataset.names = names;
  box.replaceChildren(...parameters.flatMap((own) => {
    const field = make('input', { type: 'text', inputmode: 'decimal', id: `value-${own.name}`, autocomplete: 'off' });
    field.value = own.value;
    field.addEventListener('input', () => {
      const value = Number(field.value);
      const isNumber = field.value.trim() !== '' && Number.isFinite(value);
      field.setAttribute('aria-invalid', String(!isNumber));
      if (!isNumber) return;
      now.set = { ...now.set, [own.name]: value };
      clearTimeout(typing);
      typing = setTimeout(open, PAUSE_MS);
    });
    return [make('label', { for: field.id }, own.name), field, make('span', { class: 'small' }, told(own))];
  }));
}

// The middle.

const panel = () => by('panel');

function wait(desk, what) {
  const cancel = make('button', { type: 'button' }, 'Cancel');
  cancel.addEventListener('click', () => desk.cancel());
  return make('p', { class: 'wait' }, `${what} \u2026`, cancel);
}

function show() {
  for (const tab of document.querySelectorAll('[role="tab"]')) {
    const isOwn = tab.dataset.tab === now.tab;
    tab.setAttribute('aria-selected', String(isOwn));
    tab.tabIndex = isOwn ? 0 : -1;
    tab.setAttribute('aria-controls', 'panel');
    if (isOwn) panel().setAttribute('aria-labelledby', tab.id);
  }
  if (!now.about) return;
  if (now.tab === 'files') files();
  else if (now.tab === 'checks') checksShown();
  else if (now.tab === 'orders') orders();
  else formulas(now.edition);
}

async function formulas(edition) {
  let found;
  try {
    found = await desks.open.asked([opening(), { ask: 'formulas', field: now.tab }], LIMIT.formulas);
  } catch (error) {
    if (!(error instanceof GivenUp)) panel().replaceChildren(fault(`the formulas were ${error.message}`));
    return;
  }
  if (edition !== now.edition) return;
  if (found.error || found.long) {
    panel().replaceChildren(make('p', { class: 'soft' }, found.error?.message ?? found.long));
  } else {
    const parts = found.fields.map(formula);
    if (found.where.length) parts.push(make('h3', {}, 'where'), ...found.where.map(formula));
    if (found.law) {
      parts.push(make('h3', {}, 'Material'), ...found.law.map((line) => make('p', { class: 'law' }, line)));
      if (found.rotation) parts.push(make('p', { class: 'law' }, found.rotation));
    }
    panel().replaceChildren(...parts);
  }
  panel().dataset.shown = `${now.tab} ${edition}`;
}

async function files() {
  const { hosts } = now.about;
  const edition = now.edition;
  const choice = make('select', { id: 'host' }, hosts.map((host) => make('option', { value: host.name }, `${host.name}: ${host.about}`)));
  choice.value = now.host;
  const shown = make('div', {});
  panel().replaceChildren(make('div', { class: 'row' }, make('label', { for: 'host' }, 'Host'), choice), shown);
  const write = async () => {
    now.host = choice.value;
    shown.replaceChildren(wait(desks.files, 'writing'));
    try {
      const found = await desks.files.asked([opening(), { ask: 'source', host: now.host }], LIMIT.files);
      if (edition !== now.edition) return;
      shown.replaceChildren(...(found.error ? [fault(found.error.message)] : found.files.map(file)));
    } catch (error) {
      if (!(error instanceof GivenUp)) shown.replaceChildren(fault(`writing was ${error.message}`));
      else if (error.message === 'cancelled') shown.replaceChildren(make('p', { class: 'soft' }, 'Cancelled.'));
    }
    panel().dataset.shown = `files ${edition}`;
  };
  choice.addEventListener('change', write);
  await write();
}

const LONGEST_SHOWN = 200_000;

function file({ name, text }) {
  const copy = make('button', { type: 'button' }, 'Copy');
  copy.addEventListener('click', () => copied(copy, text));
  const save = make('button', { type: 'button' }, 'Save');
  save.addEventListener('click', () => {
    const address = URL.createObjectURL(new Blob([text], { type: 'text/plain' }));
    make('a', { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  });
  const part = text.length > LONGEST_SHOWN ? `${text.slice(0, LONGEST_SHOWN)}\n\u2026 of ${text.length} characters; Copy and Save take all.` : text;
  return make('div', { class: 'file' }, make('div', {}, make('strong', {}, name), copy, save), make('pre', { tabindex: '0' }, part));
}

async function copied(button, text) {
  const before = button.textContent;
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = 'Copied';
  } catch {
    button.textContent = 'Not allowed';
  }
  setTimeout(() => { button.textContent = before; }, 1500);
}

async function checksShown() {
  const edition = now.edition;
  panel().replaceChildren(wait(desks.checks, 'comparing each field with the one that it follows from'));
  try {
    const found = await desks.checks.asked([opening(), { ask: 'check' }], LIMIT.checks);
    if (edition !== now.edition || now.tab !== 'checks') return;
    panel().replaceChildren(...(found.error ? [fault(found.error.message)] : checks(found)));
  } catch (error) {
    if (!(error instanceof GivenUp)) panel().replaceChildren(fault(`the checks were ${error.message}`));
    else if (error.message === 'cancelled') panel().replaceChildren(make('p', { class: 'soft' }, 'Cancelled.'));
  }
  panel().dataset.shown = `checks ${edition}`;
}

/** Runs begin when someone asks for them: they take seconds. */
function orders() {
  const { edition } = now;
  const run = make('button', { type: 'button', class: 'strong', id: 'run' }, `Run on ${GRIDS.join(', ')} cells`);
  const shown = make('div', {});
  panel().replaceChildren(
    make('p', {}, 'The material point solver runs a period with this body force, on one thread, and its errors show the order of accuracy.'),
    make('div', { class: 'row' }, run), shown,
  );
  panel().dataset.shown = `orders ${edition}`;
  run.addEventListener('click', async () => {
    run.disabled = true;
    let found = null;
    const tell = (...more) => shown.replaceChildren(...(found ? [plot(found), table(found), make('p', { class: 'small' }, `${found.scheme}.`)] : []), ...more);
    try {
      for (let count = 1; count <= GRIDS.length; count += 1) {
        tell(wait(desks.orders, `running on ${GRIDS[count - 1]} cells`));
        const next = await desks.orders.asked([opening(), { ask: 'run', cells: GRIDS.slice(0, count) }], LIMIT.orders);
        if (edition !== now.edition) return;
        if (next.error) { tell(fault(next.error.message)); break; }
        found = next;
      }
      if (found?.rows.length === GRIDS.length) tell();
    } catch (error) {
      if (!(error instanceof GivenUp)) tell(fault(`the run was ${error.message}`));
      else if (error.message === 'cancelled') tell(make('p', { class: 'soft' }, 'Cancelled.'));
    }
    run.disabled = false;
    shown.dataset.done = String(found?.rows.length ?? 0);
  });
}

// The motion.

const motion = new Motion(by('canvas'), by('scale'));
const play = { on: !matchMedia('(prefers-reduced-motion: reduce)').matches, at: 0, last: null };
/** Seconds that a period takes for the eye. */
const PERIOD_S = 4;

async function move() {
  const { edition } = now;
  by('seen').textContent = '';
  if (!now.about.moves) play.at = 0;
  let body;
  try {
    const particles = PARTICLES[now.about.dimension - 1];
    const frames = now.about.moves ? FRAMES : 1;
    const bytes = await desks.motion.ask([opening(), { ask: 'motion', particles, frames }], LIMIT.motion);
    if (edition !== now.edition) return;
    // An answer in words begins with a brace.
    if (bytes[0] === 123) { still(read(bytes).error.message); return; }
    body = unpack(bytes);
  } catch (error) {
    if (!(error instanceof GivenUp)) still(`the motion was ${error.message}`);
    return;
  }
  const list = quantities(body.D);
  const choice = by('colour');
  const before = choice.value;
  choice.replaceChildren(...list.map(([name]) => make('option', { value: name }, name)));
  if (list.some(([name]) => name === before)) choice.value = before;
  paint(body);
  by('canvas').dataset.shown = String(edition);
}

function still(message) {
  motion.body = null;
  const canvas = by('canvas');
  canvas.getContext('2d').clearRect(0, 0, canvas.width, canvas.height);
  by('seen').textContent = message;
  canvas.dataset.shown = String(now.edition);
}

const rounded = (value) => (Number.isFinite(value) ? Number(value.toPrecision(3)).toString() : 'no number');

function paint(body) {
  const [, value] = quantities(body.D).find(([name]) => name === by('colour').value) ?? quantities(body.D)[0];
  motion.show(body, value);
  by('least').textContent = rounded(motion.least);
  by('most').textContent = rounded(motion.most);
  const words = { 1: 'A bar', 2: 'The body in the plane', 3: 'The body in space; drag to turn it' };
  by('seen').textContent = `${words[body.D]}: ${body.count} pieces, each deformed by its F. Units are those of the specification.`;
  frame();
}

function frame() {
  motion.draw(play.at);
  by('time').value = String(play.at);
  const period = motion.body?.period ?? 0;
  by('clock').textContent = `t = ${rounded(play.at * period)} of ${rounded(period)}`;
}

function tick(moment) {
  if (play.on && motion.body && motion.body.frames > 1 && !document.hidden) {
    if (play.last !== null) play.at = (play.at + (moment - play.last) / 1000 / PERIOD_S) % 1;
    frame();
  }
  play.last = moment;
  requestAnimationFrame(tick);
}

function playing(on) {
  play.on = on;
  by('play').textContent = on ? 'Pause' : 'Play';
}

// Beginnings.

function tabs() {
  const all = [...document.querySelectorAll('[role="tab"]')];
  const choose = (tab) => {
    now.tab = tab.dataset.tab;
    remember();
    show();
  };
  all.forEach((tab, index) => {
    tab.addEventListener('click', () => choose(tab));
    tab.addEventListener('keydown', (event) => {
      const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!way) return;
      const next = all[(index + way + all.length) % all.length];
      next.focus();
      choose(next);
      event.preventDefault();
    });
  });
}

function themes() {
  const button = by('theme');
  const system = matchMedia('(prefers-color-scheme: dark)');
  const isDark = () => (document.documentElement.dataset.theme ?? (system.matches ? 'dark' : 'light')) === 'dark';
  const name = () => {
    button.textContent = isDark() ? 'Light' : 'Dark';
    button.setAttribute('aria-pressed', String(isDark()));
  };
  button.addEventListener('click', () => {
    document.documentElement.dataset.theme = isDark() ? 'light' : 'dark';
    name();
  });
  system.addEventListener('change', name);
  name();
}

async function begin() {
  themes();
  tabs();
  by('text').addEventListener('input', edited);
  by('text').addEventListener('scroll', follow);
  by('share').addEventListener('click', () => copied(by('share'), location.href));
  by('play').addEventListener('click', () => playing(!play.on));
  by('time').addEventListener('input', () => { playing(false); play.at = Math.min(Number(by('time').value), 0.999999); frame(); });
  by('colour').addEventListener('change', () => motion.body && paint(motion.body));
  addEventListener('resize', () => { if (motion.body) { motion.legend(); frame(); } });
  playing(play.on);
  requestAnimationFrame(tick);
  const response = await fetch('library.json');
  library = await response.json();
  const groups = new Map();
  for (const own of library) {
    if (!groups.has(own.group)) groups.set(own.group, make('optgroup', { label: own.group }));
    groups.get(own.group).append(make('option', { value: own.file }, `${own.name}: ${own.title}`));
  }
  by('library').append(make('option', { value: '', hidden: true }, 'your own'), ...groups.values());
  by('library').addEventListener('change', () => {
    const own = library.find((one) => one.file === by('library').value);
    if (!own) return;
    now.set = {};
    take(own);
    open();
  });
  addEventListener('hashchange', arrive);
  await arrive();
}

/** Takes what the address says. */
async function arrive() {
  let found = { set: {} };
  try {
    found = await state(location.hash);
  } catch (error) {
    tell({ message: `the link cannot be read: ${error.message}` });
  }
  now.set = found.set;
  if (document.querySelector(`[role="tab"][data-tab="${CSS.escape(found.tab ?? '')}"]`)) now.tab = found.tab;
  if (found.text !== undefined) {
    now.file = 'specification.toml';
    now.text = found.text;
    by('text').value = found.text;
    mark(null);
  } else {
    take(library.find((own) => own.name === found.solution) ?? library.find((own) => own.name === FIRST));
  }
  show();
  await open();
}

begin().catch((error) => tell({ message: `the page cannot begin: ${error.message}` }));
