/** A sphere and its shadow under the light of a photo, in react-three-fiber. */

import { Canvas, useThree } from "@react-three/fiber";
import { AnyProbe } from "anyprobe";
import { ProbeLight, groundShadowOpacity, installCameraCurve } from "anyprobe/three";
import React, { useEffect, useMemo } from "react";
import { createRoot } from "react-dom/client";

const UP = [0, 1, 0];

function Lit({ probe, light }) {
  const scene = useThree((state) => state.scene);
  const lights = useMemo(() => {
    const made = new ProbeLight(probe);
    made.update(light);
    made.directionalLight.castShadow = true;
    return made;
  }, [probe, light]);
  useEffect(() => {
    scene.environment = lights.environment;
    document.body.dataset.light = JSON.stringify(light.dominant.direction);
    return () => lights.dispose();
  }, [scene, lights, light]);
  return <primitive object={lights} />;
}

function Scene({ probe, light }) {
  return (
    <Canvas
      shadows
      gl={{ preserveDrawingBuffer: true }}
      camera={{ position: [0, 2, 7], fov: 35 }}
      onCreated={({ gl }) => installCameraCurve(gl)}
    >
      <Lit probe={probe} light={light} />
      <mesh castShadow position={[0, 1, 0]}>
        <sphereGeometry args={[1, 64, 32]} />
        <meshStandardMaterial metalness={1} roughness={0.2} />
      </mesh>
      <mesh receiveShadow rotation-x={-Math.PI / 2}>
        <planeGeometry args={[9, 9]} />
        <shadowMaterial toneMapped={false} opacity={groundShadowOpacity(light, UP)} />
      </mesh>
    </Canvas>
  );
}

const photo = new Image();
photo.src = "./vase.png";
await photo.decode();
const probe = await AnyProbe.load();
const light = await probe.estimate(photo, { fovDeg: 24 });
const root = Object.assign(document.createElement("div"), { style: "height: 100vh" });
document.body.append(root);
createRoot(root).render(<Scene probe={probe} light={light} />);
