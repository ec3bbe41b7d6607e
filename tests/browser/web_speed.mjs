// How soon and how often lights of the camera's video come. arguments: { kind: "page" | "package", threads, seconds }; for
// the package the address is of a page with its import map. first_light_s counts from the wish for the camera, the networks
// not yet fetched; megabytes are all that was fetched until then, as the server sent it; worker_ms is the processor time of
// the networks' threads a light, which other programs on the machine do not change; memory_mb is what the page and its
// workers hold in the end.

import { readFileSync, readdirSync } from "node:fs";
import { openPage } from "./page_steps.mjs";

/** Processor time in ms of the worker threads of all processes below this one (Linux: ticks of 10 ms). */
function workerMs() {
  const read = (path) => {
    try {
      return readFileSync(path, "utf8");
    } catch {
      return ""; // it has ended meanwhile
    }
  };
  const fields = (stat) => stat.slice(stat.lastIndexOf(")") + 2).split(" ");
  const parents = new Map();
  for (const pid of readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
    const stat = read(`/proc/${pid}/stat`);
    if (stat) parents.set(Number(pid), Number(fields(stat)[1]));
  }
  const isBelow = (pid) => (pid === process.pid ? true : parents.has(pid) && isBelow(parents.get(pid)));
  let ticks = 0;
  for (const pid of [...parents.keys()].filter(isBelow)) {
    for (const task of readdirSync(`/proc/${pid}/task`)) {
      const stat = read(`/proc/${pid}/task/${task}/stat`);
      if (!stat.includes("(DedicatedWorker")) continue;
      const [user, system] = fields(stat).slice(11, 13).map(Number);
      ticks += user + system;
    }
  }
  return 10 * ticks;
}

export default async ({ page, context, url, arguments: { kind, threads, seconds } }) => {
  await context.grantPermissions(["camera"], { origin: new URL(url).origin });
  let bytes = 0;
  page.on("requestfinished", async (request) => (bytes += (await request.sizes()).responseBodySize));
  if (kind === "page") {
    await openPage(page, url, `?engine=wasm&threads=${threads}`);
    await page.evaluate(() => {
      globalThis.lights = [];
      globalThis.begun = performance.now();
      document.addEventListener("anyprobe-light", () => lights.push(performance.now()));
      document.getElementById("camera").click();
    });
  } else {
    await page.goto(`${url}speed.html`);
    await page.evaluate(async (threads) => {
      globalThis.lights = [];
      globalThis.begun = performance.now();
      const { AnyProbe } = await import("anyprobe");
      const opening = AnyProbe.load({ threads });
      const video = Object.assign(document.createElement("video"), { muted: true });
      video.srcObject = await navigator.mediaDevices.getUserMedia({ video: { width: 1280, height: 720 } });
      await video.play();
      (await opening).track(video, () => lights.push(performance.now()));
    }, threads);
  }
  await page.waitForFunction(() => lights.length > 0, null, { polling: 20 });
  const loaded = bytes;
  const first = await page.evaluate(() => (lights[0] - begun) / 1000);
  await page.waitForTimeout(3000); // until the browser has compiled what runs often
  const before = workerMs();
  const count = await page.evaluate(async (seconds) => {
    const before = lights.length;
    await new Promise((done) => setTimeout(done, 1000 * seconds));
    return lights.length - before;
  }, seconds);
  const worker_ms = (workerMs() - before) / Math.max(count, 1);
  const { bytes: held } = await page.evaluate(() => performance.measureUserAgentSpecificMemory());
  return { lights_per_s: count / seconds, worker_ms, first_light_s: first, megabytes: loaded / 1e6, memory_mb: held / 1e6 };
};
