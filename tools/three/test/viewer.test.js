// The viewer's own: looks, the unbaked scene beside, files by choice and by drop, walking, what it says to nonsense.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { ASSETS, bake, bench, settled } from "./bench.js";

const SIZE = { width: 480, height: 270 };
/** On the back wall of the Cornell box, which is white. */
const WALL = [205, 100];
const WHITE = [0.725, 0.71, 0.68];

let stand;
let scene;
before(async () => {
  stand = await bench();
  scene = bake(stand.folder, `${ASSETS}cornell.glb`, "cornell.gltf", "--resolution", "128", "--rays", "16");
});
after(() => stand.close());

/** The viewer's picture of the Cornell box, and of its back wall. */
async function seen(parameters = {}, act) {
  const all = { file: scene.name, exposure: scene.exposure / 2, gloss: 0, ...parameters };
  const { pixels, said, status } = await stand.view(all, SIZE, act);
  assert.deepEqual(said, []);
  const at = 4 * (WALL[1] * pixels.width + WALL[0]);
  return { pixels, status, wall: [...pixels.data.subarray(at, at + 3)].map(linear) };
}

function linear(level) {
  const c = level / 255;
  return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
}

const near = (a, b) => a.every((x, i) => Math.abs(x / b[i] - 1) < 0.03);

test("the lightmap alone is the light on white, base colours are themselves", async () => {
  const [lit, light, albedo] = [await seen(), await seen({ look: "lightmap" }), await seen({ look: "albedo" })];
  assert.ok(near(lit.wall, light.wall.map((e, i) => e * WHITE[i])), `${lit.wall} ${light.wall}`);
  assert.ok(near(albedo.wall, WHITE), `${albedo.wall}`);
});

test("exposure is a factor", async () => {
  const [once, half] = [await seen(), await seen({ exposure: scene.exposure / 4 })];
  assert.ok(near(half.wall, once.wall.map((x) => x / 2)));
});

test("the texel grid darkens and lightens", async () => {
  const [plain, grid] = [await seen({ look: "lightmap" }), await seen({ look: "lightmap", texels: 1 })];
  const changed = { darker: 0, lighter: 0 };
  plain.pixels.data.forEach((level, at) => {
    if (grid.pixels.data[at] > level) changed.lighter++;
    if (grid.pixels.data[at] < level) changed.darker++;
  });
  assert.ok(changed.darker > 10000 && changed.lighter > 10000, JSON.stringify(changed));
});

test("pictures of luxel inspect are shown where luxel says that they belong", async () => {
  const { file, exposure, ...rest } = { file: scene.name, exposure: 1, look: "inspection", antialias: 0 };
  execFileSync(process.env.LUXEL, ["inspect", join(stand.folder, file), "-o", join(stand.folder, "seen"), "--points", "100", "--quiet"]);
  const parameters = { ...rest, inspection: "/scenes/seen/page{page}.charts.png" };
  const { pixels } = await stand.view({ file, exposure, ...parameters }, { width: 960, height: 540 });
  const view = await stand.png("seen/view.charts.png");
  // The view is shaded, so channels are compared by their share.
  const share = ({ data }, at) => [0, 1, 2].map((k) => linear(data[at + k]) / (linear(data[at]) + linear(data[at + 1]) + linear(data[at + 2])));
  let [same, all] = [0, 0];
  for (let at = 0; at < view.data.length; at += 4) {
    if (view.data[at] + view.data[at + 1] + view.data[at + 2] < 60) continue;
    all++;
    const b = share(view, at);
    if (share(pixels, at).every((x, k) => Math.abs(x - b[k]) < 0.02)) same++;
  }
  assert.ok(all > 100000 && same / all > 0.98, `${same} of ${all}`);
});

test("of several pictures that are dropped one is chosen", async () => {
  const inspection = "/scenes/seen/page{page}.receivers.png";
  const linked = await seen({ look: "inspection", inspection });
  const { pixels } = await seen({}, async (page) => {
    const names = ["charts", "receivers"].map((name) => join(stand.folder, `seen/page0.${name}.png`));
    await page.setInputFiles("input[type=file]", names);
    // The form is there, but bare.
    await page.selectOption("select[name=picture]", "receivers", { force: true });
    await page.waitForTimeout(500);
  });
  assert.ok(pixels.data.equals(linked.pixels.data));
  assert.ok(!pixels.data.equals((await seen()).pixels.data));
});

