// Pictures that `luxel inspect` painted: pageN.NAME.png, shown in place of the light.

import { NearestFilter, SRGBColorSpace, TextureLoader } from "three";
import { clearInspections, inspection } from "./look.js";

/** The pictures among dropped or chosen files: pages and addresses by what they show. */
export function inspectionsOf(files) {
  const pictures = new Map();
  for (const file of files) {
    const [, page, name] = /^page(\d+)\.(\w+)\.png$/.exec(file.name) ?? [];
    if (name) pictures.set(name, [...(pictures.get(name) ?? []), [Number(page), URL.createObjectURL(file)]]);
  }
  return pictures;
}

/** Shows pictures, [page, address] each, in place of those before. */
export async function inspect(pictures) {
  const textures = await Promise.all(pictures.map(painted));
  clearInspections();
  pictures.forEach(([page], index) => (inspection(page).value = textures[index]));
}

async function painted([page, address]) {
  const texture = await new TextureLoader().loadAsync(address).catch(() => {
    throw new Error(`the picture of page ${page} (${address}) cannot be loaded`);
  });
  texture.colorSpace = SRGBColorSpace;
  texture.generateMipmaps = false;
  texture.minFilter = texture.magFilter = NearestFilter;
  return texture;
}
