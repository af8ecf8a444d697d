// What the plugin does to a scene, and what it says about files that are broken. No browser: three.js loads in Node.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { DataUtils, FloatType, HalfFloatType } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { LuxelLightmap } from "luxel-three";
import { ASSETS, bake } from "./bench.js";
import { readGlb, toGlb } from "./glb.js";

const EXTENSION = "LUXEL_lightmap";
const EFFORT = ["--resolution", "128", "--rays", "4"];

let folder;
before(() => {
  folder = mkdtempSync(join(tmpdir(), "luxel-three-"));
  bake(folder, `${ASSETS}room.glb`, "room.glb", ...EFFORT);
  bake(folder, `${ASSETS}cornell.glb`, "cornell.glb", ...EFFORT);
  bake(folder, `${ASSETS}cornell.glb`, "float.glb", ...EFFORT, "--float");
  // More than halves can hold.
  bake(folder, `${ASSETS}cornell.glb`, "sunny.glb", ...EFFORT, "--float", "--sun", "0,30,1e6");
});
after(() => rmSync(folder, { recursive: true }));

/** Loads a baked file of the folder after `change`d its JSON, and collects the warnings. */
async function load(name, change = () => {}, options = {}) {
  const glb = readGlb(join(folder, name));
  // Node has no images.
  glb.json.materials.forEach((material) => delete material.pbrMetallicRoughness?.baseColorTexture);
  change(glb.json, glb.bin);
  const loader = new GLTFLoader().register((parser) => new LuxelLightmap(parser, options));
  const warnings = [];
  const { warn } = console;
  console.warn = (...words) => warnings.push(words.join(" "));
  try {
    const gltf = await loader.parseAsync(toGlb(glb), "");
    return { gltf, json: glb.json, lightmap: gltf.parser.plugins[EXTENSION], warnings };
  } finally {
    console.warn = warn;
  }
}

function meshes(gltf) {
  const found = [];
  gltf.scene.traverse((object) => object.isMesh && found.push(object));
  return found;
}

test("each node sees its rectangle, on its channel, from the top", async () => {
  const { gltf, json, lightmap, warnings } = await load("room.glb");
  assert.deepEqual(warnings, []);
  assert.equal(lightmap.problem, null);
  let lit = 0;
  for (const [index, node] of json.nodes.entries()) {
    const place = node.extensions?.[EXTENSION];
    if (!place) continue;
    const object = await gltf.parser.getDependency("node", index);
    object.traverse((mesh) => {
      if (!mesh.isMesh) return;
      const { lightMap, lightMapIntensity } = mesh.material;
      assert.equal(lightMap.channel, place.texCoord);
      assert.equal(lightMapIntensity, lightmap.pages[place.page].scale);
      assert.equal(lightMap.source, lightmap.pages[place.page].texture.source, "one picture on the GPU");
      assert.ok(mesh.geometry.attributes.uv1);
      lightMap.updateMatrix();
      // The corners of the rectangle: v counts from the top in the file, from the bottom in the picture.
      for (const [u, v] of [[0, 0], [1, 0], [0, 1]]) {
        const [x, y] = [place.offset[0] + place.scale[0] * u, place.offset[1] + place.scale[1] * v];
        const [m0, m1, , m3, m4, , m6, m7] = lightMap.matrix.elements;
        assert.ok(Math.abs(m0 * u + m3 * v + m6 - x) < 1e-6 && Math.abs(m1 * u + m4 * v + m7 - (1 - y)) < 1e-6);
      }
      lit++;
    });
  }
  assert.ok(lit > 30);
});

test("materials are shared where lightmaps agree, and only there", async () => {
  const { gltf } = await load("room.glb");
  const byMaterial = Map.groupBy?.(meshes(gltf), (mesh) => mesh.material)
    ?? meshes(gltf).reduce((map, mesh) => map.set(mesh.material, [...(map.get(mesh.material) ?? []), mesh]), new Map());
  assert.ok([...byMaterial.values()].some((users) => users.length > 1), "walls and ceiling are one plaster");
  const chairs = meshes(gltf).filter((mesh) => mesh.name.startsWith("Chair"));
  assert.equal(chairs.length, 2);
  assert.equal(chairs[0].geometry, chairs[1].geometry);
  assert.notEqual(chairs[0].material, chairs[1].material);
});

test("baked lights shine no more, and what hangs on them is still seen", async () => {
  const attach = (json) => {
    const [light] = json.extensions[EXTENSION].bakedLights;
    json.nodes[light].children = [json.nodes.push({ name: "hung", mesh: 0 }) - 1];
  };
  const { gltf, lightmap } = await load("room.glb", attach);
  const lights = [];
  gltf.scene.traverse((object) => object.isLight && lights.push(object));
  assert.equal(lights.length, 1);
  assert.deepEqual(lightmap.bakedLights, lights);
  assert.equal(lights[0].layers.mask, 0);
  assert.ok(lights[0].visible && gltf.scene.getObjectByName("hung").layers.mask === 1);
});

test("unlit materials stay unlit", async () => {
  const unlit = (json) => {
    json.materials[1].extensions = { KHR_materials_unlit: {} };
    json.extensionsUsed.push("KHR_materials_unlit");
  };
  const { gltf } = await load("cornell.glb", unlit);
  const basic = meshes(gltf).filter((mesh) => mesh.material.isMeshBasicMaterial);
  assert.ok(basic.length > 0 && basic.every((mesh) => !mesh.material.lightMap));
  assert.ok(meshes(gltf).some((mesh) => mesh.material.lightMap));
});

