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
}

/** What is wrong with a lightmap, in one line. Pages beside the file are not looked at: glTF-Transform does not read them. */
function problemOf(json, bufferViews) {
  const { pages, bakedLights = [] } = json.extensions[NAME];
  if (!Array.isArray(pages)) return "the file lists no pages";
  for (const [index, page] of pages.entries()) {
    const { bufferView, uri, width, height } = page ?? {};
    const known = bufferView === undefined ? typeof uri === "string" : uri === undefined && bufferViews[bufferView];
    if (!known) return `page ${index} has to be in a bufferView of the file or at a uri`;
    if (uri !== undefined) continue;
    const size = sizeOf(bufferViews[bufferView]);
    if (!size) return `page ${index} is not a whole EXR picture`;
    if (size[0] !== width || size[1] !== height) return `page ${index} is ${size.join(" x ")}, not ${width} x ${height}`;
  }
  const nodes = json.nodes ?? [];
  for (const [index, node] of nodes.entries()) {
    const place = node.extensions?.[NAME];
    if (!place || (Number.isInteger(place.page) && pages[place.page])) continue;
    return `node ${index} (${node.name}) is on page ${place.page}, but the file has ${pages.length}`;
  }
  if (!Array.isArray(bakedLights) || !bakedLights.every((light) => nodes[light])) return "its bakedLights are no nodes of the file";
  return null;
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
