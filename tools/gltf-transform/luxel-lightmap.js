// Lightmaps of luxel (LUXEL_lightmap) in glTF-Transform: without it they are lost on the first write.
//
//   import { NodeIO } from "@gltf-transform/core";
//   import { LuxelLightmap } from "luxel-gltf-transform";
//
//   const io = new NodeIO().registerExtensions([...ALL_EXTENSIONS, LuxelLightmap]);
//
// A lightmap with anything wrong about it is left out, and one line of the log says why.

import { Extension, ExtensionProperty, PropertyType, RefList } from "@gltf-transform/core";
import { sizeOf } from "./picture.js";

const NAME = "LUXEL_lightmap";
/** glTF's modes of primitives that have surfaces. */
const TRIANGLES = [undefined, 4, 5, 6];

/** The root's part: pages, and the nodes whose light is in them. */
export class Lightmap extends ExtensionProperty {
  init() {
    this.extensionName = NAME;
    this.propertyType = "Lightmap";
    this.parentTypes = [PropertyType.ROOT];
  }

  getDefaults() {
    // `definition` is the extension as it stands in the file, but for indices.
    return Object.assign(super.getDefaults(), { definition: {}, pictures: [], bakedLights: new RefList() });
  }

  /** The extension as it stands in the file; its indices are those of the file that was read. */
  getDefinition() {
    return this.get("definition");
  }

  /** The bytes of each page; null for one beside the file. */
  listPictures() {
    return this.get("pictures");
  }

  /** Nodes whose light must not be drawn again. */
  listBakedLights() {
    return this.listRefs("bakedLights");
  }
}

/** A lit node's part: its rectangle on a page. */
export class Place extends ExtensionProperty {
  init() {
    this.extensionName = NAME;
    this.propertyType = "Place";
    this.parentTypes = [PropertyType.NODE];
  }

  getDefaults() {
    return Object.assign(super.getDefaults(), { definition: {} });
  }

  /** Page, texture coordinates, offset and scale. */
  getDefinition() {
    return this.get("definition");
  }
}

/** The extension, for `registerExtensions`. */
export class LuxelLightmap extends Extension {
  static EXTENSION_NAME = NAME;
  extensionName = NAME;
  prewriteTypes = [PropertyType.BUFFER];

  read(context) {
    const { json } = context.jsonDoc;
    const definition = json.extensions?.[NAME];
    if (!definition) return this;
    const problem = problemOf(json, context.bufferViews);
    if (problem) {
      this.document.getLogger().warn(`${NAME}: ${problem}; the scene is read without its lightmap`);
      for (const owner of [this.document.getRoot(), ...context.nodes]) dropMirror(owner);
      this.dispose();
      return this;
    }
    const graph = this.document.getGraph();
    const lightmap = new Lightmap(graph);
    lightmap.set("definition", definition);
    lightmap.set("pictures", definition.pages.map(({ bufferView }) => context.bufferViews[bufferView] ?? null));
    for (const index of definition.bakedLights ?? []) lightmap.addRef("bakedLights", context.nodes[index]);
    this.document.getRoot().setExtension(NAME, lightmap);
    (json.nodes ?? []).forEach((node, index) => {
      const place = node.extensions?.[NAME];
      if (!place) return;
      const property = new Place(graph);
      property.set("definition", place);
      context.nodes[index].setExtension(NAME, property);
    });
    return this;
  }

