// What the tests stand on: luxel's bakes in a temporary folder, the viewer in headless Chromium, pixels of PNG files.

import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";
import { serve } from "../../viewer/serve.mjs";

export const ASSETS = new URL("../../../assets/", import.meta.url).pathname;
const { LUXEL, CHROMIUM = "/usr/bin/chromium" } = process.env;
/** Software rendering, the same on every machine; screenshots in sRGB. */
const FLAGS = [
  "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--force-color-profile=srgb",
];

/** Bakes into `folder`; the file's name and the exposure of its preview. */
export function bake(folder, scene, name, ...options) {
  if (!LUXEL || !existsSync(LUXEL)) throw new Error("LUXEL must name the luxel program: LUXEL=target/release/luxel npm test");
  const files = ["-o", join(folder, name), "--preview", join(folder, `${name}.png`)];
  const summary = execFileSync(LUXEL, ["bake", scene, ...files, "--quiet", ...options], { encoding: "utf8" });
  return { name, exposure: Number(/^preview .*exposure (\S+)$/m.exec(summary)[1]) };
}

/** A folder for one file of tests, served, and a browser; `close` takes all of it away. */
export async function bench() {
  const folder = mkdtempSync(join(tmpdir(), "luxel-three-"));
  const { server, url } = await serve(folder);
  const browser = await chromium.launch({ executablePath: CHROMIUM, args: FLAGS });
  let views = 0;
  const close = async () => {
    await browser.close();
    server.close();
    if (process.env.KEEP) console.log(`kept: ${folder}`);
    else rmSync(folder, { recursive: true });
  };

  /** Opens the viewer, lets `act` on the page: its pixels, what the console and the viewer said. */
  async function view(parameters, { width, height }, act = async () => {}) {
    const page = await browser.newPage({ viewport: { width, height } });
    const said = [];
    page.on("console", (message) => said.push(`${message.type()}: ${message.text()}`));
    page.on("pageerror", (error) => said.push(`exception: ${error.message}`));
    const { file, ...others } = parameters;
    const address = { bare: 1, ...others, ...(file && { file: `/scenes/${file}` }) };
    await page.goto(`${url}/viewer/?${new URLSearchParams(address)}`);
    await settled(page);
    await act(page);
    const png = await page.screenshot();
    if (process.env.KEEP) writeFileSync(join(folder, `view${++views}.${file}.png`), png);
    const status = await page.textContent("#status");
    const pixels = await decode(page, png);
    await page.close();
    return { pixels, said, status };
  }

  /** Pixels of a PNG file in the folder. */
  async function png(name) {
    const page = await browser.newPage();
    const pixels = await decode(page, readFileSync(join(folder, name)));
    await page.close();
    return pixels;
  }

  return { folder, url, view, png, close };
}

/** Waits until the viewer shows what it was asked for, or says why not. */
export async function settled(page) {
  await page.waitForFunction(() => ["ready", "failed"].includes(document.body.dataset.state));
}

/** Width, height and RGBA bytes of a PNG: the browser has a decoder. */
async function decode(page, bytes) {
  const { width, height, data } = await page.evaluate(async (base64) => {
    const blob = await (await fetch(`data:image/png;base64,${base64}`)).blob();
    const image = await createImageBitmap(blob, { colorSpaceConversion: "none" });
    const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    let text = "";
    for (let at = 0; at < data.length; at += 0x8000) text += String.fromCharCode(...data.subarray(at, at + 0x8000));
    return { width: image.width, height: image.height, data: btoa(text) };
  }, bytes.toString("base64"));
  return { width, height, data: Buffer.from(data, "base64") };
}
