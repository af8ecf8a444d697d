// Lightmaps of luxel in three.js: a plugin of GLTFLoader for LUXEL_lightmap.
//
//   loader.register((parser) => new LuxelLightmap(parser));
//
// Pages are checked and decoded before anything else loads. Then each lit node's materials get the lightmap, and the
// lights that are in it are switched off. If anything about the lightmap is wrong, the scene stays as it would be
// without this plugin, and one line on the console says why.

import { DataTexture, DataUtils, FloatType, HalfFloatType, LinearFilter, LoaderUtils, RGBAFormat } from "three";
import { EXRLoader } from "three/addons/loaders/EXRLoader.js";

const NAME = "LUXEL_lightmap";
/** GLTFLoader names no more UV sets than these in three's terms. */
const CHANNELS = 4;
const LARGEST_HALF = 65504;
/** glTF's modes of primitives that have surfaces. */
const TRIANGLES = [undefined, 4, 5, 6];

export class LuxelLightmap {
  name = NAME;
  problem = null;
  pages = [];
  bakedLights = [];

  #parser;
  #halfFloat;
  #places = new Map();
  #baked = new Set();
  #textures = new Map();
  #materials = new Map();

  constructor(parser, { halfFloat = false } = {}) {
    this.#parser = parser;
    this.#halfFloat = halfFloat;
  }

  /** Decodes the pages: nothing is bound to a lightmap that is not whole. */
  async beforeRoot() {
    const { json } = this.#parser;
    const root = json.extensions?.[NAME];
    if (!root) return;
    try {
      checkPages(json, root.pages);
      const places = checkedPlaces(json, root.pages);
      const baked = new Set(root.bakedLights);
      this.pages = await Promise.all(root.pages.map((page, index) => this.#decode(page, index)));
      [this.#places, this.#baked] = [places, baked];
    } catch (error) {
      this.problem = error.message;
      console.warn(`${NAME}: ${this.problem}; the scene is shown without its lightmap`);
    }
  }

  createNodeMesh(index) {
    const place = this.#places.get(index);
    return place ? this.#parser.createNodeMesh(index).then((object) => this.#bind(object, place)) : null;
  }

  loadNode(index) {
    return this.#baked.has(index) ? this.#parser.loadNode(index).then((node) => this.#switchOff(node)) : null;
  }

  async #decode(page, index) {
    const label = `page ${index} (${page.uri ?? `bufferView ${page.bufferView}`})`;
    const bytes = await this.#bytes(page).catch((error) => fail(`${label} cannot be loaded: ${firstLine(error)}`));
    let image;
    try {
      image = decoded(bytes, this.#halfFloat);
    } catch (error) {
      fail(`${label} is not a whole EXR picture: ${firstLine(error)}`);
    }
    const { width, height, data, type, factor } = image;
    if (width !== page.width || height !== page.height) {
      fail(`${label} is ${width} x ${height}, not ${page.width} x ${page.height}`);
    }
    const texture = new DataTexture(data, width, height, RGBAFormat, type);
    texture.name = `${NAME} page ${index}`;
    // No mipmaps: they would mix charts that have nothing to do with each other.
    texture.minFilter = texture.magFilter = LinearFilter;
    texture.needsUpdate = true;
    return { texture, scale: page.scale * factor, content: page.content };
  }

  async #bytes({ bufferView, uri }) {
    if (bufferView !== undefined) return this.#parser.getDependency("bufferView", bufferView);
    return this.#parser.fileLoader.loadAsync(LoaderUtils.resolveURL(uri, this.#parser.options.path));
  }

  #bind(object, place) {
    object.traverse((mesh) => {
      if (!mesh.isMesh) return;
      const lit = (material) => this.#lit(material, place);
      mesh.material = Array.isArray(mesh.material) ? mesh.material.map(lit) : lit(mesh.material);
    });
    return object;
  }

  /** The material with a lightmap; one for all nodes that have the same place on a page. */
  #lit(material, place) {
    // Unlit materials are MeshBasicMaterial, which would take a lightmap.
    if (!("lightMap" in material) || material.isMeshBasicMaterial) return material;
    const texture = this.#texture(place);
    const key = `${material.uuid} ${texture.uuid}`;
    if (!this.#materials.has(key)) {
      const lit = material.clone();
      lit.lightMap = texture;
      lit.lightMapIntensity = this.pages[place.page].scale;
      this.#parser.associations.set(lit, this.#parser.associations.get(material));
      this.#materials.set(key, lit);
    }
    return this.#materials.get(key);
  }

