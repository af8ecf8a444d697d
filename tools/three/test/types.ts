// Compiles if the declared types fit three's, and the use in README.md.
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { LuxelLightmap } from "luxel-three";

const loader = new GLTFLoader();
loader.register((parser) => new LuxelLightmap(parser));
loader.register((parser) => new LuxelLightmap(parser, { halfFloat: true }));
const gltf = await loader.loadAsync("room.lit.glb");
const lightmap = gltf.parser.plugins.LUXEL_lightmap as LuxelLightmap;
const problem: string | null = lightmap.problem;
lightmap.bakedLights.forEach((light) => light.layers.enable(0));
export { problem };
