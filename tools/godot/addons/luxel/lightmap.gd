@tool
extends GLTFDocumentExtension
## Lightmaps of luxel (LUXEL_lightmap) as a LightmapGI, as if Godot had baked them.
##
## Pages become the layers of one texture that holds E / pi; lit nodes are its users. Lights that
## are in the map are "static": they light nothing that has a lightmap. If anything about the
## lightmap is wrong, the scene is as it would be without this extension, and one warning says why.
## What the file says may be of any type: nothing is used before its type is known.

const NAME := "LUXEL_lightmap"
## What half floats can hold.
const LARGEST_HALF := 65504.0
## glTF's mode of triangles, which is the default.
const TRIANGLES := 4


func _get_supported_extensions() -> PackedStringArray:
	return [NAME]


func _import_post(state: GLTFState, root: Node) -> Error:
	if not _extensions(state.json).has(NAME):
		return OK
	var made := _read(state, _dictionary(_extensions(state.json)[NAME]))
	if made.has("problem"):
		var file := state.filename
		push_warning(
			"%s: %s: %s; the scene is shown without its lightmap" % [NAME, file, made.problem]
		)
		return OK
	_show(state, root, made)
	return OK


## Everything, checked before anything is changed: pages as images, places by node, baked lights;
## or a problem.
func _read(state: GLTFState, data: Dictionary) -> Dictionary:
	var pages := _list(data.get("pages"))
	if pages.is_empty():
		return {"problem": "the file lists no pages"}
	var images: Array[Image] = []
	for index: int in pages.size():
		var page := _page(state, _dictionary(pages[index]))
		if page.has("problem"):
			return {"problem": "page %d %s" % [index, page.problem]}
		images.append(page.image)
	var places := {}
	var nodes: Array = state.json.get("nodes", [])
	for index: int in nodes.size():
		if not _extensions(nodes[index]).has(NAME):
			continue
		var place := _dictionary(_extensions(nodes[index])[NAME])
		var problem := _misplaced(state, nodes[index], place, images.size())
		if problem:
			return {"problem": "node %d (%s) %s" % [index, nodes[index].get("name", ""), problem]}
		places[index] = place
	var lights := _list(data.get("bakedLights")).map(
		func(light: Variant) -> int: return _index(light, nodes.size())
	)
	return {
		"images": images,
		"places": places,
		"lights": lights.filter(func(i: int) -> bool: return i >= 0)
	}


## A page as an image of E / pi, or a problem.
func _page(state: GLTFState, page: Dictionary) -> Dictionary:
	var problem := _undefined(state, page)
	if problem:
		return {"problem": problem}
	var bytes := _bytes(state, page)
	if bytes.is_empty():
		return {"problem": "(%s) is missing" % str(page.get("uri", "in the file"))}
	var image := _decoded(bytes)
	if image == null or image.is_empty():
		return {"problem": "is not a whole EXR picture"}
	var size := [image.get_width(), image.get_height()]
	if size[0] != _number(page.get("width")) or size[1] != _number(page.get("height")):
		size.append_array([str(page.get("width")), str(page.get("height"))])
		return {"problem": "is %d x %d, not %s x %s" % size}
	return {"image": _scaled(image, page.scale / PI)}


## Why a page cannot be read, by what is said of it; or nothing.
func _undefined(state: GLTFState, page: Dictionary) -> String:
	if str(page.get("encoding")) != "irradiance":
		return "holds %s, not irradiance" % str(page.get("encoding"))
	var scale := _number(page.get("scale"))
	if not (scale > 0.0 and is_finite(scale)):
		return "has the scale %s" % str(page.get("scale"))
	var in_file := _index(page.get("bufferView"), state.get_buffer_views().size()) >= 0
	if in_file == page.has("uri"):
		return "has to be in a bufferView of the file or at a uri"
	return ""


## The bytes of a page, from the file or from beside it; none if it is not there.
func _bytes(state: GLTFState, page: Dictionary) -> PackedByteArray:
	if page.has("uri"):
		var path := state.base_path.path_join(str(page.uri).uri_decode())
		if not FileAccess.file_exists(path):
			return []
		return FileAccess.get_file_as_bytes(path)
	var view := state.get_buffer_views()[int(page.bufferView)]
	if view.buffer < 0 or view.buffer >= state.buffers.size():
		return []
	return state.buffers[view.buffer].slice(view.byte_offset, view.byte_offset + view.byte_length)


## Older versions of Godot read EXR from files only.
func _decoded(bytes: PackedByteArray) -> Image:
	var path := "user://%s.%d.exr" % [NAME, OS.get_process_id()]
	var file := FileAccess.open(path, FileAccess.WRITE)
	if file == null:
		return null
	file.store_buffer(bytes)
	file.close()
	var image := Image.load_from_file(path)
	DirAccess.remove_absolute(path)
	return image


## Times a factor; in half floats if they can hold it.
func _scaled(image: Image, factor: float) -> Image:
	image.convert(Image.FORMAT_RGBAF)
	var texels := image.get_data().to_float32_array()
	var largest := 0.0
	for i in texels.size():
		texels[i] *= factor
		largest = maxf(largest, texels[i])
	var size := image.get_size()
	var bytes := texels.to_byte_array()
	var scaled := Image.create_from_data(size.x, size.y, false, Image.FORMAT_RGBAF, bytes)
	if largest <= LARGEST_HALF:
		scaled.convert(Image.FORMAT_RGBAH)
	return scaled


