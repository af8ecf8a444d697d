// A first exposure, from the lightmap itself.

import { DataUtils, FloatType } from "three";

/** Texels that are looked at, about. */
const SAMPLES = 20000;

/** Geometric mean of the irradiance in these pages, or null where there is none. */
export function meanIrradiance(pages) {
  let [sum, count] = [0, 0];
  for (const { texture, scale } of pages) {
    const { data } = texture.image;
    const value = texture.type === FloatType ? (x) => x : DataUtils.fromHalfFloat;
    const step = 4 * Math.ceil(data.length / 4 / SAMPLES);
    for (let at = 0; at < data.length; at += step) {
      const [r, g, b] = [0, 1, 2].map((channel) => value(data[at + channel]) * scale);
      const luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
      if (luminance > 0) [sum, count] = [sum + Math.log(luminance), count + 1];
    }
  }
  return count ? Math.exp(sum / count) : null;
}

/** Factor that shows a grey surface (reflectance .5) in this irradiance as a middle grey. */
export function exposureFor(irradiance) {
  return (0.18 * Math.PI) / (0.5 * irradiance);
}
