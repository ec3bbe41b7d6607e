/** States, and the events that lead from one to another. */

export class Machine {
  #leaving = new AbortController();

  /**
   * @param {string} first state
   * @param {Record<string, Record<string, string | (() => string | null)>>} table by state and event the state to enter, or what
   *   says it; an event that a state has no entry for is dropped
   * @param {Record<string, (data: any, event: string, left: AbortSignal) => unknown>} enter what each state does once it is
   *   entered; what it throws becomes the event "failed". left: the state has been left, or entered anew
   */
  constructor(first, table, enter) {
    Object.assign(this, { state: first, table, enter });
  }

  /**
   * @param {string} event
   * @param {any} [data]
   * @param {AbortSignal} [left] of the state in which the event was begun: once it is left, its events are dropped
   */
  send(event, data = {}, left = undefined) {
    const to = this.table[this.state][event];
    const next = left?.aborted || !to ? null : typeof to === "function" ? to() : to;
    if (!next) return;
    this.#leaving.abort();
    const { signal } = (this.#leaving = new AbortController());
    this.state = next;
    this.#run(next, data, event, signal);
  }

  async #run(state, data, event, signal) {
    try {
      await this.enter[state](data, event, signal);
    } catch (error) {
      this.send("failed", { error }, signal);
    }
  }
}
