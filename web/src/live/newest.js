/** Work on one input at a time, always the newest; older ones are dropped. */

export class Newest {
  #waiting = null;
  #busy = false;

  /** @param {(item: object) => Promise<void>} work @param {(item: object) => void} drop what is never worked on */
  constructor(work, drop) {
    Object.assign(this, { work, drop });
  }

  offer(item) {
    if (this.#waiting) this.drop(this.#waiting);
    this.#waiting = item;
    if (!this.#busy) this.#run();
  }

  async #run() {
    this.#busy = true;
    while (this.#waiting) {
      const item = this.#waiting;
      this.#waiting = null;
      await this.work(item);
      await messagesHeard();
    }
    this.#busy = false;
  }
}

/** Let the thread receive its messages; a timer would take milliseconds. */
function messagesHeard() {
  return new Promise((resolve) => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = () => {
      port1.close();
      resolve();
    };
    port2.postMessage(null);
  });
}
