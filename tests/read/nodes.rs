//! The node tree, what moves, cameras.

use super::*;

fn names(input: &Input) -> Vec<u32> {
    input.scene.instances.iter().map(|i| i.node).collect()
}

#[test]
fn world_is_recentred_in_double_precision() {
    let mut b = Builder::triangle();
    b.json["nodes"][0] = json!({ "mesh": 0 });
    b.json["scenes"][0]["nodes"] = json!([1]);
    b.push("nodes", json!({ "children": [2, 0], "translation": [1e6, 0, 1e6 + 0.0625] }));
    let turn = [0.0, 0.0, (0.5f64).sqrt(), (0.5f64).sqrt()];
    b.push("nodes", json!({ "mesh": 0, "scale": [-2, 1, 1], "rotation": turn, "translation": [0, 0, 10] }));
    let input = ok(&b);
    let scene = &input.scene;
    assert_eq!(names(&input), [2, 0]);
    assert!(scene.instances[0].mirrored() && !scene.instances[1].mirrored());
    assert_eq!(scene.meshes.len(), 1);
    let world = |i: usize, p: DVec3| scene.instances[i].transform.transform_point3(p) + scene.origin;
    assert!(world(0, DVec3::X).abs_diff_eq(DVec3::new(1e6, -2.0, 1e6 + 10.0625), 1e-6));
    assert!(world(1, DVec3::Y).abs_diff_eq(DVec3::new(1e6, 1.0, 1e6 + 0.0625), 1e-9));
    assert!(scene.origin.abs_diff_eq(DVec3::new(1e6, -0.5, 1e6 + 5.0625), 1e-6), "{}", scene.origin);
}

#[test]
fn matrices_are_column_major() {
    let mut b = Builder::triangle();
    b.json["nodes"][0]["matrix"] = json!([0, 0, -1, 0, 0, 2, 0, 0, 1, 0, 0, 0, 5, 6, 7, 1]);
    let i = &ok(&b).scene.instances[0];
    assert_eq!(i.transform.matrix3.x_axis, DVec3::NEG_Z);
    assert_eq!(i.transform.matrix3.y_axis, DVec3::Y * 2.0);
    b.json["nodes"][0]["matrix"][3] = json!(1);
    refuses(&b, &["node 0", "projection"]);
    b.json["nodes"][0] = json!({ "mesh": 0, "rotation": [0, 0, 0, 0] });
    refuses(&b, &["node 0", "rotation"]);
    b.json["nodes"][0] = json!({ "mesh": 0, "translation": [1, 2] });
    refuses(&b, &["node 0"]);
    b.json["nodes"][0] = json!({ "mesh": 0, "scale": [1e300, 1, 1] });
    refuses(&b, &["node 0"]);
    b.json["nodes"][0] = json!({ "mesh": 0, "scale": [0, 0, 0] });
    refuses(&b, &["no triangle", "scaled to nothing"]);
}

#[test]
fn trees_are_checked() {
    let tree = |nodes: Value, roots: Value| {
        let mut b = Builder::triangle();
        b.json["nodes"] = nodes;
        b.json["scenes"][0]["nodes"] = roots;
        b
    };
    refuses(&tree(json!([{ "children": [1], "mesh": 0 }, { "children": [0] }]), json!([0])), &["ancestor"]);
    refuses(&tree(json!([{ "children": [0], "mesh": 0 }]), json!([0])), &["ancestor"]);
    let shared = json!([{ "children": [2] }, { "children": [2] }, { "mesh": 0 }]);
    refuses(&tree(shared, json!([0, 1])), &["node 2", "two parents"]);
    refuses(&tree(json!([{ "mesh": 0 }]), json!([0, 0])), &["twice"]);
    refuses(&tree(json!([{ "mesh": 0, "children": [5] }]), json!([0])), &["node 0", "node 5"]);
    let mut deep: Vec<Value> = (0..100_000).map(|i| json!({ "children": [i + 1] })).collect();
    deep.push(json!({ "mesh": 0 }));
    assert!(attempt(&tree(Value::Array(deep), json!([0]))).is_ok());
}

#[test]
fn which_scene() {
    let mut b = Builder::triangle();
    b.push("nodes", json!({ "mesh": 0 }));
    b.push("scenes", json!({ "nodes": [1] }));
    b.json["scene"] = json!(1);
    assert_eq!(names(&ok(&b)), [1]);
    b.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(names(&ok(&b)), [0]);
    says(&ok(&b).warnings, "default scene");
    b.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(names(&ok(&b)), [0, 1]);
    says(&ok(&b).warnings, "no scene");
}