## Why a node cannot be lit, or nothing.
func _misplaced(state: GLTFState, node: Dictionary, place: Dictionary, pages: int) -> String:
	if not node.has("mesh"):
		return "has a rectangle but no mesh"
	if not (_is_pair(place.get("offset")) and _is_pair(place.get("scale"))):
		return "has no rectangle that makes sense"
	if _index(place.get("page"), pages) < 0:
		return "is on page %s, but the file has %d" % [str(place.get("page")), pages]
	var in_all := _primitives(state, node).all(
		func(p: Dictionary) -> bool: return p.attributes.has("TEXCOORD_1")
	)
	if _number(place.get("texCoord")) != 1.0 or not in_all:
		var wished := str(place.get("texCoord"))
		return "needs TEXCOORD_%s; Godot reads lightmaps with TEXCOORD_1" % wished
	return ""


func _extensions(owner: Dictionary) -> Dictionary:
	return _dictionary(owner.get("extensions"))


func _dictionary(value: Variant) -> Dictionary:
	return value if value is Dictionary else {}


func _list(value: Variant) -> Array:
	return value if value is Array else []


## A number, or NAN, which is neither less nor more than anything.
func _number(value: Variant) -> float:
	return float(value) if value is float or value is int else NAN


## An index of so many things, or -1.
func _index(value: Variant, count: int) -> int:
	var number := _number(value)
	return int(number) if number >= 0.0 and number < count and number == floorf(number) else -1


func _is_pair(value: Variant) -> bool:
	var numbers := _list(value).map(_number)
	return numbers.size() == 2 and numbers.all(func(x: float) -> bool: return is_finite(x))


func _primitives(state: GLTFState, node: Dictionary) -> Array:
	var mesh := int(node.get("mesh", -1))
	var primitives: Array = [] if mesh < 0 else state.json.meshes[mesh].primitives
	return primitives.filter(
		func(p: Dictionary) -> bool: return p.get("mode", TRIANGLES) >= TRIANGLES
	)


func _show(state: GLTFState, root: Node, made: Dictionary) -> void:
	var images: Array[Image] = made.images
	var size := Vector2i.ZERO
	var format := Image.FORMAT_RGBAH
	for image in images:
		size = Vector2i(maxi(size.x, image.get_width()), maxi(size.y, image.get_height()))
		if image.get_format() == Image.FORMAT_RGBAF:
			format = Image.FORMAT_RGBAF
	# Layers are of one size; smaller pages lie in the corner of theirs.
	var shares: Array[Vector2] = []
	for image in images:
		shares.append(Vector2(image.get_size()) / Vector2(size))
		image.crop(size.x, size.y)
		image.convert(format)
	var texture := Texture2DArray.new()
	texture.create_from_images(images)
	var light := LightmapGIData.new()
	light.lightmap_textures = [texture]
	var bounds: Array[AABB] = []
	for index: int in made.places:
		var node := state.get_scene_node(index) as Node3D
		if node == null:
			continue
		var place: Dictionary = made.places[index]
		var share := shares[int(place.page)]
		var offset := Vector2(place.offset[0], place.offset[1]) * share
		var extent := Vector2(place.scale[0], place.scale[1]) * share
		var path := NodePath("../" + str(root.get_path_to(node)))
		light.add_user(path, Rect2(offset, extent), int(place.page), -1)
		for box in _boxes(state, state.json.nodes[index]):
			bounds.append(_to_root(node, root) * box)
	# Godot draws lightmaps whose box it sees. One probe without light makes it take the box.
	light.set("probe_data", _probes(bounds))
	var lightmap := LightmapGI.new()
	lightmap.name = "Lightmap"
	lightmap.light_data = light
	root.add_child(lightmap)
	lightmap.owner = root
	for index: int in made.lights:
		var lamp := state.get_scene_node(index) as Light3D
		if lamp != null:
			lamp.light_bake_mode = Light3D.BAKE_STATIC


## The boxes around a node's primitives, in its own space.
func _boxes(state: GLTFState, node: Dictionary) -> Array[AABB]:
	var boxes: Array[AABB] = []
	for primitive: Dictionary in _primitives(state, node):
		var accessor: Dictionary = state.json.accessors[primitive.attributes.POSITION]
		var low := Vector3(accessor.min[0], accessor.min[1], accessor.min[2])
		var high := Vector3(accessor.max[0], accessor.max[1], accessor.max[2])
		boxes.append(AABB(low, high - low))
	return boxes


## From a node's space to that of the root, neither of which is in a tree yet.
func _to_root(node: Node, root: Node) -> Transform3D:
	var transform := Transform3D.IDENTITY
	while node != null and node != root:
		if node is Node3D:
			transform = (node as Node3D).transform * transform
		node = node.get_parent()
	return transform


func _probes(boxes: Array[AABB]) -> Dictionary:
	var bounds := boxes[0] if boxes else AABB()
	for box in boxes:
		bounds = bounds.merge(box)
	var dark := PackedColorArray()
	dark.resize(9)
	dark.fill(Color.BLACK)
	return {
		"bounds": bounds,
		"points": PackedVector3Array([bounds.get_center()]),
		"sh": dark,
		"tetrahedra": PackedInt32Array(),
		"bsp": PackedInt32Array(),
		"interior": false,
		"baked_exposure": 1.0,
	}
