//! Variants of a model's materials `[KHR_materials_variants]`.

use super::error::{Result, fault};
use gltf::json::Root;
use gltf::json::mesh::Primitive;

const NAME: &str = "KHR_materials_variants";

/// Names of the variants, in file order.
pub(super) fn names(root: &Root) -> Vec<String> {
    let all = (root.extensions.as_ref())
        .and_then(|e| e.others.get(NAME)?.get("variants")?.as_array())
        .map_or(&[][..], Vec::as_slice);
    let name = |v: &gltf::json::Value| Some(v.get("name")?.as_str()?.to_owned());
    all.iter().map(|v| name(v).unwrap_or_default()).collect()
}

/// Index of the variant with this name, or else of this number; `None` for the default materials.
pub(super) fn chosen(root: &Root, wanted: Option<&str>) -> Result<Option<u64>> {
    let Some(wanted) = wanted else {
        return Ok(None);
    };
    let names = names(root);
    let by_number = || wanted.parse().ok().filter(|i| *i < names.len());
    match names.iter().position(|n| n == wanted).or_else(by_number) {
        Some(i) => Ok(Some(i as u64)),
        None => {
            let has = match names.is_empty() {
                true => "has none".to_owned(),
                false => format!("has {}", names.join(", ")),
            };
            Err(fault(
                "variants",
                format!("there is no `{wanted}`: the file {has}"),
            ))
        }
    }
}

/// Index of the material that a primitive has in a variant; its own without a mapping.
pub(super) fn material(primitive: &Primitive, variant: Option<u64>) -> Option<usize> {
    let own = primitive.material.map(|m| m.value());
    let mapped = || {
        let mappings = (primitive.extensions.as_ref()?.others.get(NAME)?).get("mappings")?;
        let of = |mapping: &&gltf::json::Value| {
            let variants = mapping.get("variants").and_then(|v| v.as_array());
            variants.is_some_and(|v| v.iter().any(|v| v.as_u64() == variant))
        };
        let found = mappings.as_array()?.iter().find(of)?;
        Some(usize::try_from(found.get("material")?.as_u64()?).unwrap_or(usize::MAX))
    };
    variant.and_then(|_| mapped()).or(own)
}
