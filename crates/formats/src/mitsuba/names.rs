//! Parameters of Mitsuba 3, and those of its predecessor that are read.

use super::super::Context;
use super::super::names::{ALL, Names, row};
use super::xml::{Link, Object};
use opsr::scene::load::error::Result;

/// Parameters by element and plugin; textures inside are parameters, too.
#[rustfmt::skip]
pub(in super::super) const NAMES: &[Names] = &[
    row("shape", ALL, "to_world flip_normals", "silhouette_sampling_weight", ""),
    row("shape", "rectangle cube disk shapegroup instance merge", "", "", ""),
    row("shape", "sphere", "center radius", "", ""),
    row("shape", "cylinder", "p0 p1 radius", "", ""),
    row("shape", "bsplinecurve linearcurve", "filename", "", ""),
    row("shape", "hair", "filename radius", "angle_threshold reduction", ""),
    row("shape", "obj ply serialized", "filename face_normals flip_tex_coords shape_index", "collapse srgb",
        "max_smooth_angle"),
    row("bsdf", "diffuse lambertian", "reflectance diffuse_reflectance", "", ""),
    row("bsdf", "roughdiffuse", "reflectance diffuse_reflectance", "alpha use_fast_approx", ""),
    row("bsdf", "conductor", "material eta k ext_eta specular_reflectance", "", ""),
    row("bsdf", "roughconductor", "material eta k ext_eta specular_reflectance distribution alpha alpha_u alpha_v",
        "sample_visible", ""),
    row("bsdf", "dielectric thindielectric", "int_ior ext_ior eta specular_reflectance specular_transmittance", "", ""),
    row("bsdf", "roughdielectric",
        "int_ior ext_ior eta specular_reflectance specular_transmittance distribution alpha alpha_u alpha_v", "sample_visible", ""),
    row("bsdf", "plastic", "int_ior ext_ior eta diffuse_reflectance specular_reflectance nonlinear", "", ""),
    row("bsdf", "roughplastic",
        "int_ior ext_ior eta diffuse_reflectance specular_reflectance nonlinear distribution alpha alpha_u alpha_v",
        "sample_visible", ""),
    row("bsdf", "pplastic", "int_ior ext_ior diffuse_reflectance specular_reflectance distribution alpha alpha_u alpha_v",
        "sample_visible", ""),
    row("bsdf", "principled", "base_color roughness metallic spec_trans eta specular clearcoat clearcoat_gloss",
        "main_specular_sampling_rate clearcoat_sampling_rate diffuse_reflectance_sampling_rate",
        "anisotropic spec_tint sheen sheen_tint flatness"),
    row("bsdf", "principledthin", "base_color roughness spec_trans diff_trans eta",
        "spec_reflect_sampling_rate spec_trans_sampling_rate diffuse_reflectance_sampling_rate diff_trans_sampling_rate",
        "anisotropic spec_tint sheen sheen_tint flatness"),
    row("bsdf", "difftrans", "transmittance", "", ""),
    row("bsdf", "coating", "", "thickness", "int_ior ext_ior eta sigma_a specular_reflectance"),
    row("bsdf", "roughcoating", "distribution alpha alpha_u alpha_v", "thickness sample_visible",
        "int_ior ext_ior eta sigma_a specular_reflectance"),
    row("bsdf", "phong", "diffuse_reflectance specular_reflectance exponent", "", ""),
    row("bsdf", "ward", "diffuse_reflectance specular_reflectance alpha_u alpha_v", "variant", ""),
    row("bsdf", "null twosided", "", "", ""),
    row("bsdf", "mask", "opacity", "", ""),
    row("bsdf", "bumpmap bump normalmap", "scale", "use_shadowing_function flip_invalid_normals", ""),
    row("bsdf", "blendbsdf", "weight", "", ""),
    row("bsdf", "mixturebsdf", "weights weight", "", ""),
    row("texture", "bitmap ldrtexture", "filename wrap_mode wrap_mode_u wrap_mode_v filter_type gamma raw to_uv uscale vscale uvscale uoffset voffset",
        "cache max_anisotropy format", "channel accel"),
    row("texture", "checkerboard", "color0 color1 to_uv uscale vscale uvscale uoffset voffset", "", ""),
    row("texture", "mesh_attribute", "name scale", "", ""),
    row("texture", "vertexcolors", "", "", ""),
    row("texture", "uniform", "value", "wavelength_min wavelength_max", ""),
    row("texture", "srgb rgb", "color value", "unbounded", ""),
    row("texture", "d65", "color value scale", "unbounded", ""),
    row("texture", "blackbody", "temperature scale", "wavelength_min wavelength_max", ""),
    row("texture", "regular", "values wavelength_min wavelength_max", "", ""),
    row("texture", "irregular", "values wavelengths", "", ""),
    row("texture", "scale", "scale", "", ""),
    row("emitter", ALL, "to_world", "sampling_weight samples", ""),
    row("emitter", "point", "position intensity", "", ""),
    row("emitter", "spot", "intensity cutoff_angle beam_width texture", "", ""),
    row("emitter", "directional distant", "irradiance radiance direction", "", ""),
    row("emitter", "constant", "radiance", "", ""),
    row("emitter", "envmap", "filename scale", "mis_compensation cache", "gamma"),
    row("emitter", "sunsky sky sun", "turbidity sun_direction scale sun_scale sky_scale", "resolution sun_aperture sun_radius_scale complex_sun",
        "albedo latitude longitude timezone year month day hour minute second stretch extend"),
    row("emitter", "projector", "irradiance scale fov fov_axis focal_length", "", ""),
    row("emitter", "area", "radiance intensity", "", ""),
    row("sensor", ALL, "to_world near_clip far_clip principal_point_offset_x principal_point_offset_y", "shutter_open shutter_close",
        ""),
    row("sensor", "perspective", "fov fov_axis focal_length", "focus_distance", ""),
    row("sensor", "thinlens", "fov fov_axis focal_length aperture_radius focus_distance", "", ""),
    row("sensor", "orthographic", "", "", ""),
    row("film", "hdrfilm ldrfilm", "width height crop_offset_x crop_offset_y crop_width crop_height",
        "file_format pixel_format component_format compensate sample_border high_quality_edges banner attach_log fov",
        "exposure gamma tonemap_method key burn"),
    row("medium", "homogeneous", "sigma_a sigma_s sigma_t albedo scale material", "sample_emitters has_spectral_extinction", ""),
    row("volume", "constvolume", "value", "", ""),
    row("phase", "hg", "g", "", ""),
    row("phase", "tabphase", "values", "", ""),
    row("phase", "blendphase", "weight", "", ""),
    row("phase", "isotropic rayleigh", "", "", ""),
];

