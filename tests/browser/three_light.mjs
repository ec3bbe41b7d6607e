// Lights scenes with an exported three.js module and reads what is seen along many directions.
// arguments: { module, directions }. A mirror facing the camera shows what lies behind the camera.

export default async ({ page, url, arguments: given }) => {
  await page.goto(`${url}three_scenes.html`);
  await page.waitForSelector("html[data-ready]");
  return page.evaluate(async ({ module, directions }) => {
    const { THREE, probe } = globalThis;
    const { lightScene } = await import(module);
    const lit = async (options, material) => {
      const scene = new THREE.Scene();
      if (material) probe.ball(scene, material);
      const made = await lightScene(scene, options);
      return { scene, made };
    };
    const white = new THREE.MeshLambertMaterial({ color: 0xffffff });
    const metal = (roughness) => new THREE.MeshStandardMaterial({ color: 0xffffff, roughness, metalness: 1 });
    const all = (scene, read) => directions.map((d) => read(scene, d));
    const background = await lit({ suns: false }, null);
    const reflected = await lit({ suns: false, background: false }, metal(0));
    const matt = await lit({ suns: false, background: false }, metal(1));
    const byProbe = await lit({ suns: false, background: false, probe: true }, white);
    const split = await lit({ background: false, probe: true }, white);
    const { made } = split;
    return {
      background: all(background.scene, (scene, d) => probe.look(scene, [0, 0, 0], d)),
      environment: all(reflected.scene, probe.facing),
      rough: all(matt.scene, probe.facing),
      probe: all(byProbe.scene, probe.facing),
      split: all(split.scene, probe.facing),
      suns: made.suns.map((sun) => ({
        position: sun.position.toArray(),
        intensity: sun.intensity,
        color: sun.color.toArray(),
        angleDeg: sun.userData.angleDeg,
      })),
    };
  }, given);
};
