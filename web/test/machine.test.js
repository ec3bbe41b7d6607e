/** States and events: what was begun in a state that was left is not heard. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Machine } from "../page/machine.js";

const settle = () => new Promise((resolve) => setTimeout(resolve));

test("events lead where the table says, others are dropped, and answers of a state that was left too", async () => {
  const entered = [];
  const asked = [];
  const machine = new Machine(
    "rest",
    { rest: { ask: "busy" }, busy: { ask: "busy", answer: () => (entered.length > 2 ? "rest" : null), failed: "rest" } },
    {
      rest: ({ error }) => void entered.push(error?.message ?? "rest"),
      busy: (data, event, left) => (entered.push(event), new Promise((resolve, reject) => asked.push({ left, reject }))),
    },
  );
  machine.send("answer");
  assert.equal(machine.state, "rest");
  machine.send("ask");
  machine.send("ask");
  machine.send("answer", {}, asked[0].left);
  assert.deepEqual([machine.state, asked[0].left.aborted, asked[1].left.aborted], ["busy", true, false]);
  machine.send("answer", {}, asked[1].left);
  assert.equal(machine.state, "busy", "a table's function may refuse");
  asked[0].reject(new Error("late"));
  await settle();
  assert.equal(machine.state, "busy");
  asked[1].reject(new Error("broken"));
  await settle();
  assert.deepEqual([machine.state, entered], ["rest", ["ask", "ask", "broken"]]);
});
