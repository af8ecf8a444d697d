// Where a scene comes from: an address, or files of this machine.

import { LoadingManager } from "three";

/** What GLTFLoader needs to load `url`. */
export function atUrl(url) {
  return { url, name: url.split("/").pop(), manager: new LoadingManager() };
}

/** The same for dropped or chosen files: a .glb, or a .gltf among all that it names; null if neither is there. */
export function ofFiles(files) {
  const main = files.find((file) => /\.gl(b|tf)$/i.test(file.name));
  if (!main) return null;
  const urls = new Map(files.map((file) => [file.name, URL.createObjectURL(file)]));
  const manager = new LoadingManager();
  // Folders are lost in a drop: names have to do.
  manager.setURLModifier((url) => urls.get(decodeURIComponent(url.split("/").pop())) ?? url);
  return { url: main.name, name: main.name, manager };
}
