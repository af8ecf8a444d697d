@tool
extends EditorPlugin
## Joins Godot's glTF importer as long as the plugin is enabled.

const Lightmap := preload("lightmap.gd")

var _extension := Lightmap.new()


func _enter_tree() -> void:
	GLTFDocument.register_gltf_document_extension(_extension)


func _exit_tree() -> void:
	GLTFDocument.unregister_gltf_document_extension(_extension)
