// Pictures that `luxel inspect` painted: pageN.NAME.png, shown in place of the light.

import { NearestFilter, SRGBColorSpace, TextureLoader } from "three";
import { inspection } from "./look.js";

/** Pages and addresses of the pictures among dropped or chosen files. */
export function inspectionsOf(files) {
  const pictures = files.map((file) => [/^page(\d+)\.\w+\.png$/.exec(file.name)?.[1], file]);
  return pictures.filter(([page]) => page !== undefined).map(([page, file]) => [Number(page), URL.createObjectURL(file)]);
}

/** Loads pictures, [page, address] each. */
export async function inspect(pictures) {
  for (const [page, address] of pictures) {
    const texture = await new TextureLoader().loadAsync(address).catch(() => {
      throw new Error(`the picture of page ${page} (${address}) cannot be loaded`);
    });
    texture.colorSpace = SRGBColorSpace;
    texture.generateMipmaps = false;
    texture.minFilter = texture.magFilter = NearestFilter;
    inspection(page).value?.dispose();
    inspection(page).value = texture;
  }
}
