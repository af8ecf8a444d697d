// How surfaces are shown: a few switches in three's own shader, set for all materials at once.

/** Uniforms of every material. */
export const look = {
  lightmapOnly: { value: false },
  albedoOnly: { value: false },
  gloss: { value: true },
  texelGrid: { value: false },
};

const DECLARATIONS = Object.keys(look).map((name) => `uniform bool ${name};`).join("\n");

const BEFORE_LIGHT = `
  if (lightmapOnly) {
    diffuseColor.rgb = vec3(1.0);
    totalEmissiveRadiance = vec3(0.0);
    metalnessFactor = 0.0;
  }
  #ifdef USE_LIGHTMAP
    if (texelGrid) {
      vec2 texel = floor(vLightMapUv * vec2(textureSize(lightMap, 0)));
      diffuseColor.rgb *= mod(texel.x + texel.y, 2.0) < 0.5 ? 1.1 : 0.8;
    }
  #endif
`;

// Without gloss nothing is taken from the diffuse part either: E times base colour over pi, as luxel reckons.
const MATERIAL = `
  if (!gloss || lightmapOnly) {
    material.specularColor = material.specularColorBlended = vec3(0.0);
    material.specularF90 = 0.0;
  }
`;

const RESULT = `
  if (albedoOnly) outgoingLight = diffuseColor.rgb * (1.0 - metalnessFactor);
`;

/** Puts the switches into a material; unlit ones are shown as they are, whatever the exposure. */
export function applyLook(material) {
  if (material.isMeshBasicMaterial) material.toneMapped = false;
  if (!material.isMeshStandardMaterial) return;
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, look);
    shader.fragmentShader = shader.fragmentShader
      .replace("void main() {", `${DECLARATIONS}\nvoid main() {`)
      .replace("#include <lights_physical_fragment>", `${BEFORE_LIGHT}\n#include <lights_physical_fragment>\n${MATERIAL}`)
      .replace("#include <opaque_fragment>", `${RESULT}\n#include <opaque_fragment>`);
  };
  material.customProgramCacheKey = () => "luxel look";
}
