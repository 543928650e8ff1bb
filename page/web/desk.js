// Questions for the module, each kind at a desk of its own: a worker that is let go where a newer question makes its own one idle, where
// it takes too long, or where someone cancels.

const modules = new Map();

/** The compiled module of a file, fetched once. */
function compiled(file) {
  if (!modules.has(file)) {
    const module = WebAssembly.compileStreaming(fetch(file)).catch(async () => {
      // A server that does not know the type of the file.
      const response = await fetch(file);
      if (!response.ok) throw new Error(`not begun: this page was built without ${file}`);
      return WebAssembly.compile(await response.arrayBuffer());
    });
    module.catch(() => modules.delete(file));
    modules.set(file, module);
  }
  return modules.get(file);
}

/** A question was given up, for a newer one or by the user. */
export class GivenUp extends Error {}

export class Desk {
  constructor(file) {
    this.file = file;
    this.worker = null;
    this.waiting = null;
    this.last = 0;
  }

  /** Lets the worker go; whoever waits for it learns why. */
  stop(reason) {
    this.worker?.terminate();
    this.worker = null;
    const waiting = this.waiting;
    this.waiting = null;
    waiting?.reject(reason);
  }

  cancel() {
    if (this.waiting) this.stop(new GivenUp('cancelled'));
  }

  /** The bytes of the answer to the last of `questions`, or of the refusal of the first that was refused. */
  async ask(questions, seconds) {
    if (this.waiting) this.stop(new GivenUp('a newer question came'));
    const id = ++this.last;
    const module = await compiled(this.file);
    if (id !== this.last) throw new GivenUp('a newer question came');
    return new Promise((resolve, reject) => {
      const isNew = !this.worker;
      this.worker ??= new Worker('worker.js');
      const limit = setTimeout(() => {
        this.stop(new Error(`stopped after ${seconds} seconds without an answer`));
      }, 1000 * seconds);
      const done = (settle) => (value) => {
        clearTimeout(limit);
        this.waiting = null;
        settle(value);
      };
      this.waiting = { reject: done(reject) };
      const worker = this.worker;
      worker.onmessage = ({ data }) => {
        if (worker !== this.worker || data.id !== id || !this.waiting) return;
        if (data.stopped) {
          this.stop(new Error(`the module stopped, which is a mistake of it, not of yours: ${data.stopped}`));
        } else {
          done(resolve)(data.found);
        }
      };
      worker.onerror = () => {
        if (worker === this.worker) this.stop(new Error('the worker could not be started'));
      };
      worker.postMessage({ id, module: isNew ? module : null, questions });
    });
  }

  /** As `ask`, for answers that are JSON. */
  async asked(questions, seconds) {
    return read(await this.ask(questions, seconds));
  }
}

/** An answer that is JSON. */
export function read(bytes) {
  return JSON.parse(new TextDecoder().decode(bytes));
}