#[test]
fn what_moves_is_left_out_unless_declared_static() {
    let mut b = Builder::triangle();
    let target = json!([{ "POSITION": 0 }]);
    b.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": 0 }, "targets": target }] }));
    b.push("nodes", json!({ "name": "child", "mesh": 0 }));
    let animated = b.root(json!({ "name": "door", "children": [1], "mesh": 0 }));
    b.root(json!({ "name": "skinned", "mesh": 0, "skin": 0 }));
    b.root(json!({ "name": "morphed", "mesh": 1 }));
    b.root(json!({ "name": "declared", "mesh": 0, "extras": { "luxel.static": false } }));
    b.json["skins"] = json!([{ "joints": [0] }]);
    let channel = json!({ "sampler": 0, "target": { "node": animated, "path": "rotation" } });
    b.json["animations"] = json!([{ "channels": [channel], "samplers": [] }]);
    let input = ok(&b);
    assert_eq!(names(&input), [0]);
    says(&input.warnings, "node 2 \"door\", node 1 \"child\": is animated");
    says(&input.warnings, "\"skinned\": is skinned");
    says(&input.warnings, "\"morphed\": has morph targets");
    says(&input.warnings, "\"declared\": is declared not static");
    for node in [2, 3, 4] {
        b.json["nodes"][node]["extras"] = json!({ "luxel": { "static": true } });
    }
    assert_eq!(names(&ok(&b)), [0, 2, 1, 3, 4]);
    let pointer =
        json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": "/nodes/0/scale" } } });
    b.json["animations"][0]["channels"] = json!([{ "sampler": 0, "target": pointer }]);
    assert_eq!(names(&ok(&b)), [2, 1, 3, 4]);
}

#[test]
fn exclusions_and_densities() {
    let mut b = Builder::triangle();
    b.push("nodes", json!({ "name": "leaf", "mesh": 0 }));
    b.root(json!({ "name": "Tree.001", "mesh": 0, "children": [1] }));
    b.root(json!({ "name": "sign", "mesh": 0, "extras": { "luxel": { "texels_per_meter": 0 } } }));
    b.root(json!({ "mesh": 0, "extras": { "luxel.texels_per_meter": -3 } }));
    let options = ReadOptions { exclude: vec!["Tree*".into(), "nobody".into()], ..ReadOptions::default() };
    let input = try_bytes(&b.glb(), &options).unwrap();
    assert_eq!(names(&input), [0, 3, 4]);
    let wished: Vec<Option<f64>> = input.scene.instances.iter().map(|i| i.texels_per_meter).collect();
    assert_eq!(wished, [None, Some(0.0), None]);
    says(&input.warnings, "--exclude nobody");
    says(&input.warnings, "luxel.texels_per_meter is -3");
    let options = ReadOptions { exclude: vec!["[".into()], ..ReadOptions::default() };
    assert_eq!(try_bytes(&b.glb(), &options).unwrap_err().exit_code(), 2);
}

#[test]
fn cameras_and_invisible_nodes() {
    let mut b = Builder::triangle();
    b.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }));
    b.push(
        "cameras",
        json!({ "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "zfar": 9, "znear": 0 } }),
    );
    let half = (0.5f64).sqrt();
    b.root(json!({ "name": "eye", "camera": 0, "translation": [0.5, 0.5, 5], "rotation": [0, half, 0, half] }));
    b.root(json!({ "camera": 1 }));
    b.root(json!({ "mesh": 0, "extensions": { "KHR_node_visibility": { "visible": false } } }));
    let input = ok(&b);
    assert_eq!((input.scene.cameras.len(), input.scene.instances.len()), (1, 1));
    let c = &input.scene.cameras[0];
    assert_eq!((c.name.as_str(), c.yfov), ("eye", 1.0));
    assert!(c.eye.abs_diff_eq(Vec3::Z * 5.0, 1e-6) && c.up.abs_diff_eq(Vec3::Y, 1e-6));
    assert!(c.forward.abs_diff_eq(Vec3::NEG_X, 1e-6), "{}", c.forward);
    says(&input.warnings, "invisible");
}
