//! KHR_lights_punctual and what extras say of its lights.

use super::*;
use luxel::scene::{Bake, Light, LightKind};

fn lights(b: &Builder) -> (Vec<Light>, Vec<String>) {
    let options = ReadOptions { light_scale: 2.0, ..ReadOptions::default() };
    let input = try_bytes(&b.glb(), &options).unwrap_or_else(|e| panic!("{e}"));
    (input.scene.lights, input.warnings)
}

#[test]
fn kinds_defaults_and_places() {
    let mut b = Builder::square();
    let half = (0.5f64).sqrt();
    let down = json!([-half, 0, 0, half]);
    b.light(
        json!({ "type": "point", "color": [1, 0.5, 0], "intensity": 10, "range": 7 }),
        json!({ "name": "bulb", "translation": [0.5, 0.5, 3], "extras": { "luxel.radius": 0.1, "luxel.bake": "indirect" } }),
    );
    b.light(json!({ "type": "spot", "spot": {} }), json!({ "rotation": down, "scale": [3, 3, 3] }));
    let cone = json!({ "innerConeAngle": 0.2, "outerConeAngle": 0.5 });
    b.light(json!({ "type": "spot", "spot": cone }), json!({}));
    b.light(
        json!({ "type": "directional", "intensity": 1000 }),
        json!({ "extras": { "luxel": { "angle": 2, "bake": "none" } } }),
    );
    let (lights, warnings) = lights(&b);
    assert_eq!(warnings, Vec::<String>::new());
    let bulb = &lights[0];
    assert_eq!((bulb.node, bulb.position, bulb.range, bulb.bake), (Some(1), Vec3::Z * 3.0, 7.0, Bake::Indirect));
    assert_eq!((bulb.kind, bulb.intensity), (LightKind::Point { radius: 0.1 }, Vec3::new(20.0, 10.0, 0.0)));
    assert_eq!((lights[1].range, lights[1].bake), (f32::INFINITY, Bake::Full));
    assert!(lights[1].direction.abs_diff_eq(Vec3::NEG_Y, 1e-6), "{}", lights[1].direction);
    let LightKind::Spot { cos_inner, cos_outer, .. } = lights[1].kind else { panic!("a spot") };
    assert!(cos_inner == 1.0 && (cos_outer - 0.5f32.sqrt()).abs() < 1e-6);
    let LightKind::Spot { cos_inner, cos_outer, .. } = lights[2].kind else { panic!("a spot") };
    assert!((cos_inner - 0.98006).abs() < 1e-4 && (cos_outer - 0.87758).abs() < 1e-4);
    assert_eq!((lights[3].direction, lights[3].bake), (Vec3::NEG_Z, Bake::None));
    assert_eq!(lights[3].kind, LightKind::Directional { angle: 2f32.to_radians() });
}

#[test]
fn damaged_lights() {
    let mut b = Builder::square();
    b.light(json!({ "type": "point", "intensity": -1 }), json!({ "name": "dark" }));
    let cone = json!({ "innerConeAngle": 2, "outerConeAngle": 1 });
    b.light(json!({ "type": "spot", "spot": cone }), json!({ "name": "cone" }));
    let extras = json!({ "luxel.radius": "big", "luxel.angle": -1, "luxel.bake": "half" });
    b.light(json!({ "type": "point", "range": 0 }), json!({ "name": "odd", "extras": extras }));
    let (read, warnings) = lights(&b);
    assert_eq!(read.len(), 2);
    for part in ["\"dark\": its light", "\"cone\": its spot", "luxel.radius", "luxel.angle", "luxel.bake", "range is 0"]
    {
        says(&warnings, part);
    }
    b.light(json!({ "type": "laser" }), json!({}));
    refuses(&b, &["light 3", "type"]);
}

#[test]
fn lights_that_move_are_left_out() {
    let mut b = Builder::square();
    let node = b.light(json!({ "type": "point" }), json!({ "name": "firefly" }));
    let channel = json!({ "sampler": 0, "target": { "node": node, "path": "translation" } });
    b.json["animations"] = json!([{ "channels": [channel], "samplers": [] }]);
    let (read, warnings) = lights(&b);
    assert!(read.is_empty());
    says(&warnings, "\"firefly\": its light moves");
    b.json["nodes"][node]["extras"] = json!({ "luxel.static": true });
    assert_eq!(lights(&b).0.len(), 1);
}
