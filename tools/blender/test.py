"""Tests of luxel_lightmap.py. See README.md.

    python3 -m venv venv && venv/bin/pip install bpy
    LUXEL=target/release/luxel venv/bin/python tools/blender/test.py
"""

import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).parent
ASSETS = HERE.parent.parent / "assets"
LUXEL = os.environ.get("LUXEL", "luxel")
SIZE = (960, 540)
EFFORT = ["--resolution", "256", "--rays", "16"]
FOLDER = Path(os.environ.get("KEEP") or tempfile.mkdtemp())

sys.path.append(str(HERE))


def bake(scene, name, *options):
    """Bakes with a preview; the lit file, the preview's levels and its exposure."""
    lit, png = FOLDER / name, FOLDER / f"{name}.png"
    command = [LUXEL, "bake", str(scene), "-o", str(lit), "--preview", str(png), "--quiet", *EFFORT, *options]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    exposure = next(float(line.split()[-1]) for line in said.splitlines() if line.startswith("preview"))
    return lit, levels(png), exposure


def levels(png):
    """Levels of eight bits, rows from the top."""
    return np.round(values(png, "Non-Color") * 255)


def values(file, space="Linear Rec.709"):
    """A picture's channels as they are stored, rows from the top."""
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = space
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    width, height = image.size
    return pixels.reshape(height, width, 4)[::-1, :, :3]


def glb(path):
    """JSON and binary chunk of a .glb."""
    data = Path(path).read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20:20 + length]), bytearray(data[28 + length:])


def write_glb(path, document, binary):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary = bytes(binary) + b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    Path(path).write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def load(path, lightmap=True):
    """The file in a new scene, imported with the add-on or without."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    if lightmap:
        bpy.ops.preferences.addon_enable(module="luxel_lightmap")
    scene = bpy.context.scene
    # Blender's own grey world stays: it must not add to the light.
    scene.world = bpy.data.worlds.new("World")
    bpy.ops.import_scene.gltf(filepath=str(path), export_import_convert_lighting_mode="COMPAT")
    return scene


def render(path, source, samples=64, prepare=None):
    """Linear radiance that Cycles sees through the first camera of `source`; `prepare`: of a scene without its maps."""
    scene = load(path, lightmap=not prepare)
    if prepare:
        prepare(scene)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = samples, False
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.filter_size = 1
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.view_settings.view_transform = "Raw"
    scene.camera = next(thing for thing in scene.objects if thing.type == "CAMERA")
    # The importer fits cameras to another shape of picture.
    scene.camera.data.sensor_fit, scene.camera.data.angle = "VERTICAL", glb(source)[0]["cameras"][0]["perspective"]["yfov"]
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(FOLDER / f"{path.name}.blender.exr")
    bpy.ops.render.render(write_still=True)
    return values(scene.render.filepath)


def shown(radiance, exposure):
    """Levels as luxel's previews show radiance."""
    c = np.clip(radiance * exposure, 0, None)
    c = np.where(c <= 0.6, c, 1 - 0.4 * np.exp((0.6 - c) / 0.4))
    return np.where(c <= 0.0031308, c * 12.92, 1.055 * c ** (1 / 2.4) - 0.055) * 255


class Pictures(unittest.TestCase):
    """Cycles' pictures against luxel's previews, in levels of eight bits."""

    def assert_near(self, lit, preview, exposure, source, median, p95):
        found = shown(render(lit, source), exposure)
        apart = np.abs(found - preview).max(axis=2)[preview.max(axis=2) > 0]
        figures = np.median(apart), np.percentile(apart, 95)
        print(f"{lit.name}: median {figures[0]:.2f}, 95th percentile {figures[1]:.2f} levels, {apart.size} pixels")
        self.assertGreater(apart.size, 100_000)
        self.assertLessEqual(figures[0], median)
        self.assertLessEqual(figures[1], p95)

    def test_cornell(self):
        box = ASSETS / "cornell.glb"
        self.assert_near(*bake(box, "cornell.glb"), box, 0.6, 1)

    def test_room(self):
        """Instances, textures, masks, a baked lamp that has to be out, a page beside the file."""
        room = ASSETS / "room.glb"
        self.assert_near(*bake(room, "room.gltf"), room, 0.6, 3)

    def test_a_lamp_over_the_indirect_light_is_the_full_bake(self):
        lamp = FOLDER / "lamp.glb"
        with_lamp(ASSETS / "cornell.glb", lamp)
        _, preview, exposure = bake(lamp, "full.glb")
        mixed, *_ = bake(lamp, "mixed.glb", "--content", "indirect")
        self.assert_near(mixed, preview, exposure, lamp, 0.6, 1.5)


