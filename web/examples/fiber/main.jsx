/** Virtual spheres on the table of a photo, under its light and behind its vase, in react-three-fiber. */

import { Canvas, useLoader, useThree } from "@react-three/fiber";
import { AnyProbe } from "anyprobe";
import { ContactShadow, MaskOccluder, ProbeLight, groundShadowOpacity, installCameraCurve } from "anyprobe/three";
import React, { useEffect, useMemo } from "react";
import { createRoot } from "react-dom/client";
import { SRGBColorSpace, TextureLoader } from "three";

const PITCH = (16 * Math.PI) / 180; // how far the camera looks down
const UP = [0, Math.cos(PITCH), Math.sin(PITCH)];
const FOV_DEG = 32.13; // vertical
const VASE_DISTANCE = 2.34; // in heights of the camera over the table
const SPHERES = [[0.06, -2.5, 0, 1], [0.33, -2.05, 0.3, 1], [0.02, -1.85, 0.9, 0]];

function Lit({ probe, light }) {
  const scene = useThree((state) => state.scene);
  const photo = useLoader(TextureLoader, "./table.jpg");
  const lights = useMemo(() => {
    const made = new ProbeLight(probe);
    made.update(light);
    made.position.set(0, 0, -2.4); // the middle of what casts shadows
    const { shadow } = made.directionalLight;
    made.directionalLight.castShadow = true;
    Object.assign(shadow.camera, { left: -1, right: 1, top: 1, bottom: -1, near: 4, far: 6 });
    Object.assign(shadow, { radius: 4, bias: -0.002 });
    shadow.mapSize.set(1024, 1024);
    return made;
  }, [probe, light]);
  const vase = useMemo(() => {
    const made = new MaskOccluder();
    made.show(light.mask, VASE_DISTANCE, light.mask.height / 2 / Math.tan((FOV_DEG * Math.PI) / 360));
    return made;
  }, [light]);
  useEffect(() => {
    photo.colorSpace = SRGBColorSpace; // shown as it is
    Object.assign(scene, { background: photo, environment: lights.environment });
    document.body.dataset.light = JSON.stringify(light.dominant.direction);
  }, [scene, photo, lights, light]);
  return <><primitive object={lights} /><primitive object={vase.group} /></>;
}

function Sphere({ place: [x, z, roughness, metalness] }) {
  const contact = useMemo(() => new ContactShadow(), []);
  return (
    <group position={[x, 0, z]}>
      <mesh castShadow position-y={0.12}>
        <sphereGeometry args={[0.12, 64, 32]} />
        <meshStandardMaterial color={0xdddddd} roughness={roughness} metalness={metalness} />
      </mesh>
      <primitive object={contact} scale={0.26} position-y={0.001} />
    </group>
  );
}

const probe = await AnyProbe.load();
const light = await probe.estimate("./table.jpg", { mask: "./table-mask.png", fovDeg: FOV_DEG }); // or click: [228, 290]
const { width, height } = light.mask;
const root = Object.assign(document.createElement("div"), { style: `width: ${width}px; height: ${height}px` });
document.body.append(root);
createRoot(root).render(
  <Canvas shadows gl={{ preserveDrawingBuffer: true }} camera={{ position: [0, 0, 0], rotation: [0, 0, 0], fov: FOV_DEG }} onCreated={({ gl }) => installCameraCurve(gl)}>
    <React.Suspense>
      <Lit probe={probe} light={light} />
      <group rotation-x={PITCH} position={UP.map((value) => -value)}>
        {SPHERES.map((place) => <Sphere key={place[0]} place={place} />)}
        <mesh receiveShadow rotation-x={-Math.PI / 2} position-z={-2.4}>
          <circleGeometry args={[0.78, 64]} />
          <shadowMaterial toneMapped={false} opacity={groundShadowOpacity(light, UP)} />
        </mesh>
      </group>
    </React.Suspense>
  </Canvas>,
);
