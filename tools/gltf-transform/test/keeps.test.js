// What survives glTF-Transform with the extension and without it, and what gltfpack leaves.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { NodeIO } from "@gltf-transform/core";
import { ALL_EXTENSIONS } from "@gltf-transform/extensions";
import { dedup, prune, quantize, unpartition } from "@gltf-transform/functions";
import { LuxelLightmap } from "luxel-gltf-transform";
import { sizeOf } from "../picture.js";

const { LUXEL } = process.env;
const ASSETS = new URL("../../../assets/", import.meta.url).pathname;
const NAME = "LUXEL_lightmap";
const silent = { debug() {}, info() {}, warn() {}, error() {} };

let folder;
let baked;
before(() => {
  if (!LUXEL) throw new Error("LUXEL must name the luxel program: LUXEL=target/release/luxel npm test");
  folder = mkdtempSync(join(tmpdir(), "luxel-gltf-transform-"));
  baked = join(folder, "room.glb");
  execFileSync(LUXEL, ["bake", `${ASSETS}room.glb`, "-o", baked, "--resolution", "128", "--rays", "8", "--quiet"], { stdio: "pipe" });
});
after(() => rmSync(folder, { recursive: true }));

const io = (...extensions) => new NodeIO().setLogger(silent).registerExtensions([...ALL_EXTENSIONS, ...extensions]);

/** JSON and binary chunk. */
function open(file) {
  const bytes = readFileSync(file);
  const length = bytes.readUInt32LE(12);
  return { json: JSON.parse(bytes.subarray(20, 20 + length)), bin: bytes.subarray(28 + length) };
}

/** Each lit node by its name: its place and the corners of its coordinates on the page. */
function places({ json }) {
  const lit = json.nodes.filter((node) => node.extensions?.[NAME]);
  return lit.map((node) => ({ name: node.name, ...node.extensions[NAME] })).sort((a, b) => (a.name < b.name ? -1 : 1));
}

function page({ json, bin }) {
  const { byteOffset = 0, byteLength } = json.bufferViews[json.extensions[NAME].pages[0].bufferView];
  return bin.subarray(byteOffset, byteOffset + byteLength);
}

const lamps = ({ json }) => json.extensions[NAME].bakedLights.map((index) => json.nodes[index].name);

function assertKept(file) {
  const [before, after] = [open(baked), open(file)];
  assert.ok(page(after).equals(page(before)), "the page's bytes");
  assert.deepEqual(places(after), places(before));
  assert.deepEqual(lamps(after), lamps(before));
  assert.ok(lamps(after).length > 0);
  assert.ok(after.json.extensionsUsed.includes(NAME));
  assert.ok(!after.json.extensionsRequired?.includes(NAME));
  for (const node of after.json.nodes.filter((node) => node.extensions?.[NAME])) {
    assert.deepEqual(node.extras.luxel.lightmap, node.extensions[NAME]);
    for (const { attributes } of after.json.meshes[node.mesh].primitives) assert.ok("TEXCOORD_1" in attributes);
  }
  assert.deepEqual(after.json.extras.luxel.lightmap, after.json.extensions[NAME]);
}

async function written(name, ...transforms) {
  const document = await io(LuxelLightmap).read(baked);
  await document.setLogger(silent).transform(...transforms);
  const file = join(folder, name);
  await io(LuxelLightmap).write(file, document);
  return file;
}

test("a file that is read and written keeps its lightmap", async () => assertKept(await written("same.glb")));

/** The baked file after `change`d its JSON. */
function broken(change) {
  const { json, bin } = open(baked);
  change(json.extensions[NAME], json, bin);
  const text = Buffer.from(JSON.stringify(json));
  const head = Buffer.alloc(20);
  const padded = Buffer.concat([text, Buffer.alloc(-text.length & 3, " ")]);
  head.write("glTF");
  [2, 28 + padded.length + bin.length, padded.length].forEach((number, i) => head.writeUInt32LE(number, 4 + 4 * i));
  head.write("JSON", 16);
  const binHead = Buffer.alloc(8);
  binHead.writeUInt32LE(bin.length);
  binHead.write("BIN\0", 4);
  return Buffer.concat([head, padded, binHead, bin]);
}

