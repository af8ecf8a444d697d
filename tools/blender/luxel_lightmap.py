"""Lightmaps of luxel (LUXEL_lightmap) in Blender.

An add-on of one file that joins the glTF importer: once it is enabled, File > Import > glTF 2.0 shows baked scenes in
the light of their maps. Without Blender's window:

    sys.path.append("tools/blender")
    bpy.ops.preferences.addon_enable(module="luxel_lightmap")
    bpy.ops.import_scene.gltf(filepath="room.lit.glb", export_import_convert_lighting_mode="COMPAT")

The map is emitted, base colour times E over pi, to every ray but diffuse ones. So surfaces do not light one another a
second time, metals mirror them, and lamps that are not in the map shine as ever.
"""

import struct
from math import isfinite, pi
from pathlib import Path
from urllib.parse import unquote

import bpy

bl_info = {
    "name": "luxel lightmaps",
    "description": "Shows the lightmaps of glTF files that luxel baked",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "File > Import > glTF 2.0",
    "category": "Import-Export",
}

NAME = "LUXEL_lightmap"


class Problem(Exception):
    """What is wrong with a lightmap, in one line."""


class glTF2ImportUserExtension:
    """What the glTF importer calls; its name is the importer's."""

    def gather_import_scene_after_animation_hook(self, gltf_scene, scene, gltf):
        root = (gltf.data.extensions or {}).get(NAME)
        if root is None:
            return
        try:
            lightmap = read(root, gltf)
        except Problem as problem:
            scene["luxel_problem"] = str(problem)
            print(f"{NAME}: {problem}; the scene is shown without its lightmap")
            return
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            scene["luxel_problem"] = "its data make no sense"
            print(f"{NAME}: its data make no sense ({error!r}); the scene is shown without its lightmap")
            return
        show(scene, *lightmap)


def register():
    """Nothing to do: the importer finds the class above in every add-on that is enabled."""


def unregister():
    """Likewise."""


def read(root, gltf):
    """All that is needed to show a lightmap, checked before anything is changed: lit objects, lamps that are in it."""
    pages = root.get("pages")
    if not isinstance(pages, list) or not pages:
        raise Problem("the file lists no pages")
    nodes = gltf.data.nodes or []
    places = {}
    for index, node in enumerate(nodes):
        place = (node.extensions or {}).get(NAME)
        if place is None:
            continue
        if node.mesh is None:
            raise Problem(f"node {index} ({node.name}) has a rectangle but no mesh")
        places[index] = checked(place, pages, f"node {index} ({node.name})")
    lit, lamps = [], []
    baked = set(root.get("bakedLights") or [])
    for vnode in gltf.vnodes.values():
        thing = vnode.blender_object
        if thing is None:
            continue
        if vnode.mesh_node_idx in places:
            page, texcoord, *rectangle = places[vnode.mesh_node_idx]
            layers = thing.data.uv_layers
            if texcoord >= len(layers):
                raise Problem(f"node {vnode.mesh_node_idx} ({thing.name}) has a mesh without TEXCOORD_{texcoord}")
            lit.append((thing, page, layers[texcoord].name, *rectangle))
        if vnode.light_node_idx in baked:
            lamps.append(thing)
    images = []
    try:
        for index, page in enumerate(pages):
            images.append((picture(page, index, gltf), float(page["scale"])))
    except Exception:
        for image, _ in images:
            bpy.data.images.remove(image)
        raise
    return images, lit, lamps


def checked(place, pages, node):
    """Page, texture coordinates, offset and scale of a node."""
    page, texcoord, offset, scale = (place.get(key) for key in ("page", "texCoord", "offset", "scale"))
    if not is_index(page, pages):
        raise Problem(f"{node} is on page {page}, but the file has {len(pages)}")
    if not isinstance(texcoord, int) or texcoord < 0 or not all(is_pair(pair) for pair in (offset, scale)):
        raise Problem(f"{node} has no rectangle that makes sense")
    return page, texcoord, offset, scale


