// A cross-origin isolated page in whose worker no other thread can be started, as where the system has too little memory. arguments: { page }; threads that were used, the light, and what was said.

export default async ({ page, url, arguments: given }) => {
  const said = [];
  page.on("console", (message) => message.type() === "warning" && said.push(message.text()));
  await page.goto(url + given.page);
  const seen = await page.evaluate(async () => {
    const { AnyProbe } = await import("anyprobe");
    const patch = `
      self.Worker = function () {
        throw new RangeError("Out of memory");
      };`;
    const script = new URL("node_modules/anyprobe/src/networks/worker.js", location.href);
    const source = `import "data:text/javascript,${encodeURIComponent(patch)}"; import "${script}";`;
    const worker = () => new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })), { type: "module" });
    const probe = await AnyProbe.load({ threads: 2, worker });
    const { sh9 } = await probe.estimate("./vase.png", { fovDeg: 24 });
    return { isolated: crossOriginIsolated, threads: probe.threads, sh9: [...sh9] };
  });
  return { ...seen, said };
};