  prewrite(context) {
    this.document.getRoot().listNodes().forEach((node) => this.#follow(node));
    const lightmap = this.document.getRoot().getExtension(NAME);
    const [buffer] = this.document.getRoot().listBuffers();
    const pictures = (lightmap?.listPictures() ?? []).filter(Boolean);
    if (!pictures.length) return this;
    context.otherBufferViews.set(buffer, [...(context.otherBufferViews.get(buffer) ?? []), ...pictures]);
    return this;
  }

  write(context) {
    const { json } = context.jsonDoc;
    const lightmap = this.document.getRoot().getExtension(NAME);
    if (!lightmap) return this;
    const definition = structuredClone(lightmap.getDefinition());
    lightmap.listPictures().forEach((picture, index) => {
      if (picture) definition.pages[index].bufferView = context.otherBufferViewsIndexMap.get(picture);
    });
    definition.bakedLights = lightmap.listBakedLights().map((node) => context.nodeIndexMap.get(node));
    bind(json, definition);
    for (const node of this.document.getRoot().listNodes()) {
      const place = node.getExtension(NAME);
      if (place) bind(json.nodes[context.nodeIndexMap.get(node)], place.getDefinition());
    }
    return this;
  }

  /** A place goes where its mesh went: `quantize` moves meshes of nodes with children or animations into a child. */
  #follow(node) {
    const place = node.getExtension(NAME);
    if (!place || node.getMesh()) return;
    // The moved one has no name, and comes after the node's own children.
    const heir = node.listChildren().findLast((child) => child.getMesh() && !child.getName() && !child.getExtension(NAME));
    node.setExtension(NAME, null);
    heir?.setExtension(NAME, place);
    const { luxel } = node.getExtras();
    if (luxel?.lightmap) heir?.setExtras({ ...heir.getExtras(), luxel: { ...heir.getExtras().luxel, lightmap: luxel.lightmap } });
    dropMirror(node);
    if (!heir) this.document.getLogger().warn(`${NAME}: node ${node.getName()} has no mesh any more; its light is left out`);
  }
}

/** What is wrong with a lightmap, in one line. Pictures beside the file are not looked at: glTF-Transform does not read them. */
function problemOf(json, bufferViews) {
  const { pages, bakedLights = [] } = json.extensions[NAME];
  if (!Array.isArray(pages)) return "the file lists no pages";
  for (const [index, page] of pages.entries()) {
    const problem = problemOfPage(page ?? {}, bufferViews);
    if (problem) return `page ${index} ${problem}`;
  }
  const nodes = json.nodes ?? [];
  for (const [index, node] of nodes.entries()) {
    const place = node.extensions?.[NAME];
    const problem = place && problemOfPlace(place, node, pages, json.meshes);
    if (problem) return `node ${index}${node.name ? ` (${node.name})` : ""} ${problem}`;
  }
  const known = Array.isArray(bakedLights) && bakedLights.every((light) => isIndex(light, nodes));
  return known ? null : "its bakedLights are no nodes of the file";
}

function problemOfPage({ bufferView, uri, width, height, encoding, scale }, bufferViews) {
  const known = bufferView === undefined ? typeof uri === "string" : uri === undefined && isIndex(bufferView, bufferViews);
  if (!known) return "has to be in a bufferView of the file or at a uri";
  if (encoding !== "irradiance") return `holds ${encoding}, not irradiance`;
  if (!(Number.isFinite(scale) && scale > 0)) return `has the scale ${scale}`;
  if (uri !== undefined) return null;
  const size = sizeOf(bufferViews[bufferView]);
  if (!size) return "is not a whole EXR picture";
  return size[0] === width && size[1] === height ? null : `is ${size.join(" x ")}, not ${width} x ${height}`;
}

function problemOfPlace({ page, texCoord, offset, scale }, { mesh }, pages, meshes) {
  if (!isIndex(mesh, meshes)) return "has a rectangle but no mesh";
  if (!isIndex(page, pages)) return `is on page ${page}, but the file has ${pages.length}`;
  if (!isPair(offset) || !isPair(scale)) return "has no offset and scale of two numbers each";
  const surfaces = meshes[mesh].primitives.filter(({ mode }) => TRIANGLES.includes(mode));
  const set = `TEXCOORD_${texCoord}`;
  const known = Number.isInteger(texCoord) && surfaces.every(({ attributes }) => set in attributes);
  return known ? null : `has a mesh without ${set}`;
}

function isIndex(value, list) {
  return Number.isInteger(value) && value >= 0 && value < (list?.length ?? 0);
}

function isPair(value) {
  return Array.isArray(value) && value.length === 2 && value.every(Number.isFinite);
}

/** Takes what `bind` mirrors out of `extras.luxel`. */
function dropMirror(owner) {
  const { luxel } = owner.getExtras();
  if (luxel?.lightmap) owner.setExtras({ ...owner.getExtras(), luxel: { ...luxel, lightmap: undefined } });
}

/** Puts the extension in place, and into the mirror in `extras.luxel` where there is one. */
function bind(owner, definition) {
  owner.extensions = { ...owner.extensions, [NAME]: definition };
  if (owner.extras?.luxel?.lightmap) owner.extras.luxel.lightmap = definition;
}