def is_index(value, things):
    return isinstance(value, int) and 0 <= value < len(things)


def is_pair(value):
    return isinstance(value, list) and len(value) == 2 and all(isinstance(x, (int, float)) and isfinite(x) for x in value)


def picture(page, index, gltf):
    """A page as an image of Blender's, packed into the .blend file."""
    name = f"page {index}"
    if page.get("encoding") != "irradiance":
        raise Problem(f"{name} holds {page.get('encoding')}, not irradiance")
    scale = page.get("scale")
    if not isinstance(scale, (int, float)) or not (isfinite(scale) and scale > 0):
        raise Problem(f"{name} has the scale {scale}")
    data = content(page, name, gltf)
    size, wished = exr_size(data, name), (page.get("width"), page.get("height"))
    if size != wished:
        raise Problem(f"{name} is {size[0]} x {size[1]}, not {wished[0]} x {wished[1]}")
    image = bpy.data.images.new(f"{Path(gltf.filename).stem} light {index}", *size, float_buffer=True)
    image.source = "FILE"
    image.pack(data=data, data_len=len(data))
    image.colorspace_settings.name = "Linear Rec.709"
    if not image.has_data and len(image.pixels) == 0:
        bpy.data.images.remove(image)
        raise Problem(f"{name} is no EXR picture that Blender can read")
    return image


def content(page, name, gltf):
    """The bytes of a page, from the file or from beside it."""
    views = gltf.data.buffer_views or []
    if ("uri" in page) == is_index(page.get("bufferView"), views):
        raise Problem(f"{name} has to be in a bufferView of the file or at a uri")
    if "uri" in page:
        place = Path(gltf.filename).parent / unquote(page["uri"])
        try:
            return place.read_bytes()
        except OSError as error:
            raise Problem(f"{name} ({page['uri']}) cannot be read: {error.strerror}") from error
    from io_scene_gltf2.io.imp.gltf2_io_binary import BinaryData
    return bytes(BinaryData.get_buffer_view(gltf, page["bufferView"]))


def exr_size(data, name):
    """Width and height of an EXR picture of scanlines, which must be whole: Blender shows half a file without a word."""
    broken = Problem(f"{name} is not a whole EXR picture")
    try:
        if data[:4] != b"\x76\x2f\x31\x01":
            raise broken
        at, attributes = 8, {}
        while data[at]:
            key, kind, rest = data[at:].split(b"\0", 2)
            at += len(key) + len(kind) + 2
            length = struct.unpack_from("<I", data, at)[0]
            attributes[key] = data[at + 4:at + 4 + length]
            at += 4 + length
        left, top, right, bottom = struct.unpack("<4i", attributes[b"dataWindow"])
        # Lines in a block, by compression: none, RLE, ZIPS, ZIP.
        lines = [1, 1, 1, 16][attributes[b"compression"][0]]
        blocks = -(-(bottom - top + 1) // lines)
        for offset in struct.unpack_from(f"<{blocks}Q", data, at + 1):
            if offset + 8 + struct.unpack_from("<2I", data, offset)[1] > len(data):
                raise broken
    except (struct.error, IndexError, KeyError, ValueError) as error:
        raise broken from error
    return right - left + 1, bottom - top + 1


def show(scene, images, lit, lamps):
    """Attaches the pages, puts baked lamps out, and keeps the world's light from adding to what the map holds of it."""
    made = {}
    for thing, page, uv_map, offset, scale in lit:
        # Blender counts v from below.
        thing["luxel_offset"] = [float(offset[0]), 1.0 - offset[1] - scale[1], 0.0]
        thing["luxel_scale"] = [float(scale[0]), float(scale[1]), 1.0]
        for slot, material in zip(thing.material_slots, [slot.material for slot in thing.material_slots]):
            if material is None or principled(material) is None:
                continue
            key = material.name, page, uv_map
            if key not in made:
                made[key] = lit_material(material, *images[page], uv_map)
            # Instances share a mesh, but lie on pages of their own.
            slot.link = "OBJECT"
            slot.material = made[key]
    for lamp in lamps:
        lamp.hide_render = True
        lamp.hide_set(True)
    if scene.world:
        scene.world.cycles_visibility.diffuse = False


def principled(material):
    """The node that the importer makes for materials that are lit."""
    nodes = material.node_tree.nodes if material.node_tree else []
    return next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)


