//! The extensions that this loader implements, and the treatment of all others.

/// The extensions that this loader implements; `docs/gltf.md` says how far.
pub const SUPPORTED: [&str; 20] = [
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_materials_volume_scatter",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// True for an extension without which a picture is still similar, even if the file requires it: appearance of
/// surfaces, metadata, visibility of nodes and animations of other properties.
pub(super) fn is_dispensable(name: &str) -> bool {
    let looks = name.starts_with("KHR_materials_") || name.starts_with("KHR_xmp");
    looks || name == "KHR_animation_pointer" || name == "KHR_node_visibility"
}

/// The names of required extensions that are not supported, all of them.
pub(super) fn refusal(unsupported: &[&str]) -> String {
    let are = if unsupported.len() == 1 { "is" } else { "are" };
    let compresses = |name: &&str| name.ends_with("_compression") || name.ends_with("_basisu");
    let decoders = match unsupported.iter().any(compresses) {
        true => "; the crate opsr-formats has decoders of compressed files",
        false => "",
    };
    format!("{} {are} not supported{decoders}", unsupported.join(", "))
}
