// How surfaces are shown: a few switches in three's own shader, set for all materials at once.

/** Uniforms of every material. */
export const look = {
  lightmapOnly: { value: false },
  albedoOnly: { value: false },
  gloss: { value: true },
  texelGrid: { value: false },
  inspected: { value: false },
};

/** What `luxel inspect` painted for each page, as a uniform of the materials on it. */
const inspections = [];

/** The uniform of a page's picture. */
export function inspection(page) {
  return (inspections[page] ??= { value: null });
}

/** Takes the pictures of all pages away. */
export function clearInspections() {
  for (const uniform of inspections.filter(Boolean)) {
    uniform.value?.dispose();
    uniform.value = null;
  }
}

const DECLARATIONS = Object.keys(look).map((name) => `uniform bool ${name};`).join("\n") + "\nuniform sampler2D inspection;";

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
  if (inspected) {
    #ifdef USE_LIGHTMAP
      outgoingLight = texture(inspection, vLightMapUv).rgb;
    #else
      outgoingLight = vec3(0.0);
    #endif
  }
`;

/** Puts the switches into a material on a page (-1: on none); unlit ones are shown as they are, whatever the exposure. */
export function applyLook(material, page) {
  if (material.isMeshBasicMaterial) material.toneMapped = false;
  if (!material.isMeshStandardMaterial) return;
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, look, { inspection: page < 0 ? { value: null } : inspection(page) });
    shader.fragmentShader = shader.fragmentShader
      .replace("void main() {", `${DECLARATIONS}\nvoid main() {`)
      .replace("#include <lights_physical_fragment>", `${BEFORE_LIGHT}\n#include <lights_physical_fragment>\n${MATERIAL}`)
      .replace("#include <opaque_fragment>", `${RESULT}\n#include <opaque_fragment>`);
  };
  material.customProgramCacheKey = () => "luxel look";
}
