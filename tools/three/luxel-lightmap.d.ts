import type { DataTexture, Group, Light, Mesh, Object3D, SkinnedMesh } from "three";
import type { GLTFLoaderPlugin, GLTFParser } from "three/addons/loaders/GLTFLoader.js";

export interface LuxelLightmapOptions {
  /**
   * Pages of 32 bits become half floats: for devices that cannot filter float textures, which lack
   * OES_texture_float_linear. Default: false.
   */
  halfFloat?: boolean;
}

/** A page of the lightmap. */
export interface LuxelPage {
  /** The whole page, rows from the bottom. Materials have clones of it, one for each rectangle. */
  readonly texture: DataTexture;
  /** Irradiance is texel times this. */
  readonly scale: number;
  /** Which light the page holds. */
  readonly content: "full" | "direct" | "indirect";
}

/**
 * A plugin of GLTFLoader that shows the lightmaps of luxel:
 * `loader.register((parser) => new LuxelLightmap(parser))`. After loading it is `gltf.parser.plugins.LUXEL_lightmap`.
 */
export class LuxelLightmap implements GLTFLoaderPlugin {
  constructor(parser: GLTFParser, options?: LuxelLightmapOptions);
  readonly name: "LUXEL_lightmap";
  /** Why the scene is shown without its lightmap, or null. */
  readonly problem: string | null;
  /** The file's pages; none if it has no lightmap, or one with a problem. */
  readonly pages: readonly LuxelPage[];
  /** Lights that are in the map. They are on no layer, so they do not shine; `light.layers.enable(0)` turns one on. */
  readonly bakedLights: readonly Light[];
  beforeRoot(): Promise<void>;
  createNodeMesh(index: number): Promise<Group | Mesh | SkinnedMesh> | null;
  loadNode(index: number): Promise<Object3D> | null;
}
