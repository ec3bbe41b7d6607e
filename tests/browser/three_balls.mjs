// Three balls before the map, lit by an exported target: linear RGB, row by row from the top.
// arguments: { target: "three" | "probe" | "cube" | "ktx2", name, size: [width, height] }

export default async ({ page, url, arguments: given }) => {
  await page.goto(`${url}three_scenes.html`);
  await page.waitForSelector("html[data-ready]");
  return page.evaluate(async ({ target, name, size: [width, height] }) => {
    const { THREE, probe } = globalThis;
    const { renderer } = probe;
    const scene = new THREE.Scene();
    const metal = (roughness, grey) => new THREE.MeshStandardMaterial({ color: new THREE.Color(grey, grey, grey), roughness, metalness: 1 });
    const white = target === "probe" ? new THREE.MeshLambertMaterial() : new THREE.MeshStandardMaterial({ roughness: 1 });
    [white, metal(0.4, 0.8), metal(0, 1)].forEach((material, i) => {
      const ball = new THREE.Mesh(new THREE.SphereGeometry(1, 96, 48), material);
      ball.position.x = 2.3 * (i - 1);
      scene.add(ball);
    });
    if (target === "three" || target === "probe") {
      const { lightScene } = await import(`/export/${name}_three.js`);
      await lightScene(scene, { probe: target === "probe" });
    } else if (target === "cube") {
      const { HDRCubeTextureLoader } = await import("three/addons/loaders/HDRCubeTextureLoader.js");
      const files = ["px", "nx", "py", "ny", "pz", "nz"].map((face) => `/export/${name}_cube_${face}.hdr`);
      scene.background = scene.environment = await new Promise((done, fail) => new HDRCubeTextureLoader().load(files, done, undefined, fail));
    } else {
      scene.background = scene.environment = await (await import(`/export/${name}_${target}.js`)).loadCube(renderer);
    }
    const camera = new THREE.PerspectiveCamera(26, width / height, 0.1, 100);
    camera.position.z = 9;
    const picture = new THREE.WebGLRenderTarget(width, height, { type: THREE.FloatType, samples: 4 });
    renderer.setRenderTarget(picture);
    renderer.render(scene, camera);
    const rgba = new Float32Array(4 * width * height);
    renderer.readRenderTargetPixels(picture, 0, 0, width, height, rgba);
    const rows = [];
    for (let y = height - 1; y >= 0; y--)
      for (let x = 0; x < width; x++) rows.push(...rgba.subarray(4 * (y * width + x), 4 * (y * width + x) + 3));
    return rows.map((value) => Math.round(value * 1e4) / 1e4);
  }, given);
};