const view = (map, json) => json.bufferViews[map.pages[0].bufferView];
const lit = (json) => json.nodes.find((node) => node.extensions?.[NAME]);
const placed = (json) => lit(json).extensions[NAME];
const PROBLEMS = [
  ["no pages", (map) => (map.pages = {}), "the file lists no pages"],
  ["a missing page", (map) => (map.pages[0].bufferView = 999), "page 0 has to be in a bufferView of the file or at a uri"],
  ["two places", (map) => (map.pages[0].uri = "none.exr"), "page 0 has to be in a bufferView of the file or at a uri"],
  ["a truncated page", (map, json) => (view(map, json).byteLength -= 1), "page 0 is not a whole EXR picture"],
  ["another picture", (map, json, bin) => bin.fill(0, view(map, json).byteOffset), "page 0 is not a whole EXR picture"],
  ["a wrong size", (map) => (map.pages[0].width = 129), "page 0 is 128 x 128, not 129 x 128"],
  ["another encoding", (map) => (map.pages[0].encoding = "radiance"), "page 0 holds radiance, not irradiance"],
  ["no scale", (map) => delete map.pages[0].scale, "page 0 has the scale undefined"],
  ["a scale of nothing", (map) => (map.pages[0].scale = 0), "page 0 has the scale 0"],
  ["no rectangle", (map, json) => delete placed(json).offset, "has no offset and scale of two numbers each"],
  ["half a rectangle", (map, json) => (placed(json).scale = [1]), "has no offset and scale of two numbers each"],
  ["no such set", (map, json) => (placed(json).texCoord = 5), "has a mesh without TEXCOORD_5"],
  ["a set that is no number", (map, json) => (placed(json).texCoord = "1"), "has a mesh without TEXCOORD_1"],
  ["no mesh", (map, json) => delete lit(json).mesh, "has a rectangle but no mesh"],
  ["a view that is no number", (map) => (map.pages[0].bufferView = "length"), "page 0 has to be in a bufferView of the file or at a uri"],
  ["no such page", (map, json) => (placed(json).page = 7), "is on page 7, but the file has 1"],
  ["no such lamp", (map) => (map.bakedLights = [999]), "its bakedLights are no nodes of the file"],
];
for (const [name, change, problem] of PROBLEMS) {
  test(`a lightmap that is broken is left out, and one line says why: ${name}`, async () => {
    const said = [];
    const reader = io(LuxelLightmap).setLogger({ ...silent, warn: (line) => said.push(line) });
    const file = join(folder, "broken.glb");
    await reader.write(file, await reader.readBinary(broken(change)));
    assert.equal(said.length, 1);
    assert.ok(said[0].startsWith(`${NAME}: `) && said[0].includes(problem) && !said[0].includes("\n"), said[0]);
    const { json } = open(file);
    assert.ok(!JSON.stringify(json).includes("lightmap"));
    assert.ok(json.meshes.length > 0 && json.nodes.some((node) => node.extensions?.KHR_lights_punctual));
  });
}

test("a file that names no lamps has none", async () => {
  const reader = io(LuxelLightmap);
  const document = await reader.readBinary(broken((map) => delete map.bakedLights));
  assert.deepEqual(document.getRoot().getExtension(NAME).listBakedLights(), []);
});

test("a page is whole or it is not, wherever it ends", () => {
  const whole = Uint8Array.from(page(open(baked)));
  assert.deepEqual(sizeOf(whole), [128, 128]);
  for (let length = 0; length < whole.length; length += 97) assert.equal(sizeOf(whole.subarray(0, length)), null);
  assert.equal(sizeOf(whole.subarray(0, -1)), null);
  const packed = Buffer.from(whole);
  packed[packed.indexOf("compression\0compression\0") + 28] = 9;
  assert.equal(sizeOf(packed), null);
});

test("nodes may move: lamps are found by what they are", async () => {
  const drop = (document) => {
    const spare = document.createNode("first");
    document.getRoot().listScenes()[0].addChild(spare);
    document.getRoot().listNodes().find((node) => !node.getExtension(NAME) && !node.listChildren().length && !node.getCamera()
      && !node.getExtension("KHR_lights_punctual"))?.dispose();
  };
  assertKept(await written("moved.glb", drop));
});

test("dedup, prune and unpartition keep it, if attributes may stay", async () => {
  assertKept(await written("clean.glb", dedup(), prune({ keepAttributes: true, keepLeaves: true }), unpartition()));
});

test("prune by itself takes the coordinates away", async () => {
  const { json } = open(await written("pruned.glb", prune()));
  assert.ok(json.meshes.some(({ primitives }) => primitives.some(({ attributes }) => !("TEXCOORD_1" in attributes))));
});

test("quantized coordinates stay within a hundredth of a texel", async () => {
  const file = await written("quantized.glb", quantize({ quantizeTexcoord: 16, quantizePosition: 16 }));
  assertKept(file);
  const [before, after] = await Promise.all([baked, file].map((name) => io(LuxelLightmap).read(name)));
  const sets = (document) => document.getRoot().listMeshes().flatMap((mesh) => mesh.listPrimitives())
    .map((primitive) => primitive.getAttribute("TEXCOORD_1"));
  sets(before).forEach((exact, index) => {
    const rounded = sets(after)[index];
    for (let i = 0; i < exact.getCount(); i++) {
      exact.getElement(i, []).forEach((x, k) => assert.ok(Math.abs(x - rounded.getElement(i, [])[k]) * 128 < 0.01));
    }
  });
});

