// The page in headless Chromium: node tests/page/browser.mjs FOLDER CHROMIUM [PICTURES]
//
// Every solution of the library is opened, edited and shown; nothing is asked of another host; nothing that a specification says
// becomes markup. Needs the package playwright-core beside this file or above it.
import assert from 'node:assert/strict';
import { existsSync, mkdtempSync, readFileSync, rmSync, mkdirSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { createRequire } from 'node:module';
import { serve } from './serve.mjs';

const [folder, chromium, pictures] = process.argv.slice(2);
const { chromium: browsers } = createRequire(path.resolve('target/page-tools/package.json'))('playwright-core');
const { server, address } = await serve(folder);
const profile = mkdtempSync(path.join(tmpdir(), 'mmsmith-page-'));
const context = await browsers.launchPersistentContext(profile, {
  executablePath: chromium,
  headless: true,
  args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'],
  viewport: { width: 1280, height: 900 },
});
const library = JSON.parse(readFileSync(path.join(folder, 'library.json')));
const page = await context.newPage();
const faults = [];
const strangers = [];
page.on('pageerror', (error) => faults.push(`error: ${error.message}`));
page.on('console', (message) => { if (['error', 'warning'].includes(message.type())) faults.push(`${message.type()}: ${message.text()}`); });
page.on('request', (request) => { if (!request.url().startsWith(address) && !/^(data|blob):/.test(request.url())) strangers.push(request.url()); });
const ready = () => page.waitForFunction(() => document.querySelector('#panel').dataset.shown?.startsWith('b ') && document.querySelector('#panel math'));

const figures = {};
let began = performance.now();
await page.goto(address);
await ready();
figures['first formula, s'] = (performance.now() - began) / 1000;

// Each edit.
let slowest = ['', 0];
for (const own of library) {
  const shown = () => page.evaluate(() => document.querySelector('#panel').dataset.shown);
  const earlier = await shown();
  await page.selectOption('#library', own.file);
  // With its formulas, so that they are not taken for those of the edit.
  await page.waitForFunction(([name, was]) => {
    const panel = document.querySelector('#panel').dataset.shown;
    return document.title.startsWith(name) && panel !== was && panel.startsWith('b ');
  }, [own.name, earlier]);
  const before = await shown();
  // From a key to the formulas, the pause of the typist included.
  const took = await page.evaluate(async (was) => {
    const text = document.querySelector('#text');
    const panel = document.querySelector('#panel');
    const start = performance.now();
    text.value += '# edited\n';
    text.dispatchEvent(new Event('input', { bubbles: true }));
    while (panel.dataset.shown === was) await new Promise((done) => setTimeout(done, 4));
    return performance.now() - start;
  }, before);
  if (took > slowest[1]) slowest = [own.name, took];
  const message = await page.textContent('#message');
  assert.equal(message, '', `${own.name}: ${message}`);
}
figures[`slowest edit (${slowest[0]}), s`] = slowest[1] / 1000;

// A mistake is told at its place, and marked.
await page.selectOption('#library', 'swirl.toml');
await page.waitForFunction(() => document.title.startsWith('swirl'));
await page.fill('#text', (await page.inputValue('#text')).replace("density = 'rho0'", "density = 'rho'"));
await page.waitForSelector('#message .fault pre');
const rendered = await page.textContent('#message .fault pre');
assert.match(rendered, /swirl\.toml:\d+:\d+/);
assert.match(await page.textContent('#mirror mark'), /rho/);
if (pictures) { mkdirSync(pictures, { recursive: true }); await page.screenshot({ path: `${pictures}/mistake.png` }); }

// No text becomes markup.
const hostile = '<img src=x onerror=alert(1)><script>alert(2)</script>';
await page.fill('#text', readFileSync('mms-specs/swirl.toml', 'utf8').replace("title = 'Swirl in a square with walls'", `title = '${hostile}'`)
  .replace("description = 'largest angle, in radians'", `description = '${hostile}'`));
await page.waitForFunction(() => document.querySelector('#values').textContent.includes('onerror'));
assert.equal(await page.locator('main img, main script').count(), 0);
await page.fill('#text', `${hostile}\n`);
await page.waitForFunction(() => document.querySelector('#message').textContent.includes('onerror'));
assert.equal(await page.locator('main img, main script').count(), 0);

// A link holds a specification of one's own, with parameters and tab.
await page.fill('#text', readFileSync('mms-specs/ring.toml', 'utf8').replace("name = 'ring'", "name = 'my-ring'"));
await page.waitForFunction(() => document.title.startsWith('my-ring'));
await page.click('#tab-P');
await page.waitForFunction(() => location.hash.includes('tab=P') && location.hash.includes('spec='));
const link = page.url();
const other = await context.newPage();
await other.goto(link);
await other.waitForFunction(() => document.title.startsWith('my-ring') && document.querySelector('#panel').dataset.shown?.startsWith('P '));
assert.match(await other.inputValue('#text'), /name = 'my-ring'/);
await other.close();

// The file of each host, and keys.
await page.selectOption('#library', 'ring.toml');
await page.waitForFunction(() => document.title.startsWith('ring'));
await page.focus('#tab-b');
await page.keyboard.press('ArrowRight');
await page.waitForSelector('#panel .file pre');
for (const host of await page.locator('#host option').evaluateAll((all) => all.map((own) => own.value))) {
  await page.selectOption('#host', host);
  await page.waitForFunction(() => document.querySelector('#panel .file pre, #panel .fault') && !document.querySelector('#panel .wait'));
  assert.equal(await page.locator('#panel .fault').count(), 0, host);
}

// A worker that takes too long is let go, and the next question is answered.
const limited = await page.evaluate(async () => {
  const { Desk } = await import('./desk.js');
  const desk = new Desk('mmsmith.wasm');
  const text = document.querySelector('#text').value;
  const open = { ask: 'open', file: 'a.toml', text, set: {} };
  let why = '';
  try { await desk.ask([open, { ask: 'motion', particles: 4000, frames: 400 }, { ask: 'motion', particles: 4000, frames: 400 }], 0.05); } catch (error) { why = error.message; }
  const after = await desk.asked([open], 20);
  return [why, after.name];
});
assert.deepEqual(limited, ['stopped after 0.05 seconds without an answer', 'ring']);

// Checks, and orders with a plot; a run is cancelled.
const hasSolver = existsSync(path.join(folder, 'mmsmith-solver.wasm'));
if (hasSolver) {
  await page.selectOption('#library', 'axis-aligned.toml');
  await page.waitForFunction(() => document.title.startsWith('axis-aligned '));
  await page.click('#tab-checks');
  await page.waitForSelector('#panel p.good', { timeout: 120000 });
  await page.click('#tab-orders');
  began = performance.now();
  await page.click('#run');
  await page.waitForFunction(() => document.querySelector('#panel [data-done="3"] svg'), null, { timeout: 300000 });
  figures['orders of axis-aligned on 8, 16, 32 cells, s'] = (performance.now() - began) / 1000;
  assert.match(await page.textContent('#panel svg'), /u: order \d/);
  if (pictures) await page.screenshot({ path: `${pictures}/orders.png` });
  await page.click('#run');
  await page.click('#panel .wait button');
  await page.waitForFunction(() => document.querySelector('#panel').textContent.includes('Cancelled.'));
}

// Offline, what was loaded is enough.
await context.setOffline(true);
await page.selectOption('#library', 'vortex.toml');
await page.waitForFunction(() => document.title.startsWith('vortex'));
await context.setOffline(false);

// Nothing is wider than a small screen.
for (const width of [1280, 900, 400]) {
  await page.setViewportSize({ width, height: 900 });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
  assert.ok(wide <= 0, `at ${width} pixels the page is ${wide} wider`);
}

if (pictures) {
  for (const [name, tab] of [['swirl', 'b'], ['ring', 'files'], ['torsion', 'P'], ['block-j2', 'u'], ['twisting-cylinder', 'F'], ['skew-3d', 'b'], ...(hasSolver ? [['bar', 'checks']] : [])]) {
    for (const [width, scheme] of [[1280, 'light'], [1280, 'dark'], [400, 'light'], [400, 'dark']]) {
      if (width === 400 && !['swirl', 'ring'].includes(name)) continue;
      if (scheme === 'dark' && !['swirl', 'ring', 'torsion'].includes(name)) continue;
      await page.setViewportSize({ width, height: 900 });
      await page.emulateMedia({ colorScheme: scheme });
      await page.goto(`${address}#solution=${name}&tab=${tab}`);
      await page.reload();
      await page.waitForFunction(() => document.querySelector('#canvas').dataset.shown && document.querySelector('#panel').dataset.shown, null, { timeout: 60000 });
      await page.evaluate(() => { const time = document.querySelector('#time'); time.value = '0.24'; time.dispatchEvent(new Event('input')); });
      await page.waitForTimeout(200);
      await page.screenshot({ path: `${pictures}/${name}-${width}-${scheme}.png`, fullPage: true });
    }
  }
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.goto(`${address}#solution=swirl&tab=b`);
  await page.reload();
  await ready();
  await page.emulateMedia({ media: 'print', colorScheme: 'light' });
  await page.waitForTimeout(1500);
  await page.screenshot({ path: `${pictures}/print.png`, fullPage: true });
}

await context.close();
server.close();
rmSync(profile, { recursive: true, force: true });
assert.deepEqual(faults.filter((fault) => !fault.includes('net::ERR_INTERNET_DISCONNECTED')), []);
assert.deepEqual(strangers, []);
for (const [name, value] of Object.entries(figures)) console.log(`${name}: ${value.toFixed(2)}`);