def with_lamp(source, target):
    document, binary = glb(source)
    document["nodes"].append({"name": "Lamp in the air", "translation": [0.3, 2, 0.8],
                              "extensions": {"KHR_lights_punctual": {"light": 0}}})
    document["scenes"][0]["nodes"].append(len(document["nodes"]) - 1)
    document["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1.5}]}}
    document.setdefault("extensionsUsed", []).append("KHR_lights_punctual")
    write_glb(target, document, binary)


class Render(unittest.TestCase):
    """`luxel render` of metal among matt surfaces, against Cycles' path tracer on the scene that was baked."""

    def difference(self, name, roughness, lamp):
        metal = FOLDER / f"{name}.glb"
        with_metal(ASSETS / "cornell.glb", metal, roughness, lamp)
        lit, picture = FOLDER / f"{name}.lit.glb", FOLDER / f"{name}.exr"
        subprocess.run([LUXEL, "bake", metal, "-o", lit, "--quiet", "--resolution", "512", "--rays", "128"], check=True,
                       capture_output=True)
        subprocess.run([LUXEL, "render", lit, "-o", picture, "--samples", "4", "--paths", "64"], check=True, capture_output=True)
        truth = render(metal, metal, 256, traced)
        found, mean = values(picture), truth[truth.sum(axis=2) > 0].mean()
        # Means of 4 x 4 pixels, so that noise and the edges of things count less.
        apart, truth = (x.reshape(SIZE[1] // 4, 4, SIZE[0] // 4, 4, 3).mean(axis=(1, 3)) for x in (found - truth, truth))
        # The lamp is brighter than all else, and no matter of the second pass.
        apart = apart[(truth.max(axis=2) > 0) & (truth.max(axis=2) < 20 * mean)]
        rms, bias = np.sqrt((apart ** 2).mean()) / mean, apart.mean() / mean
        print(f"{name}: rms {rms:.4f}, bias {bias:.4f} of the mean")
        return rms, bias

    def assert_near(self, figures, rms, bias):
        self.assertLess(figures[0], rms)
        self.assertLess(abs(figures[1]), bias)

    def test_mirror(self):
        self.assert_near(self.difference("mirror", 0.0, lamp=False), 0.012, 0.004)

    def test_rough_metal_under_a_lamp(self):
        self.assert_near(self.difference("rough", 0.4, lamp=True), 0.012, 0.004)


def with_metal(source, target, roughness, lamp):
    """The Cornell box with its blocks of metal, a lamp in the air perhaps."""
    if lamp:
        with_lamp(source, target)
        source = target
    document, binary = glb(source)
    factors = {"baseColorFactor": [0.95, 0.8, 0.4, 1], "metallicFactor": 1, "roughnessFactor": roughness}
    document["materials"].append({"name": "gold", "pbrMetallicRoughness": factors})
    blocks = [node for node in document["nodes"] if "block" in node.get("name", "")]
    assert len(blocks) == 2, "the Cornell box has two blocks"
    for block in blocks:
        for primitive in document["meshes"][block["mesh"]]["primitives"]:
            primitive["material"] = len(document["materials"]) - 1
    write_glb(target, document, binary)


def traced(scene):
    """Cycles as luxel sees the world: matt dielectrics, GGX of one bounce, and no light from metal on matt surfaces."""
    cycles = scene.cycles
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 64
    cycles.caustics_reflective = False
    cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    scene.world.cycles_visibility.camera = scene.world.cycles_visibility.diffuse = scene.world.cycles_visibility.glossy = False
    for material in bpy.data.materials:
        for node in material.node_tree.nodes:
            if node.type == "BSDF_PRINCIPLED":
                node.distribution = "GGX"
                node.inputs["Specular IOR Level"].default_value = 0


class Scenes(unittest.TestCase):
    """What is attached, and what is not."""

    @classmethod
    def setUpClass(cls):
        cls.room, *_ = bake(ASSETS / "room.glb", "whole.glb")

    def test_objects_have_their_map_and_baked_lamps_are_out(self):
        scene = load(self.room)
        self.assertNotIn("luxel_problem", scene)
        lit = [thing for thing in scene.objects if "luxel_scale" in thing]
        document, _ = glb(self.room)
        self.assertEqual(len(lit), sum("LUXEL_lightmap" in node.get("extensions", {}) for node in document["nodes"]))
        lamps = [thing for thing in scene.objects if thing.type == "LIGHT"]
        self.assertEqual(sum(thing.hide_render for thing in lamps), len(document["extensions"]["LUXEL_lightmap"]["bakedLights"]))
        self.assertGreater(len(lamps), 0)

    def test_what_is_broken_is_said_in_one_line_and_shown_unlit(self):
        root = lambda change: lambda document, binary: change(document["extensions"]["LUXEL_lightmap"])
        def node(change):
            def apply(document, binary):
                change(next(n["extensions"]["LUXEL_lightmap"] for n in document["nodes"] if "LUXEL_lightmap" in n.get("extensions", {})))
            return apply
        def view(change):
            def apply(document, binary):
                page = document["extensions"]["LUXEL_lightmap"]["pages"][0]
                change(document["bufferViews"][page["bufferView"]], binary)
            return apply
        beside = {"uri": "none.exr", "width": 256, "height": 256, "encoding": "irradiance", "scale": 1}
        def endless(view, binary):
            """The length of the first attribute leads back to its name."""
            at = view["byteOffset"] + 8
            for _ in range(2):
                at = binary.index(0, at) + 1
            struct.pack_into("<i", binary, at, view["byteOffset"] + 8 - at - 4)
        def blank(view, binary):
            binary[view["byteOffset"]:view["byteOffset"] + 4] = b"\0\0\0\0"
        cases = [
            (root(lambda map: map.update(pages=[])), "lists no pages"),
            (root(lambda map: map.update(pages={})), "lists no pages"),
            (root(lambda map: map["pages"][0].pop("bufferView")), "page 0 has to be in a bufferView of the file or at a uri"),
            (root(lambda map: map["pages"][0].update(bufferView=999)), "page 0 has to be in a bufferView of the file or at a uri"),
            (root(lambda map: map["pages"][0].update(uri="none.exr")), "page 0 has to be in a bufferView of the file or at a uri"),
            (root(lambda map: map.update(pages=[beside])), "page 0 (none.exr) cannot be read: No such file"),
            (root(lambda map: map.update(bakedLights=5)), "make no sense"),
            (root(lambda map: map["pages"][0].update(encoding="radiance")), "page 0 holds radiance"),
            (root(lambda map: map["pages"][0].pop("scale")), "page 0 has the scale None"),
            (root(lambda map: map["pages"][0].update(width=255)), "page 0 is 256 x 256, not 255 x 256"),
            (view(blank), "page 0 is not a whole EXR picture"),
            (view(lambda view, _: view.update(byteLength=view["byteLength"] // 2)), "page 0 is not a whole EXR picture"),
            (view(lambda view, _: view.update(byteLength=view["byteLength"] - 1)), "page 0 is not a whole EXR picture"),
            (view(lambda view, _: view.update(byteLength=4)), "page 0 is not a whole EXR picture"),
            (node(lambda place: place.update(page=7)), "is on page 7, but the file has 1"),
            (node(lambda place: place.update(page="x")), "is on page x, but the file has 1"),
            (node(lambda place: place.update(texCoord=5)), "has a mesh without TEXCOORD_5"),
            (node(lambda place: place.update(scale=[1])), "has no rectangle that makes sense"),
            (node(lambda place: place.update(texCoord=-1)), "has no rectangle that makes sense"),
            (node(lambda place: place.update(scale=None)), "has no rectangle that makes sense"),
            (node(lambda place: place.update(offset=["a", "b"])), "has no rectangle that makes sense"),
            (lambda document, _: next(n for n in document["nodes"] if "LUXEL_lightmap" in n.get("extensions", {})).pop("mesh"),
             "has a rectangle but no mesh"),
            (view(endless), "page 0 is not a whole EXR picture"),
        ]
        for change, problem in cases:
            with self.subTest(problem):
                document, binary = glb(self.room)
                change(document, binary)
                write_glb(FOLDER / "broken.glb", document, binary)
                scene = load(FOLDER / "broken.glb")
                self.assertIn(problem, scene.get("luxel_problem", "no problem"))
                self.assertNotIn("\n", scene["luxel_problem"])
                self.assertFalse([thing for thing in scene.objects if "luxel_scale" in thing or thing.hide_render])
                self.assertFalse([image for image in bpy.data.images if " light " in image.name])


if __name__ == "__main__":
    try:
        unittest.main()
    finally:
        if not os.environ.get("KEEP"):
            shutil.rmtree(FOLDER)