test("pictures of one file are not shown on another", async () => {
  const files = ["cornell.gltf", "cornell.bin", "cornell.page0.exr"].map((name) => join(stand.folder, name));
  const inspection = "/scenes/seen/page{page}.charts.png";
  const choose = async (page, names) => {
    await page.setInputFiles("input[type=file]", names);
    await settled(page);
  };
  const lookAt = async (page) => {
    await page.selectOption("select[name=look]", "inspection", { force: true });
    await page.waitForTimeout(500);
  };
  const lit = (await seen()).pixels.data;
  const linked = { look: "inspection", inspection };
  // Over a file with pictures, linked or chosen: its light is shown, and there are no pictures to look at.
  assert.ok((await seen(linked, (page) => choose(page, files))).pixels.data.equals(lit));
  const pictures = [join(stand.folder, "seen/page0.charts.png")];
  const after = await seen({}, async (page) => {
    await choose(page, [...files, ...pictures]);
    await choose(page, files);
    await lookAt(page);
    assert.ok(await page.$eval("select[name=picture]", (select) => select.parentElement.hidden));
  });
  const dark = await seen({}, lookAt);
  assert.ok(after.pixels.data.equals(dark.pixels.data) && !dark.pixels.data.equals(lit));
  // Those that come with it are.
  const charts = (await seen(linked)).pixels.data;
  assert.ok((await seen({}, (page) => choose(page, [...files, ...pictures]))).pixels.data.equals(charts));
});

test("the unbaked scene stands to the right, under an even light if it has none", async () => {
  const { pixels } = await seen({ compare: 1 });
  const at = (x, y) => [...pixels.data.subarray(4 * (y * pixels.width + x), 4 * (y * pixels.width + x) + 3)];
  // Below the lamp and far from it: the even light has no gradient.
  const [left, right] = [0, 240].map((start) => [at(start + 90, 70), at(start + 90, 190)]);
  assert.notDeepEqual(left[0], left[1]);
  assert.deepEqual(right[0], right[1]);
  assert.ok(right[0][0] > 20);
});

test("a .gltf with its files can be chosen, and dropped", async () => {
  const names = ["cornell.gltf", "cornell.bin", "cornell.page0.exr"];
  copyFileSync(`${ASSETS}cornell.glb`, join(stand.folder, "unbaked.glb"));
  const linked = await seen();
  const choose = async (page) => {
    await page.setInputFiles("input[type=file]", names.map((name) => join(stand.folder, name)));
    await settled(page);
  };
  const drop = async (page) => {
    const files = names.map((name) => ({ name, base64: readFileSync(join(stand.folder, name)).toString("base64") }));
    const data = await page.evaluateHandle((files) => {
      const transfer = new DataTransfer();
      for (const { name, base64 } of files) {
        transfer.items.add(new File([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], name));
      }
      return transfer;
    }, files);
    await page.dispatchEvent("body", "drop", { dataTransfer: data });
    await settled(page);
  };
  for (const act of [choose, drop]) {
    // Over another scene, which is put away.
    const opened = await seen({ file: "unbaked.glb" }, act);
    assert.match(opened.status, /^cornell\.gltf: full light, pages 128 x 128, 0 lights off$/);
    assert.ok(opened.pixels.data.equals(linked.pixels.data));
  }
});

test("one walks with W and looks around by dragging", async () => {
  const still = await seen();
  const walked = await seen({}, async (page) => {
    await page.keyboard.down("KeyW");
    await page.waitForTimeout(300);
    await page.keyboard.up("KeyW");
  });
  const turned = await seen({}, async (page) => {
    await page.mouse.move(300, 200);
    await page.mouse.down();
    await page.mouse.move(350, 200);
    await page.mouse.up();
    await page.waitForTimeout(200);
  });
  assert.ok(!walked.pixels.data.equals(still.pixels.data) && !turned.pixels.data.equals(still.pixels.data));
});

test("nonsense is named", async () => {
  writeFileSync(join(stand.folder, "nonsense.glb"), "no scene");
  const { status } = await stand.view({ file: "nonsense.glb" }, SIZE);
  assert.match(status, /^nonsense\.glb cannot be opened: .+/);
  const missing = await stand.view({ file: "nothing.glb" }, SIZE);
  assert.match(missing.status, /^nothing\.glb cannot be opened: .*404/);
});
