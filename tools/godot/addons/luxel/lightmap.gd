@tool
extends GLTFDocumentExtension
## Lightmaps of luxel (LUXEL_lightmap) as a LightmapGI, as if Godot had baked them.
##
## Pages become the layers of one texture that holds E / pi; lit nodes are its users. Lights that
## are in the map are "static": they light nothing that has a lightmap. If anything about the
## lightmap is wrong, the scene is as it would be without this extension, and one warning says why.

const NAME := "LUXEL_lightmap"
## What half floats can hold.
const LARGEST_HALF := 65504.0
## glTF's mode of triangles, which is the default.
const TRIANGLES := 4


func _get_supported_extensions() -> PackedStringArray:
	return [NAME]


func _import_post(state: GLTFState, root: Node) -> Error:
	var data: Variant = state.json.get("extensions", {}).get(NAME)
	if data == null:
		return OK
	var made := _read(state, data)
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
func _read(state: GLTFState, data: Variant) -> Dictionary:
	if not data is Dictionary or not data.get("pages") is Array or data.pages.is_empty():
		return {"problem": "the file lists no pages"}
	var images: Array[Image] = []
	for index: int in data.pages.size():
		var page := _page(state, data.pages[index])
		if page.has("problem"):
			return {"problem": "page %d %s" % [index, page.problem]}
		images.append(page.image)
	var places := {}
	var nodes: Array = state.json.get("nodes", [])
	for index: int in nodes.size():
		var place: Variant = nodes[index].get("extensions", {}).get(NAME)
		if place == null:
			continue
		var problem := _misplaced(state, nodes[index], place, images.size())
		if problem:
			return {"problem": "node %d (%s) %s" % [index, nodes[index].get("name", ""), problem]}
		places[index] = place
	return {"images": images, "places": places, "lights": data.get("bakedLights", [])}


## A page as an image of E / pi, or a problem.
func _page(state: GLTFState, page: Variant) -> Dictionary:
	if not page is Dictionary or page.get("encoding") != "irradiance":
		return {"problem": "holds no irradiance"}
	var scale: float = page.get("scale", 0.0)
	if not (scale > 0.0 and is_finite(scale)):
		return {"problem": "has the scale %s" % scale}
	var bytes := _bytes(state, page)
	if bytes.is_empty():
		return {"problem": "(%s) is missing" % page.get("uri", "in the file")}
	var image := _decoded(bytes)
	if image == null or image.is_empty():
		return {"problem": "is not a whole EXR picture"}
	var wished := Vector2i(int(page.get("width", 0)), int(page.get("height", 0)))
	if image.get_size() != wished:
		var size := [image.get_width(), image.get_height(), wished.x, wished.y]
		return {"problem": "is %d x %d, not %d x %d" % size}
	return {"image": _scaled(image, scale / PI)}


## The bytes of a page, from the file or from beside it; none if it is not there.
func _bytes(state: GLTFState, page: Dictionary) -> PackedByteArray:
	if page.has("uri"):
		return FileAccess.get_file_as_bytes(state.base_path.path_join(str(page.uri).uri_decode()))
	var views := state.get_buffer_views()
	var index := int(page.get("bufferView", -1))
	if index < 0 or index >= views.size():
		return []
	var view := views[index]
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
func _misplaced(state: GLTFState, node: Dictionary, place: Variant, pages: int) -> String:
	if (
		not place is Dictionary
		or not (_is_pair(place.get("offset")) and _is_pair(place.get("scale")))
	):
		return "has no rectangle that makes sense"
	var page := int(place.get("page", -1))
	if page < 0 or page >= pages:
		return "is on page %d, but the file has %d" % [page, pages]
	var set_of_uv := "TEXCOORD_%d" % place.get("texCoord", 1)
	for primitive: Dictionary in _primitives(state, node):
		if set_of_uv != "TEXCOORD_1" or not primitive.attributes.has(set_of_uv):
			return "needs %s; Godot reads lightmaps with TEXCOORD_1" % set_of_uv
	return ""


func _is_pair(value: Variant) -> bool:
	return value is Array and value.size() == 2


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
	for index: Variant in made.lights:
		var lamp := state.get_scene_node(int(index)) as Light3D
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
