// Loads an exported .glb in Babylon.js, which reads EXT_lights_image_based, and reads what a smooth and a
// rough metal ball and a white one show. arguments: { file, directions }

export default async ({ page, url, arguments: given }) => {
  await page.goto(`${url}babylon_scene.html`);
  await page.waitForFunction(() => globalThis.BABYLON?.PBRMaterial);
  return page.evaluate(async ({ file, directions }) => {
    const { BABYLON } = globalThis;
    const canvas = document.querySelector("canvas");
    const engine = new BABYLON.Engine(canvas, false, { preserveDrawingBuffer: true });
    const SIZE = 5;
    const seen = {};
    for (const [name, metallic, roughness] of [["mirror", 1, 0], ["white", 0, 1]]) {
      const scene = new BABYLON.Scene(engine);
      scene.useRightHandedSystem = true;
      await BABYLON.AppendSceneAsync(`${url(file)}`, scene);
      seen.lights = scene.lights.map((l) => ({ direction: l.direction?.asArray(), intensity: l.intensity, color: l.diffuse.asArray() }));
      scene.lights.forEach((light) => light.setEnabled(false));
      const ball = BABYLON.MeshBuilder.CreateSphere("ball", { diameter: 2, segments: 32 }, scene);
      const material = new BABYLON.PBRMaterial("pbr", scene);
      Object.assign(material, { metallic, roughness, albedoColor: BABYLON.Color3.White() });
      ball.material = material;
      const camera = new BABYLON.FreeCamera("eye", BABYLON.Vector3.Zero(), scene);
      camera.fov = 0.02;
      camera.minZ = 0.1;
      const target = new BABYLON.RenderTargetTexture("seen", SIZE, scene, { type: BABYLON.Constants.TEXTURETYPE_FLOAT, generateMipMaps: false });
      target.activeCamera = camera;
      target.renderList = [ball];
      scene.imageProcessingConfiguration.applyByPostProcess = true;
      await scene.whenReadyAsync();
      seen[name] = [];
      for (const d of directions) {
        camera.position.copyFromFloats(4 * d[0], 4 * d[1], 4 * d[2]);
        camera.upVector = Math.abs(d[1]) > 0.99 ? new BABYLON.Vector3(0, 0, 1) : BABYLON.Vector3.Up();
        camera.setTarget(BABYLON.Vector3.Zero());
        camera.getViewMatrix(true);
        target.render();
        const pixels = await target.readPixels();
        const middle = 4 * (SIZE * SIZE - 1) / 2;
        seen[name].push(Array.from(pixels.subarray(middle, middle + 3)));
      }
      scene.dispose();
    }
    return seen;
    function url(name) { return `/export/${encodeURIComponent(name)}`; }
  }, given);
};
