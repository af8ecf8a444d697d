//! What a node's `extras` ask of luxel: flat keys (`"luxel.static"`) and nested ones (`luxel: { static }`) alike.

use super::warnings::Warnings;
use crate::scene::Bake;
use serde_json::Value;

/// A node's wishes; `None` where it has none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Wishes {
    /// Casts and receives whatever else is known of it, or does neither.
    pub is_static: Option<bool>,
    /// Density of its map, texels per metre; 0: no map.
    pub texels_per_meter: Option<f64>,
    /// Radius of its light, metres.
    pub radius: Option<f32>,
    /// Diameter of its light's disc, degrees.
    pub angle: Option<f32>,
    /// What of its light is baked.
    pub bake: Option<Bake>,
}

impl Wishes {
    /// Reads the `extras` of the node called `name`; what makes no sense is left out with a warning.
    pub fn of(extras: &Value, name: &str, warnings: &mut Warnings) -> Self {
        let mut get = |key: &str, expected: &str, valid: &dyn Fn(&Value) -> bool| {
            let flat = extras.get(format!("luxel.{key}"));
            let value = flat.or_else(|| extras.get("luxel").and_then(|l| l.get(key)))?;
            if !valid(value) {
                warnings.about(name, format!("extras luxel.{key} is {value}, but {expected}: it is ignored"));
            }
            Some(value).filter(|v| valid(v))
        };
        let at_most = |limit: f64| move |v: &Value| v.as_f64().is_some_and(|n| (0.0..=limit).contains(&n));
        let float = |v: &Value| v.as_f64().unwrap_or_default() as f32;
        Wishes {
            is_static: get("static", "it must be true or false", &|v| truth(v).is_some()).and_then(truth),
            texels_per_meter: get("texels_per_meter", "it must be a number, 0 or more", &at_most(1e6))
                .and_then(Value::as_f64),
            radius: get("radius", "it must be a length in metres, 0 or more", &at_most(1e6)).map(float),
            angle: get("angle", "it must be between 0 and 180 degrees", &at_most(180.0)).map(float),
            bake: get("bake", "it must be \"full\", \"indirect\" or \"none\"", &|v| bake(v).is_some()).and_then(bake),
        }
    }
}

/// A truth value; exporters of custom properties write 0 and 1.
fn truth(v: &Value) -> Option<bool> {
    v.as_bool().or_else(|| v.as_f64().filter(|n| *n == 0.0 || *n == 1.0).map(|n| n == 1.0))
}

fn bake(v: &Value) -> Option<Bake> {
    match v.as_str()? {
        "full" => Some(Bake::Full),
        "indirect" => Some(Bake::Indirect),
        "none" => Some(Bake::None),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn flat_and_nested_keys_count() {
        let mut warnings = Warnings::default();
        let wishes = Wishes::of(
            &json!({ "luxel.radius": 0.5, "luxel": { "static": 1, "bake": "indirect", "angle": 500 } }),
            "node 0",
            &mut warnings,
        );
        let expected =
            Wishes { is_static: Some(true), radius: Some(0.5), bake: Some(Bake::Indirect), ..Wishes::default() };
        assert_eq!(wishes, expected);
        assert_eq!(warnings.sentences().len(), 1);
        assert_eq!(Wishes::of(&Value::Null, "", &mut warnings), Wishes::default());
    }
}
