// The viewer: opens a baked file by drop, by choice or by ?file=URL, and shows its lightmap.
//
// Further parameters, for links and tests: camera (a name, or eye and target as X,Y,Z,X,Y,Z), exposure (the factor),
// look, tone, gloss, texels, compare (what the form has; 0 or 1 for boxes), inspection (the address of pictures by luxel
// inspect, {page} for the page's number), bare=1 (without the form), antialias=0.

import {
  AgXToneMapping, AmbientLight, Box3, LinearToneMapping, MathUtils, NeutralToneMapping, PerspectiveCamera, Scene,
  Vector3, WebGLRenderer,
} from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { LuxelLightmap } from "luxel-three";
import { exposureFor, meanIrradiance } from "./exposure.js";
import { inspect, inspectionsOf } from "./inspection.js";
import { applyLook, look } from "./look.js";
import { throwShadows } from "./shadows.js";
import { atUrl, ofFiles } from "./source.js";
import { Walk } from "./walk.js";

/** Vertical degrees of a camera given by eye and target: luxel's .9 radians. */
const FOV = MathUtils.radToDeg(0.9);
/** "none" is exposure alone, clipped. */
const TONES = { none: LinearToneMapping, AgX: AgXToneMapping, Neutral: NeutralToneMapping };

const parameters = new URLSearchParams(location.search);
const form = document.forms[0].elements;
const status = document.getElementById("status");
const antialias = parameters.get("antialias") !== "0";
const renderer = new WebGLRenderer({ canvas: document.querySelector("canvas"), antialias });
renderer.shadowMap.enabled = true;
const camera = new PerspectiveCamera(FOV);
const walk = new Walk(camera, renderer.domElement, draw);
/** What is open: where from, the lit scene, the unbaked one (once it is asked for), the mean irradiance. */
let open = null;
/** Pictures that were dropped, by what they show. */
let pictures = new Map();
let drawing = null;
let drawnAt = null;

/** Opens a scene, with the pictures that came with it: dropped ones, or those at an address. */
async function show(from, dropped = new Map(), address = null) {
  say(`Loading ${from.name} ...`);
  document.body.dataset.state = "loading";
  try {
    const gltf = await load(from, true);
    const lightmap = gltf.parser.plugins.LUXEL_lightmap;
    const irradiance = meanIrradiance(lightmap.pages);
    offer(dropped);
    const painted = address ? lightmap.pages.map((_, page) => [page, address.replace("{page}", page)]) : chosen();
    await inspect(painted);
    if (!painted.length && form.look.value === "inspection") form.look.value = "scene";
    for (const scene of [open?.lit, open?.unbaked]) discard(scene);
    open = { from, irradiance, lit: staged(gltf, irradiance), unbaked: null };
    lookThrough(gltf);
    expose(Number(parameters.get("exposure")) || exposureFor(irradiance ?? 1));
    say(summary(from, lightmap));
    await settle();
    await drawn();
    document.body.dataset.state = "ready";
  } catch (error) {
    document.body.dataset.state = "failed";
    say(`${from.name} cannot be opened: ${error.message}`);
  }
}

async function load({ url, manager }, baked) {
  const loader = new GLTFLoader(manager);
  if (baked) {
    const halfFloat = !renderer.extensions.has("OES_texture_float_linear");
    loader.register((parser) => new LuxelLightmap(parser, { halfFloat }));
  }
  return loader.loadAsync(url);
}

/** A scene to be drawn. One without any light gets an even one, as bright as the map is on average. */
function staged(gltf, irradiance) {
  const scene = new Scene().add(gltf.scene);
  const pages = gltf.parser.plugins.LUXEL_lightmap?.pages ?? [];
  let lights = pages.length > 0;
  scene.traverse((object) => {
    lights ||= object.isLight;
    for (const material of [object.material ?? []].flat()) {
      applyLook(material, pages.findIndex(({ texture }) => texture.source === material.lightMap?.source));
    }
  });
  throwShadows(scene, new Box3().setFromObject(scene));
  if (!lights) scene.add(new AmbientLight(0xffffff, irradiance ?? 1));
  return scene;
}

/** Frees what a scene holds on the GPU. */
function discard(scene) {
  scene?.traverse((object) => {
    object.geometry?.dispose();
    object.shadow?.dispose();
    for (const material of [object.material ?? []].flat()) {
      Object.values(material).forEach((value) => value?.isTexture && value.dispose());
      material.dispose();
    }
  });
}

function summary({ name }, { problem, pages, bakedLights }) {
  if (problem) return `${name}: ${problem}; shown without its lightmap`;
  if (!pages.length) return `${name} has no lightmap of luxel`;
  const sizes = pages.map(({ texture: { image } }) => `${image.width} x ${image.height}`);
  return `${name}: ${pages[0].content} light, pages ${sizes.join(", ")}, ${bakedLights.length} lights off`;
}

