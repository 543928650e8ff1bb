// The state of the page in the fragment of its address: what a link holds.

const LONGEST = 4 << 20;

async function through(bytes, stream) {
  const reader = new Blob([bytes]).stream().pipeThrough(stream).getReader();
  const parts = [];
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    length += value.length;
    if (length > LONGEST) {
      await reader.cancel();
      throw new Error(`the specification in the link is longer than ${LONGEST} bytes`);
    }
    parts.push(value);
  }
  return new Uint8Array(await new Blob(parts).arrayBuffer());
}

async function packed(text) {
  const bytes = await through(new TextEncoder().encode(text), new CompressionStream('deflate-raw'));
  let letters = '';
  for (const byte of bytes) letters += String.fromCharCode(byte);
  return btoa(letters).replaceAll('+', '-').replaceAll('/', '_').replace(/=+$/, '');
}

async function unpacked(word) {
  const letters = atob(word.replaceAll('-', '+').replaceAll('_', '/'));
  const bytes = Uint8Array.from(letters, (letter) => letter.charCodeAt(0));
  return new TextDecoder().decode(await through(bytes, new DecompressionStream('deflate-raw')));
}

/** The fragment for a state: a solution of the library by its name, any other specification as a whole. */
export async function fragment({ solution, text, set, tab }) {
  const words = new URLSearchParams();
  if (solution) words.set('solution', solution);
  else words.set('spec', await packed(text));
  const values = Object.entries(set).map(([name, value]) => `${name}:${value}`).join(',');
  if (values) words.set('set', values);
  words.set('tab', tab);
  return `#${words}`;
}

/** The state of a fragment; what it does not say is missing. */
export async function state(hash) {
  const words = new URLSearchParams(hash.replace(/^#/, ''));
  const found = { set: {} };
  if (words.has('spec')) found.text = await unpacked(words.get('spec'));
  if (words.has('solution')) found.solution = words.get('solution');
  if (words.has('tab')) found.tab = words.get('tab');
  for (const pair of (words.get('set') ?? '').split(',').filter(Boolean)) {
    const [name, value] = pair.split(':');
    if (Number.isFinite(Number(value))) found.set[name] = Number(value);
  }
  return found;
}
