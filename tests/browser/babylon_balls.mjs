// Three balls lit by an exported .glb in Babylon.js: linear RGB, row by row from the top.
// arguments: { file, size: [width, height] }

export default async ({ page, url, arguments: given }) => {
  await page.goto(`${url}babylon_scene.html`);
  await page.waitForFunction(() => globalThis.BABYLON?.PBRMaterial);
  return page.evaluate(async ({ file, size: [width, height] }) => {
    const { BABYLON } = globalThis;
    const canvas = document.querySelector("canvas");
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
    const engine = new BABYLON.Engine(canvas, true, { preserveDrawingBuffer: true });
    engine.setSize(width, height);
    const scene = new BABYLON.Scene(engine);
    await BABYLON.AppendSceneAsync(`/export/${encodeURIComponent(file)}`, scene);
    scene.environmentTexture.gammaSpace = false;
    scene.createDefaultSkybox(scene.environmentTexture, true, 500, 0);
    [[0, 1, 1], [1, 0.4, 0.8], [1, 0, 1]].forEach(([metallic, roughness, grey], i) => {
      const ball = BABYLON.MeshBuilder.CreateSphere(`ball ${i}`, { diameter: 2, segments: 64 }, scene);
      ball.position.x = 2.3 * (1 - i); // x is turned round in Babylon's left-handed world
      ball.material = new BABYLON.PBRMaterial(`material ${i}`, scene);
      Object.assign(ball.material, { metallic, roughness, albedoColor: new BABYLON.Color3(grey, grey, grey) });
    });
    const camera = new BABYLON.FreeCamera("eye", new BABYLON.Vector3(0, 0, 9), scene);
    camera.setTarget(BABYLON.Vector3.Zero());
    camera.fov = (26 * Math.PI) / 180;
    scene.activeCamera = camera;
    await scene.whenReadyAsync();
    scene.render();
    const bytes = await engine.readPixels(0, 0, width, height);
    const rows = [];
    for (let y = height - 1; y >= 0; y--)
      for (let x = 0; x < width; x++)
        for (let i = 0; i < 3; i++) rows.push(Math.round((bytes[4 * (y * width + x) + i] / 255) ** 2.2 * 1e4) / 1e4);
    return rows;
  }, given);
};
