// Loads an exported cube in three.js and reads the background along many directions.
// arguments: { kind: "ktx2" | "cube", name, directions }

export default async ({ page, url, arguments: given }) => {
  await page.goto(`${url}three_scenes.html`);
  await page.waitForSelector("html[data-ready]");
  return page.evaluate(async ({ kind, name, directions }) => {
    const { THREE, probe } = globalThis;
    const { renderer } = probe;
    const at = (file) => `/export/${encodeURIComponent(file)}`;
    const load = {
      ktx2: async () => (await import(at(`${name}.js`))).loadCube(renderer),
      cube: async () => {
        const { HDRCubeTextureLoader } = await import("three/addons/loaders/HDRCubeTextureLoader.js");
        const files = ["px", "nx", "py", "ny", "pz", "nz"].map((face) => at(`${name}_${face}.hdr`));
        return new Promise((resolve, reject) => new HDRCubeTextureLoader().load(files, resolve, undefined, reject));
      },
    };
    const scene = new THREE.Scene();
    scene.background = await load[kind]();
    const seen = directions.map((d) => probe.look(scene, [0, 0, 0], d));
    const reflecting = new THREE.Scene();
    reflecting.environment = scene.background;
    probe.ball(reflecting, new THREE.MeshStandardMaterial({ color: 0xffffff, roughness: 0, metalness: 1 }));
    return { background: seen, environment: directions.map((d) => probe.facing(reflecting, d)) };
  }, given);
};