  /** A page seen through a node's rectangle. All of a page's textures share one picture on the GPU. */
  #texture({ page, texCoord, offset, scale }) {
    const key = [page, texCoord, ...offset, ...scale].join(" ");
    if (!this.#textures.has(key)) {
      const texture = this.pages[page].texture.clone();
      texture.channel = texCoord;
      // EXRLoader's rows start at the bottom, the file's v at the top: v becomes 1 - v.
      texture.offset.set(offset[0], 1 - offset[1]);
      texture.repeat.set(scale[0], -scale[1]);
      this.#textures.set(key, texture);
    }
    return this.#textures.get(key);
  }

  #switchOff(node) {
    // A node's own light is the node itself or stands before its children, which are added last.
    const light = [node, ...node.children].find((object) => object.isLight);
    if (light) {
      // Not `visible`: that would hide the node's children, too.
      light.layers.disableAll();
      this.bakedLights.push(light);
    }
    return node;
  }
}

function checkPages(json, pages) {
  if (!Array.isArray(pages)) fail("the file lists no pages");
  pages.forEach((page, index) => {
    const { bufferView, uri, encoding, scale } = page ?? {};
    const known = bufferView === undefined ? typeof uri === "string" : uri === undefined && isIndex(bufferView, json.bufferViews);
    if (!known) fail(`page ${index} has to be in a bufferView of the file or at a uri`);
    if (encoding !== "irradiance") fail(`page ${index} holds ${encoding}, not irradiance`);
    if (!(Number.isFinite(scale) && scale > 0)) fail(`page ${index} has the scale ${scale}`);
  });
}

/** The lit nodes' places on the pages, by index of the node. */
function checkedPlaces(json, pages) {
  const places = new Map();
  json.nodes?.forEach((node, index) => {
    const place = node.extensions?.[NAME];
    if (!place) return;
    const label = node.name ? `node ${index} (${node.name})` : `node ${index}`;
    const { page, texCoord, offset, scale } = place;
    if (!isIndex(node.mesh, json.meshes)) fail(`${label} has a rectangle but no mesh`);
    if (!isIndex(page, pages)) fail(`${label} is on page ${page}, but the file has ${pages.length}`);
    if (!isPair(offset) || !isPair(scale)) fail(`${label} has no offset and scale of two numbers each`);
    if (!(Number.isInteger(texCoord) && texCoord >= 0 && texCoord < CHANNELS)) {
      fail(`${label} uses TEXCOORD_${texCoord}; three.js reads TEXCOORD_0 to TEXCOORD_${CHANNELS - 1}`);
    }
    const surfaces = json.meshes[node.mesh].primitives.filter(({ mode }) => TRIANGLES.includes(mode));
    if (!surfaces.every(({ attributes }) => `TEXCOORD_${texCoord}` in attributes)) {
      fail(`${label} has a mesh without TEXCOORD_${texCoord}`);
    }
    places.set(index, place);
  });
  return places;
}

/** The picture as three's half or float texels; `factor`: what they are to be multiplied by. */
function decoded(bytes, halfFloat) {
  if (pixelType(bytes) !== FloatType) {
    return { ...new EXRLoader().parse(bytes), factor: 1 };
  }
  const image = new EXRLoader().setDataType(FloatType).parse(bytes);
  return halfFloat ? { ...image, ...narrowed(image.data), type: HalfFloatType } : { ...image, factor: 1 };
}

/** Type of the first channel, read from the header: EXRLoader has to know before it decodes. */
function pixelType(bytes) {
  const CHANNEL_LIST = "channels\0chlist\0";
  const head = new TextDecoder("latin1").decode(new Uint8Array(bytes, 0, Math.min(bytes.byteLength, 4096)));
  const list = head.indexOf(CHANNEL_LIST);
  const typeAt = head.indexOf("\0", list + CHANNEL_LIST.length + 4) + 1;
  return list >= 0 && head.charCodeAt(typeAt) === 2 ? FloatType : HalfFloatType;
}

/** Halves of floats, divided by a power of two where they are too large. */
function narrowed(floats) {
  const largest = floats.reduce((a, b) => Math.max(a, b), 0);
  const factor = 2 ** Math.max(0, Math.ceil(Math.log2(largest / LARGEST_HALF)));
  return { data: Uint16Array.from(floats, (x) => DataUtils.toHalfFloat(x / factor)), factor };
}

function isIndex(value, list) {
  return Number.isInteger(value) && value >= 0 && value < (list?.length ?? 0);
}

function isPair(value) {
  return Array.isArray(value) && value.length === 2 && value.every(Number.isFinite);
}

function firstLine(error) {
  return String(error?.message ?? error).split("\n")[0];
}

function fail(problem) {
  throw new Error(problem);
}
