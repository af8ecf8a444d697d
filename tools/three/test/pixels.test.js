// The viewer shows what luxel's preview shows: rows, rectangles, channels, scale and three's arithmetic are right.

import assert from "node:assert/strict";
import { copyFileSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { ASSETS, bake, bench } from "./bench.js";
import { compare } from "./compare.js";
import { readGlb, toGlb } from "./glb.js";

/** Twice luxel's preview. */
const SIZE = { width: 1920, height: 1080 };
const EFFORT = ["--resolution", "256", "--rays", "16"];
/** Both pictures are rounded to eight bits, luxel's at the end, the viewer's before four pixels are averaged. */
const ROUNDING = { median: 0.5, p99: 1 };
/** Textures: three takes smaller versions of them at a distance, previews do not. */
const TEXTURED = { median: 0.5, p99: 3 };
/** The edges of shadows: texels of the bake against those of a shadow map. */
const SHADOWED = { median: 0.5, p99: 4 };
/** Not in the repository. */
const { ROOMS } = process.env;

let stand;
before(async () => (stand = await bench()));
after(() => stand.close());

/** The scene in the viewer against its preview, with a silent console. */
async function difference(t, { name, exposure }, parameters) {
  const { pixels, said } = await stand.view({ file: name, exposure, antialias: 0, ...parameters }, SIZE);
  assert.deepEqual(said, []);
  const found = compare(pixels, await stand.png(`${name}.png`));
  const figures = ["median", "p99", "largest", "mean"].map((key) => `${key} ${found[key].toFixed(2)}`);
  t.diagnostic(`${figures.join(", ")} levels, ${found.pixels} pixels`);
  assert.ok(found.pixels > 200000);
  return found;
}

function assertWithin({ median, p99 }, bounds) {
  assert.ok(median <= bounds.median && p99 <= bounds.p99, `median ${median}, 99th percentile ${p99}`);
}

test("the Cornell box, matt", async (t) => {
  const scene = bake(stand.folder, `${ASSETS}cornell.glb`, "cornell.glb", ...EFFORT);
  assertWithin(await difference(t, scene, { gloss: 0 }), ROUNDING);
});

test("the Cornell box with three's gloss: what would be mirrored is not reflected diffusely", async (t) => {
  const scene = bake(stand.folder, `${ASSETS}cornell.glb`, "glossy.glb", ...EFFORT);
  const found = await difference(t, scene, { gloss: 1 });
  assertWithin(found, { median: 3, p99: 5 });
  assert.ok(found.mean < -0.5 && found.mean > -3, `mean ${found.mean}`);
});

test("the room: instances, textures, masks, a lamp that is off, a page beside the file", async (t) => {
  const scene = bake(stand.folder, `${ASSETS}room.glb`, "room.gltf", ...EFFORT);
  assertWithin(await difference(t, scene, { gloss: 0 }), TEXTURED);
});

test("the room under a lamp that half floats cannot hold, in halves with a scale", async (t) => {
  const scene = bake(stand.folder, `${ASSETS}room.glb`, "bright.glb", ...EFFORT, "--light-scale", "1e6");
  assert.ok(readGlb(join(stand.folder, scene.name)).json.extensions.LUXEL_lightmap.pages[0].scale > 1);
  assertWithin(await difference(t, scene, { gloss: 0 }), TEXTURED);
});

test("the Cornell box in floats", async (t) => {
  const scene = bake(stand.folder, `${ASSETS}cornell.glb`, "float.glb", ...EFFORT, "--float");
  assertWithin(await difference(t, scene, { gloss: 0 }), ROUNDING);
});

test("1088 instances in 64 rooms", { skip: !ROOMS && "ROOMS does not name rooms_8x8_instances.glb" }, async (t) => {
  const camera = "5,1.6,5,8,1.4,8";
  const light = ["--sky", "1,1,1", "--resolution", "1024", "--rays", "4"];
  const scene = bake(stand.folder, ROOMS, "rooms.glb", ...light, "--camera", camera);
  assertWithin(await difference(t, scene, { gloss: 0, camera }), { median: 0.5, p99: 2 });
});

test("mixed light: the map's indirect light and a lamp drawn in real time are the full bake", async (t) => {
  const lamp = join(stand.folder, "lamp.glb");
  writeFileSync(lamp, Buffer.from(withLamp(`${ASSETS}cornell.glb`)));
  const full = bake(stand.folder, lamp, "full.glb", ...EFFORT);
  const mixed = bake(stand.folder, lamp, "mixed.glb", ...EFFORT, "--content", "indirect");
  copyFileSync(join(stand.folder, "full.glb.png"), join(stand.folder, "mixed.glb.png"));
  assertWithin(await difference(t, { ...mixed, exposure: full.exposure }, { gloss: 0 }), SHADOWED);

  // Without the lamp it is not the full bake: the lamp is in neither the map nor `bakedLights`.
  const dark = readGlb(join(stand.folder, mixed.name));
  dark.json.extensions.KHR_lights_punctual.lights[0].intensity = 0;
  writeFileSync(join(stand.folder, "dark.glb"), Buffer.from(toGlb(dark)));
  copyFileSync(join(stand.folder, "full.glb.png"), join(stand.folder, "dark.glb.png"));
  const without = await difference(t, { name: "dark.glb", exposure: full.exposure }, { gloss: 0 });
  assert.ok(without.median > 20 && without.mean < -20);
});

/** The scene with a bare lamp in the air. */
function withLamp(file) {
  const glb = readGlb(file);
  const { json } = glb;
  const light = json.nodes.push({
    name: "Lamp in the air", translation: [0.3, 2, 0.8], extensions: { KHR_lights_punctual: { light: 0 } },
  }) - 1;
  json.scenes[0].nodes.push(light);
  json.extensions = { KHR_lights_punctual: { lights: [{ type: "point", intensity: 1.5 }] } };
  json.extensionsUsed = [...(json.extensionsUsed ?? []), "KHR_lights_punctual"];
  return toGlb(glb);
}

test("a page that is missing: one line, and the unbaked scene", async () => {
  const { name } = bake(stand.folder, `${ASSETS}room.glb`, "missing.gltf", ...EFFORT);
  rmSync(join(stand.folder, "missing.page0.exr"));
  copyFileSync(`${ASSETS}room.glb`, join(stand.folder, "unbaked.glb"));
  const small = { width: 480, height: 270 };
  const { pixels, said, status } = await stand.view({ file: name, exposure: 1 }, small);
  assert.match(status, /^missing\.gltf: page 0 \(missing\.page0\.exr\) cannot be loaded: .*404.*; shown without its lightmap$/);
  const ours = said.filter((line) => line.includes("LUXEL_lightmap"));
  assert.equal(ours.length, 1);
  assert.match(ours[0], /^warning: /);
  // The other line is the browser's own, about the address.
  assert.ok(said.length === 2 && said.some((line) => /^error: Failed to load resource/.test(line)), said.join("\n"));
  const unbaked = await stand.view({ file: "unbaked.glb", exposure: 1 }, small);
  assert.ok(pixels.data.equals(unbaked.pixels.data));
});
