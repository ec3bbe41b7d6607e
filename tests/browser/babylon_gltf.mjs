// Loads an exported .glb in Babylon.js, which reads EXT_lights_image_based, and reads what a mirror and a
// white ball show. arguments: { file, directions }, in glTF's axes; Babylon's default world has x turned round.

export default async ({ page, url, arguments: given }) => {
  await page.goto(`${url}babylon_scene.html`);
  await page.waitForFunction(() => globalThis.BABYLON?.PBRMaterial);
  return page.evaluate(async ({ file, directions }) => {
    const { BABYLON } = globalThis;
    const canvas = document.querySelector("canvas");
    const engine = new BABYLON.Engine(canvas, false, { preserveDrawingBuffer: true });
    const middle = (canvas.width - 1) / 2;
    const scene = new BABYLON.Scene(engine);
    await BABYLON.AppendSceneAsync(`/export/${encodeURIComponent(file)}`, scene);
    scene.environmentTexture.gammaSpace = false; // it is linear; Babylon.js 9.34 would decode it twice
    scene.lights.forEach((light) => light.computeTransformedInformation());
    const lights = scene.lights.map((light) => ({
      direction: light.transformedDirection.asArray(),
      intensity: light.intensity,
      color: light.diffuse.asArray(),
    }));
    scene.lights.forEach((light) => light.setEnabled(false));
    const ball = BABYLON.MeshBuilder.CreateSphere("ball", { diameter: 2, segments: 32 }, scene);
    const camera = new BABYLON.FreeCamera("eye", BABYLON.Vector3.Zero(), scene);
    camera.fov = 0.02;
    camera.minZ = 0.1;
    scene.activeCamera = camera;
    const seen = {};
    for (const [name, metallic, roughness] of [["mirror", 1, 0], ["white", 0, 1]]) {
      const material = new BABYLON.PBRMaterial(name, scene);
      Object.assign(material, { metallic, roughness, albedoColor: BABYLON.Color3.White() });
      ball.material = material;
      await scene.whenReadyAsync();
      seen[name] = [];
      for (const [x, y, z] of directions) {
        camera.position.copyFromFloats(-4 * x, 4 * y, 4 * z);
        camera.setTarget(BABYLON.Vector3.Zero());
        scene.render();
        const bytes = await engine.readPixels(middle, middle, 1, 1);
        seen[name].push(Array.from(bytes.subarray(0, 3), (byte) => (byte / 255) ** 2.2));
      }
    }
    return { lights, ...seen };
  }, given);
};