test("a file without a lightmap loads as ever", async () => {
  const { gltf, lightmap, warnings } = await load("cornell.glb", (json) => delete json.extensions);
  assert.deepEqual(warnings, []);
  assert.ok(lightmap.problem === null && lightmap.pages.length === 0);
  assert.ok(meshes(gltf).every((mesh) => !mesh.material.lightMap));
});

const texels = ({ lightmap: { pages: [{ texture, scale }] } }) => {
  const value = texture.type === FloatType ? (x) => x : DataUtils.fromHalfFloat;
  return Array.from(texture.image.data.filter((_, i) => i % 4 < 3), (x) => value(x) * scale);
};
const within = (ours, truth) => ours.every((x, i) => Math.abs(x - truth[i]) <= Math.abs(truth[i]) / 1024 + 1e-6);

test("pages of halves and of floats hold the same light", async () => {
  const [half, float] = [await load("cornell.glb"), await load("float.glb")];
  assert.equal(half.lightmap.pages[0].texture.type, HalfFloatType);
  assert.equal(float.lightmap.pages[0].texture.type, FloatType);
  assert.ok(within(texels(half), texels(float)));
});

test("floats become halves on demand, scaled where they are too large", async () => {
  const [float, half] = [await load("sunny.glb"), await load("sunny.glb", undefined, { halfFloat: true })];
  const { texture, scale } = half.lightmap.pages[0];
  assert.equal(texture.type, HalfFloatType);
  assert.ok(scale > 1 && Number.isInteger(Math.log2(scale)));
  assert.ok(within(texels(half), texels(float)));
  assert.deepEqual(half.warnings, []);
});

const root = (change) => (json, bin) => change(json.extensions[EXTENSION], json, bin);
const node = (change) => (json) => change(json.nodes[0].extensions[EXTENSION]);
const view = (json) => json.bufferViews[json.extensions[EXTENSION].pages[0].bufferView];
const PROBLEMS = [
  ["pages are no list", root((map) => (map.pages = {})), /lists no pages/],
  ["a page that is nothing", root((map) => (map.pages[0] = null)), /page 0 has to be in a bufferView/],
  ["no place", root((map) => delete map.pages[0].bufferView), /page 0 has to be in a bufferView/],
  ["two places", root((map) => (map.pages[0].uri = "none.exr")), /page 0 has to be in a bufferView/],
  ["no such buffer view", root((map) => (map.pages[0].bufferView = 999)), /page 0 has to be in a bufferView/],
  ["half a picture", root((map, json) => (view(json).byteLength >>= 1)), /page 0 \(bufferView \d+\) is not a whole EXR/],
  ["another encoding", root((map) => (map.pages[0].encoding = "radiance")), /page 0 holds radiance/],
  ["no scale", root((map) => delete map.pages[0].scale), /page 0 has the scale undefined/],
  ["a wrong size", root((map) => (map.pages[0].width = 129)), /page 0 \(bufferView \d+\) is 128 x 128, not 129 x 128/],
  ["no picture", root((map, json, bin) => bin.fill(0, view(json).byteOffset)), /page 0 \(bufferView \d+\) is not a whole EXR/],
  ["no such page", node((place) => (place.page = 7)), /node 0 \(Floor\) is on page 7, but the file has 1/],
  ["a page that is no number", node((place) => (place.page = "length")), /node 0 \(Floor\) is on page length/],
  ["no such set", node((place) => (place.texCoord = 2)), /node 0 \(Floor\) has a mesh without TEXCOORD_2/],
  ["a set three cannot read", node((place) => (place.texCoord = 4)), /TEXCOORD_4; three\.js reads/],
  ["no mesh", (json) => delete json.nodes[0].mesh, /node 0 \(Floor\) has a rectangle but no mesh/],
  ["no rectangle", node((place) => delete place.offset), /node 0 \(Floor\) has no offset and scale/],
];

for (const [name, change, line] of PROBLEMS) {
  test(`a broken file is named in one line and shown unlit: ${name}`, async () => {
    const { gltf, lightmap, warnings } = await load("cornell.glb", change);
    assert.equal(warnings.length, 1);
    assert.match(warnings[0], line);
    assert.match(warnings[0], /^LUXEL_lightmap: [^\n]*; the scene is shown without its lightmap$/);
    assert.ok(warnings[0].includes(lightmap.problem));
    assert.equal(lightmap.pages.length, 0);
    assert.ok(meshes(gltf).length > 0 && meshes(gltf).every((mesh) => !mesh.material.lightMap));
  });
}

test("the lights of a broken file shine", async () => {
  const { gltf, lightmap } = await load("room.glb", root((map) => (map.pages[0].width = 1)));
  assert.deepEqual(lightmap.bakedLights, []);
  gltf.scene.traverse((object) => assert.equal(object.layers.mask, 1));
});

test("a truncated page is found wherever it ends", async () => {
  const whole = view(readGlb(join(folder, "cornell.glb")).json).byteLength;
  for (let length = 0; length < whole; length += 499) {
    const { lightmap, warnings } = await load("cornell.glb", (json) => (view(json).byteLength = length));
    assert.equal(warnings.length, 1, `${length} of ${whole} bytes`);
    assert.match(lightmap.problem, /is not a whole EXR picture/);
  }
  const { lightmap } = await load("cornell.glb", (json) => (view(json).byteLength = whole - 1));
  assert.match(lightmap.problem, /is not a whole EXR picture/);
});
