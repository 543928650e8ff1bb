// The page's module in node, asked as the page asks it.
import { readFileSync } from 'node:fs';

export class Module {
  constructor(file) {
    this.module = new WebAssembly.Module(readFileSync(file));
    this.start();
  }

  start() {
    this.exported = new WebAssembly.Instance(this.module, {}).exports;
  }

  bytes(question) {
    const { room, answer, length, memory } = this.exported;
    const bytes = new TextEncoder().encode(JSON.stringify(question));
    const place = room(bytes.length) >>> 0;
    new Uint8Array(memory.buffer, place, bytes.length).set(bytes);
    const begin = answer() >>> 0;
    return new Uint8Array(memory.buffer, begin, length() >>> 0).slice();
  }

  ask(question) {
    return JSON.parse(new TextDecoder().decode(this.bytes(question)));
  }

  open(file, text, set = {}) {
    return this.ask({ ask: 'open', file, text, set });
  }
}