/** The camera that was asked for, the file's first, or one that shows the whole from a corner. */
function lookThrough(gltf) {
  const box = new Box3().setFromObject(gltf.scene);
  const diagonal = box.isEmpty() ? 1 : box.getSize(new Vector3()).length();
  const wish = parameters.get("camera") ?? "";
  const points = wish.split(",").map(Number);
  const named = gltf.parser.json.cameras?.findIndex(({ name }) => name === wish) ?? -1;
  const found = gltf.cameras[Math.max(named, 0)];
  camera.fov = FOV;
  if (points.length === 6 && points.every(Number.isFinite)) {
    camera.position.fromArray(points);
    camera.lookAt(...points.slice(3));
  } else if (found?.isPerspectiveCamera) {
    found.matrixWorld.decompose(camera.position, camera.quaternion, new Vector3());
    camera.fov = found.fov;
  } else {
    const middle = box.getCenter(new Vector3());
    camera.position.copy(middle).addScaledVector(new Vector3(0.5, 0.4, 0.75), diagonal);
    camera.lookAt(middle);
  }
  camera.near = diagonal / 5000;
  camera.far = diagonal * 10;
  walk.pace = diagonal / 6;
}

function expose(factor) {
  form.exposure.value = Math.log2(factor);
  open.exposure = factor;
}

/** What the form says, and only that, decides what is drawn. */
async function settle() {
  form.stops.value = `${Number(form.exposure.value).toFixed(1)} stops`;
  look.lightmapOnly.value = form.look.value === "lightmap";
  look.albedoOnly.value = form.look.value === "albedo";
  look.inspected.value = form.look.value === "inspection";
  look.gloss.value = form.gloss.checked;
  look.texelGrid.value = form.texels.checked;
  renderer.toneMapping = TONES[form.tone.value];
  if (!open) return;
  const { from } = open;
  if (form.compare.checked && !open.unbaked) {
    const unbaked = staged(await load(from, false), open.irradiance);
    if (open.from === from) open.unbaked = unbaked;
  }
  draw();
}

function draw() {
  drawing ??= requestAnimationFrame((now) => {
    drawing = null;
    const moving = walk.step(drawnAt ? (now - drawnAt) / 1000 : 0);
    drawnAt = moving ? now : null;
    if (open) drawNow();
    if (moving) draw();
  });
}

/** Resolves once what was asked for before is on the screen. */
function drawn() {
  return new Promise(requestAnimationFrame);
}

function drawNow() {
  const { clientWidth: width, clientHeight: height } = renderer.domElement;
  const views = form.compare.checked && open.unbaked ? [open.lit, open.unbaked] : [open.lit];
  // Base colours and pictures are no radiance.
  renderer.toneMappingExposure = look.albedoOnly.value || look.inspected.value ? 1 : open.exposure;
  renderer.setPixelRatio(devicePixelRatio);
  renderer.setSize(width, height, false);
  renderer.setScissorTest(true);
  camera.aspect = width / views.length / height;
  camera.updateProjectionMatrix();
  views.forEach((scene, index) => {
    const place = [(index * width) / views.length, 0, width / views.length, height];
    renderer.setViewport(...place);
    renderer.setScissor(...place);
    renderer.render(scene, camera);
  });
}

function say(text) {
  status.textContent = text;
}

function openFiles(list) {
  const from = ofFiles([...list]);
  const dropped = inspectionsOf([...list]);
  if (from) return show(from, dropped);
  if (!dropped.size) return say("No .glb or .gltf among these files.");
  offer(dropped);
  choosePicture();
}

/** Lets one choose among pictures of what is open. */
function offer(dropped) {
  pictures = dropped;
  form.picture.replaceChildren(...[...pictures.keys()].sort().map((name) => new Option(name)));
  form.picture.parentElement.hidden = !pictures.size;
  if (pictures.size) form.look.value = "inspection";
}

function chosen() {
  return pictures.get(form.picture.value) ?? [];
}

function choosePicture() {
  inspect(chosen()).then(settle).catch((error) => say(error.message));
}

addEventListener("resize", draw);
addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("over");
});
addEventListener("dragleave", () => document.body.classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  document.body.classList.remove("over");
  openFiles(event.dataTransfer.files);
});
form.files.addEventListener("change", () => openFiles(form.files.files));
document.forms[0].addEventListener("submit", (event) => event.preventDefault());
document.forms[0].addEventListener("input", (event) => {
  if (event.target === form.exposure && open) open.exposure = 2 ** form.exposure.value;
  if (event.target === form.picture) choosePicture();
  settle().catch((error) => say(error.message));
});

document.body.classList.toggle("bare", parameters.get("bare") === "1");
for (const name of ["look", "tone"]) if (parameters.has(name)) form[name].value = parameters.get(name);
for (const name of ["gloss", "texels", "compare"]) {
  if (parameters.has(name)) form[name].checked = parameters.get(name) === "1";
}
if (parameters.has("file")) show(atUrl(parameters.get("file")), new Map(), parameters.get("inspection"));
else document.body.dataset.state = "ready";