/// Checks the names of an object's properties and of the textures inside it.
pub(super) fn check(context: &mut Context, object: &Object) -> Result<()> {
    let element = match object.tag.as_str() {
        "luminaire" => "emitter",
        "camera" => "sensor",
        "spectrum" => "texture",
        tag => tag,
    };
    // A reference to a surface has any name; in a plugin without inner surfaces a reference can only be a texture.
    let nests = [
        "twosided",
        "mask",
        "bumpmap",
        "bump",
        "normalmap",
        "blendbsdf",
        "mixturebsdf",
        "coating",
        "roughcoating",
    ];
    let leaf = ["bsdf", "emitter", "texture"].contains(&element)
        && !nests.contains(&object.plugin.as_str());
    // The single map of these plugins has any name.
    let any = ["bumpmap", "bump", "normalmap", "scale"].contains(&object.plugin.as_str());
    let textures = object.children.iter().filter(|child| match &child.what {
        _ if any => false,
        Link::Object(inner) => ["texture", "spectrum"].contains(&inner.tag.as_str()),
        Link::Id(_) => leaf,
    });
    let textures = textures.map(|child| (child.name.as_str(), child.place.as_str()));
    let properties = (object.properties.iter()).map(|p| (p.name.as_str(), p.place.as_str()));
    context.check_names(NAMES, (element, &object.plugin), properties.chain(textures))
}
