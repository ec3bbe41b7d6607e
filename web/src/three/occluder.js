/** The real object's depth in the scene: it hides what is behind it, and is not drawn itself. */

import { DataTexture, Group, LinearFilter, Mesh, MeshBasicMaterial, PlaneGeometry } from "three";
import { AnyProbeError } from "../errors.js";
import { objectBox } from "../photo/picture.js";

export class MaskOccluder {
  constructor() {
    this.material = new MeshBasicMaterial({ alphaTest: 0.5, colorWrite: false });
    this.group = new Group();
    // two cards that leave only their depth: one through its middle, before the virtual object is drawn; one at
    // its base, after that and before the shadows on the ground
    [this.middle, this.base] = [-1, 1].map((renderOrder) => {
      const card = new Mesh(new PlaneGeometry(1, 1), this.material);
      card.renderOrder = renderOrder;
      this.group.add(card);
      return card;
    });
  }

  show(given, distance, focalPx) {
    const { data: mask, width, height } = given ?? {};
    if (!mask || mask.length !== width * height) {
      const got = `${mask?.length ?? "none"} of ${width} x ${height}`;
      throw new AnyProbeError("invalid-option", `expected one of a light or of probe.mask, width x height numbers, got ${got}`, { subject: ["mask"] });
    }
    if (!(distance > 0 && focalPx > 0)) {
      throw new AnyProbeError("invalid-option", `expected numbers above 0, got ${distance} and ${focalPx}; pass those of PhotoGround`, { subject: ["distance", "focalPx"] });
    }
    this.#setTexture(mask, width, height);
    const box = objectBox(mask, width);
    this.group.visible = box !== null;
    if (!box) return;
    const [across, down] = [box[2] - box[0], box[3] - box[1]];
    const depth = (distance * across) / 2 / focalPx; // as deep as wide
    for (const [card, away] of [[this.middle, distance + depth], [this.base, distance]]) {
      const pixel = away / focalPx;
      card.scale.set(across * pixel, down * pixel, 1);
      card.position.set(((box[0] + box[2] - width) / 2) * pixel, ((height - box[1] - box[3]) / 2) * pixel, -away);
    }
    const { alphaMap } = this.material;
    alphaMap.repeat.set(across / width, down / height);
    alphaMap.offset.set(box[0] / width, 1 - box[3] / height);
  }

  dispose() {
    this.material.alphaMap?.dispose();
    this.material.dispose();
    for (const card of [this.middle, this.base]) card.geometry.dispose();
  }

  #setTexture(mask, width, height) {
    const { material } = this;
    if (material.alphaMap?.image.width !== width || material.alphaMap?.image.height !== height) {
      material.alphaMap?.dispose();
      material.alphaMap = new DataTexture(new Uint8Array(4 * mask.length), width, height);
      material.alphaMap.magFilter = material.alphaMap.minFilter = LinearFilter; // an edge between pixels, not of squares
      material.needsUpdate = true;
    }
    const { data } = material.alphaMap.image;
    for (let y = 0; y < height; y++) {
      const below = (height - 1 - y) * width; // a texture's first row is the lowest
      for (let x = 0; x < width; x++) data[4 * (below + x) + 1] = 255 * mask[y * width + x];
    }
    material.alphaMap.needsUpdate = true;
  }
}
