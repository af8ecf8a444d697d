// Shadows of the lights that are drawn in real time: those that the lightmap leaves to the engine.

import { DoubleSide, Vector3 } from "three";

const MAP_SIZE = 2048;

/** Makes every light of the scene throw shadows; `box` is what it holds. */
export function throwShadows(scene, box) {
  const diagonal = box.getSize(new Vector3()).length();
  scene.traverse((object) => {
    if (object.isMesh) object.castShadow = object.receiveShadow = true;
    // luxel's rays stop at both sides of a surface.
    for (const material of [object.material ?? []].flat()) material.shadowSide = DoubleSide;
    if (object.shadow) adjust(object, box, diagonal);
  });
}

function adjust(light, box, diagonal) {
  const { shadow } = light;
  light.castShadow = true;
  shadow.mapSize.set(MAP_SIZE, MAP_SIZE);
  const reach = diagonal + light.getWorldPosition(new Vector3()).distanceTo(box.getCenter(new Vector3()));
  shadow.camera.near = light.isDirectionalLight ? -reach : diagonal / 1000;
  shadow.camera.far = reach;
  if (light.isDirectionalLight) {
    Object.assign(shadow.camera, { left: -reach, right: reach, bottom: -reach, top: reach });
  }
  // Two texels of the map, where it is as wide as the scene.
  shadow.normalBias = (2 * diagonal) / MAP_SIZE;
  shadow.bias = -1e-4;
}