def lit_material(material, image, scale, uv_map):
    """A copy that emits base colour times what is not metal times E over pi."""
    material = material.copy()
    # Found by rays alone, which know what they are.
    material.cycles.emission_sampling = "NONE"
    shader = principled(material)
    build = Builder(material.node_tree, shader)

    uv = build.node("ShaderNodeUVMap", uv_map=uv_map).outputs["UV"]
    offset, factor = (build.of_object(name) for name in ("luxel_offset", "luxel_scale"))
    texel = build.node("ShaderNodeTexImage", image=image, extension="EXTEND")
    build.link(build.vector("MULTIPLY_ADD", uv, factor, offset), texel.inputs["Vector"])

    base, metallic = (build.value(shader.inputs[name]) for name in ("Base Color", "Metallic"))
    matt = build.number("SUBTRACT", 1.0, metallic)
    matt = build.number("MULTIPLY", matt, scale / pi)
    matt = build.number("MULTIPLY", matt, build.number("SUBTRACT", 1.0, build.value(shader.inputs["Transmission Weight"])))
    leaving = build.vector("MULTIPLY", base, build.vector("SCALE", texel.outputs["Color"], scale=matt))
    own = build.vector("SCALE", build.value(shader.inputs["Emission Color"]),
                       scale=build.value(shader.inputs["Emission Strength"]))

    diffuse = build.node("ShaderNodeLightPath").outputs["Is Diffuse Ray"]
    seen = build.number("SUBTRACT", 1.0, diffuse)
    build.set(build.vector("SCALE", build.vector("ADD", leaving, own), scale=seen), shader.inputs["Emission Color"])
    build.set(1.0, shader.inputs["Emission Strength"])
    # Light of lamps that are not in the map falls on surfaces; its bounces are in the map.
    build.set(build.vector("SCALE", base, scale=seen), shader.inputs["Base Color"])
    # Dielectrics are matt, as luxel bakes them: what they mirror is counted in their colour.
    build.set(0.0, shader.inputs["Specular IOR Level"])
    return material


class Builder:
    """Nodes that are sockets or numbers to one another, set down in a row to the left of a shader."""

    def __init__(self, tree, shader):
        self.tree, self.at = tree, list(shader.location)

    def node(self, kind, **settings):
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        self.at[0] -= 30
        self.at[1] -= 30
        node.location, node.hide = self.at, True
        return node

    def link(self, source, target):
        self.tree.links.new(source, target)

    def set(self, value, socket):
        """Gives an input what it is to have: another node's output, or a value."""
        if isinstance(value, bpy.types.NodeSocket):
            self.link(value, socket)
            return
        for link in list(socket.links):
            self.tree.links.remove(link)
        size = len(socket.default_value) if hasattr(socket.default_value, "__len__") else 0
        socket.default_value = (list(value) + [1.0])[:size] if size else value

    def value(self, socket):
        """What an input has."""
        if socket.is_linked:
            return socket.links[0].from_socket
        value = socket.default_value
        return list(value)[:3] if hasattr(value, "__len__") else value

    def number(self, operation, *values):
        node = self.node("ShaderNodeMath", operation=operation)
        for value, socket in zip(values, node.inputs):
            self.set(value, socket)
        return node.outputs[0]

    def vector(self, operation, *values, scale=None):
        node = self.node("ShaderNodeVectorMath", operation=operation)
        for value, socket in zip(values, node.inputs):
            self.set(value, socket)
        if scale is not None:
            self.set(scale, node.inputs["Scale"])
        return node.outputs[0]

    def of_object(self, name):
        return self.node("ShaderNodeAttribute", attribute_type="OBJECT", attribute_name=name).outputs["Vector"]
