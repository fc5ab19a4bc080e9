//! Parameters of pbrt-v4, and of pbrt-v3 where its names are read.

use super::super::names::{ALL, Names, row};

/// Parameters by directive and kind.
#[rustfmt::skip]
pub(in super::super) const NAMES: &[Names] = &[
    row("Shape", ALL, "alpha", "", ""),
    row("Shape", "sphere", "radius zmin zmax phimax", "", ""),
    row("Shape", "disk", "radius height innerradius phimax", "", ""),
    row("Shape", "cylinder", "radius zmin zmax phimax", "", ""),
    row("Shape", "trianglemesh", "P N uv st indices", "faceIndices", "S"),
    row("Shape", "bilinearmesh", "P N uv indices emissionfilename", "faceIndices", ""),
    row("Shape", "plymesh", "filename displacement", "displacement.edgelength edgelength", ""),
    row("Shape", "loopsubdiv", "P indices", "levels scheme", ""),
    row("Material", ALL, "displacement normalmap", "type", ""),
    row("Material", "diffuse", "reflectance", "", "sigma"),
    row("Material", "matte", "Kd", "", "sigma"),
    row("Material", "conductor metal", "eta k reflectance roughness uroughness vroughness remaproughness", "", ""),
    row("Material", "dielectric", "eta roughness uroughness vroughness remaproughness", "", ""),
    row("Material", "thindielectric", "eta", "", ""),
    row("Material", "coateddiffuse", "reflectance eta roughness uroughness vroughness remaproughness albedo",
        "thickness g maxdepth nsamples twosided", ""),
    row("Material", "coatedconductor", "reflectance conductor.eta conductor.k conductor.roughness conductor.uroughness \
        conductor.vroughness interface.eta interface.roughness interface.uroughness interface.vroughness remaproughness albedo",
        "thickness g maxdepth nsamples twosided", ""),
    row("Material", "diffusetransmission", "reflectance", "", "transmittance scale sigma"),
    row("Material", "mix", "materials amount", "", ""),
    // The last kind is the empty one.
    row("Material", "interface none ", "", "", ""),
    row("Texture", "constant", "value", "", ""),
    row("Texture", "imagemap", "filename wrap encoding filter invert scale mapping uscale vscale udelta vdelta", "maxanisotropy", ""),
    row("Texture", "checkerboard", "dimension tex1 tex2 mapping uscale vscale udelta vdelta", "", ""),
    row("Texture", "scale", "tex scale tex1 tex2", "", ""),
    row("Texture", "mix", "tex1 tex2 amount", "", ""),
    row("LightSource", "point", "I scale power from", "", ""),
    row("LightSource", "spot", "I scale power from to coneangle conedeltaangle", "", ""),
    row("LightSource", "distant", "L scale illuminance from to", "", ""),
    row("LightSource", "infinite", "L filename scale illuminance portal", "samples nsamples", ""),
    row("AreaLightSource", "diffuse", "L filename scale power twosided", "samples nsamples", ""),
    row("Camera", "perspective", "fov frameaspectratio screenwindow lensradius focaldistance shutteropen shutterclose", "", ""),
    row("Camera", "orthographic", "frameaspectratio screenwindow lensradius focaldistance shutteropen shutterclose", "", ""),
    row("Film", "rgb gbuffer spectral image",
        "xresolution yresolution cropwindow pixelbounds iso exposuretime sensor whitebalance maxcomponentvalue",
        "filename diagonal savefp16 coordinatesystem lambdamin lambdamax nbuckets buckets", ""),
    row("MakeNamedMedium", "homogeneous", "type preset Le sigma_a sigma_s g scale", "Lescale", ""),
];
