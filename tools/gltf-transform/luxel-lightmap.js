// Lightmaps of luxel (LUXEL_lightmap) in glTF-Transform: without it they are lost on the first write.
//
//   import { NodeIO } from "@gltf-transform/core";
//   import { LuxelLightmap } from "luxel-gltf-transform";
//
//   const io = new NodeIO().registerExtensions([...ALL_EXTENSIONS, LuxelLightmap]);

import { Extension, ExtensionProperty, PropertyType, RefList } from "@gltf-transform/core";

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
    const graph = this.document.getGraph();
    const lightmap = new Lightmap(graph);
    lightmap.set("definition", definition);
    lightmap.set("pictures", (definition.pages ?? []).map(({ bufferView }) => context.bufferViews[bufferView] ?? null));
    for (const index of definition.bakedLights ?? []) {
      if (context.nodes[index]) lightmap.addRef("bakedLights", context.nodes[index]);
    }
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

/** Puts the extension in place, and into the mirror in `extras.luxel` where there is one. */
function bind(owner, definition) {
  owner.extensions = { ...owner.extensions, [NAME]: definition };
  if (owner.extras?.luxel?.lightmap) owner.extras.luxel.lightmap = definition;
}