/** The baked file, whose first lit node has a child that is not lit, read with the extension. */
async function withChild() {
  const attach = (map, json) => (lit(json).children = [json.nodes.push({ name: "Ornament", mesh: lit(json).mesh }) - 1]);
  return io(LuxelLightmap).readBinary(broken(attach));
}

test("a lit node with a child keeps its light when it is quantized: the place follows the mesh", async () => {
  const document = await withChild();
  await document.setLogger(silent).transform(quantize({ quantizeTexcoord: 16 }));
  const file = join(folder, "parent.glb");
  // Twice: the document stays true.
  for (let times = 0; times < 2; times++) await io(LuxelLightmap).write(file, document);
  const [before, { json }] = [open(baked).json, open(file)];
  const parent = json.nodes.find(({ name }) => name === lit(before).name);
  assert.ok(!("mesh" in parent) && !parent.extensions?.[NAME] && !parent.extras.luxel.lightmap);
  const child = parent.children.map((index) => json.nodes[index]).find((node) => node.extensions?.[NAME]);
  assert.deepEqual(child.extensions[NAME], placed(before));
  assert.deepEqual(child.extras.luxel.lightmap, placed(before));
  assert.ok(child.mesh !== undefined && child.name !== "Ornament");
  assert.equal(places(open(file)).length, places(open(baked)).length);
  assert.ok(json.nodes.every((node) => !node.extensions?.[NAME] || "mesh" in node));
});

test("a lit node whose mesh is gone loses its light, and one line says so", async () => {
  const said = [];
  const document = (await withChild()).setLogger({ ...silent, warn: (line) => said.push(line) });
  const node = document.getRoot().listNodes().find((node) => node.getExtension(NAME)).setMesh(null);
  const file = join(folder, "bare.glb");
  await io(LuxelLightmap).write(file, document);
  assert.deepEqual(said, [`${NAME}: node ${node.getName()} has no mesh any more; its light is left out`]);
  assert.equal(places(open(file)).length, places(open(baked)).length - 1);
});

test("without the extension the lightmap is lost: the tests above mean something", async () => {
  const file = join(folder, "lost.glb");
  await io().write(file, await io().read(baked));
  const { json } = open(file);
  assert.equal(json.extensions?.[NAME], undefined);
  assert.ok(json.nodes.every((node) => !node.extensions?.[NAME]));
});

test("the README's lines take a Draco file to a baked one", () => {
  const run = (program, ...args) => execFileSync(program, args, { cwd: folder, stdio: "pipe" });
  const cli = new URL("../node_modules/.bin/gltf-transform", import.meta.url).pathname;
  run(cli, "draco", `${ASSETS}room.glb`, "in.glb");
  assert.deepEqual(open(join(folder, "in.glb")).json.extensionsRequired, ["KHR_draco_mesh_compression"]);
  const lines = readFileSync(new URL("../README.md", import.meta.url), "utf8").split("\n")
    .filter((line) => /^    (gltf-transform (?!ktx)|luxel bake )/.test(line)).map((line) => line.split("#")[0].trim().split(" "));
  assert.deepEqual(lines.map((words) => words[1]), ["copy", "optimize", "bake"]);
  for (const [program, ...args] of lines) {
    if (program === "luxel") run(LUXEL, ...args, "--resolution", "128", "--rays", "8", "--quiet");
    else run(cli, ...args);
  }
  const { json } = open(join(folder, "room.lit.glb"));
  assert.ok(json.nodes.some((node) => node.extensions?.[NAME]));
  assert.ok(!json.extensionsUsed.includes("KHR_draco_mesh_compression"));
});

test("gltfpack drops the lightmap whatever its flags: pack first, bake last", async () => {
  const packer = new URL("../node_modules/gltfpack/cli.js", import.meta.url).pathname;
  const pack = (source, target, ...flags) => execFileSync("node", [packer, "-i", source, "-o", target, ...flags], { stdio: "pipe" });
  const packed = join(folder, "packed.glb");
  pack(baked, packed, "-kn", "-km", "-ke", "-kv", "-noq");
  const { json } = open(packed);
  assert.equal(json.extensions?.[NAME], undefined);
  // Without compression and quantization luxel reads what it leaves.
  const lit = join(folder, "packed.lit.glb");
  pack(`${ASSETS}room.glb`, packed, "-noq", "-kn");
  execFileSync(LUXEL, ["bake", packed, "-o", lit, "--resolution", "128", "--rays", "8", "--quiet"], { stdio: "pipe" });
  assert.ok(places(open(lit)).length > 0);
});
